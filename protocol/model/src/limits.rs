//! What a joint may do.

use serde::{Deserialize, Serialize};

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointType {
    /// Turns between two limits; positions in \[rad\].
    Revolute,
    /// Turns without limits; positions in \[rad\].
    Continuous,
    /// Slides between two limits; positions in \[m\].
    Prismatic,
}

/// What one joint may do, in the joint's unit: \[rad\] if it turns, \[m\] if it slides.
///
/// A limit that is `None` does not exist; JSON leaves it out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointLimits {
    /// Lowest position.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower: Option<f64>,
    /// Highest position.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper: Option<f64>,
    /// Highest speed \[1/s\], above zero for a joint that is driven.
    pub velocity: f64,
    /// Highest acceleration and deceleration \[1/s²\]; URDF rarely gives it, the robot file must.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acceleration: Option<f64>,
    /// Highest jerk \[1/s³\], the rate of change of acceleration; URDF before 1.2 cannot give it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jerk: Option<f64>,
    /// Highest torque \[Nm\] or force \[N\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort: Option<f64>,
}

impl JointLimits {
    /// Whether `position` lies inside the position limits.
    #[must_use]
    pub fn contains(&self, position: f64) -> bool {
        self.lower.is_none_or(|lower| position >= lower)
            && self.upper.is_none_or(|upper| position <= upper)
    }
}
