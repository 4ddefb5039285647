//! What a robot is.

use armada_model::{JointLimits, JointType};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::request::is_false;
use super::{ChainEquipment, ParameterInfo, SignalInfo, ToolInfo};
use crate::RobotName;

/// Identity, joints and abilities of a robot; changes only when `model_rev` does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotInfo {
    /// Name in the cell.
    pub robot: RobotName,
    /// Identity that stays the same over restarts, from the robot file.
    pub uuid: Uuid,
    /// This run of the agent.
    pub boot_id: Uuid,
    /// Sequence number of this message in this run.
    pub seqno: u64,
    /// Which driver speaks to the controller, such as `sim`.
    pub vendor: String,
    /// Model name of the maker.
    pub model: String,
    /// Serial number; empty if not known.
    pub serial: String,
    /// Version of the agent's program.
    pub software_version: String,
    /// Revision of this description; raised by each change.
    pub model_rev: u64,
    /// The joints in the order of every array of this robot.
    pub joints: Vec<JointInfo>,
    /// Kinematic chains whose tip poses are in the state.
    pub chains: Vec<ChainInfo>,
    /// What each chain carries, in the order of `chains`.
    pub equipment: Vec<ChainEquipment>,
    /// Tools of the robot file, which can be attached by name.
    pub tools: Vec<ToolInfo>,
    /// Inputs and outputs of the controller.
    pub signals: Vec<SignalInfo>,
    /// Settings of the controller.
    pub parameters: Vec<ParameterInfo>,
    /// What the robot can do.
    pub capabilities: Vec<Capability>,
    /// Methods under `rpc/` that this agent answers.
    pub methods: Vec<String>,
    /// Names of the bits of `flags`, with their values.
    pub flags: Vec<(String, u64)>,
    /// Period of the control loop \[ms\].
    pub period_ms: f64,
    /// Within what time of a stop the robot is measured to stand still \[s\]; else it is stopped
    /// harder, by itself and by whoever asked.
    #[serde(default)]
    pub stop_time_s: f64,
    /// Whether it is moved under a lease only; else anybody may while nobody holds one.
    #[serde(default, skip_serializing_if = "is_false")]
    pub lease_required: bool,
    /// How often the state is published \[Hz\].
    pub state_rate_hz: f64,
    /// Rates at which the state is published besides, as `state/{rate}` \[Hz\].
    pub state_classes_hz: Vec<u32>,
    /// The robot description as URDF text.
    pub urdf: String,
}

/// One joint of a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointInfo {
    /// Name as in the URDF.
    pub name: String,
    /// How it moves, which gives the unit of its numbers.
    #[serde(rename = "type")]
    pub joint_type: JointType,
    /// What it may do, after the robot file has narrowed the URDF's limits.
    pub limits: JointLimits,
    /// What it may do in mode `manual_reduced_speed`, and while the operational mode is not known.
    pub reduced: ReducedLimits,
    /// Home position \[rad or m\]; null if the robot file gives none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub home: Option<f64>,
}

/// Limits of a joint at reduced speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReducedLimits {
    /// Highest speed \[rad/s or m/s\], at most the joint's limit.
    pub velocity: f64,
    /// Highest acceleration and deceleration \[rad/s² or m/s²\], at most the joint's limit.
    pub acceleration: f64,
}

/// A chain of links from a base to a tip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChainInfo {
    /// Name of the chain, such as `arm`.
    pub name: String,
    /// Link the tip's pose is given in.
    pub base_link: String,
    /// Link at the end: the flange or tool centre point.
    pub tip_link: String,
}

/// Something a robot can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Capability {
    /// Jogs: moves by hand.
    JogCommand,
    /// Timed trajectories.
    TrajectoryCommand,
    /// Streamed joint positions.
    PositionCommand,
    /// Streamed joint velocities and twists.
    VelocityCommand,
    /// Homing by the controller.
    HomingCommand,
    /// Errors can be reset by software.
    SoftwareResetErrors,
    /// Drives can be switched by software.
    SoftwareEnable,
    /// Trajectories are interpolated between waypoints.
    InterpolatedTrajectory,
    /// Trajectories can wait for the end of others.
    TrajectoryQueueing,
    /// The speed of motions can be changed while they run.
    SpeedRatio,
    /// The controller makes moves of its own to joint positions.
    DelegatedMoveJoint,
    /// The controller makes moves of its own to poses.
    DelegatedMovePose,
    /// The controller makes straight moves of its own.
    DelegatedMoveLinear,
    /// The controller takes the load of tool and payload.
    LoadSetting,
}
