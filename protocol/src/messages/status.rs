//! How a robot is, and what may be done next.

use armada_model::MonoTime;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{
    AuthorityState, CommandMode, ControllerState, LatchedStop, LeaseScope, MotionStatus,
    OperationalMode, ResetNeeds, ResetParams, RobotFlags, Role, StopSourceStatus,
};
use crate::RobotName;

/// Condition of a robot, published on change and once a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotStatus {
    /// Which robot.
    pub robot: RobotName,
    /// This run of the agent.
    pub boot_id: Uuid,
    /// Sequence number of this message in this run.
    pub seqno: u64,
    /// Time, agent's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// Raised by every halt, stop, reset and change of mode.
    pub epoch: u64,
    /// What kind of command is followed.
    pub command_mode: CommandMode,
    /// The controller's key switch.
    pub operational_mode: OperationalMode,
    /// What the controller does.
    pub controller_state: ControllerState,
    /// Conditions as bits.
    pub flags: RobotFlags,
    /// The latched stop, if any.
    pub stop: Option<StopLatch>,
    /// Latched faults, oldest first.
    pub faults: Vec<Fault>,
    /// Where the right to command is.
    pub authority: AuthorityState,
    /// Who may command; null while nobody holds a lease.
    pub lease: Option<Lease>,
    /// The motion in progress or waiting for its start.
    pub motion: Option<MotionStatus>,
    /// Motions that wait behind it, in their order.
    pub queued: Vec<Uuid>,
    /// Speed of all motions, 0.01 to 1.
    pub speed_ratio: f64,
    /// The stream of commands, while one is in progress.
    pub stream: Option<StreamStatistics>,
    /// Timing of the control loop.
    pub control_loop: LoopStatistics,
    /// Messages that were dropped or refused since the start, by reason.
    pub dropped: Vec<(String, u64)>,
    /// Sources of stops elsewhere that have to check in.
    pub stop_sources: Vec<StopSourceStatus>,
    /// Why it does not move, or for whom it does: the most important first.
    pub why: Vec<Why>,
    /// What may be done next, in words for a person.
    pub next: Vec<String>,
}

/// One reason why a robot is as it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Why {
    /// What kind.
    pub code: WhyCode,
    /// The same for a person, with who, what and numbers.
    pub message: String,
    /// Who is behind it, if that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub who: Option<String>,
    /// Since when, agent's monotonic clock \[ns\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since_ns: Option<MonoTime>,
}

/// Kind of a [`Why`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WhyCode {
    /// The controller does not answer.
    NotConnected,
    /// A stop is latched.
    Stopped,
    /// A source of stops is pressed or silent.
    StopSource,
    /// A fault is latched.
    Faulted,
    /// A person at the controller has it.
    Local,
    /// The drives are off.
    DrivesOff,
    /// Somebody holds a lease.
    DrivenBy,
    /// A lease has run out.
    LeaseStale,
    /// A motion is in progress.
    Moving,
    /// A motion is paused, or waits for its partners.
    Waiting,
    /// A stream is starved, slowed or refused because of its link.
    DegradedLink,
    /// Its mode is `halt`: nothing is asked of it.
    Halted,
    /// Nothing keeps it from moving.
    Ready,
}

/// A stop in force: no motion before a reset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StopLatch {
    /// Highest level asked for.
    pub level: super::StopLevel,
    /// Every stop that the reset must clear.
    pub stops: Vec<LatchedStop>,
    /// How far the robot has come.
    pub stage: super::StopStage,
    /// What a reset needs.
    pub reset: ResetNeeds,
}

impl StopLatch {
    /// The reset of all these stops, not signed.
    #[must_use]
    pub fn reset_params(&self) -> ResetParams {
        ResetParams {
            stop_ids: self.stops.iter().map(|stop| stop.stop_id).collect(),
            nonce: self.reset.nonce,
            signature: None,
        }
    }
}

/// Who may command a robot, and for how long.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lease {
    /// Name of the holder.
    pub holder: String,
    /// As what it commands.
    #[serde(default)]
    pub role: Role,
    /// Why it took the lease from somebody else, if it did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Time left \[ms\]; 0 once it has run out.
    pub remaining_ms: u64,
    /// Whether it has run out: the holder may still renew it, anybody may acquire one.
    pub stale: bool,
    /// Whom the holder lets command as well.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub delegates: Vec<Delegate>,
}

