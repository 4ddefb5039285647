"""The Zenoh sessions of one connection, and how requests are asked on them.

```text
main    client --> gateway                           everything
direct  peer   --> each agent that cell/info names   stops, and requests that main gets nowhere
```
A router relays everything to clients but nothing between peers, so `main` is a client; a client has
one link only, so `direct` is a peer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar
from uuid import UUID

import zenoh
from zenoh.handlers import Callback

from . import codec, keys
from ._ids import new_id
from ._waiting import Inbox, Waiting
from .errors import CodecError, DeniedError, NoReply, NotConnected, RequestTimeout
from .messages import Denial, Request
from .methods import Method
from .qos import Channel
from .session import client_config, peer_config

RETRY_PAUSE_S = 0.05
"""Pause before a request that nobody answered is repeated."""
RETRY_FOR_S = 0.3
"""How long a request that nobody answers is repeated."""
VALUE_TIMEOUT_S = 1.0
"""How long to wait for a value such as a status."""
_SESSION_SLACK_S = 0.5
"""Zenoh ends a query by itself at its timeout; later than this it has lost it."""

T = TypeVar("T")
P = TypeVar("P")
A = TypeVar("A")


@dataclass(frozen=True)
class Answer:
    """What came as the reply to a query or as a sample."""

    key: str
    payload: bytes
    label: str
    """Zenoh's label of the encoding."""
    is_error: bool = False

    @classmethod
    def of_sample(cls, sample: zenoh.Sample) -> Answer:
        """The content of a sample."""
        return cls(str(sample.key_expr), sample.payload.to_bytes(), str(sample.encoding))

    @classmethod
    def of_reply(cls, reply: zenoh.Reply) -> Answer:
        """The content of a reply, good or bad."""
        if reply.ok is not None:
            return cls.of_sample(reply.ok)
        if reply.err is None:
            return cls("", b"", "", is_error=True)
        return cls("", reply.err.payload.to_bytes(), str(reply.err.encoding), is_error=True)

    def read(self, message_type: type[T], key: str, timeout_s: float) -> T:
        """The message; raises `DeniedError`, `RequestTimeout` or `CodecError`."""
        if not self.is_error:
            return codec.decode(message_type, self.payload, self.label)
        if self.label.startswith("zenoh/") and self.payload == b"Timeout":
            raise RequestTimeout(key, timeout_s)
        try:
            denial = codec.decode(Denial, self.payload, self.label)
        except CodecError as cause:
            text = self.payload[:200].decode(errors="replace")
            raise CodecError(f"{key} refused, but not with a denial: {text!r}") from cause
        raise DeniedError(denial, key)


