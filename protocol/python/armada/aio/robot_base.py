"""What a robot is and how, its lease and its mode, as asyncio calls."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from armada import keys, methods
from armada._bus import RETRY_PAUSE_S, VALUE_TIMEOUT_S
from armada._connection import Connection
from armada.errors import DeniedError, LeaseLost
from armada.messages import (
    AcquireLeaseParams,
    ClockSample,
    CommandMode,
    DenialCode,
    Empty,
    Event,
    HaltAnswer,
    JointState,
    ModeAnswer,
    RobotInfo,
    RobotState,
    RobotStatus,
    SetModeParams,
)

from .latest import LatestState
from .lease import HeldLease
from .opening import Opening
from .subscription import Subscription

P = TypeVar("P")
A = TypeVar("A")

_SETTLE_S = 5.0
"""How long a robot may take to come to rest before its mode is changed."""
_WITHOUT_LEASE = frozenset(
    method.name
    for method in (
        methods.HALT,
        methods.CANCEL,
        methods.ABORT,
        methods.DISABLE,
        methods.GET_PARAM,
        methods.GET_SIGNAL,
        methods.FORWARD_KINEMATICS,
        methods.INVERSE_KINEMATICS,
        methods.SAVE_RECORDING,
    )
)
"""What may be asked also when the lease was lost: what only ends motion, and what only reads."""


class RobotBase:
    """What a robot is and how, its lease and its mode."""

    def __init__(self, connection: Connection, name: str) -> None:
        self._connection = connection
        self._bus = connection.bus
        self.name = name
        """Its name in the cell."""
        self._latest: LatestState | None = None
        self._held: HeldLease | None = None

    async def call(self, method: methods.Method[P, A], params: P) -> A:
        """Asks the robot's agent for any method of `armada.methods`, under the lease that is held.

        Raises `LeaseLost` if the lease was lost, unless the method needs none.
        """
        held = self._held
        if held is not None and method.name not in _WITHOUT_LEASE:
            held.check()
        lease = held.id if held is not None and held.is_held else None
        key = keys.ROBOT_RPC.with_(self.name, method.name)
        return await self._bus.call(method, key, params, lease)

    async def info(self) -> RobotInfo:
        """What the robot is: joints, limits, abilities, URDF."""
        return await self._bus.value(RobotInfo, keys.ROBOT_INFO.of(self.name))

    async def status(self) -> RobotStatus:
        """How the robot is: mode, stops, faults, and what may be done next."""
        return await self._bus.value(RobotStatus, keys.ROBOT_STATUS.of(self.name))

    async def clock(self) -> ClockSample:
        """A sample of the clock of the robot's agent."""
        return await self._bus.value(ClockSample, keys.ROBOT_CLOCK.of(self.name))

    async def state(self, timeout_s: float = VALUE_TIMEOUT_S) -> RobotState:
        """The newest state; waits for one if none has come lately.

        Raises `RequestTimeout` if none comes, rather than returning an old one. The first call
        subscribes, the others look at what has come.
        """
        return await self._latest_state().read(timeout_s)

    def states(
        self, timeout_s: float | None = None, *, rate_hz: int | None = None
    ) -> Subscription[RobotState]:
        """States as they come; a slow reader gets the newest and none in between.

        With `rate_hz` at that lower rate, one of `RobotInfo.state_classes_hz`.
        """
        key = keys.ROBOT_STATE.of(self.name)
        if rate_hz is not None:
            key = keys.ROBOT_STATE_AT.with_(self.name, str(rate_hz))
        return Subscription(self._bus, key, RobotState, 1, timeout_s)

    def joint_states(self, timeout_s: float | None = None) -> Subscription[JointState]:
        """States in the shape of ROS, as they come; a slow reader gets the newest."""
        key = keys.ROBOT_JOINT_STATES.of(self.name)
        return Subscription(self._bus, key, JointState, 1, timeout_s)

    def statuses(self, timeout_s: float | None = None) -> Subscription[RobotStatus]:
        """The robot's status on change and once a second."""
        return Subscription(self._bus, keys.ROBOT_STATUS.of(self.name), RobotStatus, 16, timeout_s)

    def events(
        self, *, history: bool = False, timeout_s: float | None = None
    ) -> Subscription[Event]:
        """The robot's audit trail; with `history` also the last events before now."""
        key = keys.ROBOT_EVENTS.of(self.name)
        return Subscription(self._bus, key, Event, 1024, timeout_s, recover=True, history=history)

    async def set_mode(self, mode: CommandMode) -> ModeAnswer:
        """Changes the command mode; every mode but `halt` is entered from `halt`."""
        return await self.call(methods.SET_MODE, SetModeParams(mode=mode))

    async def enter_mode(self, mode: CommandMode) -> None:
        """Enters a mode from whatever mode it is in, through halt.

        It ends a motion of another mode, and waits for the ramp to standstill.
        """
        status = await self.status()
        if status.command_mode == mode:
            return
        if status.command_mode not in (CommandMode.HALT, CommandMode.INVALID_STATE):
            await self.halt()
        # While it still decelerates, the agent refuses as busy.
        for _ in range(int(_SETTLE_S / RETRY_PAUSE_S)):
            try:
                await self.set_mode(mode)
            except DeniedError as denied:
                if denied.code != DenialCode.BUSY:
                    raise
            else:
                return
            await self._bus.waiting.pause(RETRY_PAUSE_S)
        await self.set_mode(mode)

    async def halt(self) -> HaltAnswer:
        """Ramps to standstill and stays in `halt`; ends every motion."""
        return await self.call(methods.HALT, Empty())

    def lease(
        self, ttl_s: float = 1.0, *, on_lost: Callable[[LeaseLost], None] | None = None
    ) -> Opening[HeldLease]:
        """Acquires the right to command the robot and keeps it, to be used in a `with`.

        `ttl_s` is how long it lasts, 0.2 to 60 s, when this program does not renew it any more.
        What is asked of this robot meanwhile is asked under it. Raises `DeniedError` naming the
        holder if somebody else has it, `ValueError` if it is held already.
        """
        return Opening(lambda: self._acquire(ttl_s, on_lost))

    async def _acquire(
        self, ttl_s: float, on_lost: Callable[[LeaseLost], None] | None
    ) -> HeldLease:
        if self._held is not None and self._held.is_held:
            raise ValueError(f"the lease of {self.name} is held already")
        params = AcquireLeaseParams(ttl_ms=round(ttl_s * 1000))
        key = keys.ROBOT_RPC.with_(self.name, methods.ACQUIRE_LEASE.name)
        asked_at = time.monotonic()
        grant = await self._bus.call(methods.ACQUIRE_LEASE, key, params)
        self._held = HeldLease(self._bus, self.name, grant, asked_at, on_lost, self._forget)
        return self._held

    def _forget(self, lease: HeldLease) -> None:
        if self._held is lease:
            self._held = None

    def _latest_state(self) -> LatestState:
        if self._latest is None:
            self._latest = LatestState(self._bus, self.name)
        return self._latest
