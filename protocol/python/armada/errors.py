"""Why something did not work."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from .messages import CellMotionStatus, Denial, DenialCode, MotionStatus

_SOURCE_PLACE = re.compile(r" at \S+\.rs:\d+\.?")
"""Where in Zenoh's source an error was made, which helps nobody here."""


class ArmadaError(Exception):
    """Base of everything that Armada raises, but for `ValueError` of wrong arguments."""


class DeniedError(ArmadaError):
    """The request was refused; nothing was done."""

    def __init__(self, denial: Denial, key: str = "") -> None:
        super().__init__(denial, key)
        self.denial = denial
        """The refusal as it came."""
        self.key = key
        """Key that was asked; empty if it is not known."""

    @property
    def code(self) -> DenialCode:
        """The reason, stable over versions."""
        return self.denial.code

    @property
    def message(self) -> str:
        """What was refused, why, and what to do next."""
        return self.denial.message

    @property
    def details(self) -> Mapping[str, Any]:
        """The same as data: field, joint, value, limit, holder."""
        return self.denial.details

    def __str__(self) -> str:
        return f"{self.key}: {self.denial}" if self.key else str(self.denial)


class NoReply(ArmadaError):  # noqa: N818, named as in Rust
    """Nobody answers at the key: no such robot, or its agent is not running."""

    def __init__(self, key: str) -> None:
        super().__init__(key)
        self.key = key
        """Key that was asked."""

    def __str__(self) -> str:
        return (
            f"nobody answers at {self.key}: is the name right, and does the agent or gateway run?"
        )


class RequestTimeout(ArmadaError, TimeoutError):  # noqa: N818, named as in Rust
    """Nothing came in time; whether a request was done is not known."""

    def __init__(self, key: str, timeout_s: float) -> None:
        super().__init__(key, timeout_s)
        self.key = key
        """Key that was asked or listened to."""
        self.timeout_s = timeout_s
        """How long was waited [s]."""

    def __str__(self) -> str:
        return f"nothing from {self.key} within {self.timeout_s * 1000:.0f} ms"


class CodecError(ArmadaError):
    """A payload is not the message it should be: versions differ."""


class NotConnected(ArmadaError, ConnectionError):  # noqa: N818, says what is, as NoReply does
    """Nobody listens at any of the endpoints, or the connection was closed."""

    def __init__(self, endpoints: Sequence[str], cause: str) -> None:
        super().__init__(tuple(endpoints), cause)
        self.endpoints = tuple(endpoints)
        """Endpoints that were dialled."""
        self.cause = _SOURCE_PLACE.sub("", cause)
        """Why, in Zenoh's words."""

    def __str__(self) -> str:
        return f"not connected to {', '.join(self.endpoints)}: {self.cause}"


class LeaseLost(ArmadaError):  # noqa: N818, named after the event
    """The lease is not held any more: somebody else may command, and nothing was asked."""

    def __init__(self, robot: str, reason: str) -> None:
        super().__init__(robot, reason)
        self.robot = robot
        """Whose lease it was."""
        self.reason = reason
        """How it was lost."""

    def __str__(self) -> str:
        return f"the lease of {self.robot} is lost: {self.reason}"


class StreamEnded(ArmadaError):  # noqa: N818, named after the event
    """The robot follows the stream no more: it was halted, stopped, or its mode was changed."""

    def __init__(self, key: str, reason: str) -> None:
        super().__init__(key, reason)
        self.key = key
        """Key of the stream."""
        self.reason = reason
        """What the newest state says."""

    def __str__(self) -> str:
        return f"the stream {self.key} has ended: {self.reason}"


class MotionFailed(ArmadaError):  # noqa: N818, named after the status
    """A motion that was waited for ended early."""

    def __init__(self, status: MotionStatus | CellMotionStatus) -> None:
        super().__init__(status)
        self.status = status
        """Its terminal status."""

    def __str__(self) -> str:
        why = f": {self.status.reason}" if self.status.reason else ""
        return f"motion {self.status.id} ended as {self.status.status}{why}"
