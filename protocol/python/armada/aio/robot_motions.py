"""Motions of a robot: trajectories, moves of joints, and what is done with them."""

from __future__ import annotations

from typing import TypeVar
from uuid import UUID

from numpy.typing import ArrayLike

from armada import keys, methods
from armada._ids import new_id
from armada.messages import (
    Accepted,
    CancelParams,
    CommandMode,
    CommitParams,
    ExecuteTrajectoryParams,
    JogFreespaceParams,
    JointTrajectory,
    LeaseLoss,
    MotionParams,
    MotionStatus,
    Prepared,
    PrepareParams,
    Queue,
    SpeedRatioParams,
    joint_vector,
)
from armada.moves import check_speed

from .motion import Motion, cancelled_if_interrupted
from .robot_base import RobotBase

P = TypeVar("P")


class RobotMotions(RobotBase):
    """Motions of a robot."""

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
        queue: Queue = Queue.REFUSE,
        on_lease_loss: LeaseLoss = "stop_on_path",
    ) -> Motion[MotionStatus]:
        """Follows a trajectory, at once or after those before it; it names every joint.

        The robot is put into mode `trajectory` first, unless `set_mode` is off. `queue` says what
        to do if a motion is in progress, `on_lease_loss` what if the lease is lost on the way.
        """
        if set_mode:
            await self.enter_mode(CommandMode.TRAJECTORY)
        params = ExecuteTrajectoryParams(
            motion_id=motion_id or new_id(),
            trajectory=trajectory,
            queue=queue,
            on_lease_loss=on_lease_loss,
        )
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

    async def pause(self, motion_id: UUID) -> None:
        """Brings a motion to rest on its path until it is resumed."""
        await self.call(methods.PAUSE, MotionParams(motion_id=motion_id))

    async def resume(self, motion_id: UUID) -> None:
        """Goes on with a paused motion."""
        await self.call(methods.RESUME, MotionParams(motion_id=motion_id))

    async def set_speed_ratio(self, ratio: float) -> float:
        """Changes the speed of all motions, those in progress too; returns the ratio in force.

        It is the speed over what they were planned for, 0.01 to 1.
        """
        return (await self.call(methods.SET_SPEED_RATIO, SpeedRatioParams(ratio=ratio))).speed_ratio

    def motion(self, motion_id: UUID) -> Motion[MotionStatus]:
        """A motion of this robot by its identity."""
        return self._motion(motion_id, None)

    def _motion(self, motion_id: UUID, accepted: Accepted | None) -> Motion[MotionStatus]:
        key = keys.ROBOT_MOTION.with_(self.name, str(motion_id))
        return Motion(
            self._bus,
            key,
            MotionStatus,
            motion_id,
            accepted,
            cancel=lambda: self.cancel(motion_id),
            pause=lambda: self.pause(motion_id),
            resume=lambda: self.resume(motion_id),
            set_speed=self.set_speed_ratio,
        )

    async def _begin(
        self, method: methods.Method[P, Accepted], params: P, motion_id: UUID, *, wait: bool
    ) -> Motion[MotionStatus]:
        """Asks for a motion, which is cancelled if that or the waiting is interrupted."""
        accepted = await cancelled_if_interrupted(
            self._bus, self.call(method, params), lambda: self.cancel(motion_id)
        )
        motion = self._motion(motion_id, accepted)
        if wait:
            await motion.arrive()
        return motion
