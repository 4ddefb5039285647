//! What goes into and comes out of one [`step`](super::step).

use std::sync::Arc;
use std::time::Duration;

use armada_model::{CompiledTrajectory, JointLimits, JointVector, MonoTime};
use armada_protocol::messages::{
    ActionStatus, CommandMode, ControllerState, FaultCode, MotionKind, MotionProgress,
    OperationalMode, RobotFlags, StopLevel, StopStage,
};
use arrayvec::ArrayVec;
use uuid::Uuid;

use crate::drivers::{DriverRequest, Feedback, SetPoint};

/// Most requests one tick takes; the rest wait for the next.
pub const MAX_REQUESTS: usize = 8;
/// Most events one tick reports: three of each request, four answers to older ones, and what
/// faults (8), stops (5) and motions (5) can say in one tick, with a reserve.
pub const MAX_EVENTS: usize = 48;
/// Most trajectories one tick gives back: one of each request, and the one that was followed.
pub const MAX_RETIRED: usize = MAX_REQUESTS + 1;

/// What does not change while a loop runs.
#[derive(Clone, Debug)]
pub struct Params {
    /// Limits of each joint; acceleration is always given.
    pub limits: Vec<JointLimits>,
    /// Period of the loop.
    pub period: Duration,
    /// Feedback older than this is a loss of communication.
    pub communication_timeout: Duration,
    /// How far the robot may be from where a trajectory begins, each joint \[rad or m\].
    pub start_tolerance: JointVector,
    /// How far measured may be from commanded position (lag allowed for), each joint \[rad or m\].
    pub tracking_tolerance: JointVector,
    /// How far behind its set-point the robot is when it follows well.
    pub tracking_lag: Duration,
    /// Measured speed below which a joint stands still, each joint \[1/s\].
    pub standstill_velocity: JointVector,
    /// How long it must be below.
    pub standstill_hold: Duration,
    /// How long the controller has to do what it is asked: switch drives, clear errors.
    pub request_timeout: Duration,
    /// Whether drives are switched on once, when the controller first answers.
    pub enable_on_start: bool,
}

/// Everything one tick is told.
#[derive(Clone, Debug)]
pub struct Input {
    /// The tick's deadline: ticks are whole periods apart, however late they really ran.
    pub now: MonoTime,
    /// Newest report of the controller.
    pub feedback: Option<Feedback>,
    /// Level of the latched stop, read from the stop gate at this tick.
    pub stop: Option<StopLevel>,
    /// Whether the step before this one panicked or could not be run.
    pub loop_error: bool,
    /// Requests in the order they came; `step` takes them all out.
    pub requests: ArrayVec<LoopRequest, MAX_REQUESTS>,
}

/// A request to the loop; it is answered in exactly one [`LoopEvent::Answer`] with its ticket.
#[derive(Clone, Debug)]
pub struct LoopRequest {
    /// Chosen by the asker, returned with the answer.
    pub ticket: u64,
    /// What is asked.
    pub order: Order,
}

/// What may be asked of the loop.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "a box would be freed in the loop")]
pub enum Order {
    /// Change the command mode.
    SetMode(CommandMode),
    /// Ramp to standstill and stay in halt.
    Halt,
    /// Switch the drives on.
    Enable,
    /// Ramp to standstill, then switch the drives off.
    Disable,
    /// Clear latched faults whose cause is gone, here and at the controller.
    ResetErrors,
    /// Move all joints to a position.
    Jog(JogOrder),
    /// Follow a trajectory, at once or at an instant.
    Follow(FollowOrder),
    /// End this motion with a ramp to standstill.
    Cancel(Uuid),
}

/// A move of all joints to a position.
#[derive(Clone, Copy, Debug)]
pub struct JogOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// Goal \[rad or m\].
    pub joint_position: JointVector,
    /// Highest speed of each joint, at most its limit \[1/s\].
    pub max_velocity: JointVector,
}

/// A trajectory to follow.
#[derive(Clone, Debug)]
pub struct FollowOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// The validated trajectory.
    pub trajectory: Arc<CompiledTrajectory>,
    /// When to start; at once if `None`.
    pub start: Option<MonoTime>,
    /// If given, the epoch that must still be in force.
    pub epoch: Option<u64>,
}

/// Everything one tick says.
#[derive(Clone, Debug)]
pub struct Output {
    /// Set-point for the controller; `None` if nothing is to be sent.
    pub command: Option<SetPoint>,
    /// Request for the controller.
    pub driver_request: Option<DriverRequest>,
    /// The robot's state after this tick.
    pub snapshot: Snapshot,
    /// What happened, in order.
    pub events: ArrayVec<LoopEvent, MAX_EVENTS>,
    /// Trajectories that are no longer used, to be dropped outside the loop.
    pub retired: ArrayVec<Arc<CompiledTrajectory>, MAX_RETIRED>,
}

