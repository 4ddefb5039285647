//! Tools and payloads: what a flange carries.

use armada_model::Pose;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Mass and inertia of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inertia {
    /// Mass \[kg\], not negative.
    pub mass_kg: f64,
    /// Centre of mass in the body's frame \[m\].
    #[serde(default)]
    pub com_m: [f64; 3],
    /// Inertia about the centre of mass, xx xy xz yy yz zz \[kg m²\]; zero if not known.
    #[serde(default)]
    pub inertia_kg_m2: [f64; 6],
}

/// A tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToolInfo {
    /// Name, 1 to 64 characters.
    pub name: String,
    /// Identity of this piece of equipment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uuid: Option<Uuid>,
    /// What kind of tool.
    #[serde(default)]
    pub tool_type: ToolType,
    /// Tool centre point in the flange.
    pub tcp: Pose,
    /// Mass and inertia, in the flange's frame.
    #[serde(default)]
    pub inertia: Inertia,
    /// For people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
}

/// Kind of a tool.
///
/// Source: Robot Raconteur `com.robotraconteur.robotics.tool`, `ToolTypeCode`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToolType {
    /// Not known.
    #[default]
    Unknown,
    /// A gripper that is open or closed.
    BasicGripper,
    /// A gripper of any width.
    BasicContinuousGripper,
    /// Driven by air.
    PneumaticGripper,
    /// Driven by a motor.
    ElectricGripper,
    /// Holds by vacuum.
    VacuumGripper,
    /// Holds by soft fingers.
    SoftGripper,
    /// A welding torch.
    Welder,
    /// A hand with fingers.
    Hand,
    /// A palletizer.
    Palletizer,
    /// Something else.
    Other,
}

/// A payload, held by a tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PayloadInfo {
    /// Name, 1 to 64 characters.
    pub name: String,
    /// Identity of this piece.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uuid: Option<Uuid>,
    /// Mass and inertia, in the payload's own frame.
    #[serde(default)]
    pub inertia: Inertia,
    /// For people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
}

/// What one chain carries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainEquipment {
    /// Name of the chain.
    pub chain: String,
    /// The tool, if there is one.
    pub tool: Option<ToolInfo>,
    /// The payload, if there is one.
    pub payload: Option<AttachedPayload>,
}

/// A payload where it is held.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AttachedPayload {
    /// The payload.
    pub payload: PayloadInfo,
    /// Its pose in the tool centre point.
    pub pose: Pose,
}

/// Parameters of `attach_tool`: exactly one of `tool` and `name`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AttachToolParams {
    /// Name of the chain; may be left out if there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chain: Option<String>,
    /// The tool.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool: Option<ToolInfo>,
    /// Name of a tool of the robot file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

/// Parameters of `detach_tool` and `detach_payload`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DetachParams {
    /// Name of the chain; may be left out if there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chain: Option<String>,
    /// Name of what is to be detached; whatever is there if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

/// Parameters of `attach_payload`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AttachPayloadParams {
    /// Name of the chain; may be left out if there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chain: Option<String>,
    /// The payload.
    pub payload: PayloadInfo,
    /// Its pose in the tool centre point.
    #[serde(default)]
    pub pose: Pose,
}

/// Answer of attaching and detaching.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EquipmentAnswer {
    /// What the chain carries now.
    pub equipment: ChainEquipment,
    /// Revision of tools and payloads, as `config_seqno` in the state.
    pub config_seqno: u64,
    /// Revision of the robot's description.
    pub model_rev: u64,
}
