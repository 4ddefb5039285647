//! What goes into and comes out of one [`step`](super::step).

use std::sync::Arc;
use std::time::Duration;

use armada_model::{
    CompiledTrajectory, JointLimits, JointVector, JointVectorError, MAX_JOINTS, MonoTime, Twist,
};
use armada_protocol::messages::{
    ActionStatus, CommandMode, ControllerState, Executor, FaultCode, HomeMethod, JogFrame,
    LeaseLoss, MotionKind, MotionProgress, OperationalMode, Queue, ReducedLimits, RobotFlags,
    StopLevel, StopStage, StreamHeader,
};
use arrayvec::ArrayVec;
use serde::{Deserialize, Deserializer, Serialize};
use uuid::Uuid;

use super::equipment::{Equipment, MAX_CHAINS};
use super::values::ValueSlot;
use crate::drivers::{
    DelegatedMove, DriverRequest, Feedback, JointSet, LoadSetting, MAX_PARAMETERS,
    MAX_REPORTED_TIPS, MAX_SIGNAL_VALUES, ReportedTip, SetPoint, Values,
};

/// Most requests one tick takes; the rest wait for the next.
pub const MAX_REQUESTS: usize = 8;
/// Most events one tick reports: three of each request, four answers to older ones, and what
/// faults (8), stops (5) and motions (5, and one for each that waits), lease, stream and key
/// switch can say in one tick, with a reserve.
pub const MAX_EVENTS: usize = 96;
/// Most samples of streams one tick takes; the rest wait for the next.
pub const MAX_SAMPLES: usize = 8;
/// Most trajectories that wait for the end of another.
pub const MAX_QUEUED: usize = 16;
/// Most things one tick gives back: one of each request, what was followed, and what waited.
pub const MAX_RETIRED: usize = MAX_REQUESTS + MAX_QUEUED + 2;

/// What does not change while a loop runs.
#[derive(Clone, Debug, Serialize, Deserialize)]
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
    /// How long the controller may search the references of one group of joints.
    pub homing_timeout: Duration,
    /// Whether drives are switched on once, when the controller first answers.
    pub enable_on_start: bool,
    /// Limits of each joint at reduced speed.
    pub reduced: Vec<ReducedLimits>,
    /// Home position of each joint \[rad or m\], where the robot has one.
    pub home: Vec<Option<f64>>,
    /// The operational mode, if the controller does not report one.
    pub operational_mode: OperationalMode,
    /// What the controller can do besides following set-points.
    pub abilities: LoopAbilities,
    /// Whether single moves are left to the controller, if it can and nobody says otherwise.
    pub delegates: bool,
    /// The chains with their tools at the start.
    #[serde(with = "crate::control::shared")]
    pub equipment: Arc<Equipment>,
    /// Where the feedback shows each signal of the controller.
    pub signals: Vec<ValueSlot>,
    /// Where the feedback shows each parameter of the controller.
    pub parameters: Vec<ValueSlot>,
    /// Silence of a stream after which the robot decelerates, at the latest.
    pub stream_timeout: Duration,
    /// Highest age of the state that a sample of a stream was made for.
    pub stream_max_age: Duration,
}

impl Params {
    /// Parameters of a robot with these joints and this period, every other one a common value:
    /// tolerances of 0.02 and 0.1, no chains, no abilities of the controller.
    ///
    /// # Errors
    /// [`JointVectorError`] if there are more joints than a robot may have.
    pub fn for_joints(
        limits: Vec<JointLimits>,
        period: Duration,
    ) -> Result<Self, JointVectorError> {
        let each = |value: f64| JointVector::from_slice(&vec![value; limits.len()]);
        let reduced = limits.iter().map(|joint| ReducedLimits {
            velocity: REDUCED_SHARE * joint.velocity,
            acceleration: joint.acceleration.unwrap_or_default(),
        });
        Ok(Self {
            start_tolerance: each(0.02)?,
            tracking_tolerance: each(0.1)?,
            standstill_velocity: each(0.01)?,
            reduced: reduced.collect(),
            home: vec![None; limits.len()],
            limits,
            period,
            communication_timeout: (period * 4).max(Duration::from_millis(100)),
            tracking_lag: period * 2,
            standstill_hold: Duration::from_millis(50),
            request_timeout: Duration::from_secs(5),
            homing_timeout: Duration::from_secs(60),
            enable_on_start: false,
            operational_mode: OperationalMode::Undefined,
            abilities: LoopAbilities::default(),
            delegates: false,
            equipment: Arc::default(),
            signals: Vec::new(),
            parameters: Vec::new(),
            stream_timeout: Duration::from_millis(40),
            stream_max_age: Duration::from_millis(100),
        })
    }
}

