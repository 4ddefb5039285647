"""A motion, from its acceptance to its end."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import suppress
from typing import Generic, TypeVar
from uuid import UUID

from armada._bus import RETRY_FOR_S, RETRY_PAUSE_S, Bus
from armada.errors import ArmadaError, DeniedError, MotionFailed, NoReply, RequestTimeout
from armada.messages import (
    Accepted,
    ActionStatus,
    CellMotionStatus,
    DenialCode,
    MotionStatus,
)

from .subscription import Subscription

T = TypeVar("T")
S = TypeVar("S", bound=MotionStatus | CellMotionStatus)

_SILENCE_S = 1.0
"""How long a motion may say nothing before it is asked."""


class Motion(Generic[S]):
    """A motion that was accepted: of one robot, or of several."""

    def __init__(
        self,
        bus: Bus,
        key: str,
        status_type: type[S],
        motion_id: UUID,
        accepted: Accepted | None,
        cancel: Callable[[], Awaitable[None]],
        pause: Callable[[], Awaitable[None]],
        resume: Callable[[], Awaitable[None]],
        set_speed: Callable[[float], Awaitable[float]],
    ) -> None:
        self._bus = bus
        self._key = key
        self._status_type = status_type
        self._cancel = cancel
        self._pause = pause
        self._resume = resume
        self._set_speed = set_speed
        self.id = motion_id
        """Its identity."""
        self.accepted = accepted
        """What the agent or gateway said when it took it; None if found by its identity."""

    async def status(self) -> S:
        """Where it stands; also for some time after its end."""
        return await self._bus.value(self._status_type, self._key)

    async def cancel(self) -> None:
        """Ends it with a ramp to standstill."""
        await self._cancel()

    async def pause(self) -> None:
        """Brings it to rest on its path until it is resumed; several robots at one phase of it."""
        await self._pause()

    async def resume(self) -> None:
        """Goes on with it."""
        await self._resume()

    async def set_speed(self, ratio: float) -> float:
        """Changes its speed on its path, 0.01 to 1 of what it was planned for; returns the ratio.

        It is the speed of all motions of its robots, until it is changed again.
        """
        return await self._set_speed(ratio)

    async def wait(self, timeout_s: float | None = None) -> S:
        """Waits for its end and returns the terminal status, good or bad.

        Raises `RequestTimeout` if it has not ended after `timeout_s`, `NoReply` if the agent or
        gateway is gone.
        """
        last: S | None = None
        async for status in self.progress(timeout_s):
            last = status
        if last is None:
            raise NoReply(self._key)
        return last

    async def progress(self, timeout_s: float | None = None) -> AsyncGenerator[S, None]:
        """Yields each new status, the terminal one last; errors as in `wait`."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        async with Subscription(self._bus, self._key, self._status_type, 64) as changes:
            status = await self._status_if_known()
            if status is not None:
                yield status
            while status is None or not status.status.is_terminal:
                left = _SILENCE_S if deadline is None else deadline - time.monotonic()
                if left <= 0.0:
                    raise RequestTimeout(self._key, timeout_s or 0.0)
                newer = await self._change(changes, min(left, _SILENCE_S))
                if newer is not None and _is_newer(newer, status):
                    status = newer
                    yield status

    async def _status_if_known(self) -> S | None:
        try:
            return await self.status()
        except DeniedError:
            # It was accepted this moment: its first status is on the way.
            return None

    async def _change(self, changes: Subscription[S], patience_s: float) -> S | None:
        try:
            return await changes.next(patience_s)
        except RequestTimeout:
            # The sample with the end may have been lost, or the agent.
            return await self.status() if patience_s >= _SILENCE_S else None

    async def arrive(self) -> S:
        """Waits until it is complete; raises `MotionFailed` if it ends otherwise.

        When the waiting is interrupted, the motion is cancelled. Other errors as in `wait`.
        """
        status = await cancelled_if_interrupted(self._bus, self.wait(), self._cancel)
        if status.status != ActionStatus.COMPLETE:
            raise MotionFailed(status)
        return status


async def cancelled_if_interrupted(
    bus: Bus, work: Awaitable[T], cancel: Callable[[], Awaitable[None]]
) -> T:
    """Does work that has a robot move; when it is interrupted, cancels the motion.

    Whoever gives up waiting for a robot does not expect it to go on.
    """
    try:
        return await work
    except (KeyboardInterrupt, asyncio.CancelledError):
        with suppress(ArmadaError):
            await _cancel_soon(bus, cancel)
        raise


async def _cancel_soon(bus: Bus, cancel: Callable[[], Awaitable[None]]) -> None:
    """Cancels a motion that was asked for just now and may not have been accepted yet."""
    patience = time.monotonic() + RETRY_FOR_S
    while True:
        try:
            return await cancel()
        except DeniedError as denied:
            if denied.code != DenialCode.NOT_ATTACHED or time.monotonic() >= patience:
                raise
        await bus.waiting.pause(RETRY_PAUSE_S)


def _is_newer(newer: MotionStatus | CellMotionStatus, known: S | None) -> bool:
    return (
        known is None
        or newer.boot_id != known.boot_id
        or newer.seqno > known.seqno
        or newer.status.is_terminal
    )
