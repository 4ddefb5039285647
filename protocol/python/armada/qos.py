"""How urgent each kind of message is: the Zenoh settings of each channel, in one place."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import zenoh


@dataclass(frozen=True)
class Qos:
    """Zenoh settings of a channel."""

    priority: zenoh.Priority
    """Priority on the link."""
    congestion_control: zenoh.CongestionControl
    """What happens when the link is full: only requests wait."""
    express: bool
    """Whether a message is sent at once instead of in a batch."""


class Channel(Enum):
    """A kind of message with its own urgency."""

    STOP = "stop"
    """Stops and their acknowledgements; nothing else has this priority."""
    RPC = "rpc"
    """Requests and answers."""
    STREAM = "stream"
    """Streamed commands: newest counts."""
    STATE = "state"
    """Latest values at a rate: state, joint states, frames."""
    REPORT = "report"
    """Things that must arrive: status, info, events."""
    PROGRESS = "progress"
    """Progress of motions."""

    @property
    def qos(self) -> Qos:
        """Its Zenoh settings."""
        return _QOS[self]


_QOS = {
    Channel.STOP: Qos(zenoh.Priority.REAL_TIME, zenoh.CongestionControl.DROP, True),
    Channel.RPC: Qos(zenoh.Priority.INTERACTIVE_HIGH, zenoh.CongestionControl.BLOCK, True),
    Channel.STREAM: Qos(zenoh.Priority.INTERACTIVE_HIGH, zenoh.CongestionControl.DROP, True),
    Channel.STATE: Qos(zenoh.Priority.INTERACTIVE_LOW, zenoh.CongestionControl.DROP, False),
    Channel.REPORT: Qos(zenoh.Priority.DATA_HIGH, zenoh.CongestionControl.DROP, False),
    Channel.PROGRESS: Qos(zenoh.Priority.DATA_LOW, zenoh.CongestionControl.DROP, False),
}