/// Speed at reduced speed over the joint's limit, if nothing else is said.
pub const REDUCED_SHARE: f64 = 0.25;

/// What a controller can do besides following set-points, as far as the loop asks for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoopAbilities {
    /// It can search the references of its joints.
    pub homing: bool,
    /// It makes moves of its own to joint positions.
    pub move_joint: bool,
    /// It makes moves of its own to poses.
    pub move_pose: bool,
    /// It makes straight moves of its own.
    pub move_linear: bool,
    /// Its own moves can be paused and slowed down.
    pub pause: bool,
    /// It takes the load of tool and payload.
    pub load: bool,
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
    /// Samples of streams in the order they came; `step` takes them all out.
    pub stream: ArrayVec<StreamSample, MAX_SAMPLES>,
}

impl Input {
    /// A tick at which nothing is known and nothing is asked.
    #[must_use]
    pub const fn at(now: MonoTime) -> Self {
        Self {
            now,
            feedback: None,
            stop: None,
            loop_error: false,
            requests: ArrayVec::new_const(),
            stream: ArrayVec::new_const(),
        }
    }
}

/// One sample of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StreamSample {
    /// Lease, epoch, number and age.
    pub header: StreamHeader,
    /// What is commanded.
    pub values: StreamValues,
}

/// What a sample of a stream commands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum StreamValues {
    /// Positions \[rad or m\] of `joints`, and speeds at them if given \[1/s\]; those of the other
    /// joints do not count.
    Position {
        /// Which joints are commanded.
        joints: JointSet,
        /// One value for each joint of the robot.
        position: JointVector,
        /// One value for each joint of the robot, or empty.
        velocity: JointVector,
    },
    /// Speeds \[1/s\] of `joints`; the others are to stand.
    Velocity {
        /// Which joints are commanded.
        joints: JointSet,
        /// One value for each joint of the robot.
        velocity: JointVector,
    },
    /// Speed of a tool.
    Twist(TwistTarget),
}

/// Speed wanted of a tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TwistTarget {
    /// Which chain, in the order of the robot file.
    pub chain: u8,
    /// Speed of the tool centre point in the axes of `frame`.
    pub twist: Twist,
    /// Whose axes.
    pub frame: JogFrame,
}

/// A request to the loop; it is answered in exactly one [`LoopEvent::Answer`] with its ticket.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LoopRequest {
    /// Chosen by the asker, returned with the answer.
    pub ticket: u64,
    /// The lease it is asked under.
    pub lease: Option<Uuid>,
    /// What is asked.
    pub order: Order,
}

/// What may be asked of the loop.
#[derive(Clone, Debug, Serialize, Deserialize)]
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
    /// Give the right to command to this lease, if it is free.
    AcquireLease {
        /// The new lease.
        lease: Uuid,
        /// How long it lasts without being renewed.
        ttl: Duration,
    },
    /// Keep the lease for another while.
    RenewLease(Uuid),
    /// Give the lease back.
    ReleaseLease(Uuid),
    /// Home joints.
    Home(HomeOrder),
    /// Move joints at a speed.
    JogJoint(JogJointOrder),
    /// Move tools at a speed.
    JogCartesian(JogCartesianOrder),
    /// Let the controller make a move of its own.
    Delegate(DelegateOrder),
    /// Bring this motion to rest on its path.
    Pause(Uuid),
    /// Go on with this motion.
    Resume(Uuid),
    /// Change the speed of all motions, 0.01 to 1.
    SetSpeedRatio(f64),
    /// Go on with other tools and payloads.
    SetEquipment(EquipmentOrder),
    /// Set a signal of the controller.
    SetSignal {
        /// Its index.
        signal: u8,
        /// Its values.
        values: Values<MAX_JOINTS>,
        /// Whether it may be set only while the robot does not move.
        restricted: bool,
    },
    /// Set a parameter of the controller.
    SetParameter {
        /// Its index.
        parameter: u8,
        /// Its value.
        value: f64,
        /// Whether it may be set only while the robot does not move.
        restricted: bool,
    },
}

/// Homing of groups of joints, one group after the other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HomeOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// The groups, each of one joint or more; those after the last are empty.
    pub groups: [JointSet; MAX_JOINTS],
    /// How.
    pub method: HomeMethod,
}

