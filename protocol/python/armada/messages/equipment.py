"""Tools and payloads: what a flange carries."""

from __future__ import annotations

from typing import TypeAlias
from uuid import UUID

import msgspec

from ._base import Message, OpenEnum
from .model import Pose

Triple: TypeAlias = tuple[float, float, float]
Sextuple: TypeAlias = tuple[float, float, float, float, float, float]


class Inertia(Message, frozen=True, kw_only=True):
    """Mass and inertia of a body."""

    mass_kg: float = 0.0
    """Mass [kg], not negative."""
    com_m: Triple = (0.0, 0.0, 0.0)
    """Centre of mass in the body's frame [m]."""
    inertia_kg_m2: Sextuple = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """Inertia about the centre of mass, xx xy xz yy yz zz [kg m^2]; zero if not known."""


class ToolType(OpenEnum):
    """Kind of a tool; those of Robot Raconteur's `com.robotraconteur.robotics.tool`."""

    UNKNOWN = "unknown"
    """Not known."""
    BASIC_GRIPPER = "basic_gripper"
    """A gripper that is open or closed."""
    BASIC_CONTINUOUS_GRIPPER = "basic_continuous_gripper"
    """A gripper of any width."""
    PNEUMATIC_GRIPPER = "pneumatic_gripper"
    """Driven by air."""
    ELECTRIC_GRIPPER = "electric_gripper"
    """Driven by a motor."""
    VACUUM_GRIPPER = "vacuum_gripper"
    """Holds by vacuum."""
    SOFT_GRIPPER = "soft_gripper"
    """Holds by soft fingers."""
    WELDER = "welder"
    """A welding torch."""
    HAND = "hand"
    """A hand with fingers."""
    PALLETIZER = "palletizer"
    """A palletizer."""
    OTHER = "other"
    """Something else."""


class ToolInfo(Message, frozen=True, kw_only=True, omit_defaults=True):
    """A tool."""

    name: str
    """Name, 1 to 64 characters."""
    uuid: UUID | None = None
    """Identity of this piece of equipment."""
    # Those made by a function are written also where they are the default.
    tool_type: ToolType = msgspec.field(default_factory=lambda: ToolType.UNKNOWN)
    """What kind of tool."""
    tcp: Pose
    """Tool centre point in the flange."""
    inertia: Inertia = msgspec.field(default_factory=Inertia)
    """Mass and inertia, in the flange's frame."""
    description: str = ""
    """For people."""


class PayloadInfo(Message, frozen=True, kw_only=True, omit_defaults=True):
    """A payload, held by a tool."""

    name: str
    """Name, 1 to 64 characters."""
    uuid: UUID | None = None
    """Identity of this piece."""
    inertia: Inertia = msgspec.field(default_factory=Inertia)
    """Mass and inertia, in the payload's own frame."""
    description: str = ""
    """For people."""


class AttachedPayload(Message, frozen=True, kw_only=True):
    """A payload where it is held."""

    payload: PayloadInfo
    """The payload."""
    pose: Pose
    """Its pose in the tool centre point."""


class ChainEquipment(Message, frozen=True, kw_only=True):
    """What one chain carries."""

    chain: str
    """Name of the chain."""
    tool: ToolInfo | None
    """The tool, if there is one."""
    payload: AttachedPayload | None
    """The payload, if there is one."""


class AttachToolParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `attach_tool`: exactly one of `tool` and `name`."""

    chain: str | None = None
    """Name of the chain; may be left out if there is one only."""
    tool: ToolInfo | None = None
    """The tool."""
    name: str | None = None
    """Name of a tool of the robot file."""


class DetachParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `detach_tool` and `detach_payload`."""

    chain: str | None = None
    """Name of the chain; may be left out if there is one only."""
    name: str | None = None
    """Name of what is to be detached; whatever is there if left out."""


class AttachPayloadParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `attach_payload`."""

    chain: str | None = None
    """Name of the chain; may be left out if there is one only."""
    payload: PayloadInfo
    """The payload."""
    pose: Pose = msgspec.field(default_factory=Pose)
    """Its pose in the tool centre point."""


class EquipmentAnswer(Message, frozen=True, kw_only=True):
    """Answer of attaching and detaching."""

    equipment: ChainEquipment
    """What the chain carries now."""
    config_seqno: int
    """Revision of tools and payloads, as `config_seqno` in the state."""
    model_rev: int
    """Revision of the robot's description."""
