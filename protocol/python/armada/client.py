"""The blocking API: that of `armada.aio`, with the waiting done by the thread that calls."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import TracebackType
from typing import TypeVar
from uuid import UUID

from numpy.typing import ArrayLike

from . import aio, methods
from ._blocking.motion import Motion
from ._blocking.robot import Robot
from ._blocking.subscription import Subscription
from ._connection import DEFAULT_NAME, STOP_TIMEOUT_S, Connection, ConnectOptions
from ._waiting import ThreadWaiting, run
from .messages import (
    CellFrames,
    CellInfo,
    CellMotionStatus,
    CellResetAnswer,
    CellStatus,
    Event,
    JointTrajectory,
    MotionStatus,
    StopLevel,
    StopReport,
)

T = TypeVar("T")
S = TypeVar("S", bound=MotionStatus | CellMotionStatus)
P = TypeVar("P")
A = TypeVar("A")


def connect(
    *endpoints: str,
    namespace: str | None = None,
    name: str = DEFAULT_NAME,
    timeout_s: float = 2.0,
) -> Cell:
    """Connects to a cell; to be used in a `with`, or closed by hand.

    `endpoints` are Zenoh endpoints of the gateway (`tcp/127.0.0.1:7447` if left out) and, to work
    without it, of agents. `namespace` is the prefix of every key, as in the cell file; `name` is
    given with every request, for people and the audit trail. Raises `NotConnected` if nobody
    answers within `timeout_s`.
    """
    options = ConnectOptions(endpoints, namespace, name, timeout_s)
    return Cell(aio.Cell(run(Connection.open(ThreadWaiting(), options))))


class Cell:
    """A connection to a cell."""

    def __init__(self, inner: aio.Cell) -> None:
        self._inner = inner

    def __enter__(self) -> Cell:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connection; motions in progress go on."""
        run(self._inner.close())

    def robot(self, name: str) -> Robot:
        """The robot of this name, be it there or not; raises `ValueError` if it is no name."""
        return Robot(self._inner.robot(name))

    def robots(self) -> list[str]:
        """Names of the cell's robots in the order of the cell file, be they there or not.

        If the gateway does not answer, those that are on the bus.
        """
        return run(self._inner.robots())

    def robots_alive(self) -> list[str]:
        """Names of the robots whose agents are on the bus now, in order of the alphabet."""
        return run(self._inner.robots_alive())

    def info(self) -> CellInfo:
        """The robots of the cell and where they stand."""
        return run(self._inner.info())

    def status(self) -> CellStatus:
        """Condition of every robot and the cell's verdict."""
        return run(self._inner.status())

    def statuses(self, timeout_s: float | None = None) -> Subscription[CellStatus]:
        """The cell's status on change and once a second; see `Subscription` for `timeout_s`."""
        return Subscription(self._inner.statuses(timeout_s))

    def frames(self, timeout_s: float | None = None) -> Subscription[CellFrames]:
        """World poses of the links that moved, at 30 Hz; all links once a second."""
        return Subscription(self._inner.frames(timeout_s))

    def events(
        self, *, history: bool = False, timeout_s: float | None = None
    ) -> Subscription[Event]:
        """The gateway's audit trail; with `history` also the last events before now."""
        return Subscription(self._inner.events(history=history, timeout_s=timeout_s))

    def call(self, method: methods.Method[P, A], params: P) -> A:
        """Asks the gateway for any method of `armada.methods`."""
        return run(self._inner.call(method, params))

    def execute_trajectory(
        self,
        trajectory: JointTrajectory,
        *,
        motion_id: UUID | None = None,
        set_mode: bool = True,
    ) -> Motion[CellMotionStatus]:
        """Follows a trajectory with several robots that start at one instant.

        Joints are named `robot/joint`. Robots are put into mode `trajectory` first, unless
        `set_mode` is off.
        """
        inner = self._inner.execute_trajectory(trajectory, motion_id=motion_id, set_mode=set_mode)
        return Motion(run(inner))

    def move(
        self,
        goals: Mapping[str, ArrayLike],
        *,
        speed: float = 0.3,
        duration_s: float | None = None,
        wait: bool = True,
    ) -> Motion[CellMotionStatus]:
        """Moves several robots together from where they stand to a position of all their joints.

        `goals` has for each robot one number per joint [rad or m]. All start and arrive together;
        `speed` is the share of every joint's limits of velocity and acceleration that the slowest
        joint uses, or `duration_s` says how long it takes. With `wait` it returns when the robots
        are there, raises `MotionFailed` if they do not come there, and cancels the motion if the
        waiting is interrupted.
        """
        return Motion(run(self._inner.move(goals, speed=speed, duration_s=duration_s, wait=wait)))

    def cancel(self, motion_id: UUID) -> None:
        """Ends a motion of several robots, each with a ramp to standstill."""
        run(self._inner.cancel(motion_id))

    def motion(self, motion_id: UUID) -> Motion[CellMotionStatus]:
        """A motion of several robots by its identity."""
        return Motion(self._inner.motion(motion_id))

    def stop(
        self,
        reason: str = "",
        *,
        level: StopLevel = StopLevel.L2,
        timeout_s: float = STOP_TIMEOUT_S,
    ) -> StopReport:
        """Stops every robot, gateway alive or not, and waits until they are measured to stand.

        The report's verdict is `complete` only if every robot of the cell and every robot on the
        bus stands still. Robots stay stopped until `reset`.
        """
        return run(self._inner.stop(reason, level=level, timeout_s=timeout_s))

    def reset(self, robots: Collection[str] = ()) -> CellResetAnswer:
        """Clears the latched stops of these robots, or of all; never moves, never enables."""
        return run(self._inner.reset(robots))
