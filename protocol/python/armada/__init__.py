"""Client of Armada cells: several robot arms over Zenoh.

```python
import armada

with armada.connect() as cell:
    print(cell.robots())
    cell.move({"left_arm": [0.0, -1.2, 1.4, -0.2, 1.6, 0.0]}, speed=0.3)
```

`armada.aio` has the same names for asyncio; `armada.messages` is what is on the wire.
"""

from __future__ import annotations

from . import aio, keys, messages, methods
from ._blocking.jog import Jogging
from ._blocking.lease import HeldLease
from ._blocking.leases import HeldLeases
from ._blocking.motion import Motion
from ._blocking.robot import Robot
from ._blocking.stream import (
    CommandStream,
    PositionStream,
    Stream,
    TwistStream,
    VelocityStream,
)
from ._blocking.subscription import Subscription
from .client import Cell, connect
from .errors import (
    ArmadaError,
    CodecError,
    DeniedError,
    LeaseLost,
    MotionFailed,
    NoReply,
    NotConnected,
    RequestTimeout,
    StreamEnded,
)
from .messages import (
    ActionStatus,
    CommandMode,
    Coupling,
    Denial,
    DenialCode,
    HomeMethod,
    JogFrame,
    JointTrajectory,
    LeaseScope,
    MoveExecutor,
    MoveOptions,
    Pose,
    Queue,
    Role,
    StopLevel,
    StopStage,
    StopVerdict,
    Twist,
    Why,
    WhyCode,
)
from .moves import for_cell
from .stop_source import StopSource

__version__ = "0.1.0"

__all__ = [
    "ActionStatus",
    "ArmadaError",
    "Cell",
    "CodecError",
    "CommandMode",
    "CommandStream",
    "Coupling",
    "Denial",
    "DenialCode",
    "DeniedError",
    "HeldLease",
    "HeldLeases",
    "HomeMethod",
    "JogFrame",
    "Jogging",
    "JointTrajectory",
    "LeaseLost",
    "LeaseScope",
    "Motion",
    "MotionFailed",
    "MoveExecutor",
    "MoveOptions",
    "NoReply",
    "NotConnected",
    "Pose",
    "PositionStream",
    "Queue",
    "RequestTimeout",
    "Robot",
    "Role",
    "StopLevel",
    "StopSource",
    "StopStage",
    "StopVerdict",
    "Stream",
    "StreamEnded",
    "Subscription",
    "Twist",
    "TwistStream",
    "VelocityStream",
    "Why",
    "WhyCode",
    "aio",
    "connect",
    "for_cell",
    "keys",
    "messages",
    "methods",
]
