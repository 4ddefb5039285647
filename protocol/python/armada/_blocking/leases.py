"""The right to command several robots: all or none."""

from __future__ import annotations

from types import TracebackType
from uuid import UUID

from armada import aio
from armada._waiting import run

from .lease import HeldLease


class HeldLeases:
    """The right to command several robots: each lease is renewed until all are given back.

    When one is lost, `on_lost` is called once for it, from wherever it is renewed; the others are
    kept. What is asked of that robot or of several with it then raises `LeaseLost`; so does the end
    of a `with`, unless it ends by another error.
    """

    def __init__(self, inner: aio.HeldLeases) -> None:
        self._inner = inner

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots, in order of the alphabet."""
        return self._inner.robots

    @property
    def ids(self) -> dict[str, UUID]:
        """The lease of each robot: whoever knows one may command."""
        return self._inner.ids

    @property
    def is_held(self) -> bool:
        """Whether none is lost or given back."""
        return self._inner.is_held

    def lease(self, robot: str) -> HeldLease:
        """The lease of one robot; raises `KeyError` if it is none of these."""
        return HeldLease(self._inner.lease(robot))

    def check(self) -> None:
        """Raises `LeaseLost` of the first that is not held any more."""
        self._inner.check()

    def release(self) -> None:
        """Gives all back; motions in progress end with a ramp. Releasing twice does nothing.

        Every one is tried; the first error is raised.
        """
        run(self._inner.release())

    def __enter__(self) -> HeldLeases:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        run(self._inner.__aexit__(kind, error, trace))
