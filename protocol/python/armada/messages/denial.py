"""Why a request was refused."""

from __future__ import annotations

from typing import Any

import msgspec

from ._base import Message, OpenEnum


class DenialCode(OpenEnum):
    """Reason of a denial, stable over versions."""

    INVALID_ARGUMENT = "invalid_argument"
    """A field has a value that makes no sense."""
    OUT_OF_RANGE = "out_of_range"
    """A number lies outside its limits."""
    WRONG_MODE = "wrong_mode"
    """The command mode does not allow it."""
    NOT_READY = "not_ready"
    """The controller does not take commands now."""
    NOT_ENABLED = "not_enabled"
    """The drives are off."""
    FAULTED = "faulted"
    """A fault is latched."""
    STOPPED = "stopped"
    """A stop is latched."""
    LEASE_REQUIRED = "lease_required"
    """Somebody else holds the lease, or nobody does and one is needed."""
    LEASE_STALE = "lease_stale"
    """The lease or epoch is of the past."""
    STALE_SEQUENCE = "stale_sequence"
    """The sequence number is of the past."""
    STALE_MODEL = "stale_model"
    """The request was made for another revision of the model."""
    NOT_SUPPORTED = "not_supported"
    """This robot or this version cannot do it."""
    NOT_ATTACHED = "not_attached"
    """There is no tool or payload to detach, or no such motion."""
    ALREADY_ATTACHED = "already_attached"
    """There is a tool or payload already."""
    UNREACHABLE = "unreachable"
    """No joint position reaches the pose, or no such robot answers."""
    COLLISION = "collision"
    """Bodies would touch."""
    TOLERANCE = "tolerance"
    """The robot is too far from where the motion begins, or left its path."""
    BUSY = "busy"
    """Another motion or request is in progress."""
    TIMEOUT = "timeout"
    """No answer in time."""
    DRIVER_ERROR = "driver_error"
    """The driver refused or failed."""
    COMMUNICATION_LOST = "communication_lost"
    """The controller or agent does not answer."""
    TOO_LARGE = "too_large"
    """The message is larger than allowed."""
    BAD_ENCODING = "bad_encoding"
    """The payload is not in an encoding that is understood."""
    UNKNOWN_METHOD = "unknown_method"
    """There is no such method."""
    INTERNAL = "internal"
    """A defect of Armada."""


class Denial(Message, frozen=True, kw_only=True, omit_defaults=True):
    """A refused request: what a person needs to put it right."""

    code: DenialCode
    """The reason."""
    message: str
    """What was refused, why, and what to do next."""
    details: dict[str, Any] = msgspec.field(default_factory=dict)
    """The same as data: field, joint, value, limit, holder."""

    def __str__(self) -> str:
        return f"{self.code}: {self.message}"
