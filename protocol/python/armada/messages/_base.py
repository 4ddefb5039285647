"""What all messages have in common."""

from __future__ import annotations

from array import array
from enum import Enum
from typing import Annotated, Any, TypeAlias, get_origin

import msgspec
import numpy as np
from numpy.typing import ArrayLike

# Spelt out: numpy's own alias is of a kind that msgspec does not know, in some versions.
JointVector: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]
"""One number per joint, read-only and finite; empty where a controller does not give the value."""

RobotName: TypeAlias = Annotated[str, msgspec.Meta(pattern=r"^[a-z][a-z0-9_]{0,63}\Z")]
"""Name of a robot inside its cell: `[a-z][a-z0-9_]{0,63}`, one chunk of a key expression."""

MonoTime: TypeAlias = int
"""An instant of one machine's monotonic clock [ns]; comparable with others of that clock only."""


class Message(msgspec.Struct, frozen=True, kw_only=True, eq=False):
    """A message of the contract.

    Fields that are not known are passed over, so that newer agents can be talked to.
    """

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return bool(to_builtins(self) == to_builtins(other))

    # Arrays cannot be hashed.
    __hash__ = None  # type: ignore[assignment]


class OpenEnum(str, Enum):
    """An enum whose values are text; one that this version does not know is kept as it is.

    A value from a newer sender becomes a member outside the class's list, equal to its text.
    """

    @classmethod
    def _missing_(cls, value: object) -> OpenEnum | None:
        if not isinstance(value, str):
            return None
        member = str.__new__(cls, value)
        member._name_ = value.upper()
        member._value_ = value
        return member

    def __str__(self) -> str:
        return str(self.value)


def joint_vector(values: ArrayLike, field: str = "values") -> JointVector:
    """A read-only copy of `values`.

    Raises `ValueError` naming `field` if it is not one row of finite numbers.
    """
    vector = np.array(values, dtype=np.float64)
    if vector.ndim != 1:
        raise ValueError(f"{field} has shape {vector.shape}, expected one row of numbers")
    _require_finite(vector, field)
    vector.setflags(write=False)
    return vector


def decode_hook(expected: Any, value: Any) -> Any:
    """Makes what msgspec does not know of from what it has read."""
    if (get_origin(expected) or expected) is not np.ndarray:
        raise NotImplementedError(f"{expected} cannot be decoded")
    if not isinstance(value, list):
        raise TypeError(f"expected an array of numbers, got {type(value).__name__}")
    # array() takes numbers only, where numpy would take text as well.
    return joint_vector(array("d", value))


def encode_hook(value: Any) -> Any:
    """Makes what msgspec can write from what it does not know of."""
    if isinstance(value, np.ndarray):
        # msgspec writes NaN as null, which would be somebody else's surprise.
        _require_finite(value, "array")
        return value.tolist()
    raise NotImplementedError(f"{type(value)} cannot be encoded")


def to_builtins(message: Any) -> Any:
    """The message as dicts, lists, texts and numbers, as on the wire."""
    return msgspec.to_builtins(message, enc_hook=encode_hook)


def _require_finite(values: JointVector, field: str) -> None:
    if not np.isfinite(values).all():
        index = int(np.argmin(np.isfinite(values).ravel()))
        raise ValueError(f"{field}: value {index} is {values.flat[index]}, which is not finite")
