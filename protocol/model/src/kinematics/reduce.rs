//! From the joints between two links to the few numbers forward kinematics needs.
//!
//! Joint frames are chosen anew so that every joint turns about, or slides along, its own z axis,
//! and so that the next joint's z axis is reached by one turn about x. A rotation
//! `Rz(theta) Rx(alpha) Rz(phi)` between two axes always exists; `theta` and `phi` join the turns
//! of the joints before and after it. Translations stay free, so nearly parallel axes, which
//! Denavit and Hartenberg's convention sends to far away common normals, lose no digits.

#![allow(non_snake_case, reason = "X_JN is the pose of frame N in frame J, R_JN its rotation")]

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};
use serde::{Deserialize, Serialize};

/// Below this sine two axes count as parallel.
const PARALLEL: f64 = 1e-14;

/// Joints or fixed transforms in the order from base to tip.
#[derive(Clone, Debug)]
pub(super) enum Element {
    Fixed(Isometry3<f64>),
    Moving(Moving),
}

/// A joint that moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moving {
    /// Index among the model's joints, for errors.
    pub(super) joint: usize,
    /// Index among the chain's variables.
    pub(super) variable: usize,
    /// Position of the joint per position of the variable.
    pub(super) multiplier: f64,
    /// Position of the joint \[rad or m\] at position zero of the variable.
    pub(super) offset: f64,
    /// Whether it turns, else it slides.
    pub(super) turns: bool,
    /// Axis in the frame before it.
    pub(super) axis: Unit<Vector3<f64>>,
}

/// One moving joint with what follows it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Step {
    pub(super) joint: usize,
    pub(super) variable: usize,
    pub(super) multiplier: f64,
    pub(super) offset: f64,
    pub(super) turns: bool,
    /// Constant turn about z \[rad\], after a slide or in addition to the joint's own.
    pub(super) angle: f64,
    /// Origin of the next joint's frame in this one's, after the motion \[m\].
    pub(super) shift: Vector3<f64>,
    /// Cosine and sine of the turn about x that brings z to the next axis.
    pub(super) twist: (f64, f64),
}

/// A chain ready for evaluation.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Reduced {
    /// Pose of the first joint's frame in the base.
    pub(super) first: (Matrix3<f64>, Vector3<f64>),
    pub(super) steps: Vec<Step>,
    /// Pose of the tip in the last joint's frame, after its motion.
    pub(super) last: (Matrix3<f64>, Vector3<f64>),
}

/// The elements with fixed transforms merged and frames aligned.
pub(super) fn reduce(elements: &[Element]) -> Reduced {
    let mut reduced = Reduced {
        first: (Matrix3::identity(), Vector3::zeros()),
        steps: Vec::new(),
        last: (Matrix3::identity(), Vector3::zeros()),
    };
    // From the last joint's aligned frame, or the base, to where the elements have led so far.
    let mut R = Matrix3::identity();
    let mut p = Vector3::zeros();
    for element in elements {
        match element {
            Element::Fixed(X) => {
                p += R * X.translation.vector;
                R *= X.rotation.to_rotation_matrix().matrix();
            }
            Element::Moving(moving) => {
                let A = frame_along(&moving.axis);
                let angle = reduced.connect(R * A, p);
                reduced.steps.push(Step {
                    joint: moving.joint,
                    variable: moving.variable,
                    multiplier: moving.multiplier,
                    offset: moving.offset,
                    turns: moving.turns,
                    angle,
                    shift: Vector3::zeros(),
                    twist: (1.0, 0.0),
                });
                (R, p) = (A.transpose(), Vector3::zeros());
            }
        }
    }
    reduced.last = (R, p);
    reduced
}

impl Reduced {
    /// Puts the transform `R`, `p` behind the last joint; what is left is the turn about z that the
    /// next joint must add.
    fn connect(&mut self, R: Matrix3<f64>, p: Vector3<f64>) -> f64 {
        let Some(last) = self.steps.last_mut() else {
            self.first = (R, p);
            return 0.0;
        };
        let (theta, twist, phi) = zxz(&R);
        last.angle += theta;
        let (sin, cos) = theta.sin_cos();
        last.shift = Vector3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z);
        last.twist = twist;
        phi
    }
}

/// A rotation whose third column is `axis`.
fn frame_along(axis: &Unit<Vector3<f64>>) -> Matrix3<f64> {
    let z = axis.into_inner();
    let y = z.cross(&Vector3::ith(z.iamin(), 1.0)).normalize();
    Matrix3::from_columns(&[y.cross(&z), y, z])
}

/// `theta`, cosine and sine of `alpha`, and `phi` of `R = Rz(theta) Rx(alpha) Rz(phi)`.
fn zxz(R: &Matrix3<f64>) -> (f64, (f64, f64), f64) {
    let sine = R.m13.hypot(R.m23);
    let theta = if sine > PARALLEL { R.m13.atan2(-R.m23) } else { 0.0 };
    let norm = sine.hypot(R.m33);
    let (ca, sa) = (R.m33 / norm, sine / norm);
    // `phi` takes up what rounding of an ill-determined `theta` leaves: Rx(-alpha) Rz(-theta) R.
    let (st, ct) = theta.sin_cos();
    let x = |column: usize| ct * R[(0, column)] + st * R[(1, column)];
    let y = |column: usize| ca * (ct * R[(1, column)] - st * R[(0, column)]) + sa * R[(2, column)];
    (theta, (ca, sa), y(0).atan2(x(0)))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, UnitQuaternion};

    use super::*;

    fn rebuilt(R: &Matrix3<f64>) -> Matrix3<f64> {
        let (theta, (ca, sa), phi) = zxz(R);
        let X = Matrix3::new(1.0, 0.0, 0.0, 0.0, ca, -sa, 0.0, sa, ca);
        let z = |angle| *Rotation3::from_axis_angle(&Vector3::z_axis(), angle).matrix();
        z(theta) * X * z(phi)
    }

    #[test]
    fn every_rotation_is_two_turns_about_z_with_one_about_x_between() {
        for step in 0_u32..400 {
            let t = f64::from(step);
            let axis = Vector3::new((0.7 * t).sin(), (1.3 * t).cos(), (0.2 * t).sin());
            let R = UnitQuaternion::from_scaled_axis(axis * (0.05 * t)).to_rotation_matrix();
            assert!((rebuilt(R.matrix()) - R.matrix()).amax() < 1e-15 * 8.0, "{step}");
        }
    }

    #[test]
    fn nearly_parallel_and_opposite_axes_lose_no_digits() {
        for tilt in [0.0, 1e-16, 1e-13, 1e-9, 3e-6] {
            for flip in [0.0, std::f64::consts::PI] {
                let R = Rotation3::from_euler_angles(flip + tilt, -0.6 * tilt, 1.2);
                let difference = (rebuilt(R.matrix()) - R.matrix()).amax();
                assert!(difference < 1e-14, "{tilt} {flip}: {difference:e}");
            }
        }
    }

    #[test]
    fn a_frame_along_an_axis_is_a_rotation() {
        for axis in [Vector3::z(), -Vector3::x(), Vector3::y(), Vector3::new(1.0, -2.0, 0.5)] {
            let axis = Unit::new_normalize(axis);
            let R = frame_along(&axis);
            assert!((R.column(2) - axis.into_inner()).amax() < 1e-15);
            assert!((R.transpose() * R - Matrix3::identity()).amax() < 1e-15);
            assert!((R.determinant() - 1.0).abs() < 1e-15);
        }
    }
}
