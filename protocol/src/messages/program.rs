//! Single moves to a goal, speed, pause: motion that the robot's side plans.

use armada_model::{JointVector, Pose};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::request::{is_default, is_false};
use super::{LeaseLoss, Queue};

/// Parameters of `pause` and `resume`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionParams {
    /// Which motion.
    pub motion_id: Uuid,
}

/// Parameters of `set_speed_ratio`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeedRatioParams {
    /// Speed of all motions over what they were planned for, 0.01 to 1.
    pub ratio: f64,
}

/// Answer of `set_speed_ratio`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpeedRatioAnswer {
    /// The ratio now in force.
    pub speed_ratio: f64,
}

/// How a single move is made; all fields may be left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MoveOptions {
    /// Speed over the limits, above 0 to 1.
    pub speed: f64,
    /// How far from the goal the tool may leave the path for the next move \[m\], 0 to 1; needs
    /// `connect`.
    pub blend_radius_m: f64,
    /// Whether another move follows, to be planned together with this one: nothing moves before
    /// the first move that does not connect. Then all are one motion with the id of the last; each
    /// of the others is `complete` when its corner was passed, and ends as the motion does if that
    /// ends early. Until then all are `queued`, at most 32; a change of the epoch cancels them.
    /// Moves that blend are of one kind, chain and speed.
    pub connect: bool,
    /// Who plans and executes.
    pub executor: MoveExecutor,
    /// What to do if a motion is in progress: `refuse` or `append`.
    #[serde(skip_serializing_if = "is_default")]
    pub queue: Queue,
    /// What to do if the lease is lost on the way.
    #[serde(skip_serializing_if = "is_default")]
    pub on_lease_loss: LeaseLoss,
    /// Whether to be answered when the motion has ended.
    #[serde(skip_serializing_if = "is_false")]
    pub wait: bool,
}

impl Default for MoveOptions {
    fn default() -> Self {
        Self {
            speed: 1.0,
            blend_radius_m: 0.0,
            connect: false,
            executor: MoveExecutor::Auto,
            queue: Queue::Refuse,
            on_lease_loss: LeaseLoss::StopOnPath,
            wait: false,
        }
    }
}

/// Who plans and executes a move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MoveExecutor {
    /// The controller if it can and the robot file says `delegate: auto`, else the agent.
    #[default]
    Auto,
    /// The controller; refused if it cannot.
    Controller,
    /// The agent's control loop.
    Agent,
}

/// Parameters of `move_joint`, in mode `trajectory`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MoveJointParams {
    /// Identity the motion gets; a new one is made if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// Goal of every joint, in the robot's joint order \[rad or m\].
    pub joint_position_rad: JointVector,
    /// How.
    #[serde(default)]
    pub options: MoveOptions,
}

/// Parameters of `move_pose` and `move_linear`, in mode `trajectory`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MovePoseParams {
    /// Identity the motion gets; a new one is made if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// Name of the chain; may be left out if there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chain: Option<String>,
    /// Goal of the tool centre point, in the chain's base link.
    pub pose: Pose,
    /// How.
    #[serde(default)]
    pub options: MoveOptions,
}

/// Parameters of `move_home`, in mode `trajectory`: to the home positions of the robot file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MoveHomeParams {
    /// Identity the motion gets; a new one is made if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// How.
    #[serde(default)]
    pub options: MoveOptions,
}

/// Parameters of `forward_kinematics`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForwardKinematicsParams {
    /// Name of the chain; may be left out if there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chain: Option<String>,
    /// Position of every joint \[rad or m\]; the measured ones if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_position_rad: Option<JointVector>,
}

/// Answer of `forward_kinematics`, poses in the chain's base link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForwardKinematicsAnswer {
    /// Name of the chain.
    pub chain: String,
    /// Tool centre point.
    pub tcp: Pose,
    /// Flange.
    pub flange: Pose,
}

/// Parameters of `inverse_kinematics`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InverseKinematicsParams {
    /// Name of the chain; may be left out if there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chain: Option<String>,
    /// Wanted pose of the tool centre point, in the chain's base link.
    pub pose: Pose,
    /// Where to begin: the solution is one near it \[rad or m\]; the measured position if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed_rad: Option<JointVector>,
}

/// Answer of `inverse_kinematics`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InverseKinematicsAnswer {
    /// Name of the chain.
    pub chain: String,
    /// Position of every joint; those outside the chain as in the seed \[rad or m\].
    pub joint_position_rad: JointVector,
}
