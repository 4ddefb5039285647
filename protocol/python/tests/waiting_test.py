"""Inboxes: from a thread to whoever waits."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable

import pytest

from armada._waiting import Inbox, LoopWaiting, ThreadWaiting, run

from .fleet import DEADLINE_S


def fill(inbox: Inbox[int], count: int) -> None:
    for item in range(count):
        inbox.put(item)
    inbox.close()


def in_thread(work: Callable[[], None]) -> threading.Thread:
    thread = threading.Thread(target=work)
    thread.start()
    return thread


def test_a_thread_gets_what_another_puts_and_then_the_end() -> None:
    inbox: Inbox[int] = ThreadWaiting().inbox(10)
    putting = in_thread(lambda: fill(inbox, 2))
    got = [run(inbox.next(DEADLINE_S)) for _ in range(3)]
    putting.join()
    assert got == [0, 1, None]


def test_a_thread_waits_no_longer_than_told() -> None:
    with pytest.raises(TimeoutError):
        run(ThreadWaiting().inbox(1).next(0.01))


def test_a_full_inbox_drops_the_oldest() -> None:
    inbox: Inbox[int] = ThreadWaiting().inbox(2)
    for item in range(5):
        inbox.put(item)
    assert [inbox.try_next() for _ in range(3)] == [3, 4, None]


async def test_a_task_gets_what_a_thread_puts_and_then_the_end() -> None:
    inbox: Inbox[int] = LoopWaiting(asyncio.get_running_loop()).inbox(1000)
    putting = in_thread(lambda: fill(inbox, 500))
    got = []
    while (item := await inbox.next(DEADLINE_S)) is not None:
        got.append(item)
    putting.join()
    assert got == list(range(500))


async def test_a_task_waits_no_longer_than_told() -> None:
    with pytest.raises(TimeoutError):
        await LoopWaiting(asyncio.get_running_loop()).inbox(1).next(0.01)


async def test_a_cancellation_at_the_moment_an_item_comes_is_not_lost() -> None:
    loop = asyncio.get_running_loop()
    inbox: Inbox[int] = LoopWaiting(loop).inbox(1)
    waiting = asyncio.create_task(inbox.next(DEADLINE_S))
    await asyncio.sleep(0)
    # The hand-over is queued before the cancellation, and so comes first.
    inbox.put(1)
    loop.call_soon(waiting.cancel)
    with pytest.raises(asyncio.CancelledError):
        await waiting
    assert inbox.try_next() == 1


async def test_several_tasks_may_wait_at_one_inbox() -> None:
    inbox: Inbox[int] = LoopWaiting(asyncio.get_running_loop()).inbox(10)
    waiting = [asyncio.create_task(inbox.next(DEADLINE_S)) for _ in range(3)]
    await asyncio.sleep(0)
    for item in range(3):
        inbox.put(item)
    assert sorted([await task or 0 for task in waiting]) == [0, 1, 2]


def test_a_loop_that_is_closed_is_told_nothing() -> None:
    loop = asyncio.new_event_loop()
    inbox: Inbox[int] = LoopWaiting(loop).inbox(1)
    loop.close()
    inbox.put(1)
    inbox.close()
    assert inbox.try_next() == 1


def test_a_coroutine_that_suspends_cannot_be_run_blocking() -> None:
    async def suspends() -> None:
        await asyncio.sleep(0)

    with pytest.raises(RuntimeError, match="suspended"):
        run(suspends())
