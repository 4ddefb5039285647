"""Tools and payloads, signals and parameters, kinematics, recordings."""

from __future__ import annotations

from numpy.typing import ArrayLike

from armada._waiting import run
from armada.messages import (
    EquipmentAnswer,
    ForwardKinematicsAnswer,
    JointVector,
    PayloadInfo,
    Pose,
    RecordingAnswer,
    SignalValue,
    ToolInfo,
)

from .robot_base import RobotBase


class RobotEquipment(RobotBase):
    """Tools and payloads, signals and parameters, kinematics, recordings.

    `chain` may be left out wherever the robot has one only.
    """

    def attach_tool(self, tool: ToolInfo | str, *, chain: str | None = None) -> EquipmentAnswer:
        """Attaches a tool to a chain that has none: any tool, or one of the robot file by name."""
        return run(self._inner.attach_tool(tool, chain=chain))

    def detach_tool(self, name: str | None = None, *, chain: str | None = None) -> EquipmentAnswer:
        """Detaches the tool of a chain that holds no payload; with `name` only that one."""
        return run(self._inner.detach_tool(name, chain=chain))

    def attach_payload(
        self, payload: PayloadInfo, pose: Pose | None = None, *, chain: str | None = None
    ) -> EquipmentAnswer:
        """Attaches a payload to a chain with a tool; `pose` is in the tool centre point."""
        return run(self._inner.attach_payload(payload, pose, chain=chain))

    def detach_payload(
        self, name: str | None = None, *, chain: str | None = None
    ) -> EquipmentAnswer:
        """Detaches the payload of a chain; with `name` only that one."""
        return run(self._inner.detach_payload(name, chain=chain))

    def get_signal(self, name: str) -> SignalValue:
        """Value of a signal, one of `RobotInfo.signals`."""
        return run(self._inner.get_signal(name))

    def set_signal(self, name: str, value: SignalValue | ArrayLike) -> SignalValue:
        """Sets a signal; returns the value that the controller reports."""
        return run(self._inner.set_signal(name, value))

    def get_param(self, name: str) -> SignalValue:
        """Value of a controller's setting, one of `RobotInfo.parameters`."""
        return run(self._inner.get_param(name))

    def set_param(self, name: str, value: SignalValue | ArrayLike) -> SignalValue:
        """Sets a controller's setting; returns the value that the controller reports."""
        return run(self._inner.set_param(name, value))

    def forward_kinematics(
        self, joint_position_rad: ArrayLike | None = None, *, chain: str | None = None
    ) -> ForwardKinematicsAnswer:
        """Where tool and flange of a chain are, at these joint positions or the measured ones."""
        return run(self._inner.forward_kinematics(joint_position_rad, chain=chain))

    def inverse_kinematics(
        self, pose: Pose, seed_rad: ArrayLike | None = None, *, chain: str | None = None
    ) -> JointVector:
        """Positions of all joints at which the tool is at `pose`, in the chain's base link.

        The solution is one near `seed_rad`, or near the measured positions. Raises `DeniedError`
        with the code `unreachable` if there is none.
        """
        return run(self._inner.inverse_kinematics(pose, seed_rad, chain=chain))

    def save_recording(self) -> RecordingAnswer:
        """Has the last seconds of the control loop written to a file on the agent's machine."""
        return run(self._inner.save_recording())
