"""The two ways to wait: by blocking the thread, or by suspending the task.

Everything above is written once, as coroutines. In a program with asyncio they are awaited; in one
without, `run` runs them to their end at once, because then nothing that they await ever
suspends: it blocks instead.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any, Generic, Protocol, TypeVar

T = TypeVar("T")


class Inbox(Protocol[T]):
    """A bounded queue from Zenoh's threads to whoever waits; when full, the oldest goes."""

    def put(self, item: T) -> None:
        """Adds an item; called on Zenoh's threads, never blocks."""

    def close(self) -> None:
        """Says that nothing follows; called on any thread."""

    async def next(self, timeout_s: float | None) -> T | None:
        """Waits for the next item; None when closed and empty, `TimeoutError` when late."""

    def try_next(self) -> T | None:
        """The next item if there is one."""


class Waiting(Protocol):
    """How to wait."""

    def inbox(self, capacity: int) -> Inbox[Any]:
        """A new inbox."""

    async def pause(self, seconds: float) -> None:
        """Lets time pass."""

    async def blocking(self, work: Callable[[], T]) -> T:
        """Runs work that may take long."""

    def background(self, work: Coroutine[Any, Any, None]) -> Background:
        """Begins work that goes on beside whoever began it; it must end by itself."""


class Background(Protocol):
    """Work that goes on beside whoever began it."""

    async def join(self) -> None:
        """Waits for its end."""


def run(coroutine: Coroutine[Any, Any, T]) -> T:
    """Runs a coroutine that waits by blocking."""
    try:
        coroutine.send(None)
    except StopIteration as end:
        result: T = end.value
        return result
    coroutine.close()
    raise RuntimeError("a coroutine of the blocking API was suspended")


class ThreadWaiting:
    """Waits by blocking the thread."""

    def inbox(self, capacity: int) -> Inbox[Any]:
        return ThreadInbox[Any](capacity)

    async def pause(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds))  # noqa: ASYNC251, never runs in an event loop

    async def blocking(self, work: Callable[[], T]) -> T:
        return work()

    def background(self, work: Coroutine[Any, Any, None]) -> Background:
        thread = threading.Thread(target=run, args=(work,), daemon=True)
        thread.start()
        return ThreadBackground(thread)


class ThreadBackground:
    """Work on a thread of its own."""

    def __init__(self, thread: threading.Thread) -> None:
        self._thread = thread

    async def join(self) -> None:
        if self._thread is not threading.current_thread():
            self._thread.join()


class ThreadInbox(Generic[T]):
    """An inbox for a thread."""

    def __init__(self, capacity: int) -> None:
        self._items: deque[T] = deque(maxlen=capacity)
        self._changed = threading.Condition()
        self._closed = False

    def put(self, item: T) -> None:
        with self._changed:
            self._items.append(item)
            self._changed.notify()

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    async def next(self, timeout_s: float | None) -> T | None:
        with self._changed:
            if not self._changed.wait_for(lambda: self._items or self._closed, timeout_s):
                raise TimeoutError
            return self._items.popleft() if self._items else None

    def try_next(self) -> T | None:
        with self._changed:
            return self._items.popleft() if self._items else None


class LoopWaiting:
    """Waits by suspending the task."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop

    def inbox(self, capacity: int) -> Inbox[Any]:
        return LoopInbox[Any](self._loop, capacity)

    async def pause(self, seconds: float) -> None:
        await asyncio.sleep(seconds)

    async def blocking(self, work: Callable[[], T]) -> T:
        return await asyncio.to_thread(work)

    def background(self, work: Coroutine[Any, Any, None]) -> Background:
        return LoopBackground(self._loop.create_task(work))


class LoopBackground:
    """Work in a task of its own."""

    def __init__(self, task: asyncio.Task[None]) -> None:
        self._task = task

    async def join(self) -> None:
        if self._task is not asyncio.current_task():
            await self._task


class LoopInbox(Generic[T]):
    """An inbox for tasks of one event loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop, capacity: int) -> None:
        self._loop = loop
        self._items: deque[T] = deque(maxlen=capacity)
        self._closed = False
        self._waiters: set[asyncio.Future[None]] = set()
        self._wake_pending = False

    def put(self, item: T) -> None:
        self._items.append(item)
        self._wake()

    def close(self) -> None:
        self._closed = True
        self._wake()

    def _wake(self) -> None:
        # One hand-over for all items that come before the loop gets to it.
        if self._wake_pending:
            return
        self._wake_pending = True
        try:
            self._loop.call_soon_threadsafe(self._woken)
        except RuntimeError:
            # The loop is closed: nobody waits any more.
            self._wake_pending = False

    def _woken(self) -> None:
        self._wake_pending = False
        for waiter in self._waiters:
            _resolve(waiter)

    async def next(self, timeout_s: float | None) -> T | None:
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            if self._items:
                return self._items.popleft()
            if self._closed:
                return None
            if deadline is not None and time.monotonic() >= deadline:
                raise TimeoutError
            await self._change(deadline)

    async def _change(self, deadline: float | None) -> None:
        # Not asyncio.wait_for: before Python 3.12 it can swallow a cancellation.
        waiter: asyncio.Future[None] = self._loop.create_future()
        timer = None
        if deadline is not None:
            left = max(0.0, deadline - time.monotonic())
            timer = self._loop.call_later(left, _resolve, waiter)
        self._waiters.add(waiter)
        try:
            await waiter
        finally:
            self._waiters.discard(waiter)
            if timer is not None:
                timer.cancel()

    def try_next(self) -> T | None:
        return self._items.popleft() if self._items else None


def _resolve(waiter: asyncio.Future[None]) -> None:
    if not waiter.done():
        waiter.set_result(None)
