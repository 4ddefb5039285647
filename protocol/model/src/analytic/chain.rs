//! The exact kinematics of an arm: what every answer is checked against.

#![allow(non_snake_case, reason = "X_BT is the pose of the tip T in the base B")]

use nalgebra::{Isometry3, Matrix3, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6};

use super::error::AnalyticError;
use super::subproblem::{Angle, turning};
use crate::{Joint, JointType, PositionSource, RobotModel};

/// Error of position \[m\] and orientation \[rad\] at which a posture needs no refinement.
pub(super) const EXACT: f64 = 2e-10;

/// Steps after which refinement gives up.
const STEPS: usize = 12;

/// How much worse than the best a step may be.
const OVERSHOOT: f64 = 1e3;

/// A joint's axis in the base, with all joints at zero.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) name: String,
    /// Index in the robot's position vector.
    pub(super) variable: usize,
    /// Limits \[rad\], infinite where there are none.
    pub(super) range: (f64, f64),
    pub(super) direction: Vector3<f64>,
    pub(super) point: Vector3<f64>,
}

/// The axes from base to tip, which may hang on a link that the base is fixed to, and the tip's pose, all with the joints at zero.
pub(super) fn axes(
    model: &RobotModel,
    base_link: &str,
    tip_link: &str,
) -> Result<(Vec<Axis>, Isometry3<f64>), AnalyticError> {
    let index = |link: &str| {
        model.link_index(link).ok_or_else(|| AnalyticError::UnknownLink { link: link.to_owned() })
    };
    let (base, tip) = (path_to(model, index(base_link)?), path_to(model, index(tip_link)?));
    let shared = base.iter().zip(&tip).take_while(|(a, b)| a.name == b.name).count();
    let (beside, path) = (base.get(shared..).unwrap_or_default(), tip.get(shared..));
    if beside.iter().any(|joint| joint.motion.is_some()) {
        let (base, tip) = (base_link.to_owned(), tip_link.to_owned());
        return Err(AnalyticError::NotAChain { base, tip });
    }
    let X_CB = beside.iter().fold(Isometry3::identity(), |X, joint| X * joint.origin.isometry());
    let (mut axes, mut X_BT) = (Vec::new(), X_CB.inverse());
    for joint in path.unwrap_or_default() {
        X_BT *= joint.origin.isometry();
        let Some(motion) = &joint.motion else { continue };
        let name = joint.name.clone();
        if motion.joint_type == JointType::Prismatic {
            return Err(AnalyticError::JointSlides { joint: name });
        }
        let PositionSource::Variable(variable) = motion.position else {
            return Err(AnalyticError::JointMimics { joint: name });
        };
        axes.push(Axis {
            name,
            variable,
            range: (
                motion.limits.lower.unwrap_or(f64::NEG_INFINITY),
                motion.limits.upper.unwrap_or(f64::INFINITY),
            ),
            direction: X_BT.rotation * motion.axis.into_inner(),
            point: X_BT.translation.vector,
        });
    }
    Ok((axes, X_BT))
}

/// The joints from the root to a link.
fn path_to(model: &RobotModel, mut link: usize) -> Vec<&Joint> {
    let mut path = Vec::new();
    while let Some(joint) =
        model.links().get(link).and_then(|link| model.joints().get(link.parent_joint?))
    {
        path.push(joint);
        link = joint.parent;
    }
    path.reverse();
    path
}

/// Forward kinematics of `N` joints as a product of turns about their axes at position zero.
///
/// Source: Murray, Li, Sastry, "A Mathematical Introduction to Robotic Manipulation", section 3.2.
#[derive(Clone, Debug)]
pub(super) struct Chain<const N: usize> {
    directions: [Vector3<f64>; N],
    /// A point of the first axis, in the base.
    start: Vector3<f64>,
    /// From a point of each axis to one of the next, of the last to the tip, at position zero.
    spans: [Vector3<f64>; N],
    /// Orientation of the tip at position zero, twice.
    home: UnitQuaternion<f64>,
    home_matrix: Matrix3<f64>,
}

impl<const N: usize> Chain<N> {
    /// The chain of `axes`, and the tip's pose with the joints at zero.
    pub(super) fn new(axes: &[Axis; N], X_BT: &Isometry3<f64>) -> Self {
        let after =
            |index: usize| axes.get(index + 1).map_or(X_BT.translation.vector, |next| next.point);
        Self {
            directions: std::array::from_fn(|index| axes[index].direction),
            start: axes.first().map_or(X_BT.translation.vector, |axis| axis.point),
            spans: std::array::from_fn(|index| after(index) - axes[index].point),
            home: X_BT.rotation,
            home_matrix: *X_BT.rotation.to_rotation_matrix().matrix(),
        }
    }

