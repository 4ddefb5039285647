//! Velocity of a frame.

#![allow(non_snake_case, reason = "V_WT is the twist of frame T in W, R_AW rotates from W to A")]

use nalgebra::{UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// Velocity of a frame: of its origin \[m/s\] and of its orientation \[rad/s\].
///
/// Both parts are expressed in the axes of one frame, which the variable or field names: `V_WT` is
/// the twist of T in W, expressed in the axes of W. From the wire only finite numbers are taken:
/// `{"linear_mps":[x,y,z],"angular_radps":[x,y,z]}`; a part that is left out is zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Twist {
    /// Velocity of the frame's origin \[m/s\].
    #[serde(rename = "linear_mps", default = "Vector3::zeros", with = "finite")]
    pub linear: Vector3<f64>,
    /// Angular velocity \[rad/s\].
    #[serde(rename = "angular_radps", default = "Vector3::zeros", with = "finite")]
    pub angular: Vector3<f64>,
}

impl Twist {
    /// At rest.
    pub const ZERO: Self =
        Self { linear: Vector3::new(0.0, 0.0, 0.0), angular: Vector3::new(0.0, 0.0, 0.0) };

    /// The twist of a linear \[m/s\] and an angular velocity \[rad/s\].
    #[must_use]
    pub const fn new(linear: Vector3<f64>, angular: Vector3<f64>) -> Self {
        Self { linear, angular }
    }

    /// Linear part in the first three elements, angular part in the last three.
    #[must_use]
    pub fn to_vector(&self) -> Vector6<f64> {
        let (v, w) = (&self.linear, &self.angular);
        Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
    }

    /// The twist of a vector with the linear part in its first three elements.
    #[must_use]
    pub fn from_vector(vector: &Vector6<f64>) -> Self {
        Self {
            linear: Vector3::new(vector[0], vector[1], vector[2]),
            angular: Vector3::new(vector[3], vector[4], vector[5]),
        }
    }

    /// The same motion expressed in the axes of A, if this is expressed in those of W: `R_AW`
    /// rotates a vector from W to A.
    ///
    /// To express a twist in the axes of the tool itself, give the inverse of its orientation.
    #[must_use]
    pub fn in_frame(&self, R_AW: &UnitQuaternion<f64>) -> Self {
        Self { linear: R_AW * self.linear, angular: R_AW * self.angular }
    }

    /// The twist of a point of the same rigid body at `offset` \[m\] from this one's origin, in the
    /// axes this twist is expressed in: `v + w x offset`.
    ///
    /// Source: Lynch and Park, "Modern Robotics", 2017, section 3.3.2, with parallel axes.
    #[must_use]
    pub fn shifted(&self, offset: &Vector3<f64>) -> Self {
        Self { linear: self.linear + self.angular.cross(offset), angular: self.angular }
    }

    /// The twist times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { linear: self.linear * factor, angular: self.angular * factor }
    }

    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.linear.iter().chain(self.angular.iter()).all(|value| value.is_finite())
    }
}

impl Default for Twist {
    fn default() -> Self {
        Self::ZERO
    }
}

/// A vector as three finite numbers.
mod finite {
    use nalgebra::Vector3;
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(
        vector: &Vector3<f64>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        [vector.x, vector.y, vector.z].serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vector3<f64>, D::Error> {
        let values = <[f64; 3]>::deserialize(deserializer)?;
        match values.iter().position(|value| !value.is_finite()) {
            Some(index) => Err(D::Error::custom(format_args!("element {index} is not finite"))),
            None => Ok(Vector3::from(values)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_names_units_on_the_wire_and_takes_rest_for_what_is_left_out() {
        let twist = Twist::new(Vector3::new(0.1, 0.0, -0.2), Vector3::z());
        let text = serde_json::to_string(&twist).expect("numbers encode");
        assert_eq!(text, r#"{"linear_mps":[0.1,0.0,-0.2],"angular_radps":[0.0,0.0,1.0]}"#);
        assert_eq!(serde_json::from_str::<Twist>(&text).expect("decodes"), twist);
        assert_eq!(serde_json::from_str::<Twist>("{}").expect("decodes"), Twist::ZERO);
    }

    #[test]
    fn unknown_fields_and_infinities_are_refused() {
        assert!(serde_json::from_str::<Twist>(r#"{"linear":[0,0,0]}"#).is_err());
        assert!(serde_json::from_str::<Twist>(r#"{"linear_mps":[1e999,0,0]}"#).is_err());
    }

    #[test]
    fn a_point_beside_the_axis_of_a_turn_moves_across() {
        let turn = Twist::new(Vector3::zeros(), Vector3::z() * 2.0);
        let moved = turn.shifted(&Vector3::new(0.5, 0.0, 0.3));
        assert_eq!(moved, Twist::new(Vector3::y(), Vector3::z() * 2.0));
    }

    #[test]
    fn a_frame_turned_by_a_right_angle_sees_x_where_y_was() {
        let R_AW =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -std::f64::consts::FRAC_PI_2);
        let seen = Twist::new(Vector3::y(), Vector3::y()).in_frame(&R_AW);
        assert!((seen.linear - Vector3::x()).amax() < 1e-15, "{seen:?}");
        assert!((seen.angular - Vector3::x()).amax() < 1e-15, "{seen:?}");
    }
}
