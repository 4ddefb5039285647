"""Messages of one key as they come."""

from __future__ import annotations

from types import TracebackType
from typing import Generic, TypeVar

import zenoh
from zenoh import ext
from zenoh.handlers import Callback

from armada._bus import Answer, Bus
from armada._waiting import Inbox
from armada.errors import NotConnected, RequestTimeout

T = TypeVar("T")


class Subscription(Generic[T]):
    """Messages as they come, from the moment it is made; to be iterated over with `async for`.

    Of more messages than it has room for it drops the oldest. With `timeout_s` a silence of that
    length raises `RequestTimeout`; without, it waits for ever. A message that cannot be read raises
    `CodecError`. After both the iteration can go on. It ends when it or the connection is closed.
    """

    def __init__(
        self,
        bus: Bus,
        key: str,
        message_type: type[T],
        capacity: int,
        timeout_s: float | None = None,
        *,
        recover: bool = False,
        history: bool = False,
    ) -> None:
        self.key = key
        """Key that is listened to."""
        self._endpoints = bus.endpoints
        self._message_type = message_type
        self._timeout_s = timeout_s
        self._samples: Inbox[zenoh.Sample] = bus.waiting.inbox(capacity)
        taker = Callback(self._samples.put, self._samples.close, indirect=False)
        self._subscriber: zenoh.Subscriber[None] | ext.AdvancedSubscriber[None]
        try:
            if recover:
                self._subscriber = ext.declare_advanced_subscriber(
                    bus.main,
                    key,
                    taker,
                    history=ext.HistoryConfig(detect_late_publishers=True) if history else None,
                    recovery=ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
                )
            else:
                self._subscriber = bus.main.declare_subscriber(key, taker)
        except zenoh.ZError as cause:
            raise NotConnected(bus.endpoints, str(cause)) from cause
        self._is_closed = False

    async def next(self, timeout_s: float | None = None) -> T:
        """Waits for the next message; `timeout_s` overrides that of the subscription.

        Raises `RequestTimeout`, `CodecError`, or `NotConnected` when closed.
        """
        limit = self._timeout_s if timeout_s is None else timeout_s
        try:
            sample = await self._samples.next(limit)
        except TimeoutError:
            raise RequestTimeout(self.key, limit or 0.0) from None
        if sample is None:
            raise NotConnected(self._endpoints, f"the subscription to {self.key} is closed")
        return self._read(sample)

    def try_next(self) -> T | None:
        """The next message if one has come already; raises `CodecError`."""
        sample = self._samples.try_next()
        return None if sample is None else self._read(sample)

    def _read(self, sample: zenoh.Sample) -> T:
        return Answer.of_sample(sample).read(self._message_type, self.key, 0.0)

    def close(self) -> None:
        """Ends it; closing twice does nothing."""
        if self._is_closed:
            return
        self._is_closed = True
        self._samples.close()
        try:
            self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        except zenoh.ZError:
            # The session is closed, and the subscriber with it.
            return

    def __aiter__(self) -> Subscription[T]:
        return self

    async def __anext__(self) -> T:
        try:
            return await self.next()
        except NotConnected:
            raise StopAsyncIteration from None

    async def __aenter__(self) -> Subscription[T]:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
