"""An agent's clock, for measuring the offset to it."""

from __future__ import annotations

from uuid import UUID

from ._base import Message, MonoTime


class ClockSample(Message, frozen=True, kw_only=True):
    """Answer to a query of an agent's clock, made as late as possible.

    With the asker's times before and after, offset = `stamp_ns` - (before + after) / 2, wrong by
    at most half the round trip.
    """

    boot_id: UUID
    """Boot of the agent; offsets to different boots have nothing in common."""
    stamp_ns: MonoTime
    """The agent's monotonic clock [ns]."""
    utc_ns: int
    """The agent's wall clock, for display only [ns since 1970 UTC]."""
