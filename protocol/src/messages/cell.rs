//! The cell as a whole.

use std::collections::BTreeMap;

use armada_model::{MonoTime, Pose};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{
    ActionStatus, AuthorityState, CommandMode, ControllerState, Coupling, Denial, Fault, Lease,
    LoopStatistics, StopLatch, TcpState, Why,
};
use crate::RobotName;

/// Which robots a cell has and where they stand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellInfo {
    /// Name of the cell.
    pub cell: String,
    /// Run of the gateway.
    pub boot_id: Uuid,
    /// Sequence number of this message in this run.
    pub seqno: u64,
    /// Version of the gateway's program.
    pub software_version: String,
    /// The robots, in the order of the cell file.
    pub robots: Vec<CellRobot>,
}

/// One robot of a cell, as configured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellRobot {
    /// Which robot.
    pub robot: RobotName,
    /// Where its root link is fixed.
    pub mount: Mount,
    /// Zenoh endpoint its agent listens on, for clients that stop it without the gateway.
    pub endpoint: String,
}

/// Where a robot's root link is fixed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mount {
    /// `world`, or a link of another robot as `robot/link`.
    #[serde(default = "world")]
    pub parent: String,
    /// Pose of the robot's root link in the parent.
    #[serde(default)]
    pub pose: Pose,
}

impl Default for Mount {
    /// The robot's root link is the world.
    fn default() -> Self {
        Self { parent: world(), pose: Pose::default() }
    }
}

fn world() -> String {
    "world".to_owned()
}

/// Whether a robot's agent is on the bus. For display: no stop depends on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Presence {
    /// It has not been seen since the gateway started.
    #[default]
    NeverSeen,
    /// It is there.
    Online,
    /// It was there and is gone.
    Lost,
}

/// One word on a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CellVerdict {
    /// Every robot is online, without fault or stop.
    Ready,
    /// At least one robot is in motion, none is in trouble.
    Moving,
    /// A stop is latched on at least one robot.
    Stopped,
    /// A robot has a fault, cannot be commanded or is not online.
    Degraded,
}

/// Condition of a cell, published on change and once a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellStatus {
    /// Name of the cell.
    pub cell: String,
    /// Run of the gateway.
    pub boot_id: Uuid,
    /// Sequence number of this message in this run.
    pub seqno: u64,
    /// Time, gateway's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// One word on the whole.
    pub verdict: CellVerdict,
    /// Every configured robot.
    pub robots: BTreeMap<RobotName, CellRobotStatus>,
    /// Motions of several robots that are in progress.
    pub motions: Vec<CellMotionStatus>,
}

/// Condition of one robot as the gateway knows it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CellRobotStatus {
    /// Whether its agent is on the bus.
    pub presence: Presence,
    /// What kind of command is followed; null if not known.
    pub command_mode: Option<CommandMode>,
    /// What the controller does; null if not known.
    pub controller_state: Option<ControllerState>,
    /// The latched stop, if any.
    pub stop: Option<StopLatch>,
    /// Latched faults.
    pub faults: Vec<Fault>,
    /// Where the right to command is; null if not known.
    pub authority: Option<AuthorityState>,
    /// Who may command.
    pub lease: Option<Lease>,
    /// Why it does not move, or for whom it does.
    pub why: Vec<Why>,
    /// Motions that wait behind the one in progress.
    pub queued: u32,
    /// Speed of all its motions, 0.01 to 1; null if not known.
    pub speed_ratio: Option<f64>,
    /// Poses of the tips, in each chain's base.
    pub tcp: Vec<TcpState>,
    /// Age of the newest state when this was written \[ms\]; null if there is none.
    pub state_age_ms: Option<f64>,
    /// How often states arrive \[Hz\].
    pub state_rate_hz: f64,
    /// Timing of the control loop; null if not known.
    pub control_loop: Option<LoopStatistics>,
    /// Agent's monotonic clock minus the gateway's \[ns\]; null if not measured.
    pub clock_offset_ns: Option<i64>,
    /// How wrong the offset may be \[ns\].
    pub clock_bound_ns: Option<u64>,
}

/// Status of a motion of several robots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellMotionStatus {
    /// Which motion; its parts have the same identity at their agents.
    pub id: Uuid,
    /// Run of the gateway.
    pub boot_id: Uuid,
    /// Sequence number of status messages of this motion.
    pub seqno: u64,
    /// Time, gateway's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// Where it stands as a whole.
    pub status: ActionStatus,
    /// Why it failed or was cancelled: the first reason.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<Denial>,
    /// Who asked for it.
    pub client: String,
    /// Length \[s\].
    pub duration_s: f64,
    /// Each robot's part.
    pub parts: BTreeMap<RobotName, PartStatus>,
    /// Largest difference between the parts' measured starts \[ms\]; null before all have started.
    pub start_skew_ms: Option<f64>,
    /// How closely the robots are tied together.
    #[serde(default)]
    pub coupling: Coupling,
    /// Largest difference of phase between two robots at the same time so far \[ms\]; null before
    /// it was measured.
    #[serde(default)]
    pub max_divergence_ms: Option<f64>,
    /// How far a joint may move at most if the last word before the start is lost \[rad or m\].
    #[serde(default)]
    pub start_travel: Option<f64>,
}

/// One robot's part of a [`CellMotionStatus`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartStatus {
    /// Where it stands.
    pub status: ActionStatus,
    /// Time along its own clock \[s\].
    pub elapsed_s: f64,
    /// Why it failed or was cancelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<Denial>,
}

/// World poses of links. Only links that moved since the last message are in it, but every link
/// once a second, so that a late reader has them all after a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellFrames {
    /// Run of the gateway.
    pub boot_id: Uuid,
    /// Sequence number of this message in this run.
    pub seqno: u64,
    /// Time, gateway's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// Whether every link is in it.
    pub full: bool,
    /// Pose in the world of each link, named `robot/link`.
    pub frames: BTreeMap<String, Pose>,
}