/// Joints at a speed, for a time after the newest order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JogJointOrder {
    /// Identity of the motion; the same as that of the jog in progress to keep it going.
    pub id: Uuid,
    /// Speed of each joint \[1/s\].
    pub joint_velocity: JointVector,
    /// How long to move without another order.
    pub timeout: Duration,
    /// Whether it only keeps a jog going: refused if that has ended.
    pub renews: bool,
}

/// Tools at a speed, for a time after the newest order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JogCartesianOrder {
    /// Identity of the motion; the same as that of the jog in progress to keep it going.
    pub id: Uuid,
    /// Speeds, one for each chain that is to move.
    pub twists: [Option<TwistTarget>; MAX_CHAINS],
    /// How long to move without another order.
    pub timeout: Duration,
    /// Whether it only keeps a jog going: refused if that has ended.
    pub renews: bool,
}

/// A move that the controller makes itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DelegateOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// What kind of move.
    pub kind: MotionKind,
    /// The move; its number is given by the loop.
    pub order: DelegatedMove,
    /// What to do if a motion is in progress: refuse or append.
    pub queue: Queue,
    /// What to do if the lease is lost.
    pub on_lease_loss: LeaseLoss,
}

/// Other tools and payloads.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EquipmentOrder {
    /// The chains with them.
    #[serde(with = "crate::control::shared")]
    pub equipment: Arc<Equipment>,
    /// Revision that they were made from, which must still be in force.
    pub replaces: u64,
    /// The chain whose load changed, and the load that the controller is to be told.
    pub load: Option<(u8, LoadSetting)>,
}

/// A move of all joints to a position.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct JogOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// Goal \[rad or m\].
    pub joint_position: JointVector,
    /// Highest speed of each joint, at most its limit in force \[1/s\]; empty for that limit.
    pub max_velocity: JointVector,
}

/// A trajectory to follow.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FollowOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// The validated trajectory.
    #[serde(with = "crate::control::shared")]
    pub trajectory: Arc<CompiledTrajectory>,
    /// When to start; at once if `None`.
    pub start: Option<MonoTime>,
    /// If given, the epoch that must still be in force.
    pub epoch: Option<u64>,
    /// What it is to be called: a trajectory, or a move that was planned outside the loop.
    pub kind: MotionKind,
    /// What to do if a motion is in progress.
    pub queue: Queue,
    /// What to do if the lease is lost.
    pub on_lease_loss: LeaseLoss,
}

impl FollowOrder {
    /// The trajectory at once, refused if a motion is in progress.
    #[must_use]
    pub const fn at_once(id: Uuid, trajectory: Arc<CompiledTrajectory>) -> Self {
        Self {
            id,
            trajectory,
            start: None,
            epoch: None,
            kind: MotionKind::Trajectory,
            queue: Queue::Refuse,
            on_lease_loss: LeaseLoss::StopOnPath,
        }
    }
}

impl Order {
    /// Identity of the motion that it begins or keeps going, if it does.
    #[must_use]
    pub const fn motion_id(&self) -> Option<Uuid> {
        match self {
            Self::Jog(order) => Some(order.id),
            Self::Follow(order) => Some(order.id),
            Self::Home(order) => Some(order.id),
            Self::JogJoint(order) => Some(order.id),
            Self::JogCartesian(order) => Some(order.id),
            Self::Delegate(order) => Some(order.id),
            _ => None,
        }
    }
}

impl LoopRequest {
    /// A request under no lease.
    #[must_use]
    pub const fn new(ticket: u64, order: Order) -> Self {
        Self { ticket, lease: None, order }
    }
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
    /// What is no longer used, to be dropped outside the loop.
    pub retired: ArrayVec<Retired, MAX_RETIRED>,
}

/// Something on the heap that the loop no longer uses.
#[derive(Clone, Debug)]
pub enum Retired {
    /// A trajectory.
    Trajectory(Arc<CompiledTrajectory>),
    /// Chains with tools and payloads.
    Equipment(Arc<Equipment>),
}

/// State of the robot after a tick, copied to the publisher as the latest value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Speed of all motions, 0.01 to 1.
    pub speed_ratio: f64,
    /// The lease, if there is one.
    pub lease: Option<LeaseReport>,
    /// The stream in progress.
    pub stream: Option<StreamReport>,
    /// Samples of streams dropped so far.
    pub dropped_samples: DroppedSamples,
    /// Revision of tools and payloads in force.
    pub config_seqno: u64,
    /// Values of the controller's signals.
    pub signals: Values<MAX_SIGNAL_VALUES>,
    /// Values of the controller's parameters.
    pub parameters: Values<MAX_PARAMETERS>,
    /// Poses that the controller reports itself.
    pub tips: [Option<ReportedTip>; MAX_REPORTED_TIPS],
}

