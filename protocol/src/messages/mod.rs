//! The messages of the contract: what is on the wire, in SI units.
//!
//! A message that decodes is valid in itself: names are names, numbers are finite. Whether it fits
//! the robot (its joints, its limits, its mode) is for the agent to say.

mod cell;
mod clock;
mod denial;
mod event;
mod info;
mod mode;
mod motion;
mod request;
mod state;
mod status;
mod stop;

pub use cell::{
    CellFrames, CellInfo, CellMotionStatus, CellRobot, CellRobotStatus, CellStatus, CellVerdict,
    Mount, PartStatus, Presence,
};
pub use clock::ClockSample;
pub use denial::{Denial, DenialCode};
pub use event::{Event, EventKind, Severity};
pub use info::{Capability, ChainInfo, JointInfo, RobotInfo};
pub use mode::{CommandMode, ControllerState, OperationalMode, RobotFlags};
pub use motion::{ActionStatus, MotionKind, MotionProgress, MotionStatus};
pub use request::{
    Accepted, CancelParams, CellExecuteTrajectory, CellResetAnswer, CellResetParams, CommitParams,
    Empty, ExecuteTrajectoryParams, HaltAnswer, JogFreespaceParams, ModeAnswer, Prepared, Request,
    ResetAnswer, ResetParams, SetModeParams,
};
pub use state::{JointState, RobotState, TcpState};
pub use status::{
    Fault, FaultCode, Lease, LoopStatistics, RobotStatus, SchedulingPolicy, StopLatch,
};
pub use stop::{
    LatchedStop, StopAck, StopLevel, StopReport, StopRequest, StopScope, StopStage, StopVerdict,
};
