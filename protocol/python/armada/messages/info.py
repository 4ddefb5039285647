"""What a robot is."""

from __future__ import annotations

from uuid import UUID

from ._base import Message, OpenEnum, RobotName
from .model import JointLimits, JointType


class JointInfo(Message, frozen=True, kw_only=True, rename={"joint_type": "type"}):
    """One joint of a robot."""

    name: str
    """Name as in the URDF."""
    joint_type: JointType
    """How it moves, which gives the unit of its numbers; `type` on the wire."""
    limits: JointLimits
    """What it may do, after the robot file has narrowed the URDF's limits."""


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
    """Moves of joints to a position."""
    TRAJECTORY_COMMAND = "trajectory_command"
    """Timed trajectories."""
    SOFTWARE_RESET_ERRORS = "software_reset_errors"
    """Errors can be reset by software."""
    SOFTWARE_ENABLE = "software_enable"
    """Drives can be switched by software."""
    INTERPOLATED_TRAJECTORY = "interpolated_trajectory"
    """Trajectories are interpolated between waypoints."""


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
    capabilities: tuple[Capability, ...]
    """What the robot can do."""
    methods: tuple[str, ...]
    """Methods under `rpc/` that this agent answers."""
    flags: tuple[tuple[str, int], ...]
    """Names of the bits of `flags`, with their values."""
    period_ms: float
    """Period of the control loop [ms]."""
    state_rate_hz: float
    """How often the state is published [Hz]."""
    urdf: str
    """The robot description as URDF text."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of every array of this robot."""
        return tuple(joint.name for joint in self.joints)
