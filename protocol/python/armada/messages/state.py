"""Where a robot is and what it is told, at the state rate."""

from __future__ import annotations

from uuid import UUID

from ._base import JointVector, Message, MonoTime
from .mode import CommandMode, ControllerState, OperationalMode, RobotFlags
from .model import Pose, Twist
from .motion import MotionProgress


class TcpState(Message, frozen=True, kw_only=True):
    """Where the tool centre point and the flange of a chain are."""

    chain: str
    """Name of the chain."""
    pose: Pose
    """Pose of the tool centre point in the chain's base link."""
    twist: Twist | None
    """Its speed, in the axes of the chain's base link; None while joint speeds are not known."""
    flange_pose: Pose
    """Pose of the flange, which is the chain's tip link, in the chain's base link."""
    flange_twist: Twist | None
    """Its speed, in the axes of the chain's base link."""


class RobotState(Message, frozen=True, kw_only=True):
    """Measured and commanded state of a robot at one tick of its control loop.

    Arrays are numpy arrays in the joint order of `RobotInfo`, in rad for joints that turn and m
    for joints that slide; an array is empty where the controller does not give the value.
    """

    stamp_ns: MonoTime
    """Time of the tick, agent's monotonic clock [ns]."""
    utc_ns: int
    """Wall clock at the tick, for display only [ns since 1970 UTC]."""
    boot_id: UUID
    """This run of the agent."""
    seqno: int
    """Number of the tick in this run."""
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
    joint_position_rad: JointVector
    """Measured positions."""
    joint_velocity_rad_s: JointVector
    """Measured speeds [1/s]."""
    joint_effort_nm: JointVector
    """Measured torques [Nm] or forces [N]."""
    joint_position_command_rad: JointVector
    """Positions last sent to the controller."""
    joint_velocity_command_rad_s: JointVector
    """Speeds that go with them [1/s]."""
    tcp: tuple[TcpState, ...]
    """Where each chain's tool centre point and flange are, in the order of `RobotInfo`'s chains."""
    motion: MotionProgress | None
    """The motion in progress."""
    speed_ratio: float
    """Speed of all motions over what they were planned for, 0.01 to 1."""
    config_seqno: int
    """Revision of tools and payloads."""


class JointState(Message, frozen=True, kw_only=True):
    """Joint states in the shape of ROS `sensor_msgs/JointState`."""

    stamp_ns: MonoTime
    """Time of the tick, agent's monotonic clock [ns]."""
    boot_id: UUID
    """This run of the agent."""
    seqno: int
    """Number of the tick in this run."""
    name: tuple[str, ...]
    """Joint names."""
    position: JointVector
    """Positions [rad or m]."""
    velocity: JointVector
    """Speeds [rad/s or m/s]; empty if not available."""
    effort: JointVector
    """Torques [Nm] or forces [N]; empty if not available."""
