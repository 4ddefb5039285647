//! Motions: what is in progress and how it ended.

use armada_model::MonoTime;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{Denial, GroupQuality};
use crate::RobotName;

/// Where a motion stands; exactly one of the terminal ones is reached, once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActionStatus {
    /// Accepted, waiting for its start.
    Queued,
    /// In progress.
    Running,
    /// In progress, at rest on its path or on the way to rest, until it is resumed.
    Paused,
    /// Ended at its goal.
    Complete,
    /// Ended early because somebody asked for it.
    Cancelled,
    /// Ended early for a reason.
    Failed,
}

impl ActionStatus {
    /// Whether nothing follows any more.
    #[must_use]
    pub const fn is_terminal(self) -> bool {
        matches!(self, Self::Complete | Self::Cancelled | Self::Failed)
    }
}

/// What makes the set-points of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionKind {
    /// A move of all joints to a position.
    JogFreespace,
    /// Joints at a speed.
    JogJoint,
    /// Tools at a speed.
    JogCartesian,
    /// Homing.
    Home,
    /// A timed trajectory.
    Trajectory,
    /// A move to joint positions.
    MoveJoint,
    /// A move to a pose.
    MovePose,
    /// A straight move of the tool.
    MoveLinear,
}

/// Who makes the set-points of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Executor {
    /// The agent's control loop.
    #[default]
    Agent,
    /// The controller itself.
    Controller,
}

/// The motion in progress, as part of the state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionProgress {
    /// Which motion.
    pub id: Uuid,
    /// Time along its own clock \[s\].
    pub elapsed_s: f64,
    /// Length of its own clock \[s\].
    pub duration_s: f64,
    /// Last waypoint passed; 0 for a jog.
    pub waypoint: u32,
    /// How fast its clock runs: 1 as planned, 0 at rest on the path.
    pub rate: f64,
    /// Whether it is paused.
    pub paused: bool,
    /// How many motions wait behind it.
    pub queued: u32,
}

/// Status of one motion of one robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionStatus {
    /// Which motion.
    pub id: Uuid,
    /// Which robot.
    pub robot: RobotName,
    /// This run of the agent.
    pub boot_id: Uuid,
    /// Sequence number of status messages of this motion.
    pub seqno: u64,
    /// Time of this status, agent's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// What makes the set-points.
    pub kind: MotionKind,
    /// Who makes the set-points.
    #[serde(default)]
    pub executor: Executor,
    /// Where it stands.
    pub status: ActionStatus,
    /// Why it failed or was cancelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<Denial>,
    /// Who asked for it.
    pub client: String,
    /// Epoch it belongs to.
    pub epoch: u64,
    /// When the first set-point was sent, agent's monotonic clock \[ns\]; null before.
    pub started_ns: Option<MonoTime>,
    /// Time along its own clock \[s\].
    pub elapsed_s: f64,
    /// Length of its own clock \[s\].
    pub duration_s: f64,
    /// Last waypoint passed.
    pub waypoint: u32,
    /// Number of waypoints; 0 for a jog.
    pub waypoint_count: u32,
    /// How well it kept together with its partners, if it has any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<GroupQuality>,
}
