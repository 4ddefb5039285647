"""Who may command a robot: the lease."""

from __future__ import annotations

from uuid import UUID

import msgspec

from ._base import Message, OpenEnum, RobotName
from .denial import Denial


class AuthorityState(OpenEnum):
    """Where the right to command a robot is."""

    FREE = "free"
    """Nobody has it: anybody may command, or acquire it."""
    HELD = "held"
    """The holder of a lease has it."""
    STALE = "stale"
    """The lease has run out: its holder may renew it, anybody may acquire one."""
    LOCAL = "local"
    """A person at the controller has it, before everybody else."""
    INHIBITED = "inhibited"
    """Nobody has it, since a stop is latched."""


class Role(OpenEnum):
    """As what somebody commands; from the lowest to the highest."""

    PROGRAM = "program"
    """A program."""
    OPERATOR = "operator"
    """A person who runs the cell."""
    SUPERVISOR = "supervisor"
    """A person who answers for it."""


class LeaseScope(OpenEnum):
    """What a lease gives the right to; each contains those after it."""

    ARM = "arm"
    """Everything, motion first of all."""
    END_EFFECTOR = "end_effector"
    """Tools, payloads and end effectors."""
    IO = "io"
    """Signals and parameters."""


class AcquireLeaseParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `acquire_lease`."""

    # Made by a function, so that it is written also where it is the default.
    ttl_ms: int = msgspec.field(default_factory=lambda: 1000)
    """How long it lasts without being renewed [ms], 200 to 60000."""
    role: Role = Role.PROGRAM
    """As what the holder commands: nobody of a lower role can take the lease away."""


class TakeLeaseParams(Message, frozen=True, kw_only=True):
    """Parameters of `take_lease`: a person takes the right to command from whoever has it."""

    ttl_ms: int = 1000
    """How long it lasts without being renewed [ms], 200 to 60000."""
    role: Role
    """As what: `operator` or `supervisor`, and not below the holder's role."""
    reason: str
    """Why, for the holder and the audit trail; 1 to 200 characters."""


class DelegateLeaseParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `delegate_lease`: the holder lets somebody else command as well.

    That lasts at most for as long as its own lease is in force.
    """

    lease: UUID
    """The holder's lease."""
    to: str
    """Name of the client that is to command."""
    scope: LeaseScope = LeaseScope.ARM
    """What it gets the right to."""
    ttl_ms: int = msgspec.field(default_factory=lambda: 1000)
    """How long it lasts without being renewed [ms], 200 to 60000."""


class RenewLeaseParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `renew_lease`."""

    lease: UUID
    """Which lease."""
    ttl_ms: int | None = None
    """How long it lasts from now [ms], 200 to 60000; as before if left out."""


class LeaseParams(Message, frozen=True, kw_only=True):
    """Parameters of `release_lease`."""

    lease: UUID
    """Which lease; with it go all that its holder delegated."""


class LeaseGrant(Message, frozen=True, kw_only=True):
    """Answer of `acquire_lease`, `take_lease`, `delegate_lease` and `renew_lease`."""

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


class CellAcquireLeaseParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of the cell's `acquire_lease`: leases of several robots, all or none."""

    robots: tuple[RobotName, ...] = msgspec.field(default_factory=lambda: ())
    """Which robots; all if empty."""
    ttl_ms: int = msgspec.field(default_factory=lambda: 1000)
    """How long they last without being renewed [ms], 200 to 60000."""
    role: Role = Role.PROGRAM
    """As what the holder commands."""


class CellLeaseParams(Message, frozen=True, kw_only=True):
    """Parameters of the cell's `renew_lease` and `release_lease`."""

    leases: dict[RobotName, UUID]
    """The lease of each robot."""


class GroupLease(Message, frozen=True, kw_only=True):
    """Answer of the cell's `acquire_lease` and `renew_lease`."""

    leases: dict[RobotName, LeaseGrant]
    """The lease of each robot; each can be renewed and released at its agent as well."""


class GroupLeaseReleased(Message, frozen=True, kw_only=True):
    """Answer of the cell's `release_lease`."""

    released: tuple[RobotName, ...]
    """Robots whose lease was given back."""
    refused: tuple[tuple[RobotName, Denial], ...]
    """Robots that refused or did not answer, and why."""
