//! What goes into the coordinator and what comes out of it.

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    Accepted, AcquireLeaseParams, CellAcquireLeaseParams, CellExecuteTrajectory, CellLeaseParams,
    CellMotionStatus, CellResetAnswer, CellResetParams, CellStatus, CheckClearanceParams,
    ClearanceAnswer, ClockSample, CommandMode, CommitParams, Denial, Event, GroupLease,
    GroupLeaseReleased, LeaseGrant, ModeAnswer, MotionStatus, PrepareParams, Prepared,
    RenewLeaseParams, ResetAnswer, ResetParams, RobotInfo, RobotState, RobotStatus,
    SpeedRatioAnswer, StopAck, StopReport, StopRequest,
};
use std::time::Duration;
use uuid::Uuid;

use crate::world::{ClearanceReport, ClearanceRequest};

/// A request that waits for its one answer; the number is the runtime's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(pub u64);

/// A question to an agent that waits for its one answer; the number is the coordinator's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AskId(pub u64);

/// A check of clearances under way; the number is the coordinator's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CheckId(pub u64);

/// Something that happened.
#[derive(Clone, Debug)]
pub enum Input {
    /// The liveliness token of a robot's agent appeared or vanished.
    Presence {
        /// Which robot.
        robot: RobotName,
        /// Whether the token is there.
        online: bool,
    },
    /// The newest state of a robot.
    State {
        /// Which robot.
        robot: RobotName,
        /// The state.
        state: Box<RobotState>,
        /// When it came in.
        arrived: MonoTime,
        /// How many states came in since the last time, this one included.
        arrivals: u32,
    },
    /// The condition of a robot.
    Status(Box<RobotStatus>),
    /// What a robot is.
    Info(Box<RobotInfo>),
    /// The status of a motion of one robot.
    Motion(Box<MotionStatus>),
    /// A stage that a robot reached with a stop.
    StopAck(StopAck),
    /// A stop that somebody else published for the cell.
    CellStop(StopRequest),
    /// A request of a client.
    Request {
        /// What the answer must carry.
        ticket: Ticket,
        /// Who asks.
        client: String,
        /// What is asked.
        request: CellRequest,
    },
    /// The one answer to a question; silence is [`armada_protocol::messages::DenialCode::Timeout`].
    Answer {
        /// Which question.
        ask: AskId,
        /// What the agent says.
        result: Result<AgentAnswer, Denial>,
    },
    /// The one result of [`Action::CheckClearance`].
    Clearance {
        /// Which check.
        check: CheckId,
        /// How near the robots come, or why that cannot be told.
        result: Result<ClearanceReport, Denial>,
    },
    /// Something that a robot's agent put on record.
    RobotEvent(Box<Event>),
    /// A robot's description cannot be used.
    ModelRejected {
        /// Which robot.
        robot: RobotName,
        /// Why.
        message: String,
    },
    /// The gateway is about to end.
    Ending,
    /// The time of [`super::Coordinator::next_deadline`] has come.
    Timer,
}

/// What clients ask of the cell.
#[derive(Clone, Debug)]
pub enum CellRequest {
    /// Follow a trajectory with several robots.
    ExecuteTrajectory {
        /// Identity of the motion, chosen by the client or made by the runtime.
        motion_id: Uuid,
        /// The rest.
        params: Box<CellExecuteTrajectory>,
    },
    /// End a motion.
    Cancel {
        /// Which motion.
        motion_id: Uuid,
    },
    /// Change a motion that goes on.
    Control {
        /// Which motion.
        motion_id: Uuid,
        /// A lease of one of its robots, which shows that the client may use all of them.
        lease: Option<Uuid>,
        /// How.
        control: Control,
    },
    /// Get the leases of several robots, all or none.
    AcquireLease(CellAcquireLeaseParams),
    /// Keep the leases of several robots.
    RenewLease(CellLeaseParams),
    /// Give the leases of several robots back.
    ReleaseLease(CellLeaseParams),
    /// Tell how near robots come to each other.
    CheckClearance(Box<CheckClearanceParams>),
    /// Stop robots.
    Stop(StopRequest),
    /// Clear latched stops.
    Reset(CellResetParams),
}

/// A change of a motion that goes on, in which all its robots join.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// Come to rest on the path.
    Pause,
    /// Go on.
    Resume,
    /// Go at this speed over that of the trajectory.
    SpeedRatio(f64),
}

