"""How a robot is, and what may be done next."""

from __future__ import annotations

from typing import Literal, TypeAlias
from uuid import UUID

import msgspec

from ._base import Message, MonoTime, OpenEnum, RobotName
from .authority import AuthorityState, LeaseScope, Role
from .mode import CommandMode, ControllerState, OperationalMode, RobotFlags
from .motion import MotionStatus
from .stop import LatchedStop, ResetNeeds, StopLevel, StopSourceStatus, StopStage


class StopLatch(Message, frozen=True, kw_only=True):
    """A stop in force: no motion before a reset."""

    level: StopLevel
    """Highest level asked for."""
    stops: tuple[LatchedStop, ...]
    """Every stop that the reset must clear."""
    stage: StopStage
    """How far the robot has come."""
    reset: ResetNeeds
    """What a reset needs."""


class Delegate(Message, frozen=True, kw_only=True):
    """Somebody whom the holder of a lease lets command as well."""

    holder: str
    """Name of the client."""
    scope: LeaseScope
    """What it has the right to."""
    remaining_ms: int
    """Time left [ms]."""


class Lease(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Who may command a robot, and for how long."""

    holder: str
    """Name of the holder."""
    # Made by a function, so that it is written also where it is the default.
    role: Role = msgspec.field(default_factory=lambda: Role.PROGRAM)
    """As what it commands."""
    reason: str | None = None
    """Why it took the lease from somebody else, if it did."""
    remaining_ms: int
    """Time left [ms]; 0 once it has run out."""
    stale: bool
    """Whether it has run out: the holder may still renew it, anybody may acquire one."""
    delegates: tuple[Delegate, ...] = ()
    """Whom the holder lets command as well."""


class StreamStatistics(Message, frozen=True, kw_only=True):
    """How a stream of commands comes in."""

    taken: int
    """Samples taken in this epoch."""
    dropped: int
    """Samples dropped in this epoch."""
    limited: int = 0
    """Samples taken in this epoch of which the limits allow only a part."""
    age_ms: float
    """Time since the newest one [ms]."""
    starved: bool
    """Whether the robot decelerates or stands because samples stay away."""
    jitter_ms: float = 0.0
    """Standard deviation of the time between samples, over the last one to two seconds [ms]."""
    loss: float = 0.0
    """Share of the samples that did not come or came too late, over the same time."""
    state_age_ms: float = 0.0
    """Mean age of the states that samples were made for, when they came [ms]: the way of the
    state, what the client takes, and the way of the sample."""
    allowed: float = 1.0
    """Share of the robot's limits of speed that the link allows: 1 as asked, less when the stream
    is slowed, 0 when it is refused."""


class FaultCode(OpenEnum):
    """Kind of a fault."""

    COMMUNICATION_LOST = "communication_lost"
    """No feedback for longer than the allowed time."""
    CONTROLLER_ERROR = "controller_error"
    """The controller reports an error."""
    FATAL_ERROR = "fatal_error"
    """The controller reports an error that no reset clears."""
    EMERGENCY_STOP = "emergency_stop"
    """The controller's own emergency stop is pressed."""
    GUARD_STOP = "guard_stop"
    """A safeguard of the controller is open."""
    NOT_READY = "not_ready"
    """Drives went off, or the controller stopped taking commands, during a motion."""
    TRACKING_ERROR = "tracking_error"
    """Measured and commanded position went too far apart."""
    VELOCITY_ERROR = "velocity_error"
    """Measured and commanded speed went further apart than a waypoint allows."""
    HOMING_FAILED = "homing_failed"
    """The controller failed to home."""
    STOP_IGNORED = "stop_ignored"
    """The controller went on with a motion of its own that it was asked to end."""
    LOOP_ERROR = "loop_error"
    """The control loop itself failed."""


class ClearBy(OpenEnum):
    """What clears a fault; each level does what those before it do."""

    HALT = "halt"
    """Setting mode `halt`."""
    RESET_ERRORS = "reset_errors"
    """`reset_errors`."""
    CONTROLLER = "controller"
    """A person at the controller, then `reset_errors`."""


class Fault(Message, frozen=True, kw_only=True, omit_defaults=True):
    """A latched fault; it stays until `reset_errors` when its cause is gone."""

    code: FaultCode
    """What kind."""
    message: str
    """What happened, with joint, value and limit."""
    joint: str | None = None
    """Joint, if one is at fault."""
    value: float
    """The value that was wrong, in the unit that the message names."""
    limit: float
    """Its limit; 0 if it has none."""
    clear: ClearBy
    """What clears it."""
    remedy: str
    """What a person is to do."""
    recording: str | None = None
    """File with the last seconds of the control loop, on the agent's machine."""
    since_ns: MonoTime
    """When it was latched, agent's monotonic clock [ns]."""


class SchedulingPolicyFifo(Message, frozen=True, kw_only=True):
    """`SCHED_FIFO` with a priority; `SchedulingPolicy::Fifo` in Rust."""

    fifo: int
    """The priority."""


SchedulingPolicy: TypeAlias = Literal["other"] | SchedulingPolicyFifo
"""How the operating system schedules a thread: `"other"` is time sharing."""


class LoopStatistics(Message, frozen=True, kw_only=True):
    """Timing of a control loop since its start."""

    ticks: int
    """Ticks so far."""
    rate_hz: float
    """Rate over the last second [Hz]."""
    target_rate_hz: float
    """Rate asked for [Hz]."""
    overruns: int
    """Ticks whose work took longer than a period."""
    missed_periods: int
    """Periods in which no tick ran."""
    limited_setpoints: int
    """Set-points that the limiter had to change."""
    worst_wake_us: float
    """Latest wake-up after its deadline, over the last second [us]."""
    scheduling: SchedulingPolicy
    """How the operating system really schedules the loop."""


class WhyCode(OpenEnum):
    """Kind of a reason why a robot is as it is."""

    NOT_CONNECTED = "not_connected"
    """The controller does not answer."""
    STOPPED = "stopped"
    """A stop is latched."""
    STOP_SOURCE = "stop_source"
    """A source of stops is pressed or silent."""
    FAULTED = "faulted"
    """A fault is latched."""
    LOCAL = "local"
    """A person at the controller has it."""
    DRIVES_OFF = "drives_off"
    """The drives are off."""
    DRIVEN_BY = "driven_by"
    """Somebody holds a lease."""
    LEASE_STALE = "lease_stale"
    """A lease has run out."""
    MOVING = "moving"
    """A motion is in progress."""
    WAITING = "waiting"
    """A motion is paused, or waits for its partners."""
    DEGRADED_LINK = "degraded_link"
    """A stream is starved, slowed or refused because of its link."""
    HALTED = "halted"
    """Its mode is `halt`: nothing is asked of it."""
    READY = "ready"
    """Nothing keeps it from moving."""


class Why(Message, frozen=True, kw_only=True, omit_defaults=True):
    """One reason why a robot is as it is."""

    code: WhyCode
    """What kind."""
    message: str
    """The same for a person, with who, what and numbers."""
    who: str | None = None
    """Who is behind it, if that is known."""
    since_ns: MonoTime | None = None
    """Since when, agent's monotonic clock [ns]."""

    def __str__(self) -> str:
        return self.message


class RobotStatus(Message, frozen=True, kw_only=True):
    """Condition of a robot, published on change and once a second."""

    robot: RobotName
    """Which robot."""
    boot_id: UUID
    """This run of the agent."""
    seqno: int
    """Sequence number of this message in this run."""
    stamp_ns: MonoTime
    """Time, agent's monotonic clock [ns]."""
    epoch: int
    """Raised by every halt, stop, reset and change of mode."""
    command_mode: CommandMode
    """What kind of command is followed."""
    operational_mode: OperationalMode
    """The controller's key switch."""
    controller_state: ControllerState
    """What the controller does."""
    flags: RobotFlags
    """Conditions as bits."""
    stop: StopLatch | None
    """The latched stop, if any."""
    faults: tuple[Fault, ...]
    """Latched faults, oldest first."""
    authority: AuthorityState
    """Where the right to command is."""
    lease: Lease | None
    """Who may command; None while nobody holds a lease."""
    motion: MotionStatus | None
    """The motion in progress or waiting for its start."""
    queued: tuple[UUID, ...]
    """Motions that wait behind it, in their order."""
    speed_ratio: float
    """Speed of all motions, 0.01 to 1."""
    stream: StreamStatistics | None
    """The stream of commands, while one is in progress."""
    control_loop: LoopStatistics
    """Timing of the control loop."""
    dropped: tuple[tuple[str, int], ...]
    """Messages that were dropped or refused since the start, by reason."""
    stop_sources: tuple[StopSourceStatus, ...]
    """Sources of stops elsewhere that have to check in."""
    why: tuple[Why, ...]
    """Why it does not move, or for whom it does: the most important first."""
    next: tuple[str, ...]
    """What may be done next, in words for a person."""
