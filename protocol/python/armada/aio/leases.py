"""The right to command several robots: all or none."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from types import TracebackType
from typing import TypeVar
from uuid import UUID

from armada import keys, methods
from armada._connection import Connection
from armada.errors import ArmadaError
from armada.messages import (
    AcquireLeaseParams,
    LeaseGrant,
    LeaseParams,
    RenewLeaseParams,
    Role,
)

from .lease import HeldLease, OnLost, keep, milliseconds, refuse_second

P = TypeVar("P")
A = TypeVar("A")

_PROVISIONAL_S = 0.5
"""How long a lease lasts while the others are still asked for [s]."""


class HeldLeases:
    """The right to command several robots: each lease is renewed until all are given back.

    When one is lost, `on_lost` is called once for it, from wherever it is renewed; the others are
    kept. What is asked of that robot or of several with it then raises `LeaseLost`; so does the end
    of a `with`, unless it ends by another error.
    """

    def __init__(self, leases: Mapping[str, HeldLease]) -> None:
        self._leases = dict(leases)

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots, in order of the alphabet."""
        return tuple(self._leases)

    @property
    def ids(self) -> dict[str, UUID]:
        """The lease of each robot: whoever knows one may command."""
        return {robot: lease.id for robot, lease in self._leases.items()}

    @property
    def is_held(self) -> bool:
        """Whether none is lost or given back."""
        return all(lease.is_held for lease in self._leases.values())

    def lease(self, robot: str) -> HeldLease:
        """The lease of one robot; raises `KeyError` if it is none of these."""
        return self._leases[robot]

    def check(self) -> None:
        """Raises `LeaseLost` of the first that is not held any more."""
        for lease in self._leases.values():
            lease.check()

    async def release(self) -> None:
        """Gives all back; motions in progress end with a ramp. Releasing twice does nothing.

        Every one is tried; the first error is raised.
        """
        failed = await self._give_back()
        if failed is not None:
            raise failed

    async def _give_back(self) -> ArmadaError | None:
        first: ArmadaError | None = None
        for lease in self._leases.values():
            try:
                await lease.release()
            except ArmadaError as error:  # noqa: PERF203, each robot must be tried
                first = first or error
        return first

    async def __aenter__(self) -> HeldLeases:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        failed = await self._give_back()
        if error is not None:
            return
        for lease in self._leases.values():
            lease.raise_if_lost()
        if failed is not None:
            raise failed


async def acquire_all(
    connection: Connection,
    robots: Collection[str],
    ttl_s: float,
    role: Role,
    on_lost: OnLost | None,
) -> HeldLeases:
    """Acquires the leases of robots in the order of their names, all or none.

    Until all are there each lasts half a second only, so that a program that dies in between keeps
    none for long. Raises what the first that is refused raises, with those before it given back.
    """
    names = sorted(set(robots))
    for name in names:
        refuse_second(connection, name)
    grants: dict[str, LeaseGrant] = {}
    begun: dict[str, float] = {}
    try:
        first = AcquireLeaseParams(ttl_ms=milliseconds(min(ttl_s, _PROVISIONAL_S)), role=role)
        for name in names:
            grants[name] = await _ask(connection, name, methods.ACQUIRE_LEASE, first, None)
        for name in names:
            lease = grants[name].lease
            longer = RenewLeaseParams(lease=lease, ttl_ms=milliseconds(ttl_s))
            begun[name] = time.monotonic()
            grants[name] = await _ask(connection, name, methods.RENEW_LEASE, longer, lease)
    except BaseException:
        for name, grant in grants.items():
            with suppress(ArmadaError):
                params = LeaseParams(lease=grant.lease)
                await _ask(connection, name, methods.RELEASE_LEASE, params, grant.lease)
        raise
    return HeldLeases(
        {name: keep(connection, name, grants[name], begun[name], on_lost) for name in names}
    )


async def _ask(
    connection: Connection,
    robot: str,
    method: methods.Method[P, A],
    params: P,
    lease: UUID | None,
) -> A:
    return await connection.bus.call(
        method, keys.ROBOT_RPC.with_(robot, method.name), params, lease
    )
