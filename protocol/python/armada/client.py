"""The blocking API: that of `armada.aio`, with the waiting done by the thread that calls."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from types import TracebackType
from typing import TypeVar
from uuid import UUID

from numpy.typing import ArrayLike

from . import aio, methods
from ._blocking.leases import HeldLeases
from ._blocking.motion import Motion
from ._blocking.opened import opened
from ._blocking.robot import Robot
from ._blocking.subscription import Subscription
from ._connection import DEFAULT_NAME, STOP_TIMEOUT_S, Connection, ConnectOptions
from ._waiting import ThreadWaiting, run
from .errors import LeaseLost
from .messages import (
    CellFrames,
    CellInfo,
    CellMotionStatus,
    CellResetAnswer,
    CellStatus,
    ClearanceAnswer,
    Coupling,
    Event,
    JointTrajectory,
    LeaseLoss,
    MotionStatus,
    Role,
    StopLevel,
    StopReport,
)
from .stop_source import StopSource

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
        """The audit trail of the cell; with `history` also the last events before now.

        Every robot's events and the gateway's own, in one stream with one numbering.
        """
        return Subscription(self._inner.events(history=history, timeout_s=timeout_s))

    def call(self, method: methods.Method[P, A], params: P) -> A:
        """Asks the gateway for any method of `armada.methods`."""
        return run(self._inner.call(method, params))

    def leases(
        self,
        robots: Collection[str] = (),
        ttl_s: float = 1.0,
        *,
        role: Role = Role.PROGRAM,
        on_lost: Callable[[LeaseLost], None] | None = None,
    ) -> HeldLeases:
        """Acquires the right to command several robots, all or none, and keeps it.

        To be used in a `with`; all robots of the cell if none is named. The agents are asked, so it
        holds without the gateway. `ttl_s` is how long it lasts, 0.2 to 60 s, when this program does
        not renew it any more. What is asked of these robots meanwhile, alone or together, is asked
        under it. Raises `DeniedError` naming robot and holder if somebody else has one,
        `ValueError` if one is held already.
        """
        opening = self._inner.leases(robots, ttl_s, role=role, on_lost=on_lost)
        return HeldLeases(run(opened(opening)))

    def execute_trajectory(
        self,
        trajectory: JointTrajectory,
        *,
        motion_id: UUID | None = None,
        set_mode: bool = True,
        coupling: Coupling = Coupling.TIME_SYNCED,
        on_lease_loss: LeaseLoss = "stop_on_path",
        model_revs: Mapping[str, int] | None = None,
    ) -> Motion[CellMotionStatus]:
        """Follows a trajectory with several robots that start at one instant.

        Joints are named `robot/joint`. Robots are put into mode `trajectory` first, unless
        `set_mode` is off. `coupling` says how closely they are tied together, `on_lease_loss` what
        the whole does if a lease is lost on the way; with `model_revs` it is refused if a robot's
        tools and payloads are not those any more. Raises `LeaseLost` if the lease of a robot that
        takes part was lost.
        """
        inner = self._inner.execute_trajectory(
            trajectory,
            motion_id=motion_id,
            set_mode=set_mode,
            coupling=coupling,
            on_lease_loss=on_lease_loss,
            model_revs=model_revs,
        )
        return Motion(run(inner))

    def move(
        self,
        goals: Mapping[str, ArrayLike],
        *,
        speed: float = 0.3,
        duration_s: float | None = None,
        wait: bool = True,
        coupling: Coupling = Coupling.TIME_SYNCED,
        on_lease_loss: LeaseLoss = "stop_on_path",
    ) -> Motion[CellMotionStatus]:
        """Moves several robots together from where they stand to a position of all their joints.

        `goals` has for each robot one number per joint [rad or m]. All start and arrive together;
        `speed` is the share of every joint's limits of velocity and acceleration that the slowest
        joint uses, or `duration_s` says how long it takes. With `wait` it returns when the robots
        are there, raises `MotionFailed` if they do not come there, and cancels the motion if the
        waiting is interrupted. `coupling` and `on_lease_loss` are those of `execute_trajectory`.
        """
        inner = self._inner.move(
            goals,
            speed=speed,
            duration_s=duration_s,
            wait=wait,
            coupling=coupling,
            on_lease_loss=on_lease_loss,
        )
        return Motion(run(inner))

    def cancel(self, motion_id: UUID) -> None:
        """Ends a motion of several robots, each with a ramp to standstill."""
        run(self._inner.cancel(motion_id))

    def pause(self, motion_id: UUID) -> None:
        """Brings a motion of several robots to rest at one phase, until it is resumed."""
        run(self._inner.pause(motion_id))

    def resume(self, motion_id: UUID) -> None:
        """Goes on with a paused motion of several robots."""
        run(self._inner.resume(motion_id))

    def set_speed_ratio(self, motion_id: UUID, ratio: float) -> float:
        """Changes the speed of a motion of several robots; returns the ratio in force.

        It is the speed over that of the trajectory, 0.01 to 1, and holds for all later motions of
        its robots as well, until it is changed again.
        """
        return run(self._inner.set_speed_ratio(motion_id, ratio))

    def check_clearance(
        self, trajectory: JointTrajectory, *, offset_ms: float = 0.0
    ) -> ClearanceAnswer:
        """How near the robots come to each other on a trajectory; nothing moves.

        Joints are named `robot/joint`. With `offset_ms` the phases of two robots may be so far
        apart, and what lies between is checked as well.
        """
        return run(self._inner.check_clearance(trajectory, offset_ms=offset_ms))

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

    def reset(
        self, robots: Collection[str] = (), *, key_file: str | Path | None = None
    ) -> CellResetAnswer:
        """Clears the latched stops of these robots, or of all; never moves, never enables.

        Robots that ask for a signature get one made with the key in `key_file`. What a robot
        refused, and why, is in the answer.
        """
        return run(self._inner.reset(robots, key_file=key_file))

    def stop_source(
        self, name: str, read: Callable[[], bool], *, key_file: str | Path | None = None
    ) -> StopSource:
        """Becomes a source of stops: tells agents that ask for it whether it is pressed.

        `read` looks at the real input, for each question anew; while nobody answers the robots
        stop. See `StopSource`; to be used in a `with`.
        """
        return self._inner.stop_source(name, read, key_file=key_file)
