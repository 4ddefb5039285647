//! What the tool centre point is to reach.

#![allow(non_snake_case, reason = "X_BT is the pose of frame T in frame B, R_BT its rotation")]

use nalgebra::{Isometry3, Matrix3, Unit, UnitQuaternion, Vector3};

/// What the tool centre point, TCP, of a chain is to reach, in the chain's base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InverseTarget {
    /// This pose.
    Pose(Isometry3<f64>),
    /// This position \[m\], with any orientation.
    Position(Vector3<f64>),
    /// This orientation, at any position.
    Orientation(UnitQuaternion<f64>),
    /// This position, with an axis of the tool in a direction: the tool may turn about the axis.
    Axis {
        /// Position of the TCP \[m\].
        position: Vector3<f64>,
        /// The axis in the TCP's frame.
        tool_axis: Unit<Vector3<f64>>,
        /// The direction it is to have, in the base.
        direction: Unit<Vector3<f64>>,
    },
}

/// How far a TCP is from its target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// Distance \[m\]; zero if the target asks for no position.
    pub position: f64,
    /// Angle \[rad\]; zero if the target asks for no orientation.
    pub orientation: f64,
}

/// A target made ready for iterations.
pub(super) struct Task {
    position: Option<Vector3<f64>>,
    aim: Aim,
}

enum Aim {
    Any,
    Full(Matrix3<f64>),
    Axis { tool: Vector3<f64>, direction: Vector3<f64> },
}

/// Six errors, the first three in units of the length, and axes the last three are along.
///
/// Rows that the target leaves free are zero.
pub(super) struct Errors {
    pub(super) rows: [f64; 6],
    pub(super) residual: Residual,
    /// Direction about which the tool may turn: it counts for nothing in the angular rows.
    pub(super) free: Option<Vector3<f64>>,
}

impl InverseTarget {
    /// Whether every number is finite.
    pub(super) fn is_finite(&self) -> bool {
        let all = |values: &[f64]| values.iter().all(|value| value.is_finite());
        match self {
            Self::Pose(X) => {
                all(X.translation.vector.as_slice()) && all(X.rotation.coords.as_slice())
            }
            Self::Position(p) => all(p.as_slice()),
            Self::Orientation(R) => all(R.coords.as_slice()),
            Self::Axis { position, tool_axis, direction } => {
                all(position.as_slice()) && all(tool_axis.as_slice()) && all(direction.as_slice())
            }
        }
    }
}

impl Task {
    pub(super) fn new(target: &InverseTarget) -> Self {
        let matrix = |R: &UnitQuaternion<f64>| *R.to_rotation_matrix().matrix();
        match target {
            InverseTarget::Pose(X) => {
                Self { position: Some(X.translation.vector), aim: Aim::Full(matrix(&X.rotation)) }
            }
            InverseTarget::Position(p) => Self { position: Some(*p), aim: Aim::Any },
            InverseTarget::Orientation(R) => Self { position: None, aim: Aim::Full(matrix(R)) },
            InverseTarget::Axis { position, tool_axis, direction } => Self {
                position: Some(*position),
                aim: Aim::Axis { tool: **tool_axis, direction: **direction },
            },
        }
    }

    /// The position asked for.
    pub(super) const fn position(&self) -> Option<&Vector3<f64>> {
        self.position.as_ref()
    }

    /// The whole orientation, if asked for.
    pub(super) const fn orientation(&self) -> Option<&Matrix3<f64>> {
        match &self.aim {
            Aim::Full(R) => Some(R),
            Aim::Any | Aim::Axis { .. } => None,
        }
    }

    /// About the square of the angle \[rad²\] between the tool's axis and its direction, if asked for.
    pub(super) fn misalignment(&self, R_BT: &Matrix3<f64>) -> f64 {
        match &self.aim {
            Aim::Axis { tool, direction } => 2.0 - 2.0 * (R_BT * tool).dot(direction),
            Aim::Any | Aim::Full(_) => 0.0,
        }
    }

    /// How many directions of motion the target asks for.
    pub(super) const fn rank(&self) -> usize {
        let linear = if self.position.is_some() { 3 } else { 0 };
        let angular = match self.aim {
            Aim::Any => 0,
            Aim::Full(_) => 3,
            Aim::Axis { .. } => 2,
        };
        linear + angular
    }

