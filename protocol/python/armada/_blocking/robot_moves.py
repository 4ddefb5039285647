"""Motions that the robot's side plans: moves to a goal, jogs, homing."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from armada._waiting import run
from armada.aio.jog import DEAD_MAN_S
from armada.messages import (
    HomeMethod,
    JogFrame,
    MotionStatus,
    MoveOptions,
    Pose,
    Twist,
)

from .jog import Jogging
from .motion import Motion
from .opened import opened
from .robot_motions import RobotMotions


class RobotMoves(RobotMotions):
    """Motions that the robot's side plans.

    With `wait` they return when the robot is there, raise `MotionFailed` if it does not come there,
    and cancel the motion if the waiting is interrupted.
    """

    def move_joint(
        self,
        joint_position_rad: ArrayLike,
        *,
        options: MoveOptions | None = None,
        wait: bool = True,
    ) -> Motion[MotionStatus]:
        """Moves all joints to a position [rad or m], entering mode `trajectory` where needed.

        It can be queued and blended, where `move_joints` replaces the goal before.
        """
        return Motion(run(self._inner.move_joint(joint_position_rad, options=options, wait=wait)))

    def move_pose(
        self,
        pose: Pose,
        *,
        chain: str | None = None,
        options: MoveOptions | None = None,
        wait: bool = True,
    ) -> Motion[MotionStatus]:
        """Moves the tool to a pose in the chain's base link, the joints on the straight way.

        `chain` may be left out if there is one only.
        """
        return Motion(run(self._inner.move_pose(pose, chain=chain, options=options, wait=wait)))

    def move_linear(
        self,
        pose: Pose,
        *,
        chain: str | None = None,
        options: MoveOptions | None = None,
        wait: bool = True,
    ) -> Motion[MotionStatus]:
        """Moves the tool on a straight line to a pose in the chain's base link.

        `chain` may be left out if there is one only.
        """
        return Motion(run(self._inner.move_linear(pose, chain=chain, options=options, wait=wait)))

    def move_home(
        self, *, options: MoveOptions | None = None, wait: bool = True
    ) -> Motion[MotionStatus]:
        """Moves all joints to the home positions of the robot file."""
        return Motion(run(self._inner.move_home(options=options, wait=wait)))

    def home(
        self,
        order: Sequence[Sequence[str]] = (),
        *,
        method: HomeMethod = HomeMethod.CONTROLLER,
        wait: bool = True,
    ) -> Motion[MotionStatus]:
        """Homes joints, entering mode `homing` where needed.

        `order` has groups of joints by name, one after the other; all at the same time if it is
        empty.
        """
        return Motion(run(self._inner.home(order, method=method, wait=wait)))

    def jog_joint(
        self, joint_velocity_rad_s: ArrayLike, timeout_s: float = DEAD_MAN_S, *, wait: bool = False
    ) -> Motion[MotionStatus]:
        """Moves joints at a speed [rad/s or m/s] for a time, 0.02 to 10 s, in mode `jog`."""
        return Motion(run(self._inner.jog_joint(joint_velocity_rad_s, timeout_s, wait=wait)))

    def jog_cartesian(
        self,
        chain: str,
        twist: Twist | ArrayLike,
        timeout_s: float = DEAD_MAN_S,
        *,
        frame: JogFrame = JogFrame.BASE,
        wait: bool = False,
    ) -> Motion[MotionStatus]:
        """Moves the tool of a chain at a speed for a time, 0.02 to 10 s, in mode `jog`.

        `twist` may be six numbers: linear [m/s], then angular [rad/s], in the axes of `frame`.
        """
        return Motion(
            run(self._inner.jog_cartesian(chain, twist, timeout_s, frame=frame, wait=wait))
        )

    def keep_jogging(self, joint_velocity_rad_s: ArrayLike) -> Jogging[ArrayLike]:
        """Moves joints at a speed [rad/s or m/s] as long as a `with` lasts, in mode `jog`.

        `set` on what it gives changes the speed.
        """
        return Jogging[ArrayLike](run(opened(self._inner.keep_jogging(joint_velocity_rad_s))))

    def keep_jogging_tool(
        self, chain: str, twist: Twist | ArrayLike, frame: JogFrame = JogFrame.BASE
    ) -> Jogging[Twist | ArrayLike]:
        """Moves the tool of a chain at a speed as long as a `with` lasts, in mode `jog`.

        `set` on what it gives changes the speed.
        """
        return Jogging[Twist | ArrayLike](
            run(opened(self._inner.keep_jogging_tool(chain, twist, frame)))
        )
