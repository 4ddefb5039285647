"""Jogs that are kept going."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from types import TracebackType
from typing import Generic, TypeVar
from uuid import UUID

from armada._bus import Bus
from armada._repeat import Repeater
from armada.errors import ArmadaError, DeniedError
from armada.messages import Accepted, DenialCode, MotionStatus

from .motion import Motion

V = TypeVar("V")

REPEAT_S = 0.05
"""How often a jog is asked for [s]."""
DEAD_MAN_S = 0.2
"""How long the robot moves when it is not asked for any more [s]."""


class Jogging(Generic[V]):
    """A jog that is kept going until it is ended: asked for again every 50 ms.

    If the program or the network ends, the robot comes to rest within 0.2 s and a ramp.
    """

    def __init__(
        self,
        bus: Bus,
        motion: Motion[MotionStatus],
        speed: V,
        ask: Callable[[UUID, V], Awaitable[Accepted]],
    ) -> None:
        self.motion = motion
        """The motion that it is."""
        self._speed = speed
        self._ask = ask
        self._failed: ArmadaError | None = None
        self._repeater = Repeater(bus.waiting, REPEAT_S, self._again)

    def set(self, speed: V) -> None:
        """Changes the speed from the next request on; raises what has ended it, if it is over."""
        if self._failed is not None:
            raise self._failed
        self._speed = speed

    async def end(self) -> None:
        """Ends it with a ramp, and waits until the robot stands.

        Raises what has ended it before; ending twice does nothing more.
        """
        await self._repeater.end()
        if self._failed is not None:
            raise self._failed
        try:
            await self.motion.cancel()
        except DeniedError as denied:
            if denied.code != DenialCode.NOT_ATTACHED:
                raise
        await self.motion.wait()

    async def _again(self) -> bool:
        try:
            await self._ask(self.motion.id, self._speed)
        except (ArmadaError, ValueError) as error:
            self._failed = error if isinstance(error, ArmadaError) else ArmadaError(str(error))
            return False
        return True

    async def __aenter__(self) -> Jogging[V]:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            await self.end()
        except ArmadaError:
            # What went wrong first is what is told.
            if error is None:
                raise
