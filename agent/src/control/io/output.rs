//! What the loop says.

use std::sync::Arc;

use armada_model::{CompiledTrajectory, JointVector, MonoTime};
use armada_protocol::messages::{
    ActionStatus, AuthorityState, CommandMode, ControllerState, Executor, FaultCode, GroupQuality,
    LeaseScope, MotionKind, MotionProgress, OperationalMode, RobotFlags, Role, StopLevel,
    StopStage,
};
use arrayvec::ArrayVec;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{MAX_DELEGATES, MAX_EVENTS, MAX_RETIRED, Refusal};
use crate::control::equipment::Equipment;
use crate::control::group::{GroupReport, GroupSay, MAX_SAID};
use crate::drivers::{
    DriverRequest, MAX_PARAMETERS, MAX_REPORTED_TIPS, MAX_SIGNAL_VALUES, ReportedTip, SetPoint,
    Values,
};

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
    /// What is to be said to partners, in order.
    pub group: ArrayVec<GroupSay, MAX_SAID>,
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
    /// Where the right to command is.
    pub authority: AuthorityState,
    /// The lease, if there is one.
    pub lease: Option<LeaseReport>,
    /// Its sub-leases, in the order in which they were granted; `None` after the last.
    pub delegates: [Option<DelegateReport>; MAX_DELEGATES],
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
    /// Whether the controller's emergency stop is pressed; `None` while it is not heard.
    pub emergency_stop: Option<bool>,
    /// When somebody at the arm acknowledged last.
    pub acknowledged: Option<MonoTime>,
    /// The motion of several robots that this one takes part in, or did a moment ago.
    pub group: Option<GroupReport>,
}

/// The lease in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaseReport {
    /// Which.
    pub lease: Uuid,
    /// As what its holder commands.
    pub role: Role,
    /// When it runs out, or did.
    pub deadline: MonoTime,
    /// Whether it has run out.
    pub stale: bool,
}

/// A sub-lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DelegateReport {
    /// Which.
    pub lease: Uuid,
    /// What it gives the right to, while the lease itself is in force.
    pub scope: LeaseScope,
    /// When it runs out, or did.
    pub deadline: MonoTime,
    /// Whether it has run out: then only the motion under it goes on, because it may.
    pub stale: bool,
}

/// A stream in progress.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
    /// How well samples come.
    pub link: LinkReport,
}

/// How well the samples of a stream come, over the last one to two seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkReport {
    /// Standard deviation of the time between samples \[s\].
    pub jitter_s: f64,
    /// Share of the samples that did not come, or too late.
    pub loss: f64,
    /// Mean age of the states that samples were made for, when they came \[s\].
    pub state_age_s: f64,
    /// Share of the robot's limits of speed that the link allows; 0 if nothing is followed.
    pub allowed: f64,
}

impl Default for LinkReport {
    /// Nothing is known yet, and all is allowed.
    fn default() -> Self {
        Self { jitter_s: 0.0, loss: 0.0, state_age_s: 0.0, allowed: 1.0 }
    }
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
    /// Samples of this client come too seldom or too unevenly to be followed.
    pub link: u64,
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
    /// Standstill was not measured in time, so the stop goes on at this higher level.
    StopRaised(StopLevel),
    /// The controller's emergency stop was pressed, and the gate is closed for it; said by the loop's
    /// thread, which closes the gate, not by a step.
    EmergencyStop {
        /// Names the state of the gate.
        closing: u64,
        /// Whether the level rose by it.
        raised: bool,
    },
    /// The stop was reset.
    StopCleared,
    /// The lease was granted, taken, delegated, given back, or ran out.
    Lease(LeaseChange),
    /// The pendant has control now, or has given it back.
    LocalControl(bool),
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
    /// It was granted to this lease; one that had run out is gone with all its sub-leases.
    Granted(Uuid),
    /// It was granted to `lease` and taken away from another, with all its sub-leases.
    Taken {
        /// The lease in force now.
        lease: Uuid,
        /// The one before.
        from: Uuid,
    },
    /// This sub-lease was granted.
    Delegated(Uuid),
    /// This lease or sub-lease was given back; a lease also by a stop, the pendant, or somebody who
    /// commanded without one after it had run out. Its sub-leases are gone with it.
    Released(Uuid),
    /// This lease or sub-lease ran out; the holder of a lease may still renew it.
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
    /// Its link is bad: the robot follows it at lower speeds.
    Slowed,
    /// Its link is too bad: the robot does not follow it.
    Refused,
    /// Its link is good again.
    Restored,
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
    /// At its end: how well it kept together with its partners, if it has any.
    pub group: Option<GroupQuality>,
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
