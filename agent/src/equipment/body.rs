//! Names and bodies of tools and payloads, and what they weigh together.

use armada_model::{Load, Payload, Pose};
use armada_protocol::messages::{ChainEquipment, Inertia};

use super::error::EquipmentError;
use crate::drivers::LoadSetting;

/// Longest name of a tool or payload \[characters\].
pub(super) const MAX_NAME: usize = 64;

pub(super) fn check_name(field: &'static str, name: &str) -> Result<(), EquipmentError> {
    let len = name.chars().count();
    if len == 0 || len > MAX_NAME { Err(EquipmentError::Name { field, len }) } else { Ok(()) }
}

/// The body with this inertia, if one can have it.
pub(super) fn load_of(field: &'static str, inertia: &Inertia) -> Result<Load, EquipmentError> {
    Load::from_elements(inertia.mass_kg, inertia.com_m, inertia.inertia_kg_m2)
        .map_err(|error| EquipmentError::Body { field, error })
}

/// Tool and payload as one body in the flange's frame; what was entered has been checked.
pub(super) fn combined(carries: &ChainEquipment) -> LoadSetting {
    let load = |inertia: &Inertia| load_of("inertia", inertia).unwrap_or_default();
    let Some(tool) = &carries.tool else {
        return LoadSetting::default();
    };
    let own = Payload { attached_at: Pose::default(), load: load(&tool.inertia) };
    let held = carries.payload.as_ref().map(|held| Payload {
        attached_at: tool.tcp * held.pose,
        load: load(&held.payload.inertia),
    });
    let sum = Payload::combined([Some(&own), held.as_ref()].into_iter().flatten());
    let com = sum.centre_of_mass();
    LoadSetting { mass: sum.mass(), com: [com.x, com.y, com.z], inertia: sum.inertia_elements() }
}
