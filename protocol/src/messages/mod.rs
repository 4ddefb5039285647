//! The messages of the contract: what is on the wire, in SI units.
//!
//! A message that decodes is valid in itself: names are names, numbers are finite. Whether it fits
//! the robot (its joints, its limits, its mode) is for the agent to say.

mod authority;
mod cell;
mod clock;
mod denial;
mod equipment;
mod event;
mod group;
mod info;
mod jog;
mod mode;
mod motion;
mod program;
mod request;
mod signal;
mod state;
mod status;
mod stop;
mod stream;

pub use authority::{
    AcquireLeaseParams, AuthorityState, CellAcquireLeaseParams, CellLeaseParams,
    DelegateLeaseParams, GroupLease, GroupLeaseReleased, LeaseGrant, LeaseParams, LeaseReleased,
    LeaseScope, RenewLeaseParams, Role, TakeLeaseParams,
};
pub use cell::{
    CellFrames, CellInfo, CellMotionStatus, CellRobot, CellRobotStatus, CellStatus, CellVerdict,
    Mount, PartStatus, Presence,
};
pub use clock::ClockSample;
pub use denial::{Denial, DenialCode};
pub use equipment::{
    AttachPayloadParams, AttachToolParams, AttachedPayload, ChainEquipment, DetachParams,
    EquipmentAnswer, Inertia, PayloadInfo, ToolInfo, ToolType,
};
pub use event::{Event, EventKind, Severity};
pub use group::{
    CellSpeedRatioParams, CheckClearanceParams, ClearanceAnswer, Coupling, GroupAbort, GroupGo,
    GroupHeartbeat, GroupParams, GroupQuality, GroupReadiness, GroupState,
};
pub use info::{Capability, ChainInfo, JointInfo, ReducedLimits, RobotInfo};
pub use jog::{ChainTwist, HomeMethod, HomeParams, JogCartesianParams, JogFrame, JogJointParams};
pub use mode::{CommandMode, ControllerState, OperationalMode, RobotFlags};
pub use motion::{ActionStatus, Executor, MotionKind, MotionProgress, MotionStatus};
pub use program::{
    ForwardKinematicsAnswer, ForwardKinematicsParams, InverseKinematicsAnswer,
    InverseKinematicsParams, MotionParams, MoveExecutor, MoveHomeParams, MoveJointParams,
    MoveOptions, MovePoseParams, SpeedRatioAnswer, SpeedRatioParams,
};
pub use request::{
    Accepted, CancelParams, CellExecuteTrajectory, CellResetAnswer, CellResetParams, CommitParams,
    Empty, ExecuteTrajectoryParams, HaltAnswer, JogFreespaceParams, LeaseLoss, ModeAnswer,
    PrepareParams, Prepared, Queue, Request, ResetAnswer, ResetParams, SetModeParams,
};
pub use signal::{
    AccessLevel, NameParams, NamedValue, ParameterInfo, ParameterType, RecordingAnswer,
    SetValueParams, SignalInfo, SignalType, SignalValue,
};
pub use state::{JointState, RobotState, TcpState};
pub use status::{
    ClearBy, Delegate, Fault, FaultCode, Lease, LoopStatistics, RobotStatus, SchedulingPolicy,
    StopLatch, StreamStatistics, Why, WhyCode,
};
pub use stop::{
    LatchedStop, ResetNeeds, ResetZone, StopAck, StopChallenge, StopCheckIn, StopLevel, StopReport,
    StopRequest, StopScope, StopSourceStatus, StopStage, StopVerdict,
};
pub use stream::{JointCommand, StreamCommand, StreamHeader, StreamTwist};
