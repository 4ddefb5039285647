"""The cell as a whole."""

from __future__ import annotations

from uuid import UUID

import msgspec

from ._base import Message, MonoTime, OpenEnum, RobotName
from .authority import AuthorityState
from .denial import Denial
from .group import Coupling
from .mode import CommandMode, ControllerState
from .model import Pose
from .motion import ActionStatus
from .state import TcpState
from .status import Fault, Lease, LoopStatistics, StopLatch, Why


class Mount(Message, frozen=True, kw_only=True):
    """Where a robot's root link is fixed."""

    parent: str = "world"
    """`world`, or a link of another robot as `robot/link`."""
    pose: Pose = Pose()
    """Pose of the robot's root link in the parent."""


class CellRobot(Message, frozen=True, kw_only=True):
    """One robot of a cell, as configured."""

    robot: RobotName
    """Which robot."""
    mount: Mount
    """Where its root link is fixed."""
    endpoint: str
    """Zenoh endpoint its agent listens on, for clients that stop it without the gateway."""


class CellInfo(Message, frozen=True, kw_only=True):
    """Which robots a cell has and where they stand."""

    cell: str
    """Name of the cell."""
    boot_id: UUID
    """Run of the gateway."""
    seqno: int
    """Sequence number of this message in this run."""
    software_version: str
    """Version of the gateway's program."""
    robots: tuple[CellRobot, ...]
    """The robots, in the order of the cell file."""


class Presence(OpenEnum):
    """Whether a robot's agent is on the bus. For display: no stop depends on it."""

    NEVER_SEEN = "never_seen"
    """It has not been seen since the gateway started."""
    ONLINE = "online"
    """It is there."""
    LOST = "lost"
    """It was there and is gone."""


class CellVerdict(OpenEnum):
    """One word on a cell."""

    READY = "ready"
    """Every robot is online, without fault or stop."""
    MOVING = "moving"
    """At least one robot is in motion, none is in trouble."""
    STOPPED = "stopped"
    """A stop is latched on at least one robot."""
    DEGRADED = "degraded"
    """A robot has a fault, cannot be commanded or is not online."""


class CellRobotStatus(Message, frozen=True, kw_only=True):
    """Condition of one robot as the gateway knows it."""

    presence: Presence
    """Whether its agent is on the bus."""
    command_mode: CommandMode | None
    """What kind of command is followed; None if not known."""
    controller_state: ControllerState | None
    """What the controller does; None if not known."""
    stop: StopLatch | None
    """The latched stop, if any."""
    faults: tuple[Fault, ...]
    """Latched faults."""
    authority: AuthorityState | None
    """Where the right to command is; None if not known."""
    lease: Lease | None
    """Who may command."""
    why: tuple[Why, ...]
    """Why it does not move, or for whom it does."""
    queued: int
    """Motions that wait behind the one in progress."""
    speed_ratio: float | None
    """Speed of all its motions, 0.01 to 1; None if not known."""
    tcp: tuple[TcpState, ...]
    """Poses of the tips, in each chain's base."""
    state_age_ms: float | None
    """Age of the newest state when this was written [ms]; None if there is none."""
    state_rate_hz: float
    """How often states arrive [Hz]."""
    control_loop: LoopStatistics | None
    """Timing of the control loop; None if not known."""
    clock_offset_ns: int | None
    """Agent's monotonic clock minus the gateway's [ns]; None if not measured."""
    clock_bound_ns: int | None
    """How wrong the offset may be [ns]."""


class PartStatus(Message, frozen=True, kw_only=True, omit_defaults=True):
    """One robot's part of a motion of several robots."""

    status: ActionStatus
    """Where it stands."""
    elapsed_s: float
    """Time along its own clock [s]."""
    reason: Denial | None = None
    """Why it failed or was cancelled."""


class CellMotionStatus(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Status of a motion of several robots."""

    id: UUID
    """Which motion; its parts have the same identity at their agents."""
    boot_id: UUID
    """Run of the gateway."""
    seqno: int
    """Sequence number of status messages of this motion."""
    stamp_ns: MonoTime
    """Time, gateway's monotonic clock [ns]."""
    status: ActionStatus
    """Where it stands as a whole."""
    reason: Denial | None = None
    """Why it failed or was cancelled: the first reason."""
    client: str
    """Who asked for it."""
    duration_s: float
    """Length [s]."""
    parts: dict[RobotName, PartStatus]
    """Each robot's part."""
    start_skew_ms: float | None
    """Largest difference between the parts' measured starts [ms]; None before all have started."""
    # Made by functions, so that they are written also where they are the defaults.
    coupling: Coupling = msgspec.field(default_factory=lambda: Coupling.TIME_SYNCED)
    """How closely the robots are tied together."""
    max_divergence_ms: float | None = msgspec.field(default_factory=lambda: None)
    """Largest difference of phase between two robots at the same time so far [ms]; None before
    it was measured."""
    start_travel: float | None = msgspec.field(default_factory=lambda: None)
    """How far a joint may move at most if the last word before the start is lost [rad or m]."""


class CellStatus(Message, frozen=True, kw_only=True):
    """Condition of a cell, published on change and once a second."""

    cell: str
    """Name of the cell."""
    boot_id: UUID
    """Run of the gateway."""
    seqno: int
    """Sequence number of this message in this run."""
    stamp_ns: MonoTime
    """Time, gateway's monotonic clock [ns]."""
    verdict: CellVerdict
    """One word on the whole."""
    robots: dict[RobotName, CellRobotStatus]
    """Every configured robot."""
    motions: tuple[CellMotionStatus, ...]
    """Motions of several robots that are in progress."""


class CellFrames(Message, frozen=True, kw_only=True):
    """World poses of links.

    Only links that moved since the last message are in it, but every link once a second, so that
    a late reader has them all after a second.
    """

    boot_id: UUID
    """Run of the gateway."""
    seqno: int
    """Sequence number of this message in this run."""
    stamp_ns: MonoTime
    """Time, gateway's monotonic clock [ns]."""
    full: bool
    """Whether every link is in it."""
    frames: dict[str, Pose]
    """Pose in the world of each link, named `robot/link`."""
