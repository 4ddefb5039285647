//! What goes into the coordinator and what comes out of it.

use armada_model::{JointTrajectory, MonoTime};
use armada_protocol::RobotName;
use armada_protocol::messages::{
    Accepted, CellMotionStatus, CellResetAnswer, CellResetParams, CellStatus, ClockSample,
    CommandMode, CommitParams, Denial, Event, ModeAnswer, MotionStatus, PrepareParams, Prepared,
    ResetAnswer, ResetParams, RobotInfo, RobotState, RobotStatus, StopAck, StopReport, StopRequest,
};
use std::time::Duration;
use uuid::Uuid;

/// A request that waits for its one answer; the number is the runtime's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(pub u64);

/// A question to an agent that waits for its one answer; the number is the coordinator's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AskId(pub u64);

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
        /// Joints are named `robot/joint`.
        trajectory: JointTrajectory,
    },
    /// End a motion.
    Cancel {
        /// Which motion.
        motion_id: Uuid,
    },
    /// Stop robots.
    Stop(StopRequest),
    /// Clear latched stops.
    Reset(CellResetParams),
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
    /// Publish the condition of the cell.
    PublishStatus(Box<CellStatus>),
    /// Publish where a motion stands, and keep it for those who ask.
    PublishMotion(Box<CellMotionStatus>),
    /// Publish an event. The runtime fills in the wall clock, which is for display only.
    PublishEvent(Box<Event>),
    /// Publish a stop.
    PublishStop(StopRequest),
}
