"""Signals and parameters of a controller."""

from __future__ import annotations

from typing import TypeAlias

from ._base import Message, OpenEnum

SignalValue: TypeAlias = bool | float | str | tuple[bool | float, ...]
"""Value of a signal or parameter: on or off, a number, a text, or several of the first two."""


class SignalType(OpenEnum):
    """Kind of a signal; those of Robot Raconteur's `com.robotraconteur.signal`."""

    DIGITAL = "digital"
    """On or off."""
    ANALOG = "analog"
    """A number."""
    DIGITAL_PORT = "digital_port"
    """Several digital signals together."""
    ANALOG_PORT = "analog_port"
    """Several numbers together."""
    VECTOR3 = "vector3"
    """Three numbers."""
    WRENCH = "wrench"
    """Force [N] and torque [Nm], six numbers."""


class AccessLevel(OpenEnum):
    """Who may write a signal or parameter."""

    READ_ONLY = "read_only"
    """It can only be read."""
    RESTRICTED = "restricted"
    """It can be written while the robot does not move."""
    ALL = "all"
    """It can be written at any time."""


class SignalInfo(
    Message, frozen=True, kw_only=True, omit_defaults=True, rename={"signal_type": "type"}
):
    """An input, an output or a group of them."""

    name: str
    """Name."""
    signal_type: SignalType
    """What kind of value; `type` on the wire."""
    access: AccessLevel
    """Who may write it."""
    unit: str = ""
    """Unit of its numbers, such as `V`; empty if they have none."""
    min: float | None = None
    """Lowest value; None for digital signals."""
    max: float | None = None
    """Highest value; None for digital signals."""
    size: int
    """How many values: 1, 3 for a vector, 6 for a wrench, the number of bits of a port."""
    while_stopped: bool = False
    """Whether it may be written while a stop is latched: a lamp, but nothing that moves."""
    description: str = ""
    """For people."""


class ParameterType(OpenEnum):
    """Kind of a parameter."""

    BOOL = "bool"
    """On or off."""
    NUMBER = "number"
    """A number."""
    INTEGER = "integer"
    """A whole number."""
    CHOICE = "choice"
    """One of `choices`."""


class ParameterInfo(
    Message, frozen=True, kw_only=True, omit_defaults=True, rename={"parameter_type": "type"}
):
    """A setting of a controller."""

    name: str
    """Name."""
    parameter_type: ParameterType
    """What kind of value; `type` on the wire."""
    access: AccessLevel
    """Who may write it."""
    unit: str = ""
    """Unit of its numbers; empty if they have none."""
    min: float | None = None
    """Lowest value."""
    max: float | None = None
    """Highest value."""
    choices: tuple[str, ...] = ()
    """The values there are, in the order of their numbers; empty if any text or number is one."""
    default: SignalValue
    """Value after the controller's start."""
    description: str = ""
    """For people."""


class NameParams(Message, frozen=True, kw_only=True):
    """Parameters of `get_signal` and `get_param`."""

    name: str
    """Name of the signal or parameter."""


class SetValueParams(Message, frozen=True, kw_only=True):
    """Parameters of `set_signal` and `set_param`."""

    name: str
    """Name of the signal or parameter."""
    value: SignalValue
    """Its new value."""


class NamedValue(Message, frozen=True, kw_only=True):
    """Answer of `get_signal`, `set_signal`, `get_param` and `set_param`.

    The value is as the controller has it.
    """

    name: str
    """Name of the signal or parameter."""
    value: SignalValue
    """Its value."""


class RecordingAnswer(Message, frozen=True, kw_only=True):
    """Answer of `save_recording`."""

    file: str
    """The file, on the agent's machine."""
    ticks: int
    """Ticks in it."""
