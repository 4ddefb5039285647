"""The right to command a robot."""

from __future__ import annotations

from types import TracebackType
from uuid import UUID

from armada import aio
from armada._waiting import run
from armada.messages import LeaseGrant, LeaseScope


class HeldLease:
    """The right to command a robot: renewed until it is given back.

    While it is held, what is asked of the robot through this connection is asked under it. When it
    is lost, `on_lost` is called once, from wherever it is renewed, and what is asked then raises
    `LeaseLost`; so does the end of a `with`, unless it ends by another error.
    """

    def __init__(self, inner: aio.HeldLease) -> None:
        self._inner = inner
        self.robot: str = inner.robot
        """Name of the robot."""
        self.id: UUID = inner.id
        """The lease: whoever knows it may command."""
        self.epoch: int = inner.epoch
        """Epoch in force when it was granted."""
        self.ttl_s: float = inner.ttl_s
        """How long it lasts without being renewed [s]."""

    @property
    def is_held(self) -> bool:
        """Whether it is neither lost nor given back."""
        return self._inner.is_held

    def check(self) -> None:
        """Raises `LeaseLost` if it is not held any more."""
        self._inner.check()

    def raise_if_lost(self) -> None:
        """Raises `LeaseLost` if it was lost; one that was given back is not lost."""
        self._inner.raise_if_lost()

    def next_seq(self) -> int:
        """The number of the next sample of a stream under this lease."""
        return self._inner.next_seq()

    def delegate(
        self, to: str, *, scope: LeaseScope = LeaseScope.ARM, ttl_s: float = 1.0
    ) -> LeaseGrant:
        """Lets the client of this name command as well, as long as this lease is in force.

        Give it the lease in the answer: it keeps it with `robot.use_lease`, which lasts `ttl_s`
        without being renewed. `scope` is what it gets the right to.
        """
        return run(self._inner.delegate(to, scope=scope, ttl_s=ttl_s))

    def release(self) -> None:
        """Gives it back; a motion in progress ends with a ramp.

        Releasing twice does nothing, and one that was lost before is no error.
        """
        run(self._inner.release())

    def __enter__(self) -> HeldLease:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        run(self._inner.__aexit__(kind, error, trace))
