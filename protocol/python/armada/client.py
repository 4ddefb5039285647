"""The blocking API: that of `armada.aio`, with the waiting done by the thread that calls."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Collection, Iterator, Mapping
from types import TracebackType
from typing import Generic, TypeVar
from uuid import UUID

from numpy.typing import ArrayLike

from . import aio, methods
from ._bus import VALUE_TIMEOUT_S
from ._connection import DEFAULT_NAME, STOP_TIMEOUT_S, Connection, ConnectOptions
from ._waiting import ThreadWaiting, run
from .errors import NotConnected
from .messages import (
    Accepted,
    CellFrames,
    CellInfo,
    CellMotionStatus,
    CellResetAnswer,
    CellStatus,
    ClockSample,
    CommandMode,
    Event,
    HaltAnswer,
    JointState,
    JointTrajectory,
    ModeAnswer,
    MotionStatus,
    Prepared,
    ResetAnswer,
    RobotInfo,
    RobotState,
    RobotStatus,
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


class Robot:
    """One robot of a cell."""

    def __init__(self, inner: aio.Robot) -> None:
        self._inner = inner
        self.name = inner.name
        """Its name in the cell."""

    def call(self, method: methods.Method[P, A], params: P) -> A:
        """Asks the robot's agent for any method of `armada.methods`."""
        return run(self._inner.call(method, params))

    def info(self) -> RobotInfo:
        """What the robot is: joints, limits, abilities, URDF."""
        return run(self._inner.info())

    def status(self) -> RobotStatus:
        """How the robot is: mode, stops, faults, and what may be done next."""
        return run(self._inner.status())

    def clock(self) -> ClockSample:
        """A sample of the clock of the robot's agent."""
        return run(self._inner.clock())

    def state(self, timeout_s: float = VALUE_TIMEOUT_S) -> RobotState:
        """The newest state; waits for one if none has come lately.

        Raises `RequestTimeout` if none comes, rather than returning an old one. The first call
        subscribes, the others look at what has come.
        """
        return run(self._inner.state(timeout_s))

    def states(self, timeout_s: float | None = None) -> Subscription[RobotState]:
        """States as they come; a slow reader gets the newest and none in between."""
        return Subscription(self._inner.states(timeout_s))

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

    def enable(self) -> ModeAnswer:
        """Switches the drives on; returns when the controller reports them on."""
        return run(self._inner.enable())

    def disable(self) -> ModeAnswer:
        """Ramps to standstill and switches the drives off."""
        return run(self._inner.disable())

    def reset_errors(self) -> ModeAnswer:
        """Clears latched faults whose cause is gone, here and at the controller."""
        return run(self._inner.reset_errors())

    def reset(self, stop_ids: Collection[UUID] | None = None) -> ResetAnswer:
        """Clears the latched stop; never moves, never enables.

        `stop_ids` must list every latched stop; if left out, those of the status are taken.
        """
        return run(self._inner.reset(stop_ids))

    def jog_freespace(
        self,
        joint_position_rad: ArrayLike,
        *,
        max_velocity_rad_s: ArrayLike | None = None,
        motion_id: UUID | None = None,
    ) -> Motion[MotionStatus]:
        """Moves all joints to a position, in mode `jog`; a new goal replaces the old one."""
        inner = self._inner.jog_freespace(
            joint_position_rad, max_velocity_rad_s=max_velocity_rad_s, motion_id=motion_id
        )
        return Motion(run(inner))

    def move_joints(
        self, joint_position_rad: ArrayLike, *, speed: float = 0.3, wait: bool = True
    ) -> Motion[MotionStatus]:
        """Moves all joints to a position [rad or m], entering mode `jog` first where needed.

        `speed` is the share of every joint's velocity limit. With `wait` it returns when the
        robot is there, raises `MotionFailed` if it does not come there, and cancels the motion if
        the waiting is interrupted.
        """
        return Motion(run(self._inner.move_joints(joint_position_rad, speed=speed, wait=wait)))

    def execute_trajectory(
        self,
        trajectory: JointTrajectory,
        *,
        motion_id: UUID | None = None,
        set_mode: bool = True,
    ) -> Motion[MotionStatus]:
        """Follows a trajectory at once; it names every joint of the robot.

        The robot is put into mode `trajectory` first, unless `set_mode` is off.
        """
        inner = self._inner.execute_trajectory(trajectory, motion_id=motion_id, set_mode=set_mode)
        return Motion(run(inner))

    def prepare(self, trajectory: JointTrajectory, *, motion_id: UUID | None = None) -> Prepared:
        """Has a trajectory validated and kept for `commit`."""
        return run(self._inner.prepare(trajectory, motion_id=motion_id))

    def commit(self, motion_id: UUID, boot_id: UUID, start_ns: int) -> Motion[MotionStatus]:
        """Starts a prepared trajectory at an instant of the agent's clock, of which see `clock`."""
        return Motion(run(self._inner.commit(motion_id, boot_id, start_ns)))

    def abort(self, motion_id: UUID) -> None:
        """Forgets a prepared trajectory, or ends it with a ramp if it runs."""
        run(self._inner.abort(motion_id))

    def cancel(self, motion_id: UUID) -> None:
        """Ends a motion with a ramp to standstill; the mode stays."""
        run(self._inner.cancel(motion_id))

    def motion(self, motion_id: UUID) -> Motion[MotionStatus]:
        """A motion of this robot by its identity."""
        return Motion(self._inner.motion(motion_id))

    def stop(
        self,
        reason: str = "",
        *,
        level: StopLevel = StopLevel.L2,
        timeout_s: float = STOP_TIMEOUT_S,
    ) -> StopReport:
        """Stops this robot, gateway alive or not, and waits until it is measured to stand still.

        It stays stopped until `reset`.
        """
        return run(self._inner.stop(reason, level=level, timeout_s=timeout_s))