/// State of the robot after a tick, copied to the publisher as the latest value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// The tick's deadline.
    pub stamp: MonoTime,
    /// Number of the tick.
    pub seqno: u64,
    /// Epoch in force.
    pub epoch: u64,
    /// Command mode in force.
    pub command_mode: CommandMode,
    /// The controller's key switch.
    pub operational_mode: OperationalMode,
    /// What the controller does.
    pub controller_state: ControllerState,
    /// Conditions as bits.
    pub flags: RobotFlags,
    /// Measured positions; empty if not known.
    pub joint_position: JointVector,
    /// Measured speeds; empty if not known.
    pub joint_velocity: JointVector,
    /// Measured efforts; empty if not known.
    pub joint_effort: JointVector,
    /// Set-point last sent; empty if none is held.
    pub joint_position_command: JointVector,
    /// Speeds that go with it.
    pub joint_velocity_command: JointVector,
    /// The motion in progress.
    pub motion: Option<MotionProgress>,
    /// Set-points the limiter had to change so far.
    pub limited_setpoints: u64,
}

/// Something that happened in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoopEvent {
    /// The answer to a request.
    Answer {
        /// Ticket of the request.
        ticket: u64,
        /// Granted, with the epoch now in force, or refused.
        result: Result<Granted, Refusal>,
    },
    /// The command mode changed.
    Mode {
        /// Mode before.
        from: CommandMode,
        /// Mode now.
        to: CommandMode,
    },
    /// A motion changed its status.
    Motion(MotionReport),
    /// A fault was latched.
    FaultLatched(LoopFault),
    /// All faults were cleared.
    FaultsCleared,
    /// A stop reached a stage (never `Received`, which the gate reports).
    StopStage(StopStage),
    /// The stop was reset.
    StopCleared,
}

/// A request was granted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Granted {
    /// Epoch now in force.
    pub epoch: u64,
    /// Command mode now in force.
    pub command_mode: CommandMode,
}

/// Status of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionReport {
    /// Which motion.
    pub id: Uuid,
    /// What makes its set-points.
    pub kind: MotionKind,
    /// Where it stands.
    pub status: ActionStatus,
    /// Why it ended early.
    pub reason: Option<Refusal>,
    /// Time of its first set-point.
    pub started: Option<MonoTime>,
    /// Progress.
    pub progress: MotionProgress,
}

/// A fault with its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopFault {
    /// What kind.
    pub code: FaultCode,
    /// When.
    pub stamp: MonoTime,
    /// Joint, if one is at fault.
    pub joint: Option<usize>,
    /// The value that is wrong: error \[rad or m\], age \[s\] or the controller's error code.
    pub value: f64,
    /// Its limit, in the same unit.
    pub limit: f64,
}

/// Why the loop refuses a request or ends a motion; the runtime puts it into words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// The mode does not allow it.
    WrongMode {
        /// Mode in force.
        mode: CommandMode,
        /// Mode needed.
        needed: CommandMode,
    },
    /// There is no way from one mode to the other but through halt.
    ThroughHalt {
        /// Mode in force.
        mode: CommandMode,
        /// Mode asked for.
        wanted: CommandMode,
    },
    /// This mode does not exist in this version or for this robot.
    ModeNotSupported(CommandMode),
    /// A stop is latched.
    Stopped(StopLevel),
    /// A fault is latched.
    Faulted(FaultCode),
    /// The controller does not answer.
    CommunicationLost,
    /// Drives are off.
    NotEnabled,
    /// The controller does not take commands.
    NotReady,
    /// A fault's cause is still there.
    CauseRemains(FaultCode),
    /// A motion is in progress.
    Busy(Uuid),
    /// The robot is still decelerating.
    StillMoving,
    /// There is no such motion in progress.
    NoSuchMotion,
    /// A goal lies outside a joint's limits.
    OutOfRange {
        /// Which joint.
        joint: usize,
        /// Goal or speed.
        value: f64,
        /// Its limit.
        limit: f64,
    },
    /// The robot is too far from where the trajectory begins.
    StartTolerance {
        /// Which joint.
        joint: usize,
        /// Distance.
        value: f64,
        /// Limit.
        limit: f64,
    },
    /// A vector or trajectory has another number of joints than the robot.
    WrongLength {
        /// Number given.
        given: usize,
        /// Number of joints.
        expected: usize,
    },
    /// The epoch has passed.
    EpochPassed {
        /// Epoch named.
        given: u64,
        /// Epoch in force.
        current: u64,
    },
    /// The start lies in the past.
    StartMissed {
        /// How late \[s\].
        late_s: f64,
    },
    /// Somebody cancelled it.
    Cancelled,
    /// The mode was left.
    ModeLeft,
    /// The robot was disabled, or is about to be.
    Disabled,
    /// The controller was asked to switch the drives off, but they stayed on.
    StillEnabled,
    /// Too many requests wait for the controller already.
    TooManyPending,
}
