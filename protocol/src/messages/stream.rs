//! Streams of commands: samples at a rate, newest counts.

use armada_model::{JointVector, Twist};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::JogFrame;

/// What every sample of a stream says besides its values.
///
/// A sample is dropped and counted if its lease or epoch is not in force, if one with this or a
/// later number came before, or if the state it was made for is too old.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StreamHeader {
    /// The lease.
    pub lease: Uuid,
    /// Epoch of the stream.
    pub epoch: u64,
    /// Number of the sample, rising within an epoch and lease.
    pub seq: u64,
    /// `seqno` of the newest state the sender had seen: tells how old the sample is.
    pub state_seqno: u64,
}

/// One sample of `stream/position` or `stream/velocity`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StreamCommand {
    /// The lease.
    pub lease: Uuid,
    /// Epoch of the stream.
    pub epoch: u64,
    /// Number of the sample, rising within an epoch and lease.
    pub seq: u64,
    /// `seqno` of the newest state the sender had seen: tells how old the sample is.
    pub state_seqno: u64,
    /// Position \[rad or m\] or speed \[rad/s or m/s\] of every joint, in the robot's joint order.
    pub values: JointVector,
    /// With positions: the speed of every joint at them \[rad/s or m/s\]; found from the samples if
    /// left out. Not allowed with speeds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<JointVector>,
}

/// One sample of `stream/twist`, in mode `velocity_command`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StreamTwist {
    /// The lease.
    pub lease: Uuid,
    /// Epoch of the stream.
    pub epoch: u64,
    /// Number of the sample, rising within an epoch and lease.
    pub seq: u64,
    /// `seqno` of the newest state the sender had seen: tells how old the sample is.
    pub state_seqno: u64,
    /// Name of the chain.
    pub chain: String,
    /// Speed of the tool centre point, in the axes of `frame`.
    pub twist: Twist,
    /// Whose axes.
    #[serde(default)]
    pub frame: JogFrame,
}

/// One sample of `command`: the form of an actuator array, any subset of the joints.
///
/// In mode `position_command` positions count, in mode `velocity_command` velocities; joints that
/// are not named stay where they are. Names that the robot does not have are counted and ignored,
/// as a command may be meant for several robots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointCommand {
    /// The lease.
    pub lease: Uuid,
    /// Epoch of the stream.
    pub epoch: u64,
    /// Number of the sample, rising within an epoch and lease.
    pub seq: u64,
    /// `seqno` of the newest state the sender had seen: tells how old the sample is.
    pub state_seqno: u64,
    /// Names of joints.
    pub name: Vec<String>,
    /// Their positions \[rad or m\]; empty if not commanded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub position: Vec<f64>,
    /// Their speeds \[rad/s or m/s\]; empty if not commanded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub velocity: Vec<f64>,
}

impl StreamCommand {
    /// What it says besides its values.
    #[must_use]
    pub const fn header(&self) -> StreamHeader {
        let Self { lease, epoch, seq, state_seqno, .. } = *self;
        StreamHeader { lease, epoch, seq, state_seqno }
    }
}

impl StreamTwist {
    /// What it says besides its values.
    #[must_use]
    pub const fn header(&self) -> StreamHeader {
        let Self { lease, epoch, seq, state_seqno, .. } = *self;
        StreamHeader { lease, epoch, seq, state_seqno }
    }
}

impl JointCommand {
    /// What it says besides its values.
    #[must_use]
    pub const fn header(&self) -> StreamHeader {
        let Self { lease, epoch, seq, state_seqno, .. } = *self;
        StreamHeader { lease, epoch, seq, state_seqno }
    }
}