class Motion(Generic[S]):
    """A motion that was accepted: of one robot, or of several."""

    def __init__(self, inner: aio.Motion[S]) -> None:
        self._inner = inner
        self.id: UUID = inner.id
        """Its identity."""
        self.accepted: Accepted | None = inner.accepted
        """What the agent or gateway said when it took it; None if found by its identity."""

    def status(self) -> S:
        """Where it stands; also for some time after its end."""
        return run(self._inner.status())

    def cancel(self) -> None:
        """Ends it with a ramp to standstill."""
        run(self._inner.cancel())

    def wait(self, timeout_s: float | None = None) -> S:
        """Waits for its end and returns the terminal status, good or bad.

        Raises `RequestTimeout` if it has not ended after `timeout_s`, `NoReply` if the agent or
        gateway is gone.
        """
        return run(self._inner.wait(timeout_s))

    def arrive(self) -> S:
        """Waits until it is complete; raises `MotionFailed` if it ends otherwise.

        When the waiting is interrupted, the motion is cancelled. Other errors as in `wait`.
        """
        return run(self._inner.arrive())

    def progress(self, timeout_s: float | None = None) -> Iterator[S]:
        """Yields each new status, the terminal one last; errors as in `wait`."""
        return _iterate(self._inner.progress(timeout_s))


class Subscription(Generic[T]):
    """Messages as they come, from the moment it is made; to be iterated over with `for`.

    Of more messages than it has room for it drops the oldest. With `timeout_s` a silence of that
    length raises `RequestTimeout`; without, it waits for ever. A message that cannot be read raises
    `CodecError`. After both the iteration can go on. It ends when it or the connection is closed.
    """

    def __init__(self, inner: aio.Subscription[T]) -> None:
        self._inner = inner
        self.key: str = inner.key
        """Key that is listened to."""

    def next(self, timeout_s: float | None = None) -> T:
        """Waits for the next message; `timeout_s` overrides that of the subscription.

        Raises `RequestTimeout`, `CodecError`, or `NotConnected` when closed.
        """
        return run(self._inner.next(timeout_s))

    def try_next(self) -> T | None:
        """The next message if one has come already; raises `CodecError`."""
        return self._inner.try_next()

    def close(self) -> None:
        """Ends it; closing twice does nothing."""
        self._inner.close()

    def __iter__(self) -> Subscription[T]:
        return self

    def __next__(self) -> T:
        try:
            return self.next()
        except NotConnected:
            raise StopIteration from None

    def __enter__(self) -> Subscription[T]:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


async def _step(source: AsyncGenerator[T, None]) -> list[T]:
    try:
        return [await source.__anext__()]
    except StopAsyncIteration:
        return []


def _iterate(source: AsyncGenerator[T, None]) -> Iterator[T]:
    try:
        while item := run(_step(source)):
            yield item[0]
    finally:
        run(_end(source))


async def _end(source: AsyncGenerator[T, None]) -> None:
    await source.aclose()
