"""Motions of a robot: trajectories, moves of joints, and what is done with them."""

from __future__ import annotations

from typing import TypeVar
from uuid import UUID

from numpy.typing import ArrayLike

from armada._waiting import run
from armada.messages import (
    JointTrajectory,
    LeaseLoss,
    MotionStatus,
    Prepared,
    Queue,
)

from .motion import Motion
from .robot_base import RobotBase

P = TypeVar("P")


class RobotMotions(RobotBase):
    """Motions of a robot."""

    def jog_freespace(
        self,
        joint_position_rad: ArrayLike,
        *,
        max_velocity_rad_s: ArrayLike | None = None,
        motion_id: UUID | None = None,
    ) -> Motion[MotionStatus]:
        """Moves all joints to a position, in mode `jog`; a new goal replaces the old one."""
        return Motion(
            run(
                self._inner.jog_freespace(
                    joint_position_rad, max_velocity_rad_s=max_velocity_rad_s, motion_id=motion_id
                )
            )
        )

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
        queue: Queue = Queue.REFUSE,
        on_lease_loss: LeaseLoss = "stop_on_path",
    ) -> Motion[MotionStatus]:
        """Follows a trajectory, at once or after those before it; it names every joint.

        The robot is put into mode `trajectory` first, unless `set_mode` is off. `queue` says what
        to do if a motion is in progress, `on_lease_loss` what if the lease is lost on the way.
        """
        return Motion(
            run(
                self._inner.execute_trajectory(
                    trajectory,
                    motion_id=motion_id,
                    set_mode=set_mode,
                    queue=queue,
                    on_lease_loss=on_lease_loss,
                )
            )
        )

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

    def pause(self, motion_id: UUID) -> None:
        """Brings a motion to rest on its path until it is resumed."""
        run(self._inner.pause(motion_id))

    def resume(self, motion_id: UUID) -> None:
        """Goes on with a paused motion."""
        run(self._inner.resume(motion_id))

    def set_speed_ratio(self, ratio: float) -> float:
        """Changes the speed of all motions, those in progress too; returns the ratio in force.

        It is the speed over what they were planned for, 0.01 to 1.
        """
        return run(self._inner.set_speed_ratio(ratio))

    def motion(self, motion_id: UUID) -> Motion[MotionStatus]:
        """A motion of this robot by its identity."""
        return Motion(self._inner.motion(motion_id))