/// Somebody whom the holder of a lease lets command as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Delegate {
    /// Name of the client.
    pub holder: String,
    /// What it has the right to.
    pub scope: LeaseScope,
    /// Time left \[ms\].
    pub remaining_ms: u64,
}

/// How a stream of commands comes in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StreamStatistics {
    /// Samples taken in this epoch.
    pub taken: u64,
    /// Samples dropped in this epoch.
    pub dropped: u64,
    /// Samples taken in this epoch of which the limits allow only a part.
    #[serde(default)]
    pub limited: u64,
    /// Time since the newest one \[ms\].
    pub age_ms: f64,
    /// Whether the robot decelerates or stands because samples stay away.
    pub starved: bool,
    /// Standard deviation of the time between samples, over the last one to two seconds \[ms\].
    #[serde(default)]
    pub jitter_ms: f64,
    /// Share of the samples that did not come or came too late, over the same time.
    #[serde(default)]
    pub loss: f64,
    /// Mean age of the states that samples were made for, when they came, over the same time
    /// \[ms\]: the way of the state, what the client takes, and the way of the sample.
    #[serde(default)]
    pub state_age_ms: f64,
    /// Share of the robot's limits of speed that the link allows: 1 as asked, less when the stream
    /// is slowed, 0 when it is refused.
    #[serde(default = "all")]
    pub allowed: f64,
}

/// A latched fault; it stays until `reset_errors` when its cause is gone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    /// What kind.
    pub code: FaultCode,
    /// What happened, with joint, value and limit.
    pub message: String,
    /// Joint, if one is at fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// The value that was wrong, in the unit that the message names.
    pub value: f64,
    /// Its limit; 0 if it has none.
    pub limit: f64,
    /// What clears it.
    pub clear: ClearBy,
    /// What a person is to do.
    pub remedy: String,
    /// File with the last seconds of the control loop, on the agent's machine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<String>,
    /// When it was latched, agent's monotonic clock \[ns\].
    pub since_ns: MonoTime,
}

/// What clears a fault; each level does what those before it do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClearBy {
    /// Setting mode `halt`.
    Halt,
    /// `reset_errors`.
    ResetErrors,
    /// A person at the controller, then `reset_errors`.
    Controller,
}

/// Kind of a [`Fault`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultCode {
    /// No feedback for longer than the allowed time.
    CommunicationLost,
    /// The controller reports an error.
    ControllerError,
    /// The controller reports an error that no reset clears.
    FatalError,
    /// The controller's own emergency stop is pressed.
    EmergencyStop,
    /// A safeguard of the controller is open.
    GuardStop,
    /// Drives went off, or the controller stopped taking commands, during a motion.
    NotReady,
    /// Measured and commanded position went too far apart.
    TrackingError,
    /// Measured and commanded speed went further apart than a waypoint allows.
    VelocityError,
    /// The controller failed to home.
    HomingFailed,
    /// The controller went on with a motion of its own that it was asked to end.
    StopIgnored,
    /// The control loop itself failed.
    LoopError,
}

/// Timing of a control loop since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoopStatistics {
    /// Ticks so far.
    pub ticks: u64,
    /// Rate over the last second \[Hz\].
    pub rate_hz: f64,
    /// Rate asked for \[Hz\].
    pub target_rate_hz: f64,
    /// Ticks whose work took longer than a period.
    pub overruns: u64,
    /// Periods in which no tick ran.
    pub missed_periods: u64,
    /// Set-points that the limiter had to change.
    pub limited_setpoints: u64,
    /// Latest wake-up after its deadline, over the last second \[µs\].
    pub worst_wake_us: f64,
    /// How the operating system really schedules the loop.
    pub scheduling: SchedulingPolicy,
}

/// How the operating system schedules a thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SchedulingPolicy {
    /// Time sharing: real-time scheduling was not asked for or not permitted.
    #[default]
    Other,
    /// `SCHED_FIFO` with this priority.
    Fifo(u8),
}

const fn all() -> f64 {
    1.0
}
