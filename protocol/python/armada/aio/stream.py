"""Streams of commands to a robot: samples at a rate, of which the newest counts."""

from __future__ import annotations

import math
import time
from collections.abc import AsyncGenerator, Sequence
from types import TracebackType
from typing import TypeVar

import zenoh
from numpy.typing import ArrayLike

from armada import codec
from armada._bus import Bus
from armada.errors import NotConnected, StreamEnded
from armada.messages import (
    JogFrame,
    JointCommand,
    StreamCommand,
    StreamHeader,
    StreamTwist,
    Twist,
    joint_vector,
)
from armada.qos import Channel

from .latest import LatestState, Seen
from .lease import HeldLease

S = TypeVar("S", bound="Stream")


class Stream:
    """A stream of commands under a lease, in a mode that was entered for it.

    Samples are numbered and say which state was the newest when they were made. Sending raises
    `LeaseLost` when the lease is, and `StreamEnded` when a newer state says that the robot follows
    the stream no more. When samples stay away, the robot comes to rest by itself.
    """

    def __init__(
        self, bus: Bus, key: str, lease: HeldLease, latest: LatestState, seen: Seen
    ) -> None:
        self.key = key
        """Key that is sent to."""
        self.epoch: int = seen.epoch
        """Epoch of the stream."""
        self._bus = bus
        self._lease = lease
        self._latest = latest
        self._first = seen
        self._publisher: zenoh.Publisher | None = bus.publisher(key, Channel.STREAM)

    async def ticks(
        self, rate_hz: float, duration_s: float = math.inf
    ) -> AsyncGenerator[float, None]:
        """Yields the time since its begin [s] at a rate, for so long; what is missed is left out.

        Raises `ValueError` if the rate is not above 0 and up to 1000.
        """
        if not 0.0 < rate_hz <= 1000.0:
            raise ValueError(f"rate_hz is {rate_hz}, expected above 0 and up to 1000")
        begin = time.monotonic()
        tick = 0
        while (due := tick / rate_hz) <= duration_s:
            await self._bus.waiting.pause(begin + due - time.monotonic())
            elapsed = time.monotonic() - begin
            yield elapsed
            tick = max(tick + 1, math.ceil((time.monotonic() - begin) * rate_hz))

    def close(self) -> None:
        """Ends it: the robot comes to rest, and its mode stays. Closing twice does nothing."""
        publisher, self._publisher = self._publisher, None
        if publisher is not None:
            try:
                publisher.undeclare()
            except zenoh.ZError:
                # The session is closed, and the publisher with it.
                return

    def _header(self) -> StreamHeader:
        """What the next sample says besides its values."""
        self._lease.check()
        seen = self._latest.newest_seen() or self._first
        if seen.boot_id != self._first.boot_id:
            raise StreamEnded(self.key, "the agent was started anew")
        if seen.epoch > self.epoch:
            raise StreamEnded(self.key, f"mode {seen.command_mode}, epoch {seen.epoch}")
        return StreamHeader(
            lease=self._lease.id,
            epoch=self.epoch,
            seq=self._lease.next_seq(),
            state_seqno=seen.seqno,
        )

    def _send(self, sample: StreamHeader) -> None:
        payload = codec.encode(sample)
        if self._publisher is None:
            raise NotConnected(self._bus.endpoints, f"the stream {self.key} is closed")
        try:
            self._publisher.put(payload)
        except zenoh.ZError as cause:
            raise NotConnected(self._bus.endpoints, str(cause)) from cause

    async def __aenter__(self: S) -> S:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class PositionStream(Stream):
    """A stream of the positions of all joints."""

    def send(self, position: ArrayLike, velocity: ArrayLike | None = None) -> None:
        """Sends positions [rad or m] of every joint, and their speeds there if they are known."""
        head = self._header()
        sample = StreamCommand(
            lease=head.lease,
            epoch=head.epoch,
            seq=head.seq,
            state_seqno=head.state_seqno,
            values=joint_vector(position, "position"),
            velocity=None if velocity is None else joint_vector(velocity, "velocity"),
        )
        self._send(sample)


class VelocityStream(Stream):
    """A stream of the speeds of all joints."""

    def send(self, velocity: ArrayLike) -> None:
        """Sends the speed of every joint [rad/s or m/s]."""
        head = self._header()
        sample = StreamCommand(
            lease=head.lease,
            epoch=head.epoch,
            seq=head.seq,
            state_seqno=head.state_seqno,
            values=joint_vector(velocity, "velocity"),
        )
        self._send(sample)


class TwistStream(Stream):
    """A stream of speeds of tools."""

    def send(self, chain: str, twist: Twist | ArrayLike, frame: JogFrame = JogFrame.BASE) -> None:
        """Sends the speed of a chain's tool: a `Twist`, or six numbers, linear then angular."""
        head = self._header()
        sample = StreamTwist(
            lease=head.lease,
            epoch=head.epoch,
            seq=head.seq,
            state_seqno=head.state_seqno,
            chain=chain,
            twist=Twist.of(twist),
            frame=frame,
        )
        self._send(sample)


class CommandStream(Stream):
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
        head = self._header()
        sample = JointCommand(
            lease=head.lease,
            epoch=head.epoch,
            seq=head.seq,
            state_seqno=head.state_seqno,
            name=tuple(name),
            position=_each(name, position, "position"),
            velocity=_each(name, velocity, "velocity"),
        )
        if not sample.position and not sample.velocity:
            raise ValueError("a command needs positions or velocities")
        self._send(sample)


def _each(name: Sequence[str], values: ArrayLike | None, field: str) -> tuple[float, ...]:
    if values is None:
        return ()
    row = joint_vector(values, field)
    if len(row) != len(name):
        raise ValueError(f"{field} has {len(row)} values, expected one for each of {len(name)}")
    return tuple(row.tolist())
