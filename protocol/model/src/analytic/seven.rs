//! Arms of seven joints with spherical shoulder and wrist.

#![allow(non_snake_case, reason = "X_BT is the pose of the tip T in the base B")]

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::branch::{self, Branch, Branches, Configuration, Singularities, Wrist};
use super::chain::{self, Axis};
use super::common::{Core, Selection};
use super::error::{AnalyticError, BeyondLimit, BranchError, Mismatch};
use super::fit::{Deviation, long_enough};
use super::parts::{Elbow, Keep, Spherical, Turns, in_plane};
use super::subproblem::{Angle, Root, Roots, across, angle_between, any_across, turned};
use crate::{JointLimits, RobotModel};

/// Below this sine of the angle between axis 1 and the line to the wrist, axis 1 gives no plane.
const UPRIGHT: f64 = 1e-6;

/// Closed-form inverse kinematics of a seven-axis arm, for a given arm angle.
///
/// Axes 1, 2 and 3 meet in the shoulder, axes 5, 6 and 7 in the wrist, and axis 4 is the elbow; it
/// may lie off the line between its neighbours. For a pose of the tip the elbow can still go round
/// the line from shoulder to wrist. The *arm angle* says where it is: zero in the plane of that
/// line and axis 1, on the side to which axis 1 points, positive by the right hand about the
/// direction from shoulder to wrist. Where that line lies along axis 1, a fixed direction of the
/// base stands for it. Each answer is checked, and refined where the arm is not quite of this form,
/// as by [`AnalyticArm`](super::AnalyticArm); then the pose is exact, but the arm angle only as good
/// as the form fits. Solving allocates nothing.
///
/// Source: Shimizu, Kakuya, Yoon, Kitagaki, Kosuge, "Analytical Inverse Kinematic Computation for
/// 7-DOF Redundant Manipulators With Joint Limits and Its Application to Redundancy Resolution",
/// 2008, for the arm angle.
#[derive(Clone, Debug)]
pub struct SevenAxisArm {
    core: Core<7>,
    shoulder: Spherical,
    elbow: Elbow,
    wrist: Spherical,
    shoulder_point: Vector3<f64>,
    wrist_point: Vector3<f64>,
    /// Direction of axis 1, and one at right angles to it.
    up: Vector3<f64>,
    beside: Vector3<f64>,
}

impl SevenAxisArm {
    /// The arm between two links of `model`.
    ///
    /// # Errors
    /// [`AnalyticError::UnknownLink`] and [`AnalyticError::NotAChain`] if the links do not fit,
    /// [`AnalyticError::JointMimics`], [`AnalyticError::JointSlides`] and
    /// [`AnalyticError::JointCount`] if there are not seven driven joints that turn,
    /// [`AnalyticError::SevenAxes`] with the condition that fails.
    pub fn recognise(
        model: &RobotModel,
        base_link: &str,
        tip_link: &str,
    ) -> Result<Self, AnalyticError> {
        let (axes, X_BT) = chain::axes(model, base_link, tip_link)?;
        let given = axes.len();
        let axes: [Axis; 7] =
            axes.try_into().map_err(|_| AnalyticError::JointCount { expected: 7, given })?;
        Self::fitted(&axes, &X_BT)
            .map_err(|mismatch| AnalyticError::SevenAxes { mismatch: Box::new(mismatch) })
    }

    fn fitted(axes: &[Axis; 7], X_BT: &Isometry3<f64>) -> Result<Self, Mismatch> {
        let [a1, a2, a3, a4, a5, a6, a7] = axes;
        let mut deviation = Deviation::default();
        let shoulder_point = deviation.common_point(&[a1, a2, a3])?;
        let wrist_point = deviation.common_point(&[a5, a6, a7])?;
        let slack = deviation.slack(axes);
        let (upper, fore) = (a4.point - shoulder_point, wrist_point - a4.point);
        long_enough(&in_plane(&a4.direction, &upper), a2, a4)?;
        long_enough(&in_plane(&a4.direction, &fore), a4, a6)?;
        let spherical = |first: &Axis, middle: &Axis, last: &Axis| {
            Spherical::new([first.direction, middle.direction, last.direction], slack)
        };
        Ok(Self {
            core: Core::new(axes, X_BT),
            shoulder: spherical(a1, a2, a3),
            elbow: Elbow::new(a4.direction, upper, fore, slack),
            wrist: spherical(a5, a6, a7),
            shoulder_point,
            wrist_point,
            up: a1.direction,
            beside: any_across(&a1.direction),
        })
    }

    /// The arm with other position limits than the model's, one per joint.
    ///
    /// # Errors
    /// [`AnalyticError::LimitCount`] if there are not seven.
    pub fn with_limits(mut self, limits: &[JointLimits]) -> Result<Self, AnalyticError> {
        self.core.set_limits(limits)?;
        Ok(self)
    }

    /// Names of the arm's joints, from base to tip.
    #[must_use]
    pub const fn joint_names(&self) -> &[String; 7] {
        &self.core.names
    }

    /// Where each of the arm's joints stands in the robot's position vector.
    #[must_use]
    pub const fn variables(&self) -> &[usize; 7] {
        &self.core.variables
    }

    /// The arm angle in [-π, π] \[rad\] with the arm's joints at `joint_position` \[rad\].
    ///
    /// `None` if there are not seven finite values, or the wrist is in the shoulder. With the arm
    /// stretched it is the angle of an elbow bent a little by joint 4 in the positive direction.
    #[must_use]
    pub fn arm_angle(&self, joint_position: &[f64]) -> Option<f64> {
        let joints = <[f64; 7]>::try_from(joint_position).ok()?.map(Angle::of);
        let [q1, q2, q3, q4, _, _, _] = joints;
        let reach = self.elbow.reach(q4);
        let elbow = self.elbow.side(&reach, self.elbow.is_bent_positively(&reach))?;
        let R = self.shoulder.turning([q1, q2, q3]);
        let line = (R * reach).normalize();
        let angle = angle_between(&line, &self.zero_side(&line), &(R * elbow));
        angle.rad.is_finite().then_some(angle.rad)
    }

