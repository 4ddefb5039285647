"""Motions that the robot's side plans: moves to a goal, jogs, homing."""

from __future__ import annotations

from collections.abc import Sequence
from uuid import UUID

from numpy.typing import ArrayLike

from armada import methods
from armada._ids import new_id
from armada.messages import (
    Accepted,
    ChainTwist,
    CommandMode,
    HomeMethod,
    HomeParams,
    JogCartesianParams,
    JogFrame,
    JogJointParams,
    MotionStatus,
    MoveHomeParams,
    MoveJointParams,
    MoveOptions,
    MovePoseParams,
    Pose,
    Twist,
    joint_vector,
)

from .jog import DEAD_MAN_S, Jogging
from .motion import Motion
from .opening import Opening
from .robot_motions import RobotMotions


class RobotMoves(RobotMotions):
    """Motions that the robot's side plans.

    With `wait` they return when the robot is there, raise `MotionFailed` if it does not come there,
    and cancel the motion if the waiting is interrupted.
    """

    async def move_joint(
        self,
        joint_position_rad: ArrayLike,
        *,
        options: MoveOptions | None = None,
        wait: bool = True,
    ) -> Motion[MotionStatus]:
        """Moves all joints to a position [rad or m], entering mode `trajectory` where needed.

        It can be queued and blended, where `move_joints` replaces the goal before.
        """
        motion_id = new_id()
        params = MoveJointParams(
            motion_id=motion_id,
            joint_position_rad=joint_vector(joint_position_rad, "joint_position_rad"),
            options=options or MoveOptions(),
        )
        await self.enter_mode(CommandMode.TRAJECTORY)
        return await self._begin(methods.MOVE_JOINT, params, motion_id, wait=wait)

    async def move_pose(
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
        return await self._to_pose(methods.MOVE_POSE, pose, chain, options, wait=wait)

    async def move_linear(
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
        return await self._to_pose(methods.MOVE_LINEAR, pose, chain, options, wait=wait)

    async def _to_pose(
        self,
        method: methods.Method[MovePoseParams, Accepted],
        pose: Pose,
        chain: str | None,
        options: MoveOptions | None,
        *,
        wait: bool,
    ) -> Motion[MotionStatus]:
        motion_id = new_id()
        params = MovePoseParams(
            motion_id=motion_id, chain=chain, pose=pose, options=options or MoveOptions()
        )
        await self.enter_mode(CommandMode.TRAJECTORY)
        return await self._begin(method, params, motion_id, wait=wait)

    async def move_home(
        self, *, options: MoveOptions | None = None, wait: bool = True
    ) -> Motion[MotionStatus]:
        """Moves all joints to the home positions of the robot file."""
        motion_id = new_id()
        params = MoveHomeParams(motion_id=motion_id, options=options or MoveOptions())
        await self.enter_mode(CommandMode.TRAJECTORY)
        return await self._begin(methods.MOVE_HOME, params, motion_id, wait=wait)

    async def home(
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
        motion_id = new_id()
        groups = tuple(tuple(group) for group in order)
        params = HomeParams(motion_id=motion_id, order=groups, method=method)
        await self.enter_mode(CommandMode.HOMING)
        return await self._begin(methods.HOME, params, motion_id, wait=wait)

    async def jog_joint(
        self, joint_velocity_rad_s: ArrayLike, timeout_s: float = DEAD_MAN_S, *, wait: bool = False
    ) -> Motion[MotionStatus]:
        """Moves joints at a speed [rad/s or m/s] for a time, 0.02 to 10 s, in mode `jog`."""
        motion_id = new_id()
        params = _jog_joint(motion_id, joint_velocity_rad_s, timeout_s)
        await self.enter_mode(CommandMode.JOG)
        return await self._begin(methods.JOG_JOINT, params, motion_id, wait=wait)

    async def jog_cartesian(
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
        motion_id = new_id()
        tool = ChainTwist(chain=chain, twist=Twist.of(twist), frame=frame)
        params = _jog_tool(motion_id, tool, timeout_s)
        await self.enter_mode(CommandMode.JOG)
        return await self._begin(methods.JOG_CARTESIAN, params, motion_id, wait=wait)

    def keep_jogging(self, joint_velocity_rad_s: ArrayLike) -> Opening[Jogging[ArrayLike]]:
        """Moves joints at a speed [rad/s or m/s] as long as a `with` lasts, in mode `jog`.

        `set` on what it gives changes the speed.
        """
        return Opening(lambda: self._keep_jogging(joint_velocity_rad_s))

    async def _keep_jogging(self, velocity: ArrayLike) -> Jogging[ArrayLike]:
        async def ask(motion_id: UUID, velocity: ArrayLike) -> Accepted:
            params = _jog_joint(motion_id, velocity, DEAD_MAN_S)
            return await self.call(methods.JOG_JOINT, params)

        motion = await self.jog_joint(velocity)
        return Jogging(self._bus, motion, velocity, ask)

    def keep_jogging_tool(
        self, chain: str, twist: Twist | ArrayLike, frame: JogFrame = JogFrame.BASE
    ) -> Opening[Jogging[Twist | ArrayLike]]:
        """Moves the tool of a chain at a speed as long as a `with` lasts, in mode `jog`.

        `set` on what it gives changes the speed.
        """
        return Opening(lambda: self._keep_jogging_tool(chain, twist, frame))

    async def _keep_jogging_tool(
        self, chain: str, twist: Twist | ArrayLike, frame: JogFrame
    ) -> Jogging[Twist | ArrayLike]:
        async def ask(motion_id: UUID, twist: Twist | ArrayLike) -> Accepted:
            tool = ChainTwist(chain=chain, twist=Twist.of(twist), frame=frame)
            return await self.call(methods.JOG_CARTESIAN, _jog_tool(motion_id, tool))

        motion = await self.jog_cartesian(chain, twist, frame=frame)
        return Jogging(self._bus, motion, twist, ask)


def _jog_joint(motion_id: UUID, velocity: ArrayLike, timeout_s: float) -> JogJointParams:
    return JogJointParams(
        motion_id=motion_id,
        joint_velocity_rad_s=joint_vector(velocity, "joint_velocity_rad_s"),
        timeout_s=timeout_s,
    )


def _jog_tool(
    motion_id: UUID, tool: ChainTwist, timeout_s: float = DEAD_MAN_S
) -> JogCartesianParams:
    return JogCartesianParams(motion_id=motion_id, chains=(tool,), timeout_s=timeout_s)
