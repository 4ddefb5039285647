"""The audit trail."""

from __future__ import annotations

from typing import Any
from uuid import UUID

import msgspec

from ._base import Message, MonoTime, OpenEnum, RobotName


class Severity(OpenEnum):
    """How grave an event is."""

    INFO = "info"
    """Ordinary course of things."""
    WARNING = "warning"
    """Something is degraded."""
    ERROR = "error"
    """Somebody must act."""


class EventKind(OpenEnum):
    """Kind of an event."""

    STARTED = "started"
    """A program came up."""
    ENDING = "ending"
    """A program is about to end."""
    MODE_CHANGED = "mode_changed"
    """The command mode changed."""
    FAULT_LATCHED = "fault_latched"
    """A fault was latched."""
    FAULTS_CLEARED = "faults_cleared"
    """Faults were cleared."""
    MOTION_ACCEPTED = "motion_accepted"
    """A motion was accepted."""
    MOTION_ENDED = "motion_ended"
    """A motion reached its terminal status."""
    STOP = "stop"
    """A stop came in or reached another stage."""
    RESET = "reset"
    """A latched stop was reset."""
    LEASE = "lease"
    """A lease was granted, taken, delegated, released or ran out."""
    GROUP = "group"
    """A motion of several robots: ready, aborted, a partner lost."""
    STOP_SOURCE = "stop_source"
    """A source of stops was heard, pressed, released or lost."""
    EQUIPMENT_CHANGED = "equipment_changed"
    """A tool or payload was attached or detached."""
    VALUE_SET = "value_set"
    """A signal or parameter was set."""
    OPERATIONAL_MODE_CHANGED = "operational_mode_changed"
    """The operational mode changed: somebody turned the key switch."""
    STREAM = "stream"
    """A stream of commands began, starved or ended."""
    PRESENCE_CHANGED = "presence_changed"
    """A robot appeared in or vanished from the cell."""
    EVENTS_LOST = "events_lost"
    """Events of a robot that the gateway did not get."""
    DENIED = "denied"
    """A request was refused, or commands that nobody can be answered were dropped."""
    MODEL_REJECTED = "model_rejected"
    """A robot's description cannot be used; the robot is left out of the world."""


class Event(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Something that happened; numbered without gaps within a run of its sender."""

    robot: RobotName | None
    """Which robot; None if the gateway speaks of itself."""
    boot_id: UUID
    """Run of the sender."""
    seqno: int
    """Number of the event: the next one has the next number."""
    stamp_ns: MonoTime
    """When, sender's monotonic clock [ns]."""
    utc_ns: int
    """When by the wall clock, for display only [ns since 1970 UTC]."""
    severity: Severity
    """How grave."""
    kind: EventKind
    """What kind."""
    message: str
    """What happened, for people."""
    details: dict[str, Any] = msgspec.field(default_factory=dict)
    """The same as data."""
