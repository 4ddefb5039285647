"""Jogs that are kept going."""

from __future__ import annotations

from types import TracebackType
from typing import Generic, TypeVar

from armada import aio
from armada._waiting import run
from armada.messages import MotionStatus

from .motion import Motion

V = TypeVar("V")


class Jogging(Generic[V]):
    """A jog that is kept going until it is ended: asked for again every 50 ms.

    If the program or the network ends, the robot comes to rest within 0.2 s and a ramp.
    """

    def __init__(self, inner: aio.Jogging[V]) -> None:
        self._inner = inner
        self.motion: Motion[MotionStatus] = Motion(inner.motion)
        """The motion that it is."""

    def set(self, speed: V) -> None:
        """Changes the speed from the next request on; raises what has ended it, if it is over."""
        self._inner.set(speed)

    def end(self) -> None:
        """Ends it with a ramp, and waits until the robot stands.

        Raises what has ended it before; ending twice does nothing more.
        """
        run(self._inner.end())

    def __enter__(self) -> Jogging[V]:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        run(self._inner.__aexit__(kind, error, trace))
