"""Something that is done again and again beside whoever began it."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable

from ._waiting import Background, Inbox, Waiting


class Repeater:
    """Does something every period until it is ended, or the thing itself says that it is over."""

    def __init__(
        self, waiting: Waiting, period_s: float, work: Callable[[], Awaitable[bool]]
    ) -> None:
        """`work` returns whether to go on; it raises nothing."""
        self._period_s = period_s
        self._work = work
        self._calls: Inbox[bool] = waiting.inbox(1)
        self._going: Background = waiting.background(self._go())

    async def _go(self) -> None:
        due = time.monotonic() + self._period_s
        while True:
            try:
                called = await self._calls.next(max(0.0, due - time.monotonic()))
            except TimeoutError:
                # What was missed is not made up for.
                due = max(due + self._period_s, time.monotonic())
            else:
                if called is None:
                    return
                due = time.monotonic() + self._period_s
            if not await self._work():
                return

    def now(self) -> None:
        """Does it now, and then a period later; called on any thread, never blocks."""
        self._calls.put(True)

    async def end(self) -> None:
        """Ends it and waits until nothing of it is in progress; ending twice does nothing."""
        self._calls.close()
        await self._going.join()
