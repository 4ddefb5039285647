//! Paths against closed forms, finite differences and their own promises.

#![allow(clippy::panic, reason = "a test fails by panicking")]

mod blends;
mod geometry;
mod refusals;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::{CartesianMove, CartesianPath, Pose};

const WEIGHT: f64 = 0.1;

fn pose(position: [f64; 3], rotation: [f64; 3]) -> Pose {
    Pose::from_isometry(Isometry3::from_parts(
        Translation3::from(Vector3::from(position)),
        UnitQuaternion::from_scaled_axis(Vector3::from(rotation)),
    ))
}

fn path(start: &Pose, moves: &[CartesianMove]) -> CartesianPath {
    CartesianPath::new(start, moves, WEIGHT).unwrap_or_else(|error| panic!("{error}"))
}

/// Central differences of position \[m/m\] and orientation \[rad/m\].
fn difference(path: &CartesianPath, s: f64, step: f64) -> (Vector3<f64>, Vector3<f64>) {
    let (a, b) = (path.pose_at(s - step), path.pose_at(s + step));
    let turn = b.isometry().rotation * a.isometry().rotation.inverse();
    ((b.position() - a.position()) / (2.0 * step), turn.scaled_axis() / (2.0 * step))
}

/// Rate of the path in its own measure, which is one on moves.
fn speed(path: &CartesianPath, s: f64) -> f64 {
    let tangent = path.tangent_at(s);
    tangent.linear.norm().hypot(WEIGHT * tangent.angular.norm())
}
