"""The asyncio API; the blocking one in `armada` has the same names and does the same.

```python
async with armada.aio.connect() as cell:
    left = cell.robot("left_arm")
    async for state in left.states():
        print(state.joint_position_rad)
```
"""

from __future__ import annotations

import asyncio
from collections.abc import Generator
from types import TracebackType

from armada._connection import DEFAULT_NAME, Connection, ConnectOptions
from armada._waiting import LoopWaiting
from armada.stop_source import StopSource

from .cell import Cell
from .jog import Jogging
from .lease import HeldLease
from .leases import HeldLeases
from .motion import Motion
from .opening import Opening
from .robot import Robot
from .stream import CommandStream, PositionStream, Stream, TwistStream, VelocityStream
from .subscription import Subscription

__all__ = [
    "Cell",
    "CommandStream",
    "Connecting",
    "HeldLease",
    "HeldLeases",
    "Jogging",
    "Motion",
    "Opening",
    "PositionStream",
    "Robot",
    "StopSource",
    "Stream",
    "Subscription",
    "TwistStream",
    "VelocityStream",
    "connect",
]


def connect(
    *endpoints: str,
    namespace: str | None = None,
    name: str = DEFAULT_NAME,
    timeout_s: float = 2.0,
) -> Connecting:
    """Connects to a cell: to be awaited, or entered by `async with`.

    `endpoints` are Zenoh endpoints of the gateway (`tcp/127.0.0.1:7447` if left out) and, to work
    without it, of agents. `namespace` is the prefix of every key, as in the cell file; `name` is
    given with every request, for people and the audit trail. Raises `NotConnected` if nobody
    answers within `timeout_s`.
    """
    return Connecting(ConnectOptions(endpoints, namespace, name, timeout_s))


class Connecting:
    """A connection that is being made: to be awaited, or entered by `async with`."""

    def __init__(self, options: ConnectOptions) -> None:
        self._options = options
        self._cell: Cell | None = None

    def __await__(self) -> Generator[object, None, Cell]:
        return self._open().__await__()

    async def __aenter__(self) -> Cell:
        self._cell = await self
        return self._cell

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._cell is not None:
            await self._cell.close()

    async def _open(self) -> Cell:
        waiting = LoopWaiting(asyncio.get_running_loop())
        return Cell(await Connection.open(waiting, self._options))
