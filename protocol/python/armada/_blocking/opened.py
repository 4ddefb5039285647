"""From what suspends to what blocks."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Awaitable, Iterator
from typing import TypeVar

from armada._waiting import run

T = TypeVar("T")


async def opened(opening: Awaitable[T]) -> T:
    """What is opened, as a coroutine."""
    return await opening


def iterate(source: AsyncGenerator[T, None]) -> Iterator[T]:
    """What a generator yields, waiting by blocking."""
    try:
        while item := run(_step(source)):
            yield item[0]
    finally:
        run(_end(source))


async def _step(source: AsyncGenerator[T, None]) -> list[T]:
    try:
        return [await source.__anext__()]
    except StopAsyncIteration:
        return []


async def _end(source: AsyncGenerator[T, None]) -> None:
    await source.aclose()
