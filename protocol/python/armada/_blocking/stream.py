"""Streams of commands to a robot: samples at a rate, of which the newest counts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Any, Generic, TypeVar

from numpy.typing import ArrayLike

from armada import aio
from armada._waiting import run
from armada.messages import JogFrame, Twist

from .opened import iterate

N = TypeVar("N", bound=aio.Stream)
S = TypeVar("S", bound="Stream[Any]")


class Stream(Generic[N]):
    """A stream of commands under a lease, in a mode that was entered for it.

    Samples are numbered and say which state was the newest when they were made. Sending raises
    `LeaseLost` when the lease is, and `StreamEnded` when a newer state says that the robot follows
    the stream no more. When samples stay away, the robot comes to rest by itself.
    """

    def __init__(self, inner: N) -> None:
        self._inner = inner
        self.key: str = inner.key
        """Key that is sent to."""
        self.epoch: int = inner.epoch
        """Epoch of the stream."""

    def ticks(self, rate_hz: float, duration_s: float = math.inf) -> Iterator[float]:
        """Yields the time since its begin [s] at a rate, for so long; what is missed is left out.

        Raises `ValueError` if the rate is not above 0 and up to 1000.
        """
        return iterate(self._inner.ticks(rate_hz, duration_s))

    def close(self) -> None:
        """Ends it: the robot comes to rest, and its mode stays. Closing twice does nothing."""
        self._inner.close()

    def __enter__(self: S) -> S:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        run(self._inner.__aexit__(kind, error, trace))


class PositionStream(Stream[aio.PositionStream]):
    """A stream of the positions of all joints."""

    def send(self, position: ArrayLike, velocity: ArrayLike | None = None) -> None:
        """Sends positions [rad or m] of every joint, and their speeds there if they are known."""
        self._inner.send(position, velocity)


class VelocityStream(Stream[aio.VelocityStream]):
    """A stream of the speeds of all joints."""

    def send(self, velocity: ArrayLike) -> None:
        """Sends the speed of every joint [rad/s or m/s]."""
        self._inner.send(velocity)


class TwistStream(Stream[aio.TwistStream]):
    """A stream of speeds of tools."""

    def send(self, chain: str, twist: Twist | ArrayLike, frame: JogFrame = JogFrame.BASE) -> None:
        """Sends the speed of a chain's tool: a `Twist`, or six numbers, linear then angular."""
        self._inner.send(chain, twist, frame)


class CommandStream(Stream[aio.CommandStream]):
    """A stream of commands to joints by name; those that are not named stay where they are."""

    def send(
        self,
        name: Sequence[str],
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
    ) -> None:
        """Sends positions [rad or m], speeds [rad/s or m/s] or both of the joints `name`.

        Raises `ValueError` if there is none, or not one number for each name.
        """
        self._inner.send(name, position, velocity)
