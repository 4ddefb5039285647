//! Whether axes are parallel or meet, within what calibration and rounding leave.

use nalgebra::{Matrix3, Vector3};

use super::chain::Axis;
use super::error::Mismatch;

/// Largest angle between axes that count as parallel \[rad\]; calibrated arms have some 1e-3.
const PARALLEL_RAD: f64 = 3e-3;

/// Largest distance of axes from a point that they count as meeting in \[m\].
const MEET_M: f64 = 3e-3;

/// Least angle between neighbouring axes that must not be parallel \[rad\].
const APART_RAD: f64 = 0.05;

/// Least length of an upper arm or a forearm \[m\].
const SHORTEST_M: f64 = 0.01;

/// How far an arm is from the one that is solved: grows with each condition that is nearly met.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Deviation {
    rad: f64,
    m: f64,
}

impl Deviation {
    /// By how much the ideal arm's equations may fail for a pose that the arm reaches \[m or 1\].
    pub(super) fn slack(&self, axes: &[Axis]) -> f64 {
        let reach: f64 = axes.windows(2).map(|pair| (pair[1].point - pair[0].point).norm()).sum();
        1e-9 + 4.0 * (self.rad * reach.max(1.0) + self.m)
    }

    /// The common direction of `axes`, along the first.
    pub(super) fn parallel(&mut self, axes: &[&Axis]) -> Result<Vector3<f64>, Mismatch> {
        let first = axes[0];
        let mut sum = Vector3::zeros();
        for axis in axes {
            let angle_rad = angle(first, axis);
            if angle_rad > PARALLEL_RAD {
                let (first, second) = (first.name.clone(), axis.name.clone());
                return Err(Mismatch::AxesNotParallel { first, second, angle_rad });
            }
            self.rad = self.rad.max(angle_rad);
            sum += axis.direction * sign(first, axis);
        }
        Ok(sum.normalize())
    }

    /// The point that `axes` meet in.
    pub(super) fn common_point(&mut self, axes: &[&Axis]) -> Result<Vector3<f64>, Mismatch> {
        for pair in axes.windows(2) {
            apart(pair[0], pair[1])?;
        }
        let (mut matrix, mut side) = (Matrix3::zeros(), Vector3::zeros());
        for axis in axes {
            let across = Matrix3::identity() - axis.direction * axis.direction.transpose();
            matrix += across;
            side += across * axis.point;
        }
        // Never fails: two of the axes are apart.
        let point = matrix.try_inverse().map_or(axes[0].point, |inverse| inverse * side);
        let offset_of = |axis: &Axis| (point - axis.point).cross(&axis.direction).norm();
        for axis in axes {
            let offset_m = offset_of(axis);
            if offset_m > MEET_M && axes.iter().all(|other| offset_of(other) <= offset_m) {
                return Err(Mismatch::AxesDoNotMeet {
                    first: axes[0].name.clone(),
                    last: axes[axes.len() - 1].name.clone(),
                    joint: axis.name.clone(),
                    offset_m,
                });
            }
            self.m = self.m.max(offset_m);
        }
        Ok(point)
    }
}

/// 1 if the axes point the same way, else -1.
pub(super) fn sign(first: &Axis, second: &Axis) -> f64 {
    1.0_f64.copysign(first.direction.dot(&second.direction))
}

/// Refuses axes that are parallel.
pub(super) fn apart(first: &Axis, second: &Axis) -> Result<(), Mismatch> {
    let angle_rad = angle(first, second);
    if angle_rad >= APART_RAD {
        return Ok(());
    }
    let (first, second) = (first.name.clone(), second.name.clone());
    Err(Mismatch::AxesParallel { first, second, angle_rad })
}

/// Refuses `length`, between the axes of two joints, if it is too short for an elbow.
pub(super) fn long_enough(
    length: &Vector3<f64>,
    first: &Axis,
    second: &Axis,
) -> Result<(), Mismatch> {
    let length_m = length.norm();
    if length_m >= SHORTEST_M {
        return Ok(());
    }
    let (first, second) = (first.name.clone(), second.name.clone());
    Err(Mismatch::TooShort { first, second, length_m })
}

/// Angle between two lines, at most π/2 \[rad\].
fn angle(first: &Axis, second: &Axis) -> f64 {
    let cross = first.direction.cross(&second.direction).norm();
    cross.atan2(first.direction.dot(&second.direction).abs())
}
