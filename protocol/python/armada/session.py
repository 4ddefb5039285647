"""A Zenoh session, set up for a client; the settings are those of `protocol/src/session.rs`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import zenoh

DEFAULT_GATEWAY_ENDPOINT = "tcp/127.0.0.1:7447"
"""Where the gateway listens unless told otherwise."""

_LINK_LEASE_MS = 1000
_MAX_WIRE_MESSAGE = 8 * 1024 * 1024


def client_config(
    connect: Sequence[str], namespace: str | None = None, timeout_s: float = 2.0
) -> zenoh.Config:
    """The Zenoh configuration of a client: one link, to the first of `connect` that answers.

    Opening fails if none does; a link that is lost is made again. A router relays everything to a
    client, but nothing from one peer to another.
    """
    return _config("client", connect, (), namespace, round(timeout_s * 1000))


def peer_config(
    connect: Sequence[str], namespace: str | None = None, listen: Sequence[str] = ()
) -> zenoh.Config:
    """The Zenoh configuration of a peer: links to all of `connect`, whenever they answer."""
    return _config("peer", connect, listen, namespace, -1)


def _config(
    mode: str,
    connect: Sequence[str],
    listen: Sequence[str],
    namespace: str | None,
    timeout_ms: int,
) -> zenoh.Config:
    settings: dict[str, Any] = {
        "mode": mode,
        "listen/endpoints": list(listen),
        "connect": {
            "endpoints": list(connect),
            "timeout_ms": timeout_ms,
            "exit_on_failure": timeout_ms >= 0,
            "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2},
        },
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "timestamping": {"enabled": True},
        "queries_default_timeout": 2000,
        "transport/unicast/max_sessions": 256,
        "transport/link/tx/lease": _LINK_LEASE_MS,
        "transport/link/tx/keep_alive": 4,
        # Room for bursts of express messages, which take one batch each.
        "transport/link/tx/queue/size": {
            "control": 4,
            "real_time": 16,
            "interactive_high": 16,
            "interactive_low": 16,
            "data_high": 16,
            "data": 4,
            "data_low": 16,
            "background": 4,
        },
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 0,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 1_000_000,
        "transport/link/rx/max_message_size": _MAX_WIRE_MESSAGE,
    }
    if namespace is not None:
        settings["namespace"] = namespace
    made: zenoh.Config = zenoh.Config()
    for setting, value in settings.items():
        made.insert_json5(setting, json.dumps(value))
    return made