class Bus:
    """The sessions of one connection."""

    def __init__(
        self, waiting: Waiting, name: str, endpoints: Sequence[str], namespace: str | None
    ) -> None:
        self.waiting = waiting
        self.name = name
        self.endpoints = tuple(endpoints)
        self._namespace = namespace
        self._sessions: list[zenoh.Session] = []
        self._opened: list[Callable[[zenoh.Session], None]] = []

    @property
    def sessions(self) -> Sequence[zenoh.Session]:
        """The open sessions, the main one first."""
        return tuple(self._sessions)

    @property
    def main(self) -> zenoh.Session:
        """The session that has dialled the gateway; raises `NotConnected` when closed."""
        if not self._sessions:
            raise NotConnected(self.endpoints, "the connection is closed")
        return self._sessions[0]

    async def open(self, timeout_s: float) -> None:
        """Opens the main session; raises `NotConnected` if nobody answers at its endpoints."""
        self._add(
            await self._open(lambda: client_config(self.endpoints, self._namespace, timeout_s))
        )

    async def open_direct(self, agents: Sequence[str]) -> None:
        """Opens the second session, which dials agents; it does not wait for them."""
        # The main session has one link only, even if it was given several endpoints.
        others = self.endpoints if len(self.endpoints) > 1 else ()
        own = sorted({*agents, *others})
        if own:
            self._add(await self._open(lambda: peer_config(own, self._namespace)))

    async def _open(self, settings: Callable[[], zenoh.Config]) -> zenoh.Session:
        try:
            return await self.waiting.blocking(lambda: zenoh.open(settings()))
        except zenoh.ZError as cause:
            raise NotConnected(self.endpoints, f"{cause} (is it running? `armada up`)") from cause

    def _add(self, session: zenoh.Session) -> None:
        self._sessions.append(session)
        for tell in self._opened:
            tell(session)

    def on_each_session(self, tell: Callable[[zenoh.Session], None]) -> None:
        """Has `tell` called with each session, also with those that are opened later."""
        self._opened.append(tell)
        for session in self._sessions:
            tell(session)

    async def close(self) -> None:
        """Closes the sessions; closing twice does nothing."""
        sessions, self._sessions = self._sessions, []
        for session in sessions:
            await self.waiting.blocking(session.close)

    async def call(self, method: Method[P, A], key: str, params: P, lease: UUID | None = None) -> A:
        """Asks at a key under `rpc/`."""
        request = Request(request_id=new_id(), client=self.name, lease=lease, params=params)
        return await self.ask(method.answer, key, codec.encode(request), method.timeout_s)

    async def value(self, message_type: type[T], key: str) -> T:
        """Asks for the value at a key."""
        return await self.ask(message_type, key, None, VALUE_TIMEOUT_S)

    async def ask(
        self, message_type: type[T], key: str, payload: bytes | None, timeout_s: float
    ) -> T:
        """Asks until somebody answers: after a reconnection a query may find nobody for a moment.

        Requests carry an id, so a repetition is not done twice.
        """
        patience = time.monotonic() + min(timeout_s, RETRY_FOR_S)
        while True:
            for session in self.sessions or (self.main,):
                answer = await self._first_reply(session, key, payload, timeout_s)
                if answer is not None:
                    return answer.read(message_type, key, timeout_s)
            if time.monotonic() >= patience:
                raise NoReply(key)
            await self.waiting.pause(RETRY_PAUSE_S)

    async def _first_reply(
        self, session: zenoh.Session, key: str, payload: bytes | None, timeout_s: float
    ) -> Answer | None:
        replies: Inbox[zenoh.Reply] = self.waiting.inbox(16)
        self.get(session, key, payload, timeout_s, Channel.RPC, replies.put, replies.close)
        try:
            reply = await replies.next(timeout_s + _SESSION_SLACK_S)
        except TimeoutError:
            raise RequestTimeout(key, timeout_s) from None
        return None if reply is None else Answer.of_reply(reply)

    def publisher(self, key: str, channel: Channel) -> zenoh.Publisher:
        """A publisher of messages in JSON on the main session."""
        try:
            return self.main.declare_publisher(
                key,
                encoding=codec.WireEncoding.JSON.value,
                congestion_control=channel.qos.congestion_control,
                priority=channel.qos.priority,
                express=channel.qos.express,
            )
        except zenoh.ZError as cause:
            raise NotConnected(self.endpoints, str(cause)) from cause

    def get(
        self,
        session: zenoh.Session,
        key: str,
        payload: bytes | None,
        timeout_s: float,
        channel: Channel,
        put: Callable[[zenoh.Reply], None],
        done: Callable[[], None],
    ) -> None:
        """Sends a query, whose replies go to `put`; after the last one `done` is called.

        Requests go to the best answerer, stops to all of them.
        """
        is_stop = channel is Channel.STOP
        try:
            session.get(
                key,
                Callback(put, done, indirect=False),
                target=zenoh.QueryTarget.ALL if is_stop else zenoh.QueryTarget.BEST_MATCHING,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=timeout_s,
                payload=payload,
                encoding=None if payload is None else codec.WireEncoding.JSON.value,
                congestion_control=channel.qos.congestion_control,
                priority=channel.qos.priority,
                express=channel.qos.express,
            )
        except zenoh.ZError as cause:
            raise NotConnected(self.endpoints, str(cause)) from cause

    async def robots_alive(self) -> list[str]:
        """Names of the robots whose agents are on the bus now, in order of the alphabet."""
        replies: Inbox[zenoh.Reply] = self.waiting.inbox(1024)
        self.get_alive(self.main, replies.put, replies.close)
        robots: set[str] = set()
        try:
            while (reply := await replies.next(VALUE_TIMEOUT_S + _SESSION_SLACK_S)) is not None:
                robots.update(alive_robot(reply))
        except TimeoutError:
            raise RequestTimeout(keys.ROBOT_ALIVE.any(), VALUE_TIMEOUT_S) from None
        return sorted(robots)

    def get_alive(
        self,
        session: zenoh.Session,
        put: Callable[[zenoh.Reply], None],
        done: Callable[[], None],
    ) -> None:
        """Asks for the tokens of all agents."""
        try:
            session.liveliness().get(
                keys.ROBOT_ALIVE.any(),
                Callback(put, done, indirect=False),
                timeout=VALUE_TIMEOUT_S,
            )
        except zenoh.ZError as cause:
            raise NotConnected(self.endpoints, str(cause)) from cause


def alive_robot(reply: zenoh.Reply) -> list[str]:
    """The robot whose token a reply is: one name, or none."""
    sample = reply.ok
    if sample is None or sample.kind != zenoh.SampleKind.PUT:
        return []
    robot = keys.robot_of(str(sample.key_expr))
    return [] if robot is None else [robot]
