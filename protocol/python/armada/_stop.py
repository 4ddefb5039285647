"""The shortest path of a stop: from a client to every agent, gateway alive or not."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import TypeAlias
from uuid import UUID

import msgspec
import zenoh
from zenoh.handlers import Callback

from . import codec, keys
from ._bus import Answer, Bus, alive_robot
from ._waiting import Inbox
from .errors import CodecError, NotConnected
from .messages import (
    StopAck,
    StopLevel,
    StopReport,
    StopRequest,
    StopScopeRobots,
    StopStage,
    StopVerdict,
)
from .qos import Channel

REPEAT_S = 0.01
"""Pause between repetitions of a stop until every robot has it."""
ASK_AGAIN_S = 0.2
"""Pause before agents are asked again, in case an acknowledgement was lost."""
_HARDER = {StopLevel.L2: StopLevel.L1, StopLevel.L1: StopLevel.L0}
"""The level above each, which is what a robot that does not come to rest is asked for."""
_HARDER_TIMES = 5
"""How often it is asked for it."""


class Ladder:
    """How far each robot in scope has come."""

    def __init__(self, stop_id: UUID, in_scope: Iterable[str]) -> None:
        self._stop_id = stop_id
        self._in_scope = set(in_scope)
        self._reached: dict[str, StopAck] = {}

    def expect(self, robots: Iterable[str]) -> None:
        """Puts more robots in scope."""
        self._in_scope.update(robots)

    def take(self, ack: StopAck) -> None:
        """Takes an acknowledgement; a lower stage takes nothing back."""
        if ack.stop_id != self._stop_id:
            return
        known = self._reached.get(ack.robot)
        if known is None or known.stage.rank < ack.stage.rank:
            self._reached[ack.robot] = ack

    def all_reached(self, stage: StopStage) -> bool:
        """Whether every robot in scope is there; never if there is no robot."""
        return bool(self._in_scope) and not self._short_of(stage)

    def _short_of(self, stage: StopStage) -> list[str]:
        return sorted(robot for robot in self._in_scope if not self._has_reached(robot, stage))

    def _has_reached(self, robot: str, stage: StopStage) -> bool:
        ack = self._reached.get(robot)
        return ack is not None and ack.stage.rank >= stage.rank

    def report(self) -> StopReport:
        """The outcome."""
        complete = self.all_reached(StopStage.STANDSTILL)
        return StopReport(
            stop_id=self._stop_id,
            verdict=StopVerdict.COMPLETE if complete else StopVerdict.INCOMPLETE,
            acks=tuple(self._reached[robot] for robot in sorted(self._reached)),
            missing=tuple(self._short_of(StopStage.STANDSTILL)),
        )


class AckListener:
    """Listens to acknowledgements on every session from the start.

    A subscription made when the stop goes out could miss the first of them.
    """

    def __init__(self, bus: Bus) -> None:
        self._takers: set[Callable[[zenoh.Sample], None]] = set()
        bus.on_each_session(self._listen)

    def _listen(self, session: zenoh.Session) -> None:
        session.declare_subscriber(
            keys.ROBOT_STOP_ACK.any(), Callback(self._spread, indirect=False)
        )

    def _spread(self, sample: zenoh.Sample) -> None:
        for take in tuple(self._takers):
            take(sample)

    def add(self, take: Callable[[zenoh.Sample], None]) -> None:
        """Gives acknowledgements to `take` too, on Zenoh's threads."""
        self._takers.add(take)

    def remove(self, take: Callable[[zenoh.Sample], None]) -> None:
        """Ends that."""
        self._takers.discard(take)


@dataclass(frozen=True)
class _Present:
    """A reply about a robot that is on the bus."""

    reply: zenoh.Reply


class _PresentEnd:
    """The last of those of one session."""


_Heard: TypeAlias = zenoh.Sample | zenoh.Reply | _Present | _PresentEnd


