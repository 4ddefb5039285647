//! Why the loop refuses something.

use armada_protocol::messages::{
    CommandMode, FaultCode, LeaseScope, OperationalMode, Role, StopLevel,
};
use serde::{Deserialize, Deserializer, Serialize};
use uuid::Uuid;

use crate::control::group::PartnerFault;

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
    /// This robot is commanded under a lease only.
    NoLease,
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
    /// Somebody acquired or took the lease on the way.
    LeaseTaken,
    /// The pendant has control, or took it on the way.
    LocalControl,
    /// The lease cannot be taken in this role.
    RoleTooLow {
        /// Lowest role that could.
        needed: Role,
    },
    /// The sub-lease gives no right to this.
    ScopeTooNarrow {
        /// What it gives the right to.
        scope: LeaseScope,
        /// What the order needs.
        needed: LeaseScope,
    },
    /// A sub-lease cannot be delegated again.
    DelegatedAlready,
    /// No more sub-leases can be granted.
    TooManyDelegates {
        /// How many there are.
        limit: usize,
    },
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
    /// Whoever asked had given up waiting when it came to the loop: it was not begun.
    TooLate,
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
    /// The start of a motion of several robots is so near that they cannot agree on it.
    StartTooSoon {
        /// Time until the start \[s\].
        lead_s: f64,
        /// Least time until it \[s\].
        least_s: f64,
    },
    /// A partner ended the motion of several robots.
    Partner {
        /// The motion.
        group: Uuid,
        /// Which partner, in their order.
        partner: u8,
        /// What it did.
        fault: PartnerFault,
    },
}

/// Under another name, since serde would borrow a field of type `&str` from its input.
type StaticText = &'static str;

/// A text that lives as long as the program: recordings are read by programs that soon end.
fn leaked<'de, D: Deserializer<'de>>(deserializer: D) -> Result<&'static str, D::Error> {
    Ok(Box::leak(String::deserialize(deserializer)?.into_boxed_str()))
}