    /// All postures that bring the tip to `X_BT`, its pose in the base link, with the elbow at
    /// `arm_angle` \[rad\].
    ///
    /// Limits are not applied. Where a joint can be anything it is zero.
    #[must_use]
    pub fn solve(&self, X_BT: &Isometry3<f64>, arm_angle: f64) -> Branches {
        self.solve_near(X_BT, arm_angle, &[])
    }

    /// As [`solve`](Self::solve), but where a joint can be anything it keeps the value of
    /// `reference`, positions of the arm's joints \[rad\].
    #[must_use]
    pub fn solve_near(&self, X_BT: &Isometry3<f64>, arm_angle: f64, reference: &[f64]) -> Branches {
        let kept = Core::<7>::padded(reference);
        let mut branches = Branches::none();
        let home = self.core.chain.home();
        let R_BT = (X_BT.rotation * home.rotation.inverse()).to_rotation_matrix();
        let wrist = X_BT.translation.vector + R_BT * (self.wrist_point - home.translation.vector);
        let line = wrist - self.shoulder_point;
        let roots = self.elbow.roots(line.norm());
        if let Roots::Beyond { excess } = roots {
            branches.miss(excess);
        }
        for bend in roots.each(kept[3]) {
            let Some(R) = self.upper_arm(&bend, &line, arm_angle) else { continue };
            for front in self.shoulder.turns(&R, Keep::First(kept[0])) {
                // As it is after rounding, so that the wrist makes good for it.
                let R_4 = self.shoulder.turning(front.angles) * self.elbow.turning(bend.angle);
                let R_wrist = R_4.tr_mul(R_BT.matrix());
                let mut is_found = false;
                for turns in self.wrist.turns(&R_wrist, Keep::First(kept[4])) {
                    let (joints, letters) = posture(&front, &bend, &turns);
                    let is_reached = self.core.offer(joints, letters, X_BT, &mut branches);
                    is_found |= is_reached;
                    if is_reached && turns.singular {
                        break;
                    }
                }
                if is_found && front.singular {
                    break;
                }
            }
        }
        branches
    }

    /// `branch` with whole turns added so that each joint is within its limits and as near to
    /// `reference` as they allow.
    ///
    /// # Errors
    /// The first joint that no number of turns brings within its limits.
    pub fn within_limits(&self, branch: &Branch, reference: &[f64]) -> Result<Branch, BeyondLimit> {
        self.core.within_limits(branch, reference)
    }

    /// The posture for the pose `X_BT` of the tip in the base link, with the elbow at `arm_angle`
    /// \[rad\], that `selection` asks for, within limits and with whole turns as near to
    /// `reference`, the arm's joints \[rad\], as possible.
    ///
    /// # Errors
    /// As [`AnalyticArm::select`](super::AnalyticArm::select).
    #[expect(clippy::result_large_err, reason = "on the stack: selecting must not allocate")]
    pub fn select(
        &self,
        X_BT: &Isometry3<f64>,
        arm_angle: f64,
        reference: &[f64],
        selection: &Selection,
    ) -> Result<Branch, BranchError> {
        Core::<7>::check(reference, selection, X_BT)?;
        if !arm_angle.is_finite() {
            return Err(BranchError::NotFinite { field: "arm angle" });
        }
        self.core.select(&self.solve_near(X_BT, arm_angle, reference), reference, selection)
    }

    /// The turn of the shoulder that points the bent arm along `line` with the elbow at its angle.
    fn upper_arm(&self, bend: &Root, line: &Vector3<f64>, arm_angle: f64) -> Option<Matrix3<f64>> {
        let reach = self.elbow.reach(bend.angle);
        let from = frame(&reach, &self.elbow.side(&reach, bend.falls)?);
        let line = line.normalize();
        let side = turned(&line, Angle::of(arm_angle), &self.zero_side(&line));
        Some(frame(&line, &side) * from.transpose())
    }

    /// Where the elbow is at arm angle zero, from the line to the wrist.
    fn zero_side(&self, line: &Vector3<f64>) -> Vector3<f64> {
        across(line, &self.up)
            .try_normalize(UPRIGHT)
            .unwrap_or_else(|| across(line, &self.beside).normalize())
    }
}

/// The right-handed frame with x along `x` and y along `y`, a unit vector at right angles to it.
fn frame(x: &Vector3<f64>, y: &Vector3<f64>) -> Matrix3<f64> {
    let x = x.normalize();
    Matrix3::from_columns(&[x, *y, x.cross(y)])
}

fn posture(
    front: &Turns,
    bend: &Root,
    turns: &Turns,
) -> ([Angle; 7], (Configuration, Singularities)) {
    let ([q1, q2, q3], [q5, q6, q7]) = (front.angles, turns.angles);
    let shoulder = match front.flip {
        Wrist::NoFlip => branch::Shoulder::Front,
        Wrist::Flip => branch::Shoulder::Back,
    };
    let elbow = if bend.falls { branch::Elbow::Up } else { branch::Elbow::Down };
    let configuration = Configuration { shoulder, elbow, wrist: turns.flip };
    let (shoulder, elbow, wrist) = (front.singular, bend.singular, turns.singular);
    let singular = Singularities { shoulder, elbow, wrist };
    ([q1, q2, q3, bend.angle, q5, q6, q7], (configuration, singular))
}
