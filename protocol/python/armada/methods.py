"""The methods under `rpc/`, as in `protocol/src/method.rs`; a test compares the two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from .messages import (
    Accepted,
    AcquireLeaseParams,
    AttachPayloadParams,
    AttachToolParams,
    CancelParams,
    CellAcquireLeaseParams,
    CellExecuteTrajectory,
    CellLeaseParams,
    CellResetAnswer,
    CellResetParams,
    CellSpeedRatioParams,
    CheckClearanceParams,
    ClearanceAnswer,
    CommitParams,
    DelegateLeaseParams,
    DetachParams,
    Empty,
    EquipmentAnswer,
    ExecuteTrajectoryParams,
    ForwardKinematicsAnswer,
    ForwardKinematicsParams,
    GroupLease,
    GroupLeaseReleased,
    HaltAnswer,
    HomeParams,
    InverseKinematicsAnswer,
    InverseKinematicsParams,
    JogCartesianParams,
    JogFreespaceParams,
    JogJointParams,
    LeaseGrant,
    LeaseParams,
    LeaseReleased,
    ModeAnswer,
    MotionParams,
    MoveHomeParams,
    MoveJointParams,
    MovePoseParams,
    NamedValue,
    NameParams,
    Prepared,
    PrepareParams,
    RecordingAnswer,
    RenewLeaseParams,
    ResetAnswer,
    ResetParams,
    SetModeParams,
    SetValueParams,
    SpeedRatioAnswer,
    SpeedRatioParams,
    StopReport,
    StopRequest,
    TakeLeaseParams,
)

P = TypeVar("P")
A = TypeVar("A")


@dataclass(frozen=True)
class Method(Generic[P, A]):
    """A method: one query, one answer."""

    name: str
    """Last part of its key."""
    timeout_s: float
    """How long an asker waits; longer than the answerer ever takes."""
    params: type[P]
    """What is asked, inside a `Request`."""
    answer: type[A]
    """What is answered."""


ACQUIRE_LEASE: Final = Method("acquire_lease", 2.0, AcquireLeaseParams, LeaseGrant)
"""Takes the right to command, if nobody has it."""
RENEW_LEASE: Final = Method("renew_lease", 2.0, RenewLeaseParams, LeaseGrant)
"""Keeps the right to command."""
TAKE_LEASE: Final = Method("take_lease", 2.0, TakeLeaseParams, LeaseGrant)
"""Takes the right to command from whoever has it: for a person, with a reason."""
DELEGATE_LEASE: Final = Method("delegate_lease", 2.0, DelegateLeaseParams, LeaseGrant)
"""Lets somebody else command as well, under the holder's lease."""
RELEASE_LEASE: Final = Method("release_lease", 2.0, LeaseParams, LeaseReleased)
"""Gives the right to command back; a motion in progress ends with a ramp."""
SET_MODE: Final = Method("set_mode", 2.0, SetModeParams, ModeAnswer)
"""Changes the command mode; every mode but `halt` is entered from `halt`."""
HALT: Final = Method("halt", 2.0, Empty, HaltAnswer)
"""Ramps to standstill and stays in `halt`; ends every motion."""
ENABLE: Final = Method("enable", 8.0, Empty, ModeAnswer)
"""Switches the drives on; answered when the controller reports them on."""
DISABLE: Final = Method("disable", 8.0, Empty, ModeAnswer)
"""Ramps to standstill and switches the drives off."""
RESET_ERRORS: Final = Method("reset_errors", 8.0, Empty, ModeAnswer)
"""Clears latched faults whose cause is gone, here and at the controller."""
RESET: Final = Method("reset", 2.0, ResetParams, ResetAnswer)
"""Clears the latched stop; never moves, never enables."""
HOME: Final = Method("home", 4.0, HomeParams, Accepted)
"""Homes joints in an order, in mode `homing`."""
JOG_FREESPACE: Final = Method("jog_freespace", 2.0, JogFreespaceParams, Accepted)
"""Moves all joints to a position, in mode `jog`; a new goal replaces the old one."""
JOG_JOINT: Final = Method("jog_joint", 2.0, JogJointParams, Accepted)
"""Moves joints at a speed as long as it is repeated, in mode `jog`."""
JOG_CARTESIAN: Final = Method("jog_cartesian", 2.0, JogCartesianParams, Accepted)
"""Moves tools at a speed as long as it is repeated, in mode `jog`."""
EXECUTE_TRAJECTORY: Final = Method("execute_trajectory", 4.0, ExecuteTrajectoryParams, Accepted)
"""Follows a trajectory, in mode `trajectory`: at once, or after those before it."""
MOVE_JOINT: Final = Method("move_joint", 4.0, MoveJointParams, Accepted)
"""Moves all joints to a position, in mode `trajectory`."""
MOVE_POSE: Final = Method("move_pose", 4.0, MovePoseParams, Accepted)
"""Moves the tool to a pose, the joints on the straight way, in mode `trajectory`."""
MOVE_LINEAR: Final = Method("move_linear", 4.0, MovePoseParams, Accepted)
"""Moves the tool on a straight line, in mode `trajectory`."""
MOVE_HOME: Final = Method("move_home", 4.0, MoveHomeParams, Accepted)
"""Moves all joints to their home positions, in mode `trajectory`."""
CANCEL: Final = Method("cancel", 2.0, CancelParams, Empty)
"""Ends a motion with a ramp to standstill, or takes it out of the queue; the mode stays."""
PAUSE: Final = Method("pause", 2.0, MotionParams, Empty)
"""Brings a motion to rest on its path until it is resumed."""
RESUME: Final = Method("resume", 2.0, MotionParams, Empty)
"""Goes on with a paused motion."""
SET_SPEED_RATIO: Final = Method("set_speed_ratio", 2.0, SpeedRatioParams, SpeedRatioAnswer)
"""Changes the speed of all motions, those in progress too."""
ATTACH_TOOL: Final = Method("attach_tool", 4.0, AttachToolParams, EquipmentAnswer)
"""Attaches a tool to a chain that has none."""
DETACH_TOOL: Final = Method("detach_tool", 4.0, DetachParams, EquipmentAnswer)
"""Detaches the tool of a chain that holds no payload."""
ATTACH_PAYLOAD: Final = Method("attach_payload", 4.0, AttachPayloadParams, EquipmentAnswer)
"""Attaches a payload to a chain with a tool."""
DETACH_PAYLOAD: Final = Method("detach_payload", 4.0, DetachParams, EquipmentAnswer)
"""Detaches the payload of a chain."""
GET_PARAM: Final = Method("get_param", 2.0, NameParams, NamedValue)
"""Value of a controller's setting."""
SET_PARAM: Final = Method("set_param", 4.0, SetValueParams, NamedValue)
"""Sets a controller's setting; answered when the controller reports it."""
GET_SIGNAL: Final = Method("get_signal", 2.0, NameParams, NamedValue)
"""Value of a signal."""
SET_SIGNAL: Final = Method("set_signal", 4.0, SetValueParams, NamedValue)
"""Sets a signal; answered when the controller reports it."""
FORWARD_KINEMATICS: Final = Method(
    "forward_kinematics", 2.0, ForwardKinematicsParams, ForwardKinematicsAnswer
)
"""Where tool and flange of a chain are."""
INVERSE_KINEMATICS: Final = Method(
    "inverse_kinematics", 2.0, InverseKinematicsParams, InverseKinematicsAnswer
)
"""Joint positions for a pose of the tool."""
PREPARE: Final = Method("prepare", 4.0, PrepareParams, Prepared)
"""Validates a trajectory and keeps it for `commit`."""
COMMIT: Final = Method("commit", 2.0, CommitParams, Accepted)
"""Starts a prepared trajectory at an instant of the agent's clock."""
ABORT: Final = Method("abort", 2.0, CancelParams, Empty)
"""Forgets a prepared trajectory, or ends it with a ramp if it runs."""
SAVE_RECORDING: Final = Method("save_recording", 8.0, Empty, RecordingAnswer)
"""Writes the last seconds of the control loop to a file."""

