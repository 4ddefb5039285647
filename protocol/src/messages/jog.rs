//! Jogs and homing: motion by hand, without a path.

use armada_model::{JointVector, Twist};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::request::is_false;

/// Parameters of `jog_joint`: move joints at a speed, until a time after the newest request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JogJointParams {
    /// Identity the motion gets; a new one is made if left out. Repeat it to keep a jog going.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// Speed of every joint, in the robot's joint order \[rad/s or m/s\].
    pub joint_velocity_rad_s: JointVector,
    /// Dead-man time: how long to move without another request \[s\], 0.02 to 10.
    pub timeout_s: f64,
    /// Whether to be answered when the motion has ended.
    #[serde(default, skip_serializing_if = "is_false")]
    pub wait: bool,
}

/// Parameters of `jog_cartesian`: move tools at a speed, until a time after the newest request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JogCartesianParams {
    /// Identity the motion gets; a new one is made if left out. Repeat it to keep a jog going.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// Speeds of the tools of one or more chains.
    pub chains: Vec<ChainTwist>,
    /// Dead-man time: how long to move without another request \[s\], 0.02 to 10.
    pub timeout_s: f64,
    /// Whether to be answered when the motion has ended.
    #[serde(default, skip_serializing_if = "is_false")]
    pub wait: bool,
}

/// Speed of the tool of one chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChainTwist {
    /// Name of the chain.
    pub chain: String,
    /// Speed of the tool centre point, in the axes of `frame`.
    pub twist: Twist,
    /// Whose axes.
    #[serde(default)]
    pub frame: JogFrame,
}

/// Axes in which a speed of a tool is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JogFrame {
    /// The base link of the chain.
    #[default]
    Base,
    /// The tool itself.
    Tool,
    /// The world, as the robot file's `mount` has it.
    World,
}

/// Parameters of `home`, in mode `homing`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HomeParams {
    /// Identity the motion gets; a new one is made if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion_id: Option<Uuid>,
    /// Groups of joints by name, one after the other; joints of a group at the same time. Empty:
    /// every joint at the same time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub order: Vec<Vec<String>>,
    /// How.
    #[serde(default)]
    pub method: HomeMethod,
    /// Whether to be answered when the motion has ended.
    #[serde(default, skip_serializing_if = "is_false")]
    pub wait: bool,
}

/// How joints are homed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HomeMethod {
    /// The controller searches the reference of its encoders.
    #[default]
    Controller,
    /// The joints move to the home positions of the robot file; they know where they are.
    MoveToHome,
}
