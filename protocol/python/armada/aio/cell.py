"""The cell, as asyncio calls."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from types import TracebackType
from typing import TypeVar
from uuid import UUID

from numpy.typing import ArrayLike

from armada import keys, methods
from armada._connection import STOP_TIMEOUT_S, Connection
from armada._ids import new_id
from armada._signature import SigningKey, reset_params
from armada.errors import LeaseLost, NoReply, RequestTimeout
from armada.messages import (
    Accepted,
    CancelParams,
    CellExecuteTrajectory,
    CellFrames,
    CellInfo,
    CellMotionStatus,
    CellResetAnswer,
    CellResetParams,
    CellSpeedRatioParams,
    CellStatus,
    CheckClearanceParams,
    ClearanceAnswer,
    CommandMode,
    Coupling,
    Event,
    JointTrajectory,
    LeaseLoss,
    MotionParams,
    ResetParams,
    Role,
    StopLatch,
    StopLevel,
    StopReport,
)
from armada.moves import Part, cell_move, check_speed
from armada.stop_source import StopSource

from .leases import HeldLeases, acquire_all
from .motion import Motion, cancelled_if_interrupted
from .opening import Opening
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
        """The audit trail of the cell; with `history` also the last events before now.

        Every robot's events and the gateway's own, in one stream with one numbering.
        """
        key = keys.CELL_EVENTS.any()
        return Subscription(self._bus, key, Event, 1024, timeout_s, recover=True, history=history)

    async def call(self, method: methods.Method[P, A], params: P) -> A:
        """Asks the gateway for any method of `armada.methods`."""
        return await self._bus.call(method, keys.CELL_RPC.with_(method.name), params)

    def leases(
        self,
        robots: Collection[str] = (),
        ttl_s: float = 1.0,
        *,
        role: Role = Role.PROGRAM,
        on_lost: Callable[[LeaseLost], None] | None = None,
    ) -> Opening[HeldLeases]:
        """Acquires the right to command several robots, all or none, and keeps it.

        To be used in a `with`; all robots of the cell if none is named. The agents are asked, so it
        holds without the gateway. `ttl_s` is how long it lasts, 0.2 to 60 s, when this program does
        not renew it any more. What is asked of these robots meanwhile, alone or together, is asked
        under it. Raises `DeniedError` naming robot and holder if somebody else has one,
        `ValueError` if one is held already.
        """

        async def acquire() -> HeldLeases:
            named = [keys.check_robot_name(robot) for robot in robots] or await self.robots()
            return await acquire_all(self._connection, named, ttl_s, role, on_lost)

        return Opening(acquire)

    async def execute_trajectory(
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
        robots = sorted({name.partition("/")[0] for name in trajectory.joint_names})
        leases = self._leases_of(robots)
        if set_mode:
            for robot in robots:
                await self.robot(robot).enter_mode(CommandMode.TRAJECTORY)
        params = CellExecuteTrajectory(
            motion_id=motion_id or new_id(),
            trajectory=trajectory,
            coupling=coupling,
            leases=leases,
            on_lease_loss=on_lease_loss,
            model_revs=dict(model_revs or {}),
        )
        accepted = await self.call(methods.CELL_EXECUTE_TRAJECTORY, params)
        return self._motion(accepted.motion_id, accepted)

    async def move(
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
            self.execute_trajectory(
                trajectory,
                motion_id=motion_id,
                set_mode=False,
                coupling=coupling,
                on_lease_loss=on_lease_loss,
            ),
            lambda: self.cancel(motion_id),
        )
        if wait:
            await motion.arrive()
        return motion

    async def cancel(self, motion_id: UUID) -> None:
        """Ends a motion of several robots, each with a ramp to standstill."""
        await self.call(methods.CELL_CANCEL, CancelParams(motion_id=motion_id))

    async def pause(self, motion_id: UUID) -> None:
        """Brings a motion of several robots to rest at one phase, until it is resumed."""
        await self._control(methods.CELL_PAUSE, motion_id, MotionParams(motion_id=motion_id))

    async def resume(self, motion_id: UUID) -> None:
        """Goes on with a paused motion of several robots."""
        await self._control(methods.CELL_RESUME, motion_id, MotionParams(motion_id=motion_id))

    async def set_speed_ratio(self, motion_id: UUID, ratio: float) -> float:
        """Changes the speed of a motion of several robots; returns the ratio in force.

        It is the speed over that of the trajectory, 0.01 to 1, and holds for all later motions of
        its robots as well, until it is changed again.
        """
        params = CellSpeedRatioParams(motion_id=motion_id, ratio=ratio)
        answer = await self._control(methods.CELL_SET_SPEED_RATIO, motion_id, params)
        return answer.speed_ratio

    async def check_clearance(
        self, trajectory: JointTrajectory, *, offset_ms: float = 0.0
    ) -> ClearanceAnswer:
        """How near the robots come to each other on a trajectory; nothing moves.

        Joints are named `robot/joint`. With `offset_ms` the phases of two robots may be so far
        apart, and what lies between is checked as well.
        """
        params = CheckClearanceParams(trajectory=trajectory, offset_ms=offset_ms)
        return await self.call(methods.CELL_CHECK_CLEARANCE, params)

    def motion(self, motion_id: UUID) -> Motion[CellMotionStatus]:
        """A motion of several robots by its identity."""
        return self._motion(motion_id, None)

    def _motion(self, motion_id: UUID, accepted: Accepted | None) -> Motion[CellMotionStatus]:
        key = keys.CELL_MOTION.with_(str(motion_id))
        return Motion(
            self._bus,
            key,
            CellMotionStatus,
            motion_id,
            accepted,
            cancel=lambda: self.cancel(motion_id),
            pause=lambda: self.pause(motion_id),
            resume=lambda: self.resume(motion_id),
            set_speed=lambda ratio: self.set_speed_ratio(motion_id, ratio),
        )

    async def _control(self, method: methods.Method[P, A], motion_id: UUID, params: P) -> A:
        """Asks under a lease that is held here of one of the motion's robots, if there is one."""
        lease = None
        if self._connection.held:
            status = await self._bus.value(CellMotionStatus, keys.CELL_MOTION.with_(str(motion_id)))
            lease = next(iter(self._leases_of(status.parts).values()), None)
        return await self._bus.call(method, keys.CELL_RPC.with_(method.name), params, lease)

    def _leases_of(self, robots: Collection[str]) -> dict[str, UUID]:
        held = [lease for name in robots if (lease := self._connection.held.get(name)) is not None]
        for lease in held:
            lease.check()
        return {lease.robot: lease.id for lease in held}

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

    async def reset(
        self, robots: Collection[str] = (), *, key_file: str | Path | None = None
    ) -> CellResetAnswer:
        """Clears the latched stops of these robots, or of all; never moves, never enables.

        Robots that ask for a signature get one made with the key in `key_file`. What a robot
        refused, and why, is in the answer.
        """
        key = SigningKey.read(key_file)
        stops = {name: robot.stop for name, robot in (await self.status()).robots.items()}
        named = robots or [name for name, latch in stops.items() if latch is not None]
        resets = {name: await self._reset_of(name, stops.get(name), key) for name in named}
        return await self.call(methods.CELL_RESET, CellResetParams(resets=resets))

    async def _reset_of(
        self, name: str, latch: StopLatch | None, key: SigningKey | None
    ) -> ResetParams:
        if key is None or latch is None or not latch.reset.signed:
            return reset_params(latch, None)
        try:
            boot_id = (await self.robot(name).status()).boot_id
        except (NoReply, RequestTimeout):
            # The gateway says that it is not there, and the others are reset.
            return reset_params(latch, None)
        return key.signed(name, boot_id, reset_params(latch, None))

    def stop_source(
        self, name: str, read: Callable[[], bool], *, key_file: str | Path | None = None
    ) -> StopSource:
        """Becomes a source of stops: tells agents that ask for it whether it is pressed.

        `read` looks at the real input, for each question anew; while nobody answers the robots
        stop. See `StopSource`; to be used in a `with`.
        """
        return StopSource(self._bus, name, read, SigningKey.read(key_file))