/// What the coordinator asks an agent.
#[derive(Clone, Debug, PartialEq)]
pub enum AgentCall {
    /// A sample of its clock.
    Clock,
    /// What the robot is.
    Info,
    /// How the robot is.
    Status,
    /// Where a motion stands.
    Motion(Uuid),
    /// Change the command mode.
    SetMode(CommandMode),
    /// Check a trajectory and keep it.
    Prepare(Box<PrepareParams>),
    /// Start a prepared trajectory at an instant.
    Commit(CommitParams),
    /// Forget a prepared trajectory, or end it with a ramp.
    Abort(Uuid),
    /// Stop.
    Stop(StopRequest),
    /// Clear these stops.
    Reset(Box<ResetParams>),
    /// Change a motion that goes on.
    Control(Uuid, Control),
    /// Grant the right to command.
    AcquireLease(AcquireLeaseParams),
    /// Keep it.
    RenewLease(RenewLeaseParams),
    /// Take it back.
    ReleaseLease(Uuid),
}

/// What an agent answers, in the order of [`AgentCall`].
#[derive(Clone, Debug, PartialEq)]
pub enum AgentAnswer {
    /// A sample of its clock, and the gateway's own before and after.
    Clock {
        /// The sample.
        sample: ClockSample,
        /// When it was asked for, gateway's clock.
        sent: MonoTime,
        /// When it came in, gateway's clock.
        received: MonoTime,
    },
    /// What the robot is.
    Info(Box<RobotInfo>),
    /// How the robot is.
    Status(Box<RobotStatus>),
    /// Where the motion stands.
    Motion(Box<MotionStatus>),
    /// The mode now in force.
    Mode(ModeAnswer),
    /// The trajectory is kept.
    Prepared(Prepared),
    /// The motion will start.
    Committed(Accepted),
    /// The motion ends or is forgotten.
    Aborted,
    /// The first stage of the stop.
    Stop(StopAck),
    /// The stops that were cleared.
    Reset(ResetAnswer),
    /// The motion is paused or goes on.
    Controlled,
    /// The speed now in force.
    SpeedRatio(SpeedRatioAnswer),
    /// The lease was granted or renewed.
    Lease(LeaseGrant),
    /// The lease was taken back.
    LeaseReleased,
}

/// What is answered to a client.
#[derive(Clone, Debug, PartialEq)]
pub enum CellAnswer {
    /// The motion was accepted and starts on all robots.
    Accepted(Accepted),
    /// The motion ends on all robots.
    Cancelled,
    /// How far each robot came.
    Stopped(StopReport),
    /// What was reset and what not.
    Reset(CellResetAnswer),
    /// Every robot is paused or goes on.
    Controlled,
    /// The speed that all robots now have.
    SpeedRatio(SpeedRatioAnswer),
    /// The lease of each robot.
    Lease(GroupLease),
    /// Which leases were given back.
    LeaseReleased(GroupLeaseReleased),
    /// How near the robots come.
    Clearance(ClearanceAnswer),
}

/// What the runtime is to do, at once and without waiting.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Ask an agent; [`Input::Answer`] must follow within `timeout`.
    Ask {
        /// What the answer must carry.
        ask: AskId,
        /// Whose agent.
        robot: RobotName,
        /// On whose behalf.
        client: String,
        /// The lease under which it is asked.
        lease: Option<Uuid>,
        /// What.
        call: AgentCall,
        /// How long to wait.
        timeout: Duration,
    },
    /// Answer a client.
    Answer {
        /// Which request.
        ticket: Ticket,
        /// The answer.
        result: Result<CellAnswer, Denial>,
    },
    /// Work out how near robots come, away from this task; [`Input::Clearance`] must follow.
    CheckClearance {
        /// What the result must carry.
        check: CheckId,
        /// Which motion.
        request: Box<ClearanceRequest>,
    },
    /// Publish the condition of the cell.
    PublishStatus(Box<CellStatus>),
    /// Publish where a motion stands, and keep it for those who ask.
    PublishMotion(Box<CellMotionStatus>),
    /// Publish an event. The runtime fills in the wall clock, which is for display only.
    PublishEvent(Box<Event>),
    /// Publish a stop.
    PublishStop(StopRequest),
}