/// The lease in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaseReport {
    /// Which.
    pub lease: Uuid,
    /// When it runs out, or did.
    pub deadline: MonoTime,
    /// Whether it has run out.
    pub stale: bool,
}

/// A stream in progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StreamReport {
    /// Samples taken in this epoch.
    pub taken: u64,
    /// Samples dropped in this epoch.
    pub dropped: u64,
    /// Samples taken of which a limit allows only a part, in this epoch.
    pub limited: u64,
    /// When the newest one was taken.
    pub newest: MonoTime,
    /// Whether the robot decelerates or stands because samples stay away.
    pub starved: bool,
}

/// Samples of streams that were not followed, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DroppedSamples {
    /// The lease is not in force.
    pub lease: u64,
    /// The epoch is not in force.
    pub epoch: u64,
    /// A sample of this or a later number came before.
    pub sequence: u64,
    /// The state it was made for is too old, or of the future.
    pub age: u64,
    /// The mode takes no such samples.
    pub mode: u64,
    /// Its values make no sense for this robot.
    pub values: u64,
}

/// Something that happened in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
    /// The lease was granted, given back, or ran out.
    Lease(LeaseChange),
    /// The key switch was turned.
    OperationalMode {
        /// Mode before.
        from: OperationalMode,
        /// Mode now.
        to: OperationalMode,
    },
    /// A stream began, starved, went on or ended.
    Stream(StreamChange),
}

/// What became of the lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum LeaseChange {
    /// It was granted to this lease.
    Granted(Uuid),
    /// It was given back, or taken away by a stop.
    Released(Uuid),
    /// It ran out; its holder may still renew it.
    Expired(Uuid),
    /// It was renewed after it had run out.
    Recovered(Uuid),
}

/// What became of a stream of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum StreamChange {
    /// Its first sample was taken.
    Began,
    /// Samples stay away: the robot decelerates.
    Starved,
    /// Samples came again.
    Resumed,
    /// The epoch or the mode ended it.
    Ended,
}

/// A request was granted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Granted {
    /// Epoch now in force.
    pub epoch: u64,
    /// Command mode now in force.
    pub command_mode: CommandMode,
}

/// Status of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionReport {
    /// Which motion.
    pub id: Uuid,
    /// What makes its set-points.
    pub kind: MotionKind,
    /// Who makes its set-points.
    pub executor: Executor,
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
    /// This robot cannot do it: what is missing.
    NotSupported(#[serde(deserialize_with = "leaked")] StaticText),
    /// Somebody holds the lease, or none was given and one is needed.
    LeaseRequired {
        /// Time left of the lease in force \[s\].
        remaining_s: f64,
    },
    /// The lease given is not in force any more.
    LeaseStale,
    /// The lease ran out on the way.
    LeaseLost,
    /// Somebody acquired the lease on the way.
    LeaseTaken,
    /// The key switch stands where it forbids this.
    OperationalMode(OperationalMode),
    /// The key switch was turned on the way.
    OperationalModeChanged,
    /// No more motions may wait.
    QueueFull {
        /// How many wait.
        limit: usize,
    },
    /// A motion that waited behind another that ended early.
    QueueBroken,
    /// The motion that it joined is of another kind, or it cannot be paused.
    NotPausable,
    /// The robot has no home position of a joint.
    NoHome {
        /// Which joint.
        joint: usize,
    },
    /// A joint does not know its reference.
    NotHomed {
        /// Which joint.
        joint: usize,
    },
    /// The robot has no such chain.
    NoSuchChain {
        /// Its number.
        chain: u8,
    },
    /// The controller gave its own move up, with its error.
    ControllerRefused {
        /// The error, in its numbering.
        code: u32,
    },
    /// The controller did not do it in time.
    ControllerTimeout,
    /// The step that took the request failed: whether it was done is not known.
    StepFailed,
    /// Tools or payloads were changed meanwhile.
    EquipmentChanged {
        /// Revision that the change was made from.
        given: u64,
        /// Revision in force.
        current: u64,
    },
    /// Another request of the same kind took its place.
    Superseded,
}

/// Under another name, since serde would borrow a field of type `&str` from its input.
type StaticText = &'static str;

/// A text that lives as long as the program: recordings are read by programs that soon end.
fn leaked<'de, D: Deserializer<'de>>(deserializer: D) -> Result<&'static str, D::Error> {
    Ok(Box::leak(String::deserialize(deserializer)?.into_boxed_str()))
}
