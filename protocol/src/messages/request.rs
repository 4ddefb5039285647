//! Requests and answers of the methods under `rpc/`.

use std::collections::BTreeMap;

use armada_model::{JointTrajectory, JointVector, MonoTime};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{ActionStatus, CommandMode, Coupling, GroupParams, GroupReadiness};
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
    /// The lease under which it is asked; not needed while nobody holds one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lease: Option<Uuid>,
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
        Self { request_id: Some(Uuid::now_v7()), client: client.into(), lease: None, params }
    }

    /// The same under a lease.
    #[must_use]
    pub fn under(mut self, lease: Option<Uuid>) -> Self {
        self.lease = lease;
        self
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
    /// Whether to be answered when the motion has ended.
    #[serde(default, skip_serializing_if = "is_false")]
    pub wait: bool,
}

/// Parameters of an agent's `execute_trajectory`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExecuteTrajectoryParams {
    /// Identity the motion gets; a new one is made if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// The trajectory; it names every joint of the robot.
    pub trajectory: JointTrajectory,
    /// What to do if a motion is in progress.
    #[serde(default, skip_serializing_if = "is_default")]
    pub queue: Queue,
    /// What to do if the lease is lost on the way.
    #[serde(default, skip_serializing_if = "is_default")]
    pub on_lease_loss: LeaseLoss,
    /// Whether to be answered when the motion has ended.
    #[serde(default, skip_serializing_if = "is_false")]
    pub wait: bool,
}

impl ExecuteTrajectoryParams {
    /// The trajectory at once, to stop on its path if the lease is lost.
    #[must_use]
    pub const fn at_once(motion_id: Option<Uuid>, trajectory: JointTrajectory) -> Self {
        let (queue, on_lease_loss) = (Queue::Refuse, LeaseLoss::StopOnPath);
        Self { motion_id, trajectory, queue, on_lease_loss, wait: false }
    }
}

/// Parameters of `prepare`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrepareParams {
    /// Identity the motion gets; a new one is made if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// The trajectory; it names every joint of the robot.
    pub trajectory: JointTrajectory,
    /// With whom it is to be followed; alone, at an instant, if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<GroupParams>,
    /// What to do if the lease is lost on the way.
    #[serde(default, skip_serializing_if = "is_default")]
    pub on_lease_loss: LeaseLoss,
}

impl PrepareParams {
    /// A trajectory that is followed alone, at an instant.
    #[must_use]
    pub const fn alone(motion_id: Option<Uuid>, trajectory: JointTrajectory) -> Self {
        Self { motion_id, trajectory, group: None, on_lease_loss: LeaseLoss::StopOnPath }
    }
}

/// What becomes of a trajectory that comes while another is in progress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Queue {
    /// It is refused as busy.
    #[default]
    Refuse,
    /// It waits for the end of the last one in the queue, where it must begin.
    Append,
    /// As `append`, and the robot does not come to rest in between where the limits allow: the
    /// way leaves the end of the one and the beginning of the other by their tolerances at most.
    AppendBlended,
    /// It takes the place of what is in progress and in the queue, which end as cancelled; the
    /// robot goes over to it without a halt where the limits allow.
    Replace,
}

/// What becomes of a motion whose lease runs out. Streams and jogs always stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LeaseLoss {
    /// It comes to rest on its path.
    #[default]
    StopOnPath,
    /// It goes on to its end; what is queued behind it is cancelled.
    Finish,
    /// It goes on for so long \[s\], above 0 to 60, and then comes to rest on its path.
    ContinueS(f64),
}

/// A motion was accepted; what becomes of it is published under `motions/{id}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Accepted {
    /// Identity of the motion.
    pub motion_id: Uuid,
    /// How long it takes \[s\]; 0 if that is not known.
    pub duration_s: f64,
    /// Epoch it belongs to.
    pub epoch: u64,
    /// How it ended, if the answer was to wait for that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub status: Option<ActionStatus>,
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
    /// What the others need to know of it, if it is to be followed with others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<GroupReadiness>,
}

/// Parameters of `commit`: start a prepared motion at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommitParams {
    /// Which motion.
    pub motion_id: Uuid,
    /// Run of the agent whose clock `start_ns` is of.
    pub boot_id: Uuid,
    /// Start, agent's monotonic clock \[ns\].
    pub start_ns: MonoTime,
    /// Fastest change of the rate of all robots \[1/s\]: the lowest of what they answered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_slope_s: Option<f64>,
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
    /// The number that the robot's status asks for in [`ResetNeeds`](super::ResetNeeds).
    pub nonce: Uuid,
    /// Signature with the reset key, in hexadecimal, if the robot asks for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signature: Option<String>,
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
    /// How closely the robots are tied together.
    #[serde(default, skip_serializing_if = "is_default")]
    pub coupling: Coupling,
    /// The lease of each robot that somebody holds one of.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub leases: BTreeMap<RobotName, Uuid>,
    /// What the whole does if a lease is lost on the way.
    #[serde(default, skip_serializing_if = "is_default")]
    pub on_lease_loss: LeaseLoss,
    /// Revision of each robot's tools and payloads that it was made for; any if left out.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub model_revs: BTreeMap<RobotName, u64>,
}

impl CellExecuteTrajectory {
    /// The trajectory under no lease, coupled as it is by default.
    #[must_use]
    pub fn new(motion_id: Option<Uuid>, trajectory: JointTrajectory) -> Self {
        Self {
            motion_id,
            trajectory,
            coupling: Coupling::default(),
            leases: BTreeMap::new(),
            on_lease_loss: LeaseLoss::StopOnPath,
            model_revs: BTreeMap::new(),
        }
    }
}

/// Parameters of the cell's `reset`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellResetParams {
    /// What is to be cleared, by robot, as it was shown to whoever asks; signed where the robot asks
    /// for it. A stop that came since is not cleared.
    pub resets: BTreeMap<RobotName, ResetParams>,
}

/// Answer of the cell's `reset`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellResetAnswer {
    /// Robots that are reset, with the stops that were cleared.
    pub reset: Vec<(RobotName, Vec<Uuid>)>,
    /// Robots that refused or did not answer, and why.
    pub refused: Vec<(RobotName, super::Denial)>,
}

pub(super) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "what serde wants")]
pub(super) const fn is_false(value: &bool) -> bool {
    !*value
}
