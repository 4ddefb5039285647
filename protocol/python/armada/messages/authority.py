"""Who may command a robot: the lease."""

from __future__ import annotations

from uuid import UUID

from ._base import Message


class AcquireLeaseParams(Message, frozen=True, kw_only=True):
    """Parameters of `acquire_lease`."""

    ttl_ms: int = 1000
    """How long it lasts without being renewed [ms], 200 to 60000."""


class LeaseParams(Message, frozen=True, kw_only=True):
    """Parameters of `renew_lease` and `release_lease`."""

    lease: UUID
    """Which lease."""


class LeaseGrant(Message, frozen=True, kw_only=True):
    """Answer of `acquire_lease` and `renew_lease`."""

    lease: UUID
    """The lease: whoever knows it may command, so keep it to yourself."""
    epoch: int
    """Epoch in force; streams name it."""
    ttl_ms: int
    """How long it lasts from now without being renewed [ms]."""


class LeaseReleased(Message, frozen=True, kw_only=True):
    """Answer of `release_lease`."""

    epoch: int
    """Epoch in force."""