class Stop:
    """One stop on its way."""

    def __init__(
        self, bus: Bus, acks: AckListener, request: StopRequest, expected: Iterable[str]
    ) -> None:
        self._bus = bus
        self._acks = acks
        self._request = request
        self._inbox: Inbox[_Heard] = bus.waiting.inbox(4096)
        named = request.scope.robots if isinstance(request.scope, StopScopeRobots) else None
        self._whole_cell = named is None
        self._ladder = Ladder(request.stop_id, expected if named is None else named)
        one = named is not None and len(named) == 1
        self._ask_key = keys.ROBOT_STOP.of(named[0]) if named and one else keys.ROBOT_STOP.any()
        self._looking = 0

    async def run(self, timeout_s: float) -> StopReport:
        """Repeats the stop until every robot has it, and waits until they stand still."""
        self._acks.add(self._inbox.put)
        try:
            self._publish()
            return await self._follow(timeout_s)
        finally:
            self._acks.remove(self._inbox.put)

    async def _follow(self, timeout_s: float) -> StopReport:
        now = time.monotonic()
        deadline, repeat_at, ask_at = now + timeout_s, now + REPEAT_S, now
        self._look_who_is_there()
        while not self._is_over() and now < deadline:
            if now >= ask_at:
                self._ask(timeout_s)
                ask_at = now + ASK_AGAIN_S
            if now >= repeat_at:
                if not self._ladder.all_reached(StopStage.RECEIVED):
                    self._publish()
                repeat_at = now + REPEAT_S
            await self._hear_until(min(deadline, repeat_at))
            now = time.monotonic()
        report = self._ladder.report()
        await self._ask_harder(report)
        return report

    async def _ask_harder(self, report: StopReport) -> None:
        """Asks again, one level harder, those that are not known to stand."""
        level = _HARDER.get(self._request.level)
        if not report.missing or level is None:
            return
        scope = StopScopeRobots(robots=tuple(report.missing))
        self._request = msgspec.structs.replace(self._request, level=level, scope=scope)
        for _ in range(_HARDER_TIMES):
            # Whoever asked has the report all the same, which says INCOMPLETE.
            with suppress(NotConnected):
                self._publish()
                self._ask(REPEAT_S)
            await self._bus.waiting.pause(REPEAT_S)

    def _is_over(self) -> bool:
        return self._looking == 0 and self._ladder.all_reached(StopStage.STANDSTILL)

    def _publish(self) -> None:
        payload = codec.encode(self._request)
        qos = Channel.STOP.qos
        sent = False
        cause = "the connection is closed"
        for session in self._bus.sessions:
            try:
                session.put(
                    keys.CELL_STOP.any(),
                    payload,
                    encoding=codec.WireEncoding.JSON.value,
                    priority=qos.priority,
                    congestion_control=qos.congestion_control,
                    express=qos.express,
                )
                sent = True
            except zenoh.ZError as error:  # noqa: PERF203, one session must not stop the other
                cause = str(error)
        if not sent:
            raise NotConnected(self._bus.endpoints, cause)
        self._request = msgspec.structs.replace(self._request, seq=self._request.seq + 1)

    def _ask(self, timeout_s: float) -> None:
        payload = codec.encode(self._request)
        for session in self._bus.sessions:
            self._bus.get(
                session, self._ask_key, payload, timeout_s, Channel.STOP, self._inbox.put, _nothing
            )

    def _look_who_is_there(self) -> None:
        if not self._whole_cell:
            return
        for session in self._bus.sessions:
            self._looking += 1
            self._bus.get_alive(
                session,
                lambda reply: self._inbox.put(_Present(reply)),
                lambda: self._inbox.put(_PresentEnd()),
            )

    async def _hear_until(self, instant: float) -> None:
        try:
            heard = await self._inbox.next(max(0.0, instant - time.monotonic()))
        except TimeoutError:
            return
        while heard is not None:
            self._take(heard)
            heard = self._inbox.try_next()

    def _take(self, heard: _Heard) -> None:
        if isinstance(heard, _Present):
            self._ladder.expect(alive_robot(heard.reply))
        elif isinstance(heard, _PresentEnd):
            self._looking -= 1
        elif isinstance(heard, zenoh.Reply):
            self._take_ack(Answer.of_reply(heard))
        else:
            self._take_ack(Answer.of_sample(heard))

    def _take_ack(self, answer: Answer) -> None:
        if answer.is_error:
            return
        try:
            self._ladder.take(codec.decode(StopAck, answer.payload, answer.label))
        except CodecError:
            # What cannot be read proves nothing.
            return


def _nothing() -> None:
    pass
