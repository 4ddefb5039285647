//! How exactly a path is followed, and what stops it.

use super::error::CartesianError;

/// Least tolerance of a path \[m\] and \[rad\]: poses are solved ten times as exactly.
pub const MIN_PATH_TOLERANCE: f64 = 1e-8;

/// How a Cartesian path becomes a motion of joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartesianOptions {
    /// Largest distance of the tool from the path \[m\], between the poses that are solved too; at
    /// least [`MIN_PATH_TOLERANCE`].
    pub position_tolerance: f64,
    /// Largest angle of the tool from the path \[rad\], likewise.
    pub angle_tolerance: f64,
    /// Most that a joint may move between two solved poses \[rad or m\]. They are laid closer until
    /// that holds; a joint that still moves more within a millionth of the path jumps.
    pub max_joint_step: f64,
    /// Most that a joint may move per length of the path \[rad/m or m/m\]; at a tool speed of `v`
    /// \[m/s\] the joint has this times `v`. Near a singularity it grows without bound.
    pub max_joint_rate: f64,
    /// Smallest singular value of the Jacobian, with lengths in \[m\], that the path may pass: the
    /// distance to a singularity, across which posture is not determined. Zero allows all.
    pub min_singular_value: f64,
    /// Highest speed of the tool along the path \[m/s\], infinite if only the joints limit it.
    pub max_linear_speed: f64,
    /// Highest angular speed of the tool \[rad/s\], infinite if only the joints limit it.
    pub max_angular_speed: f64,
}

impl Default for CartesianOptions {
    /// 0.1 mm and 1 mrad; steps of 0.1 rad, 100 rad/m and singular values down to 0.001; as fast
    /// as the joints allow.
    fn default() -> Self {
        Self {
            position_tolerance: 1e-4,
            angle_tolerance: 1e-3,
            max_joint_step: 0.1,
            max_joint_rate: 100.0,
            min_singular_value: 1e-3,
            max_linear_speed: f64::INFINITY,
            max_angular_speed: f64::INFINITY,
        }
    }
}

impl CartesianOptions {
    pub(super) fn check(&self) -> Result<(), CartesianError> {
        let tolerances = [
            ("position_tolerance", self.position_tolerance),
            ("angle_tolerance", self.angle_tolerance),
        ];
        for (field, value) in tolerances {
            // Written so that not a number is refused as well.
            let is_attainable = value >= MIN_PATH_TOLERANCE;
            if !is_attainable {
                return Err(CartesianError::Tolerance { field, value });
            }
        }
        let positive = [
            ("max_joint_step", self.max_joint_step),
            ("max_joint_rate", self.max_joint_rate),
            ("max_linear_speed", self.max_linear_speed),
            ("max_angular_speed", self.max_angular_speed),
        ];
        for (field, value) in positive {
            let is_positive = value > 0.0;
            if !is_positive {
                return Err(CartesianError::Option { field, value });
            }
        }
        let (field, value) = ("min_singular_value", self.min_singular_value);
        let is_distance = value >= 0.0;
        if is_distance { Ok(()) } else { Err(CartesianError::Option { field, value }) }
    }
}
