"""Motions: what is in progress and how it ended."""

from __future__ import annotations

from uuid import UUID

import msgspec

from ._base import Message, MonoTime, OpenEnum, RobotName
from .denial import Denial


class ActionStatus(OpenEnum):
    """Where a motion stands; exactly one of the terminal ones is reached, once."""

    QUEUED = "queued"
    """Accepted, waiting for its start."""
    RUNNING = "running"
    """In progress."""
    PAUSED = "paused"
    """In progress, at rest on its path or on the way to rest, until it is resumed."""
    COMPLETE = "complete"
    """Ended at its goal."""
    CANCELLED = "cancelled"
    """Ended early because somebody asked for it."""
    FAILED = "failed"
    """Ended early for a reason."""

    @property
    def is_terminal(self) -> bool:
        """Whether nothing follows any more."""
        return self in (ActionStatus.COMPLETE, ActionStatus.CANCELLED, ActionStatus.FAILED)


class MotionKind(OpenEnum):
    """What makes the set-points of a motion."""

    JOG_FREESPACE = "jog_freespace"
    """A move of all joints to a position."""
    JOG_JOINT = "jog_joint"
    """Joints at a speed."""
    JOG_CARTESIAN = "jog_cartesian"
    """Tools at a speed."""
    HOME = "home"
    """Homing."""
    TRAJECTORY = "trajectory"
    """A timed trajectory."""
    MOVE_JOINT = "move_joint"
    """A move to joint positions."""
    MOVE_POSE = "move_pose"
    """A move to a pose."""
    MOVE_LINEAR = "move_linear"
    """A straight move of the tool."""


class Executor(OpenEnum):
    """Who makes the set-points of a motion."""

    AGENT = "agent"
    """The agent's control loop."""
    CONTROLLER = "controller"
    """The controller itself."""


class MotionProgress(Message, frozen=True, kw_only=True):
    """The motion in progress, as part of the state."""

    id: UUID
    """Which motion."""
    elapsed_s: float
    """Time along its own clock [s]."""
    duration_s: float
    """Length of its own clock [s]."""
    waypoint: int
    """Last waypoint passed; 0 for a jog."""
    rate: float
    """How fast its clock runs: 1 as planned, 0 at rest on the path."""
    paused: bool
    """Whether it is paused."""
    queued: int
    """How many motions wait behind it."""


class GroupQuality(Message, frozen=True, kw_only=True):
    """What a motion with partners was like, as measured."""

    max_divergence_ms: float
    """Largest difference of phase to a partner at the same time [ms]."""
    max_silence_ms: float
    """Longest silence of a partner [ms]."""


class MotionStatus(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Status of one motion of one robot."""

    id: UUID
    """Which motion."""
    robot: RobotName
    """Which robot."""
    boot_id: UUID
    """This run of the agent."""
    seqno: int
    """Sequence number of status messages of this motion."""
    stamp_ns: MonoTime
    """Time of this status, agent's monotonic clock [ns]."""
    kind: MotionKind
    """What makes the set-points."""
    # Made by a function, so that it is written also where it is the default.
    executor: Executor = msgspec.field(default_factory=lambda: Executor.AGENT)
    """Who makes the set-points."""
    status: ActionStatus
    """Where it stands."""
    reason: Denial | None = None
    """Why it failed or was cancelled."""
    client: str
    """Who asked for it."""
    epoch: int
    """Epoch it belongs to."""
    started_ns: MonoTime | None
    """When the first set-point was sent, agent's monotonic clock [ns]; None before."""
    elapsed_s: float
    """Time along its own clock [s]."""
    duration_s: float
    """Length of its own clock [s]."""
    waypoint: int
    """Last waypoint passed."""
    waypoint_count: int
    """Number of waypoints; 0 for a jog."""
    group: GroupQuality | None = None
    """How well it kept together with its partners, if it has any."""
