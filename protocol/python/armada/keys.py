"""The table of keys, as in `protocol/src/keys.rs`; a test compares the two."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from .qos import Channel

_ROBOT_NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")


@dataclass(frozen=True)
class Key:
    """One row of the table."""

    name: str
    """Name of the row."""
    pattern: str
    """Key expression; `{...}` stands for one chunk."""
    kinds: tuple[str, ...]
    """How it is used: liveliness, published, cached, queryable, subscribed."""
    owner: str
    """Who sends or answers: agent, gateway, client."""
    message: str
    """Message type; `-` for none."""
    channel: Channel
    """Its urgency."""

    def with_(self, *parts: str) -> str:
        """The key with its placeholders filled in order; those not given become `*`."""
        left = iter(parts)
        chunks = self.pattern.split("/")
        return "/".join(next(left, "*") if chunk.startswith("{") else chunk for chunk in chunks)

    def any(self) -> str:
        """The key with every placeholder open."""
        return self.with_()

    def of(self, robot: str) -> str:
        """The key of this robot."""
        return self.with_(robot)


def robot_of(key: str) -> str | None:
    """The robot that a key `robots/{robot}/...` belongs to; None for other keys."""
    chunks = key.split("/")
    if len(chunks) < 2 or chunks[0] != "robots" or not _ROBOT_NAME.fullmatch(chunks[1]):
        return None
    return chunks[1]


def is_robot_name(name: str) -> bool:
    """Whether it has the form of a robot's name, which is one chunk of a key."""
    return _ROBOT_NAME.fullmatch(name) is not None


def check_robot_name(name: str) -> str:
    """The name itself; raises `ValueError` if it is not the name of a robot."""
    if not is_robot_name(name):
        raise ValueError(
            f"{name[:80]!r} is not a robot name: 1 to 64 of a-z, 0-9 and _, beginning with a letter"
        )
    return name


