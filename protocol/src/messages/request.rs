//! Requests and answers of the methods under `rpc/`.

use armada_model::{JointTrajectory, JointVector, MonoTime};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::CommandMode;
use crate::RobotName;

/// Envelope of every request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request<P> {
    /// Identity of the request: repeated with the same id it is answered again, not done again.
    /// Without one each arrival is a request of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request_id: Option<Uuid>,
    /// Who asks, for people and the audit trail.
    #[serde(default = "anonymous")]
    pub client: String,
    /// What is asked.
    pub params: P,
}

fn anonymous() -> String {
    "anonymous".to_owned()
}

impl<P> Request<P> {
    /// A request with a new identity.
    #[must_use]
    pub fn new(client: impl Into<String>, params: P) -> Self {
        Self { request_id: Some(Uuid::now_v7()), client: client.into(), params }
    }
}

/// No parameters, or nothing to say in an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Empty {}

/// Parameters of `set_mode`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetModeParams {
    /// The mode to enter; every mode but `halt` is entered from `halt`.
    pub mode: CommandMode,
}

/// Answer of `set_mode`, `enable`, `disable` and `reset_errors`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModeAnswer {
    /// The mode now in force.
    pub command_mode: CommandMode,
    /// The epoch now in force.
    pub epoch: u64,
}

/// Answer of `halt`: the ramp to standstill has begun, or the robot stood already.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct HaltAnswer {
    /// The epoch now in force: motions of older epochs are over.
    pub epoch: u64,
}

/// Parameters of `jog_freespace`: move all joints to a position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JogFreespaceParams {
    /// Identity the motion gets; a new one is made if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// Goal of every joint, in the robot's joint order \[rad or m\].
    pub joint_position_rad: JointVector,
    /// Highest speed of every joint \[rad/s or m/s\]; the joints' limits if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_velocity_rad_s: Option<JointVector>,
}

/// Parameters of an agent's `execute_trajectory` and `prepare`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExecuteTrajectoryParams {
    /// Identity the motion gets; a new one is made if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// The trajectory; it names every joint of the robot.
    pub trajectory: JointTrajectory,
}

/// A motion was accepted; what becomes of it is published under `motions/{id}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Accepted {
    /// Identity of the motion.
    pub motion_id: Uuid,
    /// How long it takes \[s\].
    pub duration_s: f64,
    /// Epoch it belongs to.
    pub epoch: u64,
}

/// Answer of `prepare`: valid, and kept for a `commit`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prepared {
    /// Identity of the motion.
    pub motion_id: Uuid,
    /// How long it takes \[s\].
    pub duration_s: f64,
    /// Epoch it belongs to; any halt or stop makes the commit fail.
    pub epoch: u64,
    /// How long it is kept \[ms\].
    pub ttl_ms: u64,
}

/// Parameters of `commit`: start a prepared motion at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommitParams {
    /// Which motion.
    pub motion_id: Uuid,
    /// Run of the agent whose clock `start_ns` is of.
    pub boot_id: Uuid,
    /// Start, agent's monotonic clock \[ns\].
    pub start_ns: MonoTime,
}

/// Parameters of `cancel` and `abort`: end a motion with a ramp to standstill.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CancelParams {
    /// Which motion.
    pub motion_id: Uuid,
}

/// Parameters of an agent's `reset`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResetParams {
    /// The stops to clear; it must list every latched one.
    pub stop_ids: Vec<Uuid>,
}

/// Answer of an agent's `reset`: nothing moves and nothing is enabled by it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResetAnswer {
    /// The stops that were cleared.
    pub cleared: Vec<Uuid>,
    /// The epoch now in force.
    pub epoch: u64,
}

/// Parameters of the cell's `execute_trajectory`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellExecuteTrajectory {
    /// Identity the motion gets; a new one is made if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// Joints are named `robot/joint`; every joint of each robot that takes part is named.
    pub trajectory: JointTrajectory,
}

/// Parameters of the cell's `reset`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellResetParams {
    /// Which robots; all if empty.
    #[serde(default)]
    pub robots: Vec<RobotName>,
}

/// Answer of the cell's `reset`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellResetAnswer {
    /// Robots that are reset, with the stops that were cleared.
    pub reset: Vec<(RobotName, Vec<Uuid>)>,
    /// Robots that refused or did not answer, and why.
    pub refused: Vec<(RobotName, super::Denial)>,
}
