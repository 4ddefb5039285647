"""Single moves to a goal, speed, pause: motion that the robot's side plans."""

from __future__ import annotations

from uuid import UUID

import msgspec

from ._base import JointVector, Message, OpenEnum
from .model import Pose
from .request import LeaseLoss, Queue


class MotionParams(Message, frozen=True, kw_only=True):
    """Parameters of `pause` and `resume`."""

    motion_id: UUID
    """Which motion."""


class SpeedRatioParams(Message, frozen=True, kw_only=True):
    """Parameters of `set_speed_ratio`."""

    ratio: float
    """Speed of all motions over what they were planned for, 0.01 to 1."""


class SpeedRatioAnswer(Message, frozen=True, kw_only=True):
    """Answer of `set_speed_ratio`."""

    speed_ratio: float
    """The ratio now in force."""


class MoveExecutor(OpenEnum):
    """Who plans and executes a move."""

    AUTO = "auto"
    """The controller if it can, else the agent."""
    CONTROLLER = "controller"
    """The controller; refused if it cannot."""
    AGENT = "agent"
    """The agent's control loop."""


class MoveOptions(Message, frozen=True, kw_only=True, omit_defaults=True):
    """How a single move is made; all fields may be left out."""

    # Those made by a function are written also where they are the default.
    speed: float = msgspec.field(default_factory=lambda: 1.0)
    """Speed over the limits, above 0 to 1."""
    blend_radius_m: float = msgspec.field(default_factory=lambda: 0.0)
    """How far from the goal the tool may leave the path for the next move [m], 0 to 1; needs
    `connect`."""
    connect: bool = msgspec.field(default_factory=lambda: False)
    """Whether another move follows, to be planned together with this one: nothing moves before
    the first move that does not connect."""
    executor: MoveExecutor = msgspec.field(default_factory=lambda: MoveExecutor.AUTO)
    """Who plans and executes."""
    queue: Queue = Queue.REFUSE
    """What to do if a motion is in progress: `refuse` or `append`."""
    on_lease_loss: LeaseLoss = "stop_on_path"
    """What to do if the lease is lost on the way."""
    wait: bool = False
    """Whether to be answered when the motion has ended."""


class MoveJointParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `move_joint`, in mode `trajectory`."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out."""
    joint_position_rad: JointVector
    """Goal of every joint, in the robot's joint order [rad or m]."""
    options: MoveOptions = msgspec.field(default_factory=MoveOptions)
    """How."""


class MovePoseParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `move_pose` and `move_linear`, in mode `trajectory`."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out."""
    chain: str | None = None
    """Name of the chain; may be left out if there is one only."""
    pose: Pose
    """Goal of the tool centre point, in the chain's base link."""
    options: MoveOptions = msgspec.field(default_factory=MoveOptions)
    """How."""


class MoveHomeParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `move_home`, in mode `trajectory`: to the home positions of the robot file."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out."""
    options: MoveOptions = msgspec.field(default_factory=MoveOptions)
    """How."""


class ForwardKinematicsParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `forward_kinematics`."""

    chain: str | None = None
    """Name of the chain; may be left out if there is one only."""
    joint_position_rad: JointVector | None = None
    """Position of every joint [rad or m]; the measured ones if left out."""


class ForwardKinematicsAnswer(Message, frozen=True, kw_only=True):
    """Answer of `forward_kinematics`, poses in the chain's base link."""

    chain: str
    """Name of the chain."""
    tcp: Pose
    """Tool centre point."""
    flange: Pose
    """Flange."""


class InverseKinematicsParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `inverse_kinematics`."""

    chain: str | None = None
    """Name of the chain; may be left out if there is one only."""
    pose: Pose
    """Wanted pose of the tool centre point, in the chain's base link."""
    seed_rad: JointVector | None = None
    """Where to begin: the solution is one near it [rad or m]; the measured position if left out."""


class InverseKinematicsAnswer(Message, frozen=True, kw_only=True):
    """Answer of `inverse_kinematics`."""

    chain: str
    """Name of the chain."""
    joint_position_rad: JointVector
    """Position of every joint; those outside the chain as in the seed [rad or m]."""