ROBOT_ALIVE: Final = Key(
    "ROBOT_ALIVE", "robots/{robot}/alive", ("liveliness",), "agent", "-", Channel.REPORT
)
"""Presence of the agent; no stop depends on it."""
ROBOT_INFO: Final = Key(
    "ROBOT_INFO",
    "robots/{robot}/info",
    ("cached", "queryable"),
    "agent",
    "RobotInfo",
    Channel.REPORT,
)
"""Identity, joints, limits, chains, capabilities, methods, URDF text."""
ROBOT_STATE: Final = Key(
    "ROBOT_STATE", "robots/{robot}/state", ("published",), "agent", "RobotState", Channel.STATE
)
"""Measured and commanded state, at the robot's state rate."""
ROBOT_STATE_AT: Final = Key(
    "ROBOT_STATE_AT",
    "robots/{robot}/state/{rate_hz}",
    ("published",),
    "agent",
    "RobotState",
    Channel.STATE,
)
"""The state at a lower rate, for the rates of `RobotInfo.state_classes_hz`."""
ROBOT_STATUS: Final = Key(
    "ROBOT_STATUS",
    "robots/{robot}/status",
    ("cached", "queryable"),
    "agent",
    "RobotStatus",
    Channel.REPORT,
)
"""Mode, latched stop, faults, motion, loop timing, what may be done next; on change and at 1 Hz."""
ROBOT_JOINT_STATES: Final = Key(
    "ROBOT_JOINT_STATES",
    "robots/{robot}/joint_states",
    ("published",),
    "agent",
    "JointState",
    Channel.STATE,
)
"""The state in the shape of ROS; published with the state."""
ROBOT_EVENTS: Final = Key(
    "ROBOT_EVENTS", "robots/{robot}/events", ("cached",), "agent", "Event", Channel.REPORT
)
"""The audit trail, numbered without gaps."""
ROBOT_MOTION: Final = Key(
    "ROBOT_MOTION",
    "robots/{robot}/motions/{id}",
    ("published", "queryable"),
    "agent",
    "MotionStatus",
    Channel.PROGRESS,
)
"""Status of a motion: on change and at 10 Hz while running; queryable after its end."""
ROBOT_STREAM_POSITION: Final = Key(
    "ROBOT_STREAM_POSITION",
    "robots/{robot}/stream/position",
    ("subscribed",),
    "agent",
    "StreamCommand",
    Channel.STREAM,
)
"""Streamed joint positions, in mode `position_command`."""
ROBOT_STREAM_VELOCITY: Final = Key(
    "ROBOT_STREAM_VELOCITY",
    "robots/{robot}/stream/velocity",
    ("subscribed",),
    "agent",
    "StreamCommand",
    Channel.STREAM,
)
"""Streamed joint velocities, in mode `velocity_command`."""
ROBOT_STREAM_TWIST: Final = Key(
    "ROBOT_STREAM_TWIST",
    "robots/{robot}/stream/twist",
    ("subscribed",),
    "agent",
    "StreamTwist",
    Channel.STREAM,
)
"""Streamed velocities of a tool, in mode `velocity_command`."""
ROBOT_COMMAND: Final = Key(
    "ROBOT_COMMAND",
    "robots/{robot}/command",
    ("subscribed",),
    "agent",
    "JointCommand",
    Channel.STREAM,
)
"""Streamed commands to any joints by name, in mode `position_command` or `velocity_command`."""
ROBOT_RPC: Final = Key(
    "ROBOT_RPC", "robots/{robot}/rpc/{method}", ("queryable",), "agent", "per method", Channel.RPC
)
"""Requests to the agent, one query and one answer."""
ROBOT_STOP: Final = Key(
    "ROBOT_STOP",
    "robots/{robot}/stop",
    ("queryable", "subscribed"),
    "agent",
    "StopRequest -> StopAck",
    Channel.STOP,
)
"""Stops this robot; needs no lease and is never refused."""
ROBOT_STOP_ACK: Final = Key(
    "ROBOT_STOP_ACK", "robots/{robot}/stop/ack", ("published",), "agent", "StopAck", Channel.STOP
)
"""Stages of a stop: received, commanded, standstill, drives off."""
ROBOT_CLOCK: Final = Key(
    "ROBOT_CLOCK", "robots/{robot}/clock", ("queryable",), "agent", "ClockSample", Channel.RPC
)
"""The agent's clock, for measuring the offset to it."""
CELL_STOP: Final = Key(
    "CELL_STOP", "cell/stop", ("published",), "client", "StopRequest", Channel.STOP
)
"""Stops every robot; published by any client, taken by every agent and the gateway."""
CELL_STOP_SOURCE: Final = Key(
    "CELL_STOP_SOURCE",
    "cell/stop_sources/{source}",
    ("queryable",),
    "client",
    "StopChallenge -> StopCheckIn",
    Channel.STOP,
)
"""Whether a source of stops is pressed: agents ask it again and again, silence is a press."""
CELL_GATEWAY_ALIVE: Final = Key(
    "CELL_GATEWAY_ALIVE", "cell/gateway/alive", ("liveliness",), "gateway", "-", Channel.REPORT
)
"""Presence of the gateway."""
CELL_INFO: Final = Key(
    "CELL_INFO", "cell/info", ("cached", "queryable"), "gateway", "CellInfo", Channel.REPORT
)
"""The robots of the cell and where they stand."""
CELL_STATUS: Final = Key(
    "CELL_STATUS", "cell/status", ("cached", "queryable"), "gateway", "CellStatus", Channel.REPORT
)
"""Condition of every robot and the cell's verdict; on change and at 1 Hz."""
CELL_FRAMES: Final = Key(
    "CELL_FRAMES", "cell/frames", ("published",), "gateway", "CellFrames", Channel.STATE
)
"""World poses of the links that moved, at 30 Hz."""
CELL_EVENTS: Final = Key(
    "CELL_EVENTS", "cell/events", ("cached",), "gateway", "Event", Channel.REPORT
)
"""Every robot's events and the gateway's own in one stream, numbered without gaps."""
CELL_MOTION: Final = Key(
    "CELL_MOTION",
    "cell/motions/{id}",
    ("published", "queryable"),
    "gateway",
    "CellMotionStatus",
    Channel.PROGRESS,
)
"""Status of a motion of several robots."""
GROUP_GO: Final = Key(
    "GROUP_GO",
    "cell/groups/{group}/go/{robot}",
    ("published", "subscribed"),
    "agent",
    "GroupGo",
    Channel.STOP,
)
"""A robot is ready to start with its partners."""
GROUP_HEARTBEAT: Final = Key(
    "GROUP_HEARTBEAT",
    "cell/groups/{group}/heartbeat/{robot}",
    ("published", "subscribed"),
    "agent",
    "GroupHeartbeat",
    Channel.STREAM,
)
"""Where a robot is on the common path, every 20 ms, for its partners."""
GROUP_ABORT: Final = Key(
    "GROUP_ABORT",
    "cell/groups/{group}/abort/{robot}",
    ("published", "subscribed"),
    "agent",
    "GroupAbort",
    Channel.STOP,
)
"""A robot stops, and its partners are to do the same."""
CELL_RPC: Final = Key(
    "CELL_RPC", "cell/rpc/{method}", ("queryable",), "gateway", "per method", Channel.RPC
)
"""Requests to the gateway, one query and one answer."""

ALL: Final = (
    ROBOT_ALIVE,
    ROBOT_INFO,
    ROBOT_STATE,
    ROBOT_STATE_AT,
    ROBOT_STATUS,
    ROBOT_JOINT_STATES,
    ROBOT_EVENTS,
    ROBOT_MOTION,
    ROBOT_STREAM_POSITION,
    ROBOT_STREAM_VELOCITY,
    ROBOT_STREAM_TWIST,
    ROBOT_COMMAND,
    ROBOT_RPC,
    ROBOT_STOP,
    ROBOT_STOP_ACK,
    ROBOT_CLOCK,
    CELL_STOP,
    CELL_STOP_SOURCE,
    CELL_GATEWAY_ALIVE,
    CELL_INFO,
    CELL_STATUS,
    CELL_FRAMES,
    CELL_EVENTS,
    CELL_MOTION,
    GROUP_GO,
    GROUP_HEARTBEAT,
    GROUP_ABORT,
    CELL_RPC,
)
"""Every row, in the order of the documentation."""
