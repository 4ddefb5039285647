"""What a robot is and how, its lease and its mode, as blocking calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar
from uuid import UUID

from armada import aio, methods
from armada._bus import VALUE_TIMEOUT_S
from armada._waiting import run
from armada.errors import LeaseLost
from armada.messages import (
    ClockSample,
    CommandMode,
    Event,
    HaltAnswer,
    JointState,
    ModeAnswer,
    RobotInfo,
    RobotState,
    RobotStatus,
    Role,
    Why,
)

from .lease import HeldLease
from .opened import opened
from .subscription import Subscription

P = TypeVar("P")
A = TypeVar("A")


class RobotBase:
    """What a robot is and how, its lease and its mode."""

    def __init__(self, inner: aio.Robot) -> None:
        self._inner = inner
        self.name = inner.name
        """Its name in the cell."""

    @property
    def held(self) -> HeldLease | None:
        """The lease of the robot that this connection holds or has lost; None if there is none."""
        held = self._inner.held
        return None if held is None else HeldLease(held)

    def call(self, method: methods.Method[P, A], params: P) -> A:
        """Asks the robot's agent for any method of `armada.methods`, under the lease that is held.

        Raises `LeaseLost` if the lease was lost, unless the method needs none.
        """
        return run(self._inner.call(method, params))

    def info(self) -> RobotInfo:
        """What the robot is: joints, limits, abilities, URDF."""
        return run(self._inner.info())

    def status(self) -> RobotStatus:
        """How the robot is: mode, stops, faults, and what may be done next."""
        return run(self._inner.status())

    def why(self) -> tuple[Why, ...]:
        """Why the robot does not move, or for whom it does: the most important reason first."""
        return run(self._inner.why())

    def clock(self) -> ClockSample:
        """A sample of the clock of the robot's agent."""
        return run(self._inner.clock())

    def state(self, timeout_s: float = VALUE_TIMEOUT_S) -> RobotState:
        """The newest state; waits for one if none has come lately.

        Raises `RequestTimeout` if none comes, rather than returning an old one. The first call
        subscribes, the others look at what has come.
        """
        return run(self._inner.state(timeout_s))

    def states(
        self, timeout_s: float | None = None, *, rate_hz: int | None = None
    ) -> Subscription[RobotState]:
        """States as they come; a slow reader gets the newest and none in between.

        With `rate_hz` at that lower rate, one of `RobotInfo.state_classes_hz`.
        """
        return Subscription(self._inner.states(timeout_s, rate_hz=rate_hz))

    def joint_states(self, timeout_s: float | None = None) -> Subscription[JointState]:
        """States in the shape of ROS, as they come; a slow reader gets the newest."""
        return Subscription(self._inner.joint_states(timeout_s))

    def statuses(self, timeout_s: float | None = None) -> Subscription[RobotStatus]:
        """The robot's status on change and once a second."""
        return Subscription(self._inner.statuses(timeout_s))

    def events(
        self, *, history: bool = False, timeout_s: float | None = None
    ) -> Subscription[Event]:
        """The robot's audit trail; with `history` also the last events before now."""
        return Subscription(self._inner.events(history=history, timeout_s=timeout_s))

    def set_mode(self, mode: CommandMode) -> ModeAnswer:
        """Changes the command mode; every mode but `halt` is entered from `halt`."""
        return run(self._inner.set_mode(mode))

    def enter_mode(self, mode: CommandMode) -> None:
        """Enters a mode from whatever mode it is in, through halt.

        It ends a motion of another mode, and waits for the ramp to standstill.
        """
        run(self._inner.enter_mode(mode))

    def halt(self) -> HaltAnswer:
        """Ramps to standstill and stays in `halt`; ends every motion."""
        return run(self._inner.halt())

    def lease(
        self,
        ttl_s: float = 1.0,
        *,
        role: Role = Role.PROGRAM,
        on_lost: Callable[[LeaseLost], None] | None = None,
    ) -> HeldLease:
        """Acquires the right to command the robot and keeps it, to be used in a `with`.

        `ttl_s` is how long it lasts, 0.2 to 60 s, when this program does not renew it any more.
        What is asked of this robot meanwhile is asked under it. Nobody of a lower `role` can take
        it away. Raises `DeniedError` naming the holder if somebody else has it, `ValueError` if it
        is held already.
        """
        return HeldLease(run(opened(self._inner.lease(ttl_s, role=role, on_lost=on_lost))))

    def take_lease(
        self,
        role: Role,
        reason: str,
        ttl_s: float = 1.0,
        *,
        on_lost: Callable[[LeaseLost], None] | None = None,
    ) -> HeldLease:
        """Takes the right to command the robot from whoever has it: for a person, with a reason.

        `role` is `operator` or `supervisor` and not below the holder's; the holder is told the
        reason, and its motion ends. What is taken is kept as by `lease`.
        """
        opening = self._inner.take_lease(role, reason, ttl_s, on_lost=on_lost)
        return HeldLease(run(opened(opening)))

    def use_lease(
        self, lease: UUID, *, on_lost: Callable[[LeaseLost], None] | None = None
    ) -> HeldLease:
        """Commands under a lease that its holder delegated to this client, and keeps it.

        It is renewed and given back as one that was acquired, and lost with the holder's.
        """
        return HeldLease(run(opened(self._inner.use_lease(lease, on_lost=on_lost))))
