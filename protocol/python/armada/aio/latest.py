"""The newest state of a robot."""

from __future__ import annotations

import time
from uuid import UUID

import msgspec
import zenoh
from zenoh.handlers import Callback

from armada import keys
from armada._bus import Answer, Bus
from armada._waiting import Inbox
from armada.errors import NotConnected, RequestTimeout
from armada.messages import CommandMode, RobotState

FRESH_S = 0.25
"""Age up to which a state counts as new [s], from its arrival."""


class Seen(msgspec.Struct, frozen=True):
    """The part of a state that a stream needs."""

    boot_id: UUID
    """Run of the agent."""
    seqno: int
    """Number of the tick in this run."""
    epoch: int
    """Epoch in force."""
    command_mode: CommandMode
    """What kind of command is followed."""


class LatestState:
    """Keeps the newest state of a robot as it comes, and reads it only when asked."""

    def __init__(self, bus: Bus, robot: str) -> None:
        self._key = keys.ROBOT_STATE.of(robot)
        self._endpoints = bus.endpoints
        self._came: Inbox[tuple[float, zenoh.Sample]] = bus.waiting.inbox(1)
        self._newest: tuple[float, zenoh.Sample] | None = None
        taker = Callback(self._take, self._came.close, indirect=False)
        self._subscriber = bus.main.declare_subscriber(self._key, taker)

    def _take(self, sample: zenoh.Sample) -> None:
        self._came.put((time.monotonic(), sample))

    async def read(self, timeout_s: float) -> RobotState:
        """The newest state; waits up to `timeout_s` if none has come lately.

        Raises `RequestTimeout` if none comes, `CodecError` if it is not a state.
        """
        self._newest = self._came.try_next() or self._newest
        if self._newest is None or time.monotonic() - self._newest[0] > FRESH_S:
            try:
                self._newest = await self._came.next(timeout_s)
            except TimeoutError:
                raise RequestTimeout(self._key, timeout_s) from None
            if self._newest is None:
                raise NotConnected(self._endpoints, "the connection is closed")
        return Answer.of_sample(self._newest[1]).read(RobotState, self._key, timeout_s)

    def newest_seen(self) -> Seen | None:
        """The newest state as far as a stream needs it, however old; None if none ever came."""
        self._newest = self._came.try_next() or self._newest
        if self._newest is None:
            return None
        return Answer.of_sample(self._newest[1]).read(Seen, self._key, 0.0)
