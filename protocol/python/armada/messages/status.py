"""How a robot is, and what may be done next."""

from __future__ import annotations

from typing import Literal, TypeAlias
from uuid import UUID

from ._base import Message, MonoTime, OpenEnum, RobotName
from .mode import CommandMode, ControllerState, OperationalMode, RobotFlags
from .motion import MotionStatus
from .stop import LatchedStop, StopLevel, StopStage


class StopLatch(Message, frozen=True, kw_only=True):
    """A stop in force: no motion before a reset."""

    level: StopLevel
    """Highest level asked for."""
    stops: tuple[LatchedStop, ...]
    """Every stop that the reset must clear."""
    stage: StopStage
    """How far the robot has come."""


class Lease(Message, frozen=True, kw_only=True):
    """Who may command a robot, and for how long."""

    holder: str
    """Name of the holder."""
    remaining_ms: int
    """Time left [ms]; 0 once it has run out."""
    stale: bool
    """Whether it has run out: the holder may still renew it, anybody may acquire one."""


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
    lease: Lease | None
    """Who may command; None while nobody holds a lease."""
    motion: MotionStatus | None
    """The motion in progress or waiting for its start."""
    queued: tuple[UUID, ...]
    """Motions that wait behind it, in their order."""
    stream: StreamStatistics | None
    """The stream of commands, while one is in progress."""
    control_loop: LoopStatistics
    """Timing of the control loop."""
    dropped: tuple[tuple[str, int], ...]
    """Messages that were dropped or refused since the start, by reason."""
    next: tuple[str, ...]
    """What may be done next, in words for a person."""
