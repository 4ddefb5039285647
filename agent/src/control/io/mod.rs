//! What goes into and comes out of one [`step`](super::step).

mod order;
mod output;
mod params;
mod refusal;

use armada_model::{JointVector, MonoTime, Twist};
use armada_protocol::messages::{JogFrame, StopLevel, StreamHeader};
use arrayvec::ArrayVec;
use serde::{Deserialize, Serialize};

pub(super) use crate::control::group::GroupSay;
use crate::control::group::{GroupWord, MAX_WORDS};
use crate::drivers::{Feedback, JointSet};
pub use order::{
    DelegateOrder, EquipmentOrder, FollowOrder, HomeOrder, JogCartesianOrder, JogJointOrder,
    JogOrder, LoopRequest, Order,
};
pub use output::{
    DelegateReport, DroppedSamples, Granted, LeaseChange, LeaseReport, LinkReport, LoopEvent,
    LoopFault, MotionReport, Output, Retired, Snapshot, StreamChange, StreamReport,
};
pub use params::{LoopAbilities, MAX_STOP_TIME, Params, REDUCED_SHARE, default_stop_time};
pub use refusal::Refusal;

/// Most requests one tick takes; the rest wait for the next.
pub const MAX_REQUESTS: usize = 8;
/// Most events one tick reports: three of each request, four answers to older ones, and what
/// faults (8), stops (6) and motions (5, and one for each that waits), lease, sub-leases (8),
/// stream, key switch and pendant can say in one tick, with a reserve.
pub const MAX_EVENTS: usize = 104;
/// Most sub-leases of a lease.
pub const MAX_DELEGATES: usize = 8;
/// Most samples of streams one tick takes; the rest wait for the next.
pub const MAX_SAMPLES: usize = 8;
/// Most motions that wait for the end of another.
pub const MAX_QUEUED: usize = 16;
/// Most things one tick gives back: one of each request, what was followed, and what waited.
pub const MAX_RETIRED: usize = MAX_REQUESTS + MAX_QUEUED + 2;

/// Everything one tick is told.
#[derive(Clone, Debug)]
pub struct Input {
    /// The tick's deadline: ticks are whole periods apart, however late they really ran.
    pub now: MonoTime,
    /// Newest report of the controller.
    pub feedback: Option<Feedback>,
    /// Level of the latched stop, read from the stop gate at this tick.
    pub stop: Option<StopLevel>,
    /// How often that gate has been opened, from 0 again after 65 535: a reset that a stop followed
    /// before this tick.
    pub resets: u16,
    /// Whether the step before this one panicked or could not be run.
    pub loop_error: bool,
    /// Requests in the order they came; `step` takes them all out.
    pub requests: ArrayVec<LoopRequest, MAX_REQUESTS>,
    /// Samples of streams in the order they came; `step` takes them all out.
    pub stream: ArrayVec<StreamSample, MAX_SAMPLES>,
    /// What partners said, in the order it came; `step` takes all of it out.
    pub group: ArrayVec<GroupWord, MAX_WORDS>,
}

impl Input {
    /// A tick at which nothing is known and nothing is asked.
    #[must_use]
    pub const fn at(now: MonoTime) -> Self {
        Self {
            now,
            feedback: None,
            stop: None,
            resets: 0,
            loop_error: false,
            requests: ArrayVec::new_const(),
            stream: ArrayVec::new_const(),
            group: ArrayVec::new_const(),
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
