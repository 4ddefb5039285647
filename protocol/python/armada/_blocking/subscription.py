"""Messages of one key as they come."""

from __future__ import annotations

from types import TracebackType
from typing import Generic, TypeVar

from armada import aio
from armada._waiting import run
from armada.errors import NotConnected

T = TypeVar("T")


class Subscription(Generic[T]):
    """Messages as they come, from the moment it is made; to be iterated over with `for`.

    Of more messages than it has room for it drops the oldest. With `timeout_s` a silence of that
    length raises `RequestTimeout`; without, it waits for ever. A message that cannot be read raises
    `CodecError`. After both the iteration can go on. It ends when it or the connection is closed.
    """

    def __init__(self, inner: aio.Subscription[T]) -> None:
        self._inner = inner
        self.key: str = inner.key
        """Key that is listened to."""

    def next(self, timeout_s: float | None = None) -> T:
        """Waits for the next message; `timeout_s` overrides that of the subscription.

        Raises `RequestTimeout`, `CodecError`, or `NotConnected` when closed.
        """
        return run(self._inner.next(timeout_s))

    def try_next(self) -> T | None:
        """The next message if one has come already; raises `CodecError`."""
        return self._inner.try_next()

    def close(self) -> None:
        """Ends it; closing twice does nothing."""
        self._inner.close()

    def __iter__(self) -> Subscription[T]:
        return self

    def __next__(self) -> T:
        try:
            return self.next()
        except NotConnected:
            raise StopIteration from None

    def __enter__(self) -> Subscription[T]:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
