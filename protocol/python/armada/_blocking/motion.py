"""A motion, from its acceptance to its end."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Generic, TypeVar
from uuid import UUID

from armada import aio
from armada._waiting import run
from armada.messages import Accepted, CellMotionStatus, MotionStatus

from .opened import iterate

S = TypeVar("S", bound=MotionStatus | CellMotionStatus)


class Motion(Generic[S]):
    """A motion that was accepted: of one robot, or of several."""

    def __init__(self, inner: aio.Motion[S]) -> None:
        self._inner = inner
        self.id: UUID = inner.id
        """Its identity."""
        self.accepted: Accepted | None = inner.accepted
        """What the agent or gateway said when it took it; None if found by its identity."""

    def status(self) -> S:
        """Where it stands; also for some time after its end."""
        return run(self._inner.status())

    def cancel(self) -> None:
        """Ends it with a ramp to standstill."""
        run(self._inner.cancel())

    def pause(self) -> None:
        """Brings it to rest on its path until it is resumed; several robots at one phase of it."""
        run(self._inner.pause())

    def resume(self) -> None:
        """Goes on with it."""
        run(self._inner.resume())

    def set_speed(self, ratio: float) -> float:
        """Changes its speed on its path, 0.01 to 1 of what it was planned for; returns the ratio.

        It is the speed of all motions of its robots, until it is changed again.
        """
        return run(self._inner.set_speed(ratio))

    def wait(self, timeout_s: float | None = None) -> S:
        """Waits for its end and returns the terminal status, good or bad.

        Raises `RequestTimeout` if it has not ended after `timeout_s`, `NoReply` if the agent or
        gateway is gone.
        """
        return run(self._inner.wait(timeout_s))

    def arrive(self) -> S:
        """Waits until it is complete; raises `MotionFailed` if it ends otherwise.

        When the waiting is interrupted, the motion is cancelled. Other errors as in `wait`.
        """
        return run(self._inner.arrive())

    def progress(self, timeout_s: float | None = None) -> Iterator[S]:
        """Yields each new status, the terminal one last; errors as in `wait`."""
        return iterate(self._inner.progress(timeout_s))
