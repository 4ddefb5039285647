"""Streams of commands: samples at a rate, newest counts."""

from __future__ import annotations

from uuid import UUID

from ._base import JointVector, Message
from .jog import JogFrame
from .model import Twist


class StreamHeader(Message, frozen=True, kw_only=True):
    """What every sample of a stream says besides its values.

    A sample is dropped and counted if its lease or epoch is not in force, if one with this or a
    later number came before, or if the state it was made for is too old.
    """

    lease: UUID
    """The lease."""
    epoch: int
    """Epoch of the stream."""
    seq: int
    """Number of the sample, rising within an epoch and lease."""
    state_seqno: int
    """`seqno` of the newest state the sender had seen: tells how old the sample is."""


class StreamCommand(StreamHeader, frozen=True, kw_only=True, omit_defaults=True):
    """One sample of `stream/position` or `stream/velocity`."""

    values: JointVector
    """Position [rad or m] or speed [rad/s or m/s] of every joint, in the robot's joint order."""
    velocity: JointVector | None = None
    """With positions: the speed of every joint at them [rad/s or m/s]; found from the samples if
    left out. Not allowed with speeds."""


class StreamTwist(StreamHeader, frozen=True, kw_only=True):
    """One sample of `stream/twist`, in mode `velocity_command`."""

    chain: str
    """Name of the chain."""
    twist: Twist
    """Speed of the tool centre point, in the axes of `frame`."""
    frame: JogFrame = JogFrame.BASE
    """Whose axes."""


class JointCommand(StreamHeader, frozen=True, kw_only=True, omit_defaults=True):
    """One sample of `command`: the form of an actuator array, any subset of the joints.

    In mode `position_command` positions count, in mode `velocity_command` velocities; joints that
    are not named stay where they are. Names that the robot does not have are counted and ignored,
    as a command may be meant for several robots.
    """

    name: tuple[str, ...]
    """Names of joints."""
    position: tuple[float, ...] = ()
    """Their positions [rad or m]; empty if not commanded."""
    velocity: tuple[float, ...] = ()
    """Their speeds [rad/s or m/s]; empty if not commanded."""
