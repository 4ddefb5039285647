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
from .client import Cell, Motion, Robot, Subscription, connect
from .errors import (
    ArmadaError,
    CodecError,
    DeniedError,
    MotionFailed,
    NoReply,
    NotConnected,
    RequestTimeout,
)
from .messages import (
    ActionStatus,
    CommandMode,
    DenialCode,
    JointTrajectory,
    StopLevel,
    StopStage,
    StopVerdict,
)
from .moves import for_cell

__version__ = "0.1.0"

__all__ = [
    "ActionStatus",
    "ArmadaError",
    "Cell",
    "CodecError",
    "CommandMode",
    "DenialCode",
    "DeniedError",
    "JointTrajectory",
    "Motion",
    "MotionFailed",
    "NoReply",
    "NotConnected",
    "RequestTimeout",
    "Robot",
    "StopLevel",
    "StopStage",
    "StopVerdict",
    "Subscription",
    "aio",
    "connect",
    "for_cell",
    "keys",
    "messages",
    "methods",
]
