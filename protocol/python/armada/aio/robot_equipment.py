"""Tools and payloads, signals and parameters, kinematics, recordings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armada import methods
from armada.messages import (
    AttachPayloadParams,
    AttachToolParams,
    DetachParams,
    Empty,
    EquipmentAnswer,
    ForwardKinematicsAnswer,
    ForwardKinematicsParams,
    InverseKinematicsParams,
    JointVector,
    NameParams,
    PayloadInfo,
    Pose,
    RecordingAnswer,
    SetValueParams,
    SignalValue,
    ToolInfo,
    joint_vector,
)

from .robot_base import RobotBase


class RobotEquipment(RobotBase):
    """Tools and payloads, signals and parameters, kinematics, recordings.

    `chain` may be left out wherever the robot has one only.
    """

    async def attach_tool(
        self, tool: ToolInfo | str, *, chain: str | None = None
    ) -> EquipmentAnswer:
        """Attaches a tool to a chain that has none: any tool, or one of the robot file by name."""
        if isinstance(tool, str):
            params = AttachToolParams(chain=chain, name=tool)
        else:
            params = AttachToolParams(chain=chain, tool=tool)
        return await self.call(methods.ATTACH_TOOL, params)

    async def detach_tool(
        self, name: str | None = None, *, chain: str | None = None
    ) -> EquipmentAnswer:
        """Detaches the tool of a chain that holds no payload; with `name` only that one."""
        return await self.call(methods.DETACH_TOOL, DetachParams(chain=chain, name=name))

    async def attach_payload(
        self, payload: PayloadInfo, pose: Pose | None = None, *, chain: str | None = None
    ) -> EquipmentAnswer:
        """Attaches a payload to a chain with a tool; `pose` is in the tool centre point."""
        params = AttachPayloadParams(chain=chain, payload=payload, pose=pose or Pose())
        return await self.call(methods.ATTACH_PAYLOAD, params)

    async def detach_payload(
        self, name: str | None = None, *, chain: str | None = None
    ) -> EquipmentAnswer:
        """Detaches the payload of a chain; with `name` only that one."""
        return await self.call(methods.DETACH_PAYLOAD, DetachParams(chain=chain, name=name))

    async def get_signal(self, name: str) -> SignalValue:
        """Value of a signal, one of `RobotInfo.signals`."""
        return (await self.call(methods.GET_SIGNAL, NameParams(name=name))).value

    async def set_signal(self, name: str, value: SignalValue | ArrayLike) -> SignalValue:
        """Sets a signal; returns the value that the controller reports."""
        params = SetValueParams(name=name, value=_signal_value(value))
        return (await self.call(methods.SET_SIGNAL, params)).value

    async def get_param(self, name: str) -> SignalValue:
        """Value of a controller's setting, one of `RobotInfo.parameters`."""
        return (await self.call(methods.GET_PARAM, NameParams(name=name))).value

    async def set_param(self, name: str, value: SignalValue | ArrayLike) -> SignalValue:
        """Sets a controller's setting; returns the value that the controller reports."""
        params = SetValueParams(name=name, value=_signal_value(value))
        return (await self.call(methods.SET_PARAM, params)).value

    async def forward_kinematics(
        self, joint_position_rad: ArrayLike | None = None, *, chain: str | None = None
    ) -> ForwardKinematicsAnswer:
        """Where tool and flange of a chain are, at these joint positions or the measured ones."""
        position = joint_position_rad
        params = ForwardKinematicsParams(
            chain=chain,
            joint_position_rad=None
            if position is None
            else joint_vector(position, "joint_position_rad"),
        )
        return await self.call(methods.FORWARD_KINEMATICS, params)

    async def inverse_kinematics(
        self, pose: Pose, seed_rad: ArrayLike | None = None, *, chain: str | None = None
    ) -> JointVector:
        """Positions of all joints at which the tool is at `pose`, in the chain's base link.

        The solution is one near `seed_rad`, or near the measured positions. Raises `DeniedError`
        with the code `unreachable` if there is none.
        """
        params = InverseKinematicsParams(
            chain=chain,
            pose=pose,
            seed_rad=None if seed_rad is None else joint_vector(seed_rad, "seed_rad"),
        )
        return (await self.call(methods.INVERSE_KINEMATICS, params)).joint_position_rad

    async def save_recording(self) -> RecordingAnswer:
        """Has the last seconds of the control loop written to a file on the agent's machine."""
        return await self.call(methods.SAVE_RECORDING, Empty())


def _signal_value(value: SignalValue | ArrayLike) -> SignalValue:
    """The value as it is on the wire; raises `ValueError` if it is none."""
    if isinstance(value, bool | str):
        return value
    row = np.asarray(value)
    if row.dtype.kind not in "biuf" or row.ndim > 1:
        raise ValueError(f"{value!r} is neither on nor off, a number, a text, nor a row of them")
    plain: Any = row.tolist()
    if row.dtype.kind != "b":
        plain = joint_vector(np.atleast_1d(row).astype(np.float64), "value").tolist()
        plain = plain if row.ndim else plain[0]
    result: SignalValue = tuple(plain) if row.ndim else plain
    return result
