"""Motions of several robots that watch each other directly, agent to agent."""

from __future__ import annotations

from uuid import UUID

import msgspec

from ._base import Message, OpenEnum, RobotName
from .denial import Denial
from .model import JointTrajectory


class Coupling(OpenEnum):
    """How closely the robots of a motion are tied together."""

    INDEPENDENT = "independent"
    """They start at one instant and end together if one fails; each keeps its own pace."""
    TIME_SYNCED = "time_synced"
    """They are always at the same phase of the motion: pauses and speeds are common."""
    RIGID = "rigid"
    """As `time_synced`, and whoever stops takes all others along on one common ramp, which keeps
    what they hold between them."""


class GroupParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """With whom a prepared trajectory is to be followed."""

    partners: tuple[RobotName, ...]
    """The other robots."""
    # Made by functions, so that they are written also where they are the defaults.
    coupling: Coupling = msgspec.field(default_factory=lambda: Coupling.TIME_SYNCED)
    """How closely they are tied together."""
    loss_ms: int = msgspec.field(default_factory=lambda: 60)
    """Silence of a partner after which all stop [ms], 30 to 150."""
    max_divergence_ms: float = msgspec.field(default_factory=lambda: 50.0)
    """How far the phases of two robots may be apart before all stop [ms]."""
    model_rev: int | None = None
    """Revision of the robot's tools and payloads that the motion was made for; any if left out."""


class GroupReadiness(Message, frozen=True, kw_only=True):
    """What an agent answers about a prepared trajectory that is to be followed with others."""

    stop_time_s: float
    """Longest time to rest on the path, from anywhere on it [s]."""
    rate_slope_s: float
    """Fastest change of the rate that is legal everywhere on the path [1/s]; 0 if the trajectory
    leaves no room for one."""
    start_travel: float
    """Furthest that a joint moves until it rests, if a partner is lost at the start [rad or m]."""
    controller_lag_ms: float
    """How late the controller does what it is sent [ms]."""
    model_rev: int
    """Revision of tools and payloads in force."""


class GroupGo(Message, frozen=True, kw_only=True):
    """`go`: the sender is ready, and will start if all its partners are."""

    motion_id: UUID
    """Which motion."""
    robot: RobotName
    """Who."""
    boot_id: UUID
    """Run of its agent."""


class GroupState(OpenEnum):
    """Where a robot stands in a motion of several."""

    ARMED = "armed"
    """It waits for the start."""
    RUNNING = "running"
    """It moves."""
    DONE = "done"
    """It has reached its goal."""
    ABORTING = "aborting"
    """It comes to rest before its goal, or has."""


class GroupHeartbeat(Message, frozen=True, kw_only=True, omit_defaults=True):
    """`heartbeat`, every 20 ms from `commit` to the end: where the sender is on the common path."""

    motion_id: UUID
    """Which motion."""
    robot: RobotName
    """Who."""
    boot_id: UUID
    """Run of its agent."""
    seq: int
    """Number of the heartbeat of this motion; older ones do not count."""
    state: GroupState
    """Where the sender stands."""
    time_s: float
    """Time since the common start by the sender's clock [s]; below 0 before it."""
    phase_s: float
    """Phase it was at then [s]."""
    rate: float
    """How fast its phase runs."""
    error: float
    """Largest tracking error over its tolerance, 0 to 1."""
    scale: float
    """Highest rate it allows the group."""
    scale_next: float
    """Highest rate it allows from `scale_next_from_s` on."""
    scale_next_from_s: float
    """Phase from which that counts [s]; all robots change there."""
    scale_next_at_s: float | None = None
    """Time since the common start from which it counts as well [s], where no phase goes on: the end
    of a pause."""


class GroupAbort(Message, frozen=True, kw_only=True, omit_defaults=True):
    """`abort`: the sender stops, and its partners are to do the same."""

    motion_id: UUID
    """Which motion."""
    robot: RobotName
    """Who."""
    boot_id: UUID
    """Run of its agent."""
    reason: Denial
    """Why."""
    from_phase_s: float | None = None
    """Phase at which the common ramp begins [s], for `rigid`; at once if left out."""


class CheckClearanceParams(Message, frozen=True, kw_only=True):
    """Parameters of the cell's `check_clearance`."""

    trajectory: JointTrajectory
    """Joints are named `robot/joint`; every joint of each robot that takes part is named."""
    offset_ms: float = 0.0
    """How far the phases of two robots may be apart [ms]: what lies between is checked as well."""


class ClearanceAnswer(Message, frozen=True, kw_only=True):
    """Answer of the cell's `check_clearance`."""

    clear: bool
    """Whether every pair keeps the least distance."""
    required_m: float
    """The least distance that the cell demands [m]."""
    distance_m: float | None
    """Smallest distance that was found [m]: a lower bound of the true one if `clear`, else that of
    the place where the search ended; None if no two robots have shapes."""
    links: tuple[str, str] | None
    """The two links, named `robot/link`, where it was found."""
    at_s: float | None
    """Where on the motion [s]."""
    without_shape: tuple[str, ...]
    """Links that have no shape, so nothing is known of them."""


class CellSpeedRatioParams(Message, frozen=True, kw_only=True):
    """Parameters of the cell's `set_speed_ratio`."""

    motion_id: UUID
    """Which motion."""
    ratio: float
    """Speed over that of the trajectory, 0.01 to 1."""