    /// Pose of the tip with the joints at zero.
    pub(super) fn home(&self) -> Isometry3<f64> {
        let position = self.spans.iter().fold(self.start, |point, span| point + span);
        Isometry3::from_parts(position.into(), self.home)
    }

    /// By how much the tip misses `target`, the larger of position \[m\] and orientation \[rad\].
    pub(super) fn miss(&self, angles: &[Angle; N], target: &Isometry3<f64>) -> f64 {
        let (mut rotation, mut point) = (Matrix3::identity(), self.start);
        for ((direction, span), &angle) in self.directions.iter().zip(&self.spans).zip(angles) {
            rotation *= turning(direction, angle);
            point += rotation * span;
        }
        let shift = target.translation.vector - point;
        let turn = target.rotation.to_rotation_matrix().matrix() - rotation * self.home_matrix;
        // The norm is 2 sqrt(2) times the sine of half the angle.
        shift.norm_squared().max(0.5 * turn.norm_squared()).sqrt()
    }

    /// Improves `joints` until they bring the tip to `target`; the error that remains, the larger
    /// of position \[m\] and orientation \[rad\].
    ///
    /// Steps of Levenberg and Marquardt, damped by the square of the error: quadratic convergence,
    /// at singularities as well if there is an answer near by.
    /// Source: Yamashita, Fukushima, "On the rate of convergence of the Levenberg-Marquardt
    /// method", 2001.
    pub(super) fn refine(&self, joints: &mut [f64; N], target: &Isometry3<f64>) -> f64 {
        let mut best = amax(&self.error(joints, target));
        let mut current = *joints;
        for _ in 0..STEPS {
            if best <= EXACT || best.is_nan() {
                break;
            }
            let Some(next) = self.step(&current, target) else { break };
            let error = amax(&self.error(&next, target));
            // Beside a singularity the first step may overshoot and the second mend it.
            if error.is_nan() || error > OVERSHOOT * best {
                break;
            }
            current = next;
            if error < best {
                (*joints, best) = (next, error);
            }
        }
        best
    }

    /// Position error \[m\] over rotation vector \[rad\], in the base.
    fn error(&self, joints: &[f64; N], target: &Isometry3<f64>) -> Vector6<f64> {
        let (mut rotation, mut point) = (UnitQuaternion::identity(), self.start);
        for ((direction, span), &angle) in self.directions.iter().zip(&self.spans).zip(joints) {
            rotation *= turn(direction, angle);
            point += rotation * span;
        }
        difference(&point, &(rotation * self.home), target)
    }

    fn step(&self, joints: &[f64; N], target: &Isometry3<f64>) -> Option<[f64; N]> {
        let (mut rotation, mut point) = (UnitQuaternion::identity(), self.start);
        let mut screws = [(Vector3::zeros(), Vector3::zeros()); N];
        for (index, screw) in screws.iter_mut().enumerate() {
            *screw = (rotation * self.directions[index], point);
            rotation *= turn(&self.directions[index], joints[index]);
            point += rotation * self.spans[index];
        }
        let error = difference(&point, &(rotation * self.home), target);
        let columns = screws.map(|(axis, origin)| {
            let moment = axis.cross(&(point - origin));
            Vector6::new(moment.x, moment.y, moment.z, axis.x, axis.y, axis.z)
        });
        let damping = error.norm_squared().max(1e-14);
        let mut normal = Matrix6::from_diagonal_element(damping);
        for column in &columns {
            normal += column * column.transpose();
        }
        let weight = normal.cholesky()?.solve(&error);
        Some(std::array::from_fn(|index| joints[index] + columns[index].dot(&weight)))
    }
}

/// The turn about `axis`, of unit length, by `angle` \[rad\].
fn turn(axis: &Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = (0.5 * angle).sin_cos();
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, axis * sin))
}

fn difference(
    position: &Vector3<f64>,
    rotation: &UnitQuaternion<f64>,
    target: &Isometry3<f64>,
) -> Vector6<f64> {
    let shift = target.translation.vector - position;
    let left = target.rotation * rotation.inverse();
    // Twice the sine of half the angle: the angle itself where it is small, and never zero elsewhere.
    let turn = left.imag() * 2.0_f64.copysign(left.w);
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// The larger of the lengths of the two halves.
fn amax(error: &Vector6<f64>) -> f64 {
    let squares = error.component_mul(error);
    (squares.x + squares.y + squares.z).max(squares.w + squares.a + squares.b).sqrt()
}