ROBOT_METHODS: Final[tuple[Method[Any, Any], ...]] = (
    ACQUIRE_LEASE,
    RENEW_LEASE,
    TAKE_LEASE,
    DELEGATE_LEASE,
    RELEASE_LEASE,
    SET_MODE,
    HALT,
    ENABLE,
    DISABLE,
    RESET_ERRORS,
    RESET,
    HOME,
    JOG_FREESPACE,
    JOG_JOINT,
    JOG_CARTESIAN,
    EXECUTE_TRAJECTORY,
    MOVE_JOINT,
    MOVE_POSE,
    MOVE_LINEAR,
    MOVE_HOME,
    CANCEL,
    PAUSE,
    RESUME,
    SET_SPEED_RATIO,
    ATTACH_TOOL,
    DETACH_TOOL,
    ATTACH_PAYLOAD,
    DETACH_PAYLOAD,
    GET_PARAM,
    SET_PARAM,
    GET_SIGNAL,
    SET_SIGNAL,
    FORWARD_KINEMATICS,
    INVERSE_KINEMATICS,
    PREPARE,
    COMMIT,
    ABORT,
    SAVE_RECORDING,
)
"""Every method of an agent, under `robots/{robot}/rpc/`."""

CELL_STOP: Final = Method("stop", 5.0, StopRequest, StopReport)
"""Stops the robots in scope and reports how far each has come."""
CELL_RESET: Final = Method("reset", 4.0, CellResetParams, CellResetAnswer)
"""Clears the latched stops of robots; never moves, never enables."""
CELL_EXECUTE_TRAJECTORY: Final = Method("execute_trajectory", 8.0, CellExecuteTrajectory, Accepted)
"""Follows a trajectory with several robots that start at one instant."""
CELL_CANCEL: Final = Method("cancel", 4.0, CancelParams, Empty)
"""Ends a motion of several robots, each with a ramp to standstill."""
CELL_PAUSE: Final = Method("pause", 4.0, MotionParams, Empty)
"""Brings a motion of several robots to rest at one phase, until it is resumed."""
CELL_RESUME: Final = Method("resume", 4.0, MotionParams, Empty)
"""Goes on with a paused motion of several robots."""
CELL_SET_SPEED_RATIO: Final = Method("set_speed_ratio", 4.0, CellSpeedRatioParams, SpeedRatioAnswer)
"""Changes the speed of a motion of several robots, and of all later ones of its robots."""
CELL_ACQUIRE_LEASE: Final = Method("acquire_lease", 4.0, CellAcquireLeaseParams, GroupLease)
"""Gets the leases of several robots, all or none."""
CELL_RENEW_LEASE: Final = Method("renew_lease", 4.0, CellLeaseParams, GroupLease)
"""Keeps the leases of several robots."""
CELL_RELEASE_LEASE: Final = Method("release_lease", 4.0, CellLeaseParams, GroupLeaseReleased)
"""Gives the leases of several robots back."""
CELL_CHECK_CLEARANCE: Final = Method("check_clearance", 8.0, CheckClearanceParams, ClearanceAnswer)
"""How near the robots come to each other on a trajectory."""

CELL_METHODS: Final[tuple[Method[Any, Any], ...]] = (
    CELL_STOP,
    CELL_RESET,
    CELL_EXECUTE_TRAJECTORY,
    CELL_CANCEL,
    CELL_PAUSE,
    CELL_RESUME,
    CELL_SET_SPEED_RATIO,
    CELL_ACQUIRE_LEASE,
    CELL_RENEW_LEASE,
    CELL_RELEASE_LEASE,
    CELL_CHECK_CLEARANCE,
)
"""Every method of the gateway, under `cell/rpc/`."""
