//! Rigid transforms as they go over the wire.

use std::ops::Mul;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// How far the norm of a quaternion from the wire may be from one before it is refused.
const QUATERNION_NORM_TOLERANCE: f64 = 1e-3;

/// Pose of one frame in another: a rotation and a translation \[m\].
///
/// A variable `X_AB` holds the pose of frame B in frame A, so `X_AC = X_AB * X_BC`.
/// On the wire: `{"position_m":{"x","y","z"},"orientation":{"w","x","y","z"}}`; a quaternion
/// within 0.1 % of unit length is normalised, any other is refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "PoseFields", into = "PoseFields")]
pub struct Pose(Isometry3<f64>);

/// Why numbers are not a [`Pose`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// A coordinate is infinite or not a number.
    #[error("{field} is {value}, which is not finite")]
    NotFinite {
        /// Name of the coordinate, such as `position_m.x`.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// The quaternion is not of unit length.
    #[error("orientation has norm {norm}, expected 1 within {QUATERNION_NORM_TOLERANCE}")]
    NotUnit {
        /// Norm of the quaternion.
        norm: f64,
    },
}

impl Pose {
    /// Rotation and translation as one transform.
    #[must_use]
    pub const fn from_isometry(isometry: Isometry3<f64>) -> Self {
        Self(isometry)
    }

    /// The pose without rotation at `x`, `y`, `z` \[m\].
    #[must_use]
    pub fn from_translation(x: f64, y: f64, z: f64) -> Self {
        Self(Isometry3::translation(x, y, z))
    }

    /// The transform for calculations.
    #[must_use]
    pub const fn isometry(&self) -> &Isometry3<f64> {
        &self.0
    }

    /// Position of the frame's origin \[m\].
    #[must_use]
    pub const fn position(&self) -> &Vector3<f64> {
        &self.0.translation.vector
    }

    /// The pose that undoes this one.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self(self.0.inverse())
    }

    /// Distance of the origins \[m\] and angle between the orientations \[rad\].
    #[must_use]
    pub fn distance(&self, other: &Self) -> (f64, f64) {
        ((self.position() - other.position()).norm(), self.0.rotation.angle_to(&other.0.rotation))
    }
}

impl Mul for Pose {
    type Output = Self;

    fn mul(self, rhs: Self) -> Self {
        Self(self.0 * rhs.0)
    }
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseFields {
    #[serde(default = "zero")]
    position_m: Xyz,
    #[serde(default = "identity")]
    orientation: Wxyz,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Wxyz {
    w: f64,
    x: f64,
    y: f64,
    z: f64,
}

const fn zero() -> Xyz {
    Xyz { x: 0.0, y: 0.0, z: 0.0 }
}

const fn identity() -> Wxyz {
    Wxyz { w: 1.0, x: 0.0, y: 0.0, z: 0.0 }
}

impl TryFrom<PoseFields> for Pose {
    type Error = PoseError;

    fn try_from(fields: PoseFields) -> Result<Self, PoseError> {
        let (p, q) = (fields.position_m, fields.orientation);
        let named = [
            ("position_m.x", p.x),
            ("position_m.y", p.y),
            ("position_m.z", p.z),
            ("orientation.w", q.w),
            ("orientation.x", q.x),
            ("orientation.y", q.y),
            ("orientation.z", q.z),
        ];
        for (field, value) in named {
            if !value.is_finite() {
                return Err(PoseError::NotFinite { field, value });
            }
        }
        let quaternion = Quaternion::new(q.w, q.x, q.y, q.z);
        let norm = quaternion.norm();
        if (norm - 1.0).abs() > QUATERNION_NORM_TOLERANCE {
            return Err(PoseError::NotUnit { norm });
        }
        // Of unit length already, as far as rounding allows, it stays as it is, bit for bit: what was
        // written by `Serialize` comes back the same.
        let rotation = if (norm - 1.0).abs() <= 4.0 * f64::EPSILON {
            UnitQuaternion::new_unchecked(quaternion)
        } else {
            UnitQuaternion::new_normalize(quaternion)
        };
        Ok(Self(Isometry3::from_parts(Translation3::new(p.x, p.y, p.z), rotation)))
    }
}

impl From<Pose> for PoseFields {
    fn from(pose: Pose) -> Self {
        let p = pose.position();
        let q = pose.0.rotation.quaternion();
        Self {
            position_m: Xyz { x: p.x, y: p.y, z: p.z },
            orientation: Wxyz { w: q.w, x: q.i, y: q.j, z: q.k },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wire_form_names_every_coordinate() {
        let text = serde_json::to_string(&Pose::from_translation(1.0, 2.0, 3.0)).expect("encodes");
        assert_eq!(
            text,
            r#"{"position_m":{"x":1.0,"y":2.0,"z":3.0},"orientation":{"w":1.0,"x":0.0,"y":0.0,"z":0.0}}"#
        );
    }

    #[test]
    fn a_quaternion_far_from_unit_length_is_refused() {
        let text = r#"{"orientation":{"w":0.5,"x":0.0,"y":0.0,"z":0.0}}"#;
        let error = serde_json::from_str::<Pose>(text).expect_err("norm is 0.5");
        assert!(error.to_string().contains("norm 0.5"), "{error}");
    }

    #[test]
    fn a_pose_comes_back_bit_for_bit() {
        for step in 0..200 {
            let angle = Vector3::new(0.01, -0.02, 0.013) * f64::from(step);
            let pose = Pose::from_isometry(Isometry3::new(Vector3::new(0.1, 0.2, -0.3), angle));
            let text = serde_json::to_string(&pose).expect("encodes");
            assert_eq!(serde_json::from_str::<Pose>(&text).expect("decodes"), pose);
        }
    }

    #[test]
    fn a_pose_times_its_inverse_is_identity() {
        let pose = Pose::from_isometry(Isometry3::new(
            Vector3::new(0.1, -0.2, 0.3),
            Vector3::new(0.4, 0.5, -0.6),
        ));
        let (distance, angle) = (pose * pose.inverse()).distance(&Pose::default());
        assert!(distance < 1e-15 && angle < 1e-7, "{distance} m, {angle} rad");
    }
}
