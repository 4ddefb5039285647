"""Jogs and homing: motion by hand, without a path."""

from __future__ import annotations

from uuid import UUID

import msgspec

from ._base import JointVector, Message, OpenEnum
from .model import Twist


class JogFrame(OpenEnum):
    """Axes in which a speed of a tool is given."""

    BASE = "base"
    """The base link of the chain."""
    TOOL = "tool"
    """The tool itself."""
    WORLD = "world"
    """The world, as the robot file's `mount` has it."""


class JogJointParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `jog_joint`: move joints at a speed, until a time after the newest request."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out. Repeat it to keep a jog going."""
    joint_velocity_rad_s: JointVector
    """Speed of every joint, in the robot's joint order [rad/s or m/s]."""
    timeout_s: float
    """Dead-man time: how long to move without another request [s], 0.02 to 10."""
    wait: bool = False
    """Whether to be answered when the motion has ended."""


class ChainTwist(Message, frozen=True, kw_only=True):
    """Speed of the tool of one chain."""

    chain: str
    """Name of the chain."""
    twist: Twist
    """Speed of the tool centre point, in the axes of `frame`."""
    frame: JogFrame = JogFrame.BASE
    """Whose axes."""


class JogCartesianParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `jog_cartesian`: move tools at a speed, until a time after the newest one."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out. Repeat it to keep a jog going."""
    chains: tuple[ChainTwist, ...]
    """Speeds of the tools of one or more chains."""
    timeout_s: float
    """Dead-man time: how long to move without another request [s], 0.02 to 10."""
    wait: bool = False
    """Whether to be answered when the motion has ended."""


class HomeMethod(OpenEnum):
    """How joints are homed."""

    CONTROLLER = "controller"
    """The controller searches the reference of its encoders."""
    MOVE_TO_HOME = "move_to_home"
    """The joints move to the home positions of the robot file; they know where they are."""


class HomeParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `home`, in mode `homing`."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out."""
    order: tuple[tuple[str, ...], ...] = ()
    """Groups of joints by name, one after the other; joints of a group at the same time. Empty:
    every joint at the same time."""
    # Made by a function, so that it is written also where it is the default.
    method: HomeMethod = msgspec.field(default_factory=lambda: HomeMethod.CONTROLLER)
    """How."""
    wait: bool = False
    """Whether to be answered when the motion has ended."""
