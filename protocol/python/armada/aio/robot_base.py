"""What a robot is and how, its lease and its mode, as asyncio calls."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import TypeVar
from uuid import UUID

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
    LeaseGrant,
    ModeAnswer,
    RenewLeaseParams,
    RobotInfo,
    RobotState,
    RobotStatus,
    Role,
    SetModeParams,
    TakeLeaseParams,
    Why,
)

from .latest import LatestState
from .lease import HeldLease, hold, milliseconds
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
        methods.RESET,
        methods.GET_PARAM,
        methods.GET_SIGNAL,
        methods.FORWARD_KINEMATICS,
        methods.INVERSE_KINEMATICS,
        methods.SAVE_RECORDING,
    )
)
"""What may be asked also when the lease was lost: ends of motion, resets, and what only reads."""


class RobotBase:
    """What a robot is and how, its lease and its mode."""

    def __init__(self, connection: Connection, name: str) -> None:
        self._connection = connection
        self._bus = connection.bus
        self.name = name
        """Its name in the cell."""
        self._latest: LatestState | None = None

    @property
    def held(self) -> HeldLease | None:
        """The lease of the robot that this connection holds or has lost; None if there is none."""
        return self._connection.held.get(self.name)

    async def call(self, method: methods.Method[P, A], params: P) -> A:
        """Asks the robot's agent for any method of `armada.methods`, under the lease that is held.

        Raises `LeaseLost` if the lease was lost, unless the method needs none.
        """
        held = self.held
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

    async def why(self) -> tuple[Why, ...]:
        """Why the robot does not move, or for whom it does: the most important reason first."""
        return (await self.status()).why

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
        self,
        ttl_s: float = 1.0,
        *,
        role: Role = Role.PROGRAM,
        on_lost: Callable[[LeaseLost], None] | None = None,
    ) -> Opening[HeldLease]:
        """Acquires the right to command the robot and keeps it, to be used in a `with`.

        `ttl_s` is how long it lasts, 0.2 to 60 s, when this program does not renew it any more.
        What is asked of this robot meanwhile is asked under it. Nobody of a lower `role` can take
        it away. Raises `DeniedError` naming the holder if somebody else has it, `ValueError` if it
        is held already.
        """
        params = AcquireLeaseParams(ttl_ms=milliseconds(ttl_s), role=role)
        return self._hold(methods.ACQUIRE_LEASE, params, on_lost)

    def take_lease(
        self,
        role: Role,
        reason: str,
        ttl_s: float = 1.0,
        *,
        on_lost: Callable[[LeaseLost], None] | None = None,
    ) -> Opening[HeldLease]:
        """Takes the right to command the robot from whoever has it: for a person, with a reason.

        `role` is `operator` or `supervisor` and not below the holder's; the holder is told the
        reason, and its motion ends. What is taken is kept as by `lease`.
        """
        params = TakeLeaseParams(ttl_ms=milliseconds(ttl_s), role=role, reason=reason)
        return self._hold(methods.TAKE_LEASE, params, on_lost)

    def use_lease(
        self, lease: UUID, *, on_lost: Callable[[LeaseLost], None] | None = None
    ) -> Opening[HeldLease]:
        """Commands under a lease that its holder delegated to this client, and keeps it.

        It is renewed and given back as one that was acquired, and lost with the holder's.
        """
        return self._hold(methods.RENEW_LEASE, RenewLeaseParams(lease=lease), on_lost)

    def _hold(
        self,
        method: methods.Method[P, LeaseGrant],
        params: P,
        on_lost: Callable[[LeaseLost], None] | None,
    ) -> Opening[HeldLease]:
        key = keys.ROBOT_RPC.with_(self.name, method.name)

        def ask() -> Awaitable[LeaseGrant]:
            return self._bus.call(method, key, params)

        return Opening(lambda: hold(self._connection, self.name, ask, on_lost))

    def _latest_state(self) -> LatestState:
        if self._latest is None:
            self._latest = LatestState(self._bus, self.name)
        return self._latest
