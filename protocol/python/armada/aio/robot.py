"""One robot, as asyncio calls."""

from __future__ import annotations

from collections.abc import Collection
from typing import TypeVar
from uuid import UUID

from numpy.typing import ArrayLike

from armada import keys, methods
from armada._bus import RETRY_PAUSE_S, VALUE_TIMEOUT_S
from armada._connection import STOP_TIMEOUT_S, Connection
from armada._ids import new_id
from armada.errors import DeniedError
from armada.messages import (
    Accepted,
    CancelParams,
    ClockSample,
    CommandMode,
    CommitParams,
    DenialCode,
    Empty,
    Event,
    ExecuteTrajectoryParams,
    HaltAnswer,
    JogFreespaceParams,
    JointState,
    JointTrajectory,
    ModeAnswer,
    MotionStatus,
    Prepared,
    PrepareParams,
    ResetAnswer,
    ResetParams,
    RobotInfo,
    RobotState,
    RobotStatus,
    SetModeParams,
    StopLevel,
    StopReport,
    StopScopeRobots,
    joint_vector,
)
from armada.moves import check_speed

from .latest import LatestState
from .motion import Motion, cancelled_if_interrupted
from .subscription import Subscription

P = TypeVar("P")
A = TypeVar("A")

_SETTLE_S = 5.0
"""How long a robot may take to come to rest before its mode is changed."""


class Robot:
    """One robot of a cell."""

    def __init__(self, connection: Connection, name: str) -> None:
        self._connection = connection
        self._bus = connection.bus
        self.name = name
        """Its name in the cell."""
        self._latest: LatestState | None = None

    async def call(self, method: methods.Method[P, A], params: P) -> A:
        """Asks the robot's agent for any method of `armada.methods`."""
        return await self._bus.call(method, keys.ROBOT_RPC.with_(self.name, method.name), params)

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
        if self._latest is None:
            self._latest = LatestState(self._bus, self.name)
        return await self._latest.read(timeout_s)

    def states(self, timeout_s: float | None = None) -> Subscription[RobotState]:
        """States as they come; a slow reader gets the newest and none in between."""
        return Subscription(self._bus, keys.ROBOT_STATE.of(self.name), RobotState, 1, timeout_s)

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

    async def enable(self) -> ModeAnswer:
        """Switches the drives on; returns when the controller reports them on."""
        return await self.call(methods.ENABLE, Empty())

    async def disable(self) -> ModeAnswer:
        """Ramps to standstill and switches the drives off."""
        return await self.call(methods.DISABLE, Empty())

    async def reset_errors(self) -> ModeAnswer:
        """Clears latched faults whose cause is gone, here and at the controller."""
        return await self.call(methods.RESET_ERRORS, Empty())

    async def reset(self, stop_ids: Collection[UUID] | None = None) -> ResetAnswer:
        """Clears the latched stop; never moves, never enables.

        `stop_ids` must list every latched stop; if left out, those of the status are taken.
        """
        if stop_ids is None:
            latch = (await self.status()).stop
            stop_ids = () if latch is None else [stop.stop_id for stop in latch.stops]
        return await self.call(methods.RESET, ResetParams(stop_ids=tuple(stop_ids)))

    async def jog_freespace(
        self,
        joint_position_rad: ArrayLike,
        *,
        max_velocity_rad_s: ArrayLike | None = None,
        motion_id: UUID | None = None,
    ) -> Motion[MotionStatus]:
        """Moves all joints to a position, in mode `jog`; a new goal replaces the old one."""
        slow = max_velocity_rad_s
        params = JogFreespaceParams(
            motion_id=motion_id or new_id(),
            joint_position_rad=joint_vector(joint_position_rad, "joint_position_rad"),
            max_velocity_rad_s=None if slow is None else joint_vector(slow, "max_velocity_rad_s"),
        )
        accepted = await self.call(methods.JOG_FREESPACE, params)
        return self._motion(accepted.motion_id, accepted)

    async def move_joints(
        self, joint_position_rad: ArrayLike, *, speed: float = 0.3, wait: bool = True
    ) -> Motion[MotionStatus]:
        """Moves all joints to a position [rad or m], entering mode `jog` first where needed.

        `speed` is the share of every joint's velocity limit. With `wait` it returns when the
        robot is there, raises `MotionFailed` if it does not come there, and cancels the motion if
        the waiting is interrupted.
        """
        check_speed(speed)
        goal = joint_vector(joint_position_rad, "joint_position_rad")
        info = await self.info()
        slow = [speed * joint.limits.velocity for joint in info.joints]
        await self.enter_mode(CommandMode.JOG)
        motion_id = new_id()
        motion = await cancelled_if_interrupted(
            self._bus,
            self.jog_freespace(goal, max_velocity_rad_s=slow, motion_id=motion_id),
            lambda: self.cancel(motion_id),
        )
        if wait:
            await motion.arrive()
        return motion

    async def execute_trajectory(
        self,
        trajectory: JointTrajectory,
        *,
        motion_id: UUID | None = None,
        set_mode: bool = True,
    ) -> Motion[MotionStatus]:
        """Follows a trajectory at once; it names every joint of the robot.

        The robot is put into mode `trajectory` first, unless `set_mode` is off.
        """
        if set_mode:
            await self.enter_mode(CommandMode.TRAJECTORY)
        params = ExecuteTrajectoryParams(motion_id=motion_id or new_id(), trajectory=trajectory)
        accepted = await self.call(methods.EXECUTE_TRAJECTORY, params)
        return self._motion(accepted.motion_id, accepted)

    async def prepare(
        self, trajectory: JointTrajectory, *, motion_id: UUID | None = None
    ) -> Prepared:
        """Has a trajectory validated and kept for `commit`."""
        params = PrepareParams(motion_id=motion_id or new_id(), trajectory=trajectory)
        return await self.call(methods.PREPARE, params)

    async def commit(self, motion_id: UUID, boot_id: UUID, start_ns: int) -> Motion[MotionStatus]:
        """Starts a prepared trajectory at an instant of the agent's clock, of which see `clock`."""
        params = CommitParams(motion_id=motion_id, boot_id=boot_id, start_ns=start_ns)
        accepted = await self.call(methods.COMMIT, params)
        return self._motion(accepted.motion_id, accepted)

    async def abort(self, motion_id: UUID) -> None:
        """Forgets a prepared trajectory, or ends it with a ramp if it runs."""
        await self.call(methods.ABORT, CancelParams(motion_id=motion_id))

    async def cancel(self, motion_id: UUID) -> None:
        """Ends a motion with a ramp to standstill; the mode stays."""
        await self.call(methods.CANCEL, CancelParams(motion_id=motion_id))

    def motion(self, motion_id: UUID) -> Motion[MotionStatus]:
        """A motion of this robot by its identity."""
        return self._motion(motion_id, None)

    def _motion(self, motion_id: UUID, accepted: Accepted | None) -> Motion[MotionStatus]:
        key = keys.ROBOT_MOTION.with_(self.name, str(motion_id))
        return Motion(
            self._bus, key, MotionStatus, motion_id, accepted, lambda: self.cancel(motion_id)
        )

    async def stop(
        self,
        reason: str = "",
        *,
        level: StopLevel = StopLevel.L2,
        timeout_s: float = STOP_TIMEOUT_S,
    ) -> StopReport:
        """Stops this robot, gateway alive or not, and waits until it is measured to stand still.

        It stays stopped until `reset`.
        """
        scope = StopScopeRobots(robots=(self.name,))
        return await self._connection.stop(scope, reason, level, timeout_s)
