"""Stops. An operational stop over a network, never a rated safety function."""

from __future__ import annotations

from typing import Literal, TypeAlias
from uuid import UUID

from ._base import Message, MonoTime, OpenEnum, RobotName


class StopLevel(OpenEnum):
    """How hard to stop; a request, not a safety rating."""

    L2 = "L2"
    """Controlled, drives stay on."""
    L1 = "L1"
    """Controlled, then drives off."""
    L0 = "L0"
    """Drives off at once."""


class StopScopeRobots(Message, frozen=True, kw_only=True):
    """These robots only; `StopScope::Robots` in Rust."""

    robots: tuple[RobotName, ...]
    """Which."""


StopScope: TypeAlias = Literal["cell"] | StopScopeRobots
"""Which robots a stop is for: `"cell"` for every robot that hears it, or some by name."""


class StopRequest(Message, frozen=True, kw_only=True):
    """Stop, and stay stopped until a reset. Needs no lease and is never refused."""

    stop_id: UUID
    """Identity of the stop; the same in every repetition."""
    source: str
    """Who asks."""
    level: StopLevel
    """How hard."""
    scope: StopScope = "cell"
    """Which robots."""
    reason: str = ""
    """Why, for people."""
    seq: int = 0
    """Number of the repetition."""


class StopStage(OpenEnum):
    """How far a robot has come with a stop."""

    RECEIVED = "received"
    """The agent has it and its gate for motion is closed."""
    COMMANDED = "commanded"
    """The first decelerating set-point, or drives-off, was sent to the controller."""
    STANDSTILL = "standstill"
    """Measured speed has been below the threshold for the hold time."""
    DRIVES_OFF = "drives_off"
    """The controller reports its drives off."""

    @property
    def rank(self) -> int:
        """Position on the way from received to drives off; -1 if this version does not know it."""
        order = list(StopStage)
        return order.index(self) if self in order else -1


class StopAck(Message, frozen=True, kw_only=True):
    """One step of a robot's answer to a stop."""

    stop_id: UUID
    """Which stop."""
    robot: RobotName
    """Which robot."""
    boot_id: UUID
    """This run of the agent."""
    stage: StopStage
    """How far."""
    stamp_ns: MonoTime
    """When, agent's monotonic clock [ns]."""
    since_received_ms: float
    """Time since this agent first received the stop [ms]."""


class LatchedStop(Message, frozen=True, kw_only=True):
    """One stop that keeps a robot stopped."""

    stop_id: UUID
    """Identity, to be listed in the reset."""
    source: str
    """Who asked."""
    level: StopLevel
    """How hard."""
    reason: str
    """Why."""


class ResetZone(OpenEnum):
    """Who has to see to it before a robot's stop is reset."""

    REMOTE = "remote"
    """Nobody has to be at the arm."""
    MANUAL = "manual"
    """Somebody acknowledges at the arm first."""


class ResetNeeds(Message, frozen=True, kw_only=True):
    """What a reset of a latched stop needs."""

    nonce: UUID
    """To be returned in the reset; a new one after every stop and every attempt."""
    signed: bool
    """Whether the reset has to be signed."""
    zone: ResetZone
    """Who has to see to it."""
    acknowledged: bool
    """Whether that was acknowledged at the arm; true if nobody has to."""


class StopVerdict(OpenEnum):
    """Verdict of a stop report."""

    COMPLETE = "complete"
    """Every robot in scope stands still, by measurement."""
    INCOMPLETE = "incomplete"
    """At least one is not known to stand still: go and look."""


class StopReport(Message, frozen=True, kw_only=True):
    """Outcome of a stop: complete only if every robot in scope was measured to stand still."""

    stop_id: UUID
    """Which stop."""
    verdict: StopVerdict
    """The verdict."""
    acks: tuple[StopAck, ...]
    """Highest stage reached by each robot in scope, with its time."""
    missing: tuple[RobotName, ...]
    """Robots in scope that did not reach standstill in time."""


class StopSourceStatus(Message, frozen=True, kw_only=True):
    """A source of stops elsewhere that has to check in, as a robot knows it."""

    source: str
    """Name of the source."""
    pressed: bool
    """Whether it is pressed; true as well while it is not heard."""
    age_ms: float | None
    """Time since its last check-in [ms]; None if it has never been heard."""


class StopChallenge(Message, frozen=True, kw_only=True):
    """What an agent asks a source of stops, with a number that nobody can guess."""

    robot: RobotName
    """Who asks."""
    nonce: UUID
    """To be returned."""


class StopCheckIn(Message, frozen=True, kw_only=True, omit_defaults=True):
    """What a source of stops answers: made from its real input for every challenge.

    It never comes from a wrapper that knows no input.
    """

    source: str
    """Name of the source."""
    nonce: UUID
    """Number of the challenge."""
    pressed: bool
    """Whether it is pressed."""
    signature: str | None = None
    """Signature of the rest with the key of the cell, if it has one."""
