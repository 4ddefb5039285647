"""A connection to a cell, below the API: its sessions, who is in it, and its stops."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from . import keys
from ._bus import Bus
from ._ids import new_id
from ._stop import AckListener, Stop
from ._waiting import Waiting
from .errors import NoReply, RequestTimeout
from .messages import CellInfo, StopLevel, StopReport, StopRequest, StopScope
from .session import DEFAULT_GATEWAY_ENDPOINT

if TYPE_CHECKING:
    from .aio.lease import HeldLease

DEFAULT_NAME = "armada-python"
"""Name given with every request unless told otherwise."""
STOP_TIMEOUT_S = 5.0
"""How long a stop waits for standstill."""


@dataclass(frozen=True)
class ConnectOptions:
    """How a client reaches its cell."""

    endpoints: tuple[str, ...]
    """Zenoh endpoints to dial; that of a gateway on this machine if empty."""
    namespace: str | None
    """Prefix of every key."""
    name: str
    """Name given with every request."""
    timeout_s: float
    """How long to wait for somebody to answer."""


class Connection:
    """The sessions, and what the gateway said of the cell."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        """The sessions."""
        self.held: dict[str, HeldLease] = {}
        """The lease of each robot that is held through this connection, or was lost."""
        self._acks = AckListener(bus)
        self._expected: tuple[str, ...] = ()

    @classmethod
    async def open(cls, waiting: Waiting, options: ConnectOptions) -> Connection:
        """Dials the gateway, and then the agents it names.

        Raises `NotConnected` if nobody answers.
        """
        endpoints = options.endpoints or (DEFAULT_GATEWAY_ENDPOINT,)
        bus = Bus(waiting, options.name, endpoints, options.namespace)
        await bus.open(options.timeout_s)
        try:
            connection = cls(bus)
            agents: list[str] = []
            with suppress(NoReply, RequestTimeout):
                # Without a gateway there are only the agents that were dialled.
                info = await connection.cell_info()
                agents = [robot.endpoint for robot in info.robots if robot.endpoint]
            await bus.open_direct(agents)
        except BaseException:
            await bus.close()
            raise
        return connection

    async def cell_info(self) -> CellInfo:
        """The robots of the cell, which from now on are expected to follow its stops."""
        info = await self.bus.value(CellInfo, keys.CELL_INFO.any())
        self._expected = tuple(robot.robot for robot in info.robots)
        return info

    async def stop(
        self, scope: StopScope, reason: str, level: StopLevel, timeout_s: float
    ) -> StopReport:
        """Stops the robots in scope and waits until they are measured to stand still."""
        request = StopRequest(
            stop_id=new_id(), source=self.bus.name, level=level, scope=scope, reason=reason
        )
        return await Stop(self.bus, self._acks, request, self._expected).run(timeout_s)
