"""The cell, as asyncio calls."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import TracebackType
from typing import TypeVar
from uuid import UUID

from numpy.typing import ArrayLike

from armada import keys, methods
from armada._connection import STOP_TIMEOUT_S, Connection
from armada._ids import new_id
from armada.errors import NoReply
from armada.messages import (
    Accepted,
    CancelParams,
    CellExecuteTrajectory,
    CellFrames,
    CellInfo,
    CellMotionStatus,
    CellResetAnswer,
    CellResetParams,
    CellStatus,
    CommandMode,
    Event,
    JointTrajectory,
    StopLevel,
    StopReport,
)
from armada.moves import Part, cell_move, check_speed

from .motion import Motion, cancelled_if_interrupted
from .robot import Robot
from .subscription import Subscription

P = TypeVar("P")
A = TypeVar("A")


class Cell:
    """A connection to a cell."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._bus = connection.bus
        self._robots: dict[str, Robot] = {}

    async def __aenter__(self) -> Cell:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Closes the connection; motions in progress go on."""
        await self._bus.close()

    def robot(self, name: str) -> Robot:
        """The robot of this name, be it there or not; raises `ValueError` if it is no name."""
        if name not in self._robots:
            self._robots[name] = Robot(self._connection, keys.check_robot_name(name))
        return self._robots[name]

    async def robots(self) -> list[str]:
        """Names of the cell's robots in the order of the cell file, be they there or not.

        If the gateway does not answer, those that are on the bus.
        """
        try:
            return [robot.robot for robot in (await self.info()).robots]
        except NoReply:
            return await self.robots_alive()

    async def robots_alive(self) -> list[str]:
        """Names of the robots whose agents are on the bus now, in order of the alphabet."""
        return await self._bus.robots_alive()

    async def info(self) -> CellInfo:
        """The robots of the cell and where they stand."""
        return await self._connection.cell_info()

    async def status(self) -> CellStatus:
        """Condition of every robot and the cell's verdict."""
        return await self._bus.value(CellStatus, keys.CELL_STATUS.any())

    def statuses(self, timeout_s: float | None = None) -> Subscription[CellStatus]:
        """The cell's status on change and once a second; see `Subscription` for `timeout_s`."""
        return Subscription(self._bus, keys.CELL_STATUS.any(), CellStatus, 16, timeout_s)

    def frames(self, timeout_s: float | None = None) -> Subscription[CellFrames]:
        """World poses of the links that moved, at 30 Hz; all links once a second."""
        return Subscription(self._bus, keys.CELL_FRAMES.any(), CellFrames, 64, timeout_s)

    def events(
        self, *, history: bool = False, timeout_s: float | None = None
    ) -> Subscription[Event]:
        """The gateway's audit trail; with `history` also the last events before now."""
        key = keys.CELL_EVENTS.any()
        return Subscription(self._bus, key, Event, 1024, timeout_s, recover=True, history=history)

    async def call(self, method: methods.Method[P, A], params: P) -> A:
        """Asks the gateway for any method of `armada.methods`."""
        return await self._bus.call(method, keys.CELL_RPC.with_(method.name), params)

    async def execute_trajectory(
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
        if set_mode:
            for robot in sorted({name.partition("/")[0] for name in trajectory.joint_names}):
                await self.robot(robot).enter_mode(CommandMode.TRAJECTORY)
        params = CellExecuteTrajectory(motion_id=motion_id or new_id(), trajectory=trajectory)
        accepted = await self.call(methods.CELL_EXECUTE_TRAJECTORY, params)
        return self._motion(accepted.motion_id, accepted)

    async def move(
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
        check_speed(speed)
        parts = []
        for name, goal in goals.items():
            robot = self.robot(name)
            info = await robot.info()
            await robot.enter_mode(CommandMode.TRAJECTORY)
            parts.append(Part.from_state(info, await robot.state(), goal))
        trajectory = cell_move(parts, speed, duration_s)
        motion_id = new_id()
        motion = await cancelled_if_interrupted(
            self._bus,
            self.execute_trajectory(trajectory, motion_id=motion_id, set_mode=False),
            lambda: self.cancel(motion_id),
        )
        if wait:
            await motion.arrive()
        return motion

    async def cancel(self, motion_id: UUID) -> None:
        """Ends a motion of several robots, each with a ramp to standstill."""
        await self.call(methods.CELL_CANCEL, CancelParams(motion_id=motion_id))

    def motion(self, motion_id: UUID) -> Motion[CellMotionStatus]:
        """A motion of several robots by its identity."""
        return self._motion(motion_id, None)

    def _motion(self, motion_id: UUID, accepted: Accepted | None) -> Motion[CellMotionStatus]:
        key = keys.CELL_MOTION.with_(str(motion_id))
        return Motion(
            self._bus, key, CellMotionStatus, motion_id, accepted, lambda: self.cancel(motion_id)
        )

    async def stop(
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
        return await self._connection.stop("cell", reason, level, timeout_s)

    async def reset(self, robots: Collection[str] = ()) -> CellResetAnswer:
        """Clears the latched stops of these robots, or of all; never moves, never enables."""
        return await self.call(methods.CELL_RESET, CellResetParams(robots=tuple(robots)))