    /// Which of the linear and of the angular rows count.
    pub(super) const fn counts(&self) -> (bool, bool) {
        (self.position.is_some(), !matches!(self.aim, Aim::Any))
    }

    /// Errors of a TCP at `R_BT`, `p_BT`.
    #[inline]
    pub(super) fn errors(&self, R_BT: &Matrix3<f64>, p_BT: &Vector3<f64>, length: f64) -> Errors {
        let linear = self.position.map_or_else(Vector3::zeros, |position| position - p_BT);
        let (angular, free) = match &self.aim {
            Aim::Any => (Vector3::zeros(), None),
            Aim::Full(R) => (turn_between(R, R_BT), None),
            Aim::Axis { tool, direction } => {
                let now = R_BT * tool;
                (turn_onto(&now, direction), Some(now))
            }
        };
        let scaled = linear / length;
        Errors {
            rows: [scaled.x, scaled.y, scaled.z, angular.x, angular.y, angular.z],
            residual: Residual { position: linear.norm(), orientation: angular.norm() },
            free,
        }
    }
}

/// Rotation vector \[rad\] that takes `from` to `to`: of angle 0 to pi.
#[inline]
fn turn_between(to: &Matrix3<f64>, from: &Matrix3<f64>) -> Vector3<f64> {
    let R = to * from.transpose();
    let skew = Vector3::new(R.m32 - R.m23, R.m13 - R.m31, R.m21 - R.m12) * 0.5;
    let (sine, cosine) = (skew.norm(), 0.5 * (R.trace() - 1.0));
    if cosine > 0.0 || sine > 1e-4 {
        let factor = if sine > 1e-9 { sine.atan2(cosine) / sine } else { 1.0 };
        return skew * factor;
    }
    // Near half a turn the skew part vanishes; the symmetric one is cos 1 + (1 - cos) a a^T.
    let symmetric = (R + R.transpose()) * 0.5 - Matrix3::identity() * cosine;
    let axis = symmetric.column(symmetric.diagonal().imax()).normalize();
    let sign = if axis.dot(&skew) < 0.0 { -1.0 } else { 1.0 };
    axis * (sign * sine.atan2(cosine))
}

/// Shortest rotation vector \[rad\] that takes the unit vector `from` to `to`.
#[inline]
fn turn_onto(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    let cross = from.cross(to);
    let (sine, cosine) = (cross.norm(), from.dot(to));
    if cosine > 0.0 || sine > 1e-9 {
        let factor = if sine > 1e-12 { sine.atan2(cosine) / sine } else { 1.0 };
        return cross * factor;
    }
    let across = from.cross(&Vector3::ith(from.iamin(), 1.0)).normalize();
    across * std::f64::consts::PI
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Rotation3;

    use super::*;

    #[test]
    fn the_turn_between_two_orientations_is_the_logarithm() {
        let from = Rotation3::from_euler_angles(0.3, -0.2, 1.1);
        for angle in [0.0, 1e-12, 1e-7, 0.1, 1.5, 3.0, PI - 5e-4, PI - 5e-5, PI - 1e-8, PI] {
            for axis in [Vector3::x(), Vector3::new(0.6, -0.8, 0.0), Vector3::new(1.0, 1.0, 1.0)] {
                let axis = Unit::new_normalize(axis);
                let to = Rotation3::from_axis_angle(&axis, angle) * from;
                let turn = turn_between(to.matrix(), from.matrix());
                let again = Rotation3::from_scaled_axis(turn) * from;
                let difference = (again.matrix() - to.matrix()).amax();
                assert!(difference < 1e-11, "{angle} {axis:?}: {difference:e}");
                assert!((turn.norm() - angle).abs() < 1e-11, "{angle}: {}", turn.norm());
            }
        }
    }

    #[test]
    fn the_turn_onto_a_direction_brings_it_there_even_from_the_opposite() {
        for to in [Vector3::x(), -Vector3::x(), Vector3::new(-0.6, 0.8, 0.0)] {
            let turn = turn_onto(&Vector3::x(), &to);
            let reached = Rotation3::from_scaled_axis(turn) * Vector3::x();
            assert!((reached - to).amax() < 1e-15, "{to}");
        }
    }
}
