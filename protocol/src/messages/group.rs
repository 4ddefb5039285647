//! Motions of several robots that watch each other directly, agent to agent.

use armada_model::JointTrajectory;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::Denial;
use crate::RobotName;

/// How closely the robots of a motion are tied together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Coupling {
    /// They start at one instant and end together if one fails; each keeps its own pace.
    Independent,
    /// They are always at the same phase of the motion: pauses and speeds are common.
    #[default]
    TimeSynced,
    /// As `time_synced`, and whoever stops takes all others along on one common ramp, which keeps
    /// what they hold between them.
    Rigid,
}

/// With whom a prepared trajectory is to be followed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupParams {
    /// The other robots.
    pub partners: Vec<RobotName>,
    /// How closely they are tied together.
    #[serde(default)]
    pub coupling: Coupling,
    /// Silence of a partner after which all stop \[ms\], 30 to 150.
    #[serde(default = "default_loss_ms")]
    pub loss_ms: u64,
    /// How far the phases of two robots may be apart before all stop \[ms\].
    #[serde(default = "default_divergence_ms")]
    pub max_divergence_ms: f64,
    /// Revision of the robot's tools and payloads that the motion was made for; any if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_rev: Option<u64>,
}

const fn default_loss_ms() -> u64 {
    60
}

const fn default_divergence_ms() -> f64 {
    50.0
}

/// What an agent answers about a prepared trajectory that is to be followed with others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupReadiness {
    /// Longest time to rest on the path, from anywhere on it \[s\].
    pub stop_time_s: f64,
    /// Fastest change of the rate that is legal everywhere on the path \[1/s\]; 0 if the trajectory
    /// leaves no room for one.
    pub rate_slope_s: f64,
    /// Furthest that a joint moves until it rests, if a partner is lost at the start \[rad or m\].
    pub start_travel: f64,
    /// How late the controller does what it is sent \[ms\].
    pub controller_lag_ms: f64,
    /// Revision of tools and payloads in force.
    pub model_rev: u64,
}

/// `go`: the sender is ready, and will start if all its partners are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupGo {
    /// Which motion.
    pub motion_id: Uuid,
    /// Who.
    pub robot: RobotName,
    /// Run of its agent.
    pub boot_id: Uuid,
}

/// `heartbeat`, every 20 ms from `commit` to the end: where the sender is on the common path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupHeartbeat {
    /// Which motion.
    pub motion_id: Uuid,
    /// Who.
    pub robot: RobotName,
    /// Run of its agent.
    pub boot_id: Uuid,
    /// Number of the heartbeat of this motion; older ones do not count.
    pub seq: u64,
    /// Where the sender stands.
    pub state: GroupState,
    /// Time since the common start by the sender's clock \[s\]; below 0 before it.
    pub time_s: f64,
    /// Phase it was at then \[s\].
    pub phase_s: f64,
    /// How fast its phase runs.
    pub rate: f64,
    /// Largest tracking error over its tolerance, 0 to 1.
    pub error: f64,
    /// Highest rate it allows the group.
    pub scale: f64,
    /// Highest rate it allows from `scale_next_from_s` on.
    pub scale_next: f64,
    /// Phase from which that counts \[s\]; all robots change there.
    pub scale_next_from_s: f64,
    /// Time since the common start from which it counts as well \[s\]: for the end of a pause, when
    /// no phase goes on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_next_at_s: Option<f64>,
}

/// Where a robot stands in a motion of several.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GroupState {
    /// It waits for the start.
    Armed,
    /// It moves.
    Running,
    /// It has reached its goal.
    Done,
    /// It comes to rest before its goal, or has.
    Aborting,
}

/// `abort`: the sender stops, and its partners are to do the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupAbort {
    /// Which motion.
    pub motion_id: Uuid,
    /// Who.
    pub robot: RobotName,
    /// Run of its agent.
    pub boot_id: Uuid,
    /// Why.
    pub reason: Denial,
    /// Phase at which the common ramp begins \[s\], for `rigid`; at once if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_phase_s: Option<f64>,
}

/// What the motion was like, as measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroupQuality {
    /// Largest difference of phase to a partner at the same time \[ms\].
    pub max_divergence_ms: f64,
    /// Longest silence of a partner \[ms\].
    pub max_silence_ms: f64,
}

/// Parameters of the cell's `check_clearance`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckClearanceParams {
    /// Joints are named `robot/joint`; every joint of each robot that takes part is named.
    pub trajectory: JointTrajectory,
    /// How far the phases of two robots may be apart \[ms\]: what lies between is checked as well.
    #[serde(default)]
    pub offset_ms: f64,
}

/// Answer of the cell's `check_clearance`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClearanceAnswer {
    /// Whether every pair keeps the least distance.
    pub clear: bool,
    /// The least distance that the cell demands \[m\].
    pub required_m: f64,
    /// Smallest distance that was found \[m\]: a lower bound of the true one if `clear`, else that of
    /// the place where the search ended; null if no two robots have shapes.
    pub distance_m: Option<f64>,
    /// The two links, named `robot/link`, where it was found.
    pub links: Option<(String, String)>,
    /// Where on the motion \[s\].
    pub at_s: Option<f64>,
    /// Links that have no shape, so nothing is known of them.
    pub without_shape: Vec<String>,
}

/// Parameters of the cell's `set_speed_ratio`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellSpeedRatioParams {
    /// Which motion.
    pub motion_id: Uuid,
    /// Speed over that of the trajectory, 0.01 to 1.
    pub ratio: f64,
}
