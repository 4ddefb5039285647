"""The right to command a robot."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from types import TracebackType
from typing import TypeVar
from uuid import UUID

import zenoh

from armada import keys, methods
from armada._bus import Answer, Bus
from armada._connection import Connection
from armada._repeat import Repeater
from armada.errors import ArmadaError, CodecError, DeniedError, LeaseLost
from armada.messages import (
    DelegateLeaseParams,
    DenialCode,
    Event,
    EventKind,
    LeaseGrant,
    LeaseParams,
    LeaseScope,
    RenewLeaseParams,
)

P = TypeVar("P")
A = TypeVar("A")

OnLost = Callable[[LeaseLost], None]
"""What is told of the loss of a lease."""

_RENEWALS = 3
"""How often a lease is renewed while it lasts."""


class HeldLease:
    """The right to command a robot: renewed until it is given back.

    While it is held, what is asked of the robot through this connection is asked under it. When it
    is lost, `on_lost` is called once, from wherever it is renewed, and what is asked then raises
    `LeaseLost`; so does the end of a `with`, unless it ends by another error.

    It listens to what the robot tells of leases: that somebody took it is known after one more
    round trip, not with the next renewal.
    """

    def __init__(
        self,
        bus: Bus,
        robot: str,
        grant: LeaseGrant,
        asked_at: float,
        on_lost: OnLost | None,
        forget: Callable[[HeldLease], None],
    ) -> None:
        self._bus = bus
        self.robot = robot
        """Name of the robot."""
        self.id: UUID = grant.lease
        """The lease: whoever knows it may command."""
        self.epoch: int = grant.epoch
        """Epoch in force when it was granted."""
        self.ttl_s: float = grant.ttl_ms / 1000
        """How long it lasts without being renewed [s]."""
        self._renewed_at = asked_at
        self._on_lost = on_lost
        self._forget = forget
        self._lost: LeaseLost | None = None
        self._released = False
        self._seq = 0
        self._repeater = Repeater(bus.waiting, self.ttl_s / _RENEWALS, self._renew)
        self._news = self._listen()

    @property
    def is_held(self) -> bool:
        """Whether it is neither lost nor given back."""
        return self._lost is None and not self._released

    def check(self) -> None:
        """Raises `LeaseLost` if it is not held any more."""
        self.raise_if_lost()
        if self._released:
            raise LeaseLost(self.robot, "it was given back")

    def raise_if_lost(self) -> None:
        """Raises `LeaseLost` if it was lost; one that was given back is not lost."""
        if self._lost is not None:
            raise self._lost

    def next_seq(self) -> int:
        """The number of the next sample of a stream under this lease."""
        self._seq += 1
        return self._seq

    async def delegate(
        self, to: str, *, scope: LeaseScope = LeaseScope.ARM, ttl_s: float = 1.0
    ) -> LeaseGrant:
        """Lets the client of this name command as well, as long as this lease is in force.

        Give it the lease in the answer: it keeps it with `robot.use_lease`, which lasts `ttl_s`
        without being renewed. `scope` is what it gets the right to.
        """
        self.check()
        params = DelegateLeaseParams(lease=self.id, to=to, scope=scope, ttl_ms=milliseconds(ttl_s))
        return await self._call(methods.DELEGATE_LEASE, params)

    async def release(self) -> None:
        """Gives it back; a motion in progress ends with a ramp.

        Releasing twice does nothing, and one that was lost before is no error.
        """
        await self._repeater.end()
        self._stop_listening()
        if self._released:
            return
        self._released = True
        self._forget(self)
        if self._lost is not None:
            return
        try:
            await self._call(methods.RELEASE_LEASE, LeaseParams(lease=self.id))
        except DeniedError as error:
            # Taken away, by a stop for one, since it was renewed last.
            if error.code != DenialCode.LEASE_STALE:
                raise
            self._lose(str(error))

    def _listen(self) -> zenoh.Subscriber[None] | None:
        """Has the lease looked at when the robot tells of one; without, it is when renewed."""
        key = keys.ROBOT_EVENTS.of(self.robot)

        def heard(sample: zenoh.Sample) -> None:
            with suppress(CodecError):
                event = Answer.of_sample(sample).read(Event, key, 0.0)
                if event.kind == EventKind.LEASE:
                    self._repeater.now()

        try:
            return self._bus.main.declare_subscriber(key, heard)
        except zenoh.ZError:
            return None

    def _stop_listening(self) -> None:
        news, self._news = self._news, None
        if news is not None:
            # If the session is closed it has ended with it.
            with suppress(zenoh.ZError):
                news.undeclare()

    async def _call(self, method: methods.Method[P, A], params: P) -> A:
        key = keys.ROBOT_RPC.with_(self.robot, method.name)
        return await self._bus.call(method, key, params, self.id)

    async def _renew(self) -> bool:
        asked_at = time.monotonic()
        limited = replace(methods.RENEW_LEASE, timeout_s=self.ttl_s / _RENEWALS)
        try:
            await self._call(limited, RenewLeaseParams(lease=self.id))
        except (DeniedError, CodecError) as error:
            return self._lose(str(error))
        except ArmadaError as error:
            # The agent or the link may be back before it has run out.
            if time.monotonic() - self._renewed_at < self.ttl_s:
                return True
            return self._lose(str(error))
        self._renewed_at = asked_at
        return True

    def _lose(self, reason: str) -> bool:
        self._lost = LeaseLost(self.robot, reason)
        if self._on_lost is not None:
            self._on_lost(self._lost)
        return False

    async def __aenter__(self) -> HeldLease:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.release()
        if error is None:
            self.raise_if_lost()


async def hold(
    connection: Connection,
    robot: str,
    ask: Callable[[], Awaitable[LeaseGrant]],
    on_lost: OnLost | None,
) -> HeldLease:
    """Keeps what `ask` is granted; raises `ValueError` if a lease of the robot is held already."""
    refuse_second(connection, robot)
    asked_at = time.monotonic()
    return keep(connection, robot, await ask(), asked_at, on_lost)


def refuse_second(connection: Connection, robot: str) -> None:
    """Raises `ValueError` if this connection holds a lease of the robot."""
    held = connection.held.get(robot)
    if held is not None and held.is_held:
        raise ValueError(f"the lease of {robot} is held already")


def keep(
    connection: Connection, robot: str, grant: LeaseGrant, asked_at: float, on_lost: OnLost | None
) -> HeldLease:
    """Renews a lease from now on, and has what is asked of the robot asked under it."""

    def forget(lease: HeldLease) -> None:
        if connection.held.get(robot) is lease:
            del connection.held[robot]

    lease = HeldLease(connection.bus, robot, grant, asked_at, on_lost, forget)
    connection.held[robot] = lease
    return lease


def milliseconds(seconds: float) -> int:
    """The same on the wire."""
    return round(seconds * 1000)
