"""What a robot is."""

from __future__ import annotations

from uuid import UUID

from ._base import Message, OpenEnum, RobotName
from .equipment import ChainEquipment, ToolInfo
from .model import JointLimits, JointType
from .signal import ParameterInfo, SignalInfo


class ReducedLimits(Message, frozen=True, kw_only=True):
    """Limits of a joint at reduced speed."""

    velocity: float
    """Highest speed [rad/s or m/s], at most the joint's limit."""
    acceleration: float
    """Highest acceleration and deceleration [rad/s^2 or m/s^2], at most the joint's limit."""


class JointInfo(
    Message, frozen=True, kw_only=True, omit_defaults=True, rename={"joint_type": "type"}
):
    """One joint of a robot."""

    name: str
    """Name as in the URDF."""
    joint_type: JointType
    """How it moves, which gives the unit of its numbers; `type` on the wire."""
    limits: JointLimits
    """What it may do, after the robot file has narrowed the URDF's limits."""
    reduced: ReducedLimits
    """What it may do in mode `manual_reduced_speed`, and while the operational mode is not
    known."""
    home: float | None = None
    """Home position [rad or m]; None if the robot file gives none."""


class ChainInfo(Message, frozen=True, kw_only=True):
    """A chain of links from a base to a tip."""

    name: str
    """Name of the chain, such as `arm`."""
    base_link: str
    """Link the tip's pose is given in."""
    tip_link: str
    """Link at the end: the flange or tool centre point."""


class Capability(OpenEnum):
    """Something a robot can do."""

    JOG_COMMAND = "jog_command"
    """Jogs: moves by hand."""
    TRAJECTORY_COMMAND = "trajectory_command"
    """Timed trajectories."""
    POSITION_COMMAND = "position_command"
    """Streamed joint positions."""
    VELOCITY_COMMAND = "velocity_command"
    """Streamed joint velocities and twists."""
    HOMING_COMMAND = "homing_command"
    """Homing by the controller."""
    SOFTWARE_RESET_ERRORS = "software_reset_errors"
    """Errors can be reset by software."""
    SOFTWARE_ENABLE = "software_enable"
    """Drives can be switched by software."""
    INTERPOLATED_TRAJECTORY = "interpolated_trajectory"
    """Trajectories are interpolated between waypoints."""
    TRAJECTORY_QUEUEING = "trajectory_queueing"
    """Trajectories can wait for the end of others."""
    SPEED_RATIO = "speed_ratio"
    """The speed of motions can be changed while they run."""
    DELEGATED_MOVE_JOINT = "delegated_move_joint"
    """The controller makes moves of its own to joint positions."""
    DELEGATED_MOVE_POSE = "delegated_move_pose"
    """The controller makes moves of its own to poses."""
    DELEGATED_MOVE_LINEAR = "delegated_move_linear"
    """The controller makes straight moves of its own."""
    LOAD_SETTING = "load_setting"
    """The controller takes the load of tool and payload."""


class RobotInfo(Message, frozen=True, kw_only=True):
    """Identity, joints and abilities of a robot; changes only when `model_rev` does."""

    robot: RobotName
    """Name in the cell."""
    uuid: UUID
    """Identity that stays the same over restarts, from the robot file."""
    boot_id: UUID
    """This run of the agent."""
    seqno: int
    """Sequence number of this message in this run."""
    vendor: str
    """Which driver speaks to the controller, such as `sim`."""
    model: str
    """Model name of the maker."""
    serial: str
    """Serial number; empty if not known."""
    software_version: str
    """Version of the agent's program."""
    model_rev: int
    """Revision of this description; raised by each change."""
    joints: tuple[JointInfo, ...]
    """The joints in the order of every array of this robot."""
    chains: tuple[ChainInfo, ...]
    """Kinematic chains whose tip poses are in the state."""
    equipment: tuple[ChainEquipment, ...]
    """What each chain carries, in the order of `chains`."""
    tools: tuple[ToolInfo, ...]
    """Tools of the robot file, which can be attached by name."""
    signals: tuple[SignalInfo, ...]
    """Inputs and outputs of the controller."""
    parameters: tuple[ParameterInfo, ...]
    """Settings of the controller."""
    capabilities: tuple[Capability, ...]
    """What the robot can do."""
    methods: tuple[str, ...]
    """Methods under `rpc/` that this agent answers."""
    flags: tuple[tuple[str, int], ...]
    """Names of the bits of `flags`, with their values."""
    period_ms: float
    """Period of the control loop [ms]."""
    stop_time_s: float = 0.0
    """Within what time of a stop the robot is measured to stand still [s]; else it is stopped
    harder, by itself and by whoever asked."""
    lease_required: bool = False
    """Whether it is moved under a lease only; else anybody may while nobody holds one."""
    state_rate_hz: float
    """How often the state is published [Hz]."""
    state_classes_hz: tuple[int, ...]
    """Rates at which the state is published besides, as `state/{rate}` [Hz]."""
    urdf: str
    """The robot description as URDF text."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of every array of this robot."""
        return tuple(joint.name for joint in self.joints)
