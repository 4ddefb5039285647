"""A source of stops: something elsewhere that robots ask whether it is pressed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

import zenoh

from . import codec, keys
from ._bus import Bus
from ._signature import SigningKey
from .errors import CodecError, NotConnected
from .messages import StopChallenge, StopCheckIn


class StopSource:
    """A source of stops that answers until it is closed; silence is a press to the robots.

    `read` is called once for every question, ten times a second for each robot, on a thread of its
    own, and has to be quick. It looks at a real input *now*: a value that stays when the input dies
    would be an answer that nobody gave, so there is none by default. Only `False` is released:
    whatever else it returns, or raises, is a press; what it raised is in `error`, and raised at the
    end of a `with`. To be used in a `with` or an `async with`; the robots that follow a source name
    it in their files.
    """

    def __init__(
        self, bus: Bus, name: str, read: Callable[[], bool], key: SigningKey | None
    ) -> None:
        if not keys.is_robot_name(name):
            raise ValueError(
                f"{name[:80]!r} is not the name of a stop source: it is of the form of a robot's"
            )
        self.name = name
        """Its name."""
        self.error: Exception | None = None
        """What `read` raised first; None if nothing."""
        self._read = read
        self._key = key
        self._own_key = keys.CELL_STOP_SOURCE.with_(name)
        self._asking: dict[str, float] = {}
        self._change = threading.Lock()
        self._queryables: list[zenoh.Queryable[None]] | None = []
        self._endpoints = bus.endpoints
        if not bus.sessions:
            raise NotConnected(bus.endpoints, "the connection is closed")
        bus.on_each_session(self._declare)

    def asking(self) -> dict[str, float]:
        """The robots that have asked, each with the time since it did last [s]."""
        now = time.monotonic()
        with self._change:
            return {robot: now - last for robot, last in sorted(self._asking.items())}

    def close(self) -> None:
        """Answers no more, which is a press. Closing twice does nothing."""
        with self._change:
            queryables, self._queryables = self._queryables or [], None
        for queryable in queryables:
            try:
                queryable.undeclare()
            except zenoh.ZError:  # noqa: PERF203, each must be tried
                # The session is closed, and the queryable with it.
                continue

    def _declare(self, session: zenoh.Session) -> None:
        with self._change:
            if self._queryables is None:
                return
            try:
                queryable = session.declare_queryable(self._own_key, self._answer, complete=True)
            except zenoh.ZError as cause:
                raise NotConnected(self._endpoints, str(cause)) from cause
            self._queryables.append(queryable)

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            if query.payload is None:
                return
            try:
                challenge = codec.decode(
                    StopChallenge, query.payload.to_bytes(), str(query.encoding or "")
                )
            except CodecError:
                # Whoever it was asks again, or stops.
                return
            payload = codec.encode(self._check_in(challenge))
            with self._change:
                self._asking[challenge.robot] = time.monotonic()
                is_closed = self._queryables is None
            if not is_closed:
                # It goes with the urgency of the question.
                query.reply(self._own_key, payload, encoding=codec.WireEncoding.JSON.value)

    def _check_in(self, challenge: StopChallenge) -> StopCheckIn:
        pressed = self._is_pressed()
        signature = None
        if self._key is not None:
            signature = self._key.sign_check_in(self.name, challenge, pressed=pressed)
        return StopCheckIn(
            source=self.name, nonce=challenge.nonce, pressed=pressed, signature=signature
        )

    def _is_pressed(self) -> bool:
        try:
            return self._read() is not False
        except Exception as error:  # noqa: BLE001, whatever it is, the input is not known
            self.error = self.error or error
            return True

    def __enter__(self) -> StopSource:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
        if error is None and self.error is not None:
            raise self.error

    async def __aenter__(self) -> StopSource:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.__exit__(kind, error, trace)
