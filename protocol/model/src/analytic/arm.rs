//! Arms of six joints.

#![allow(non_snake_case, reason = "X_BT is the pose of the tip T in the base B")]

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::branch::{self, Branch, Branches, Configuration, Singularities, Wrist};
use super::chain::{self, Axis};
use super::common::{Core, Selection};
use super::error::{AnalyticError, BeyondLimit, BranchError, Mismatch};
use super::fit::{Deviation, apart, long_enough, sign};
use super::parts::{Elbow, Keep, Shoulder, Spherical, Turns, in_plane};
use super::subproblem::{
    Angle, Root, Roots, Wave, across, angle_between, turned, turning, wrapped,
};
use crate::{JointLimits, RobotModel};

/// Closed-form inverse kinematics of a six-axis arm: every posture that reaches a pose.
///
/// Recognised from the axes alone, wherever the base is mounted, whatever the tip, the signs of the
/// axes and the zero positions. Two families have a closed form, see [`ArmFamily`]. Each answer is
/// checked by forward kinematics of the exact model, and refined where the arm is not quite of its
/// family, as after calibration or with a rounded description. Solving allocates nothing.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use armada_model::{AnalyticArm, JointVector, RobotModel, Selection};
///
/// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/robots/");
/// # let urdf = std::fs::read_to_string(format!("{folder}six_axis_arm.urdf"))?;
/// let model = RobotModel::from_urdf(&urdf, "six_axis_arm.urdf")?;
/// let arm = AnalyticArm::recognise(&model, "base_link", "tool0")?;
///
/// let q = [0.3, -1.2, 1.9, -2.4, -1.1, 0.5];
/// let tool0 = model.link_index("tool0").ok_or("no tool0")?;
/// let target = model.link_pose(&q, tool0)?;
/// assert_eq!(arm.solve(&target).len(), 8);
///
/// let nearest = Selection::Nearest { weights: JointVector::EMPTY };
/// let chosen = arm.select(&target, &q, &nearest)?;
/// assert!(chosen.joint_position.iter().zip(q).all(|(a, b)| (a - b).abs() < 1e-9));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct AnalyticArm {
    core: Core<6>,
    shoulder: Shoulder,
    /// Axes 2 and 3.
    elbow: Elbow,
    wrist: Spherical,
    /// Point where the wrist's axes meet, at position zero.
    wrist_point: Vector3<f64>,
    /// From joint 2 to joint 1.
    back: Vector3<f64>,
    /// Sign of axis 3 along axis 2.
    elbow_sign: f64,
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    ThreeParallel {
        axes: [Vector3<f64>; 2],
        /// From where axes 5 and 6 meet to axis 4, at position zero.
        to_wrist_1: Vector3<f64>,
        /// Sign of axis 4 along axis 2.
        wrist_sign: f64,
    },
    SphericalWrist,
}

/// Which closed form an arm has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmFamily {
    /// Axes 2, 3 and 4 are parallel, axes 5 and 6 meet: as the arms of Universal Robots.
    ThreeParallelAxes,
    /// Axes 2 and 3 are parallel, axes 4, 5 and 6 meet in one point: most industrial arms.
    SphericalWrist,
}

/// A posture but for its wrist.
struct Posture {
    /// Orientation of the target before joint 1.
    R: Matrix3<f64>,
    root: Root,
    /// From joint 2 to where axes meet in the wrist, before joint 1.
    p: Vector3<f64>,
}

impl AnalyticArm {
    /// The arm between two links of `model`.
    ///
    /// # Errors
    /// [`AnalyticError::UnknownLink`] and [`AnalyticError::NotAChain`] if the links do not fit,
    /// [`AnalyticError::JointMimics`], [`AnalyticError::JointSlides`] and
    /// [`AnalyticError::JointCount`] if there are not six driven joints that turn,
    /// [`AnalyticError::SixAxes`] with the condition that fails for each family.
    pub fn recognise(
        model: &RobotModel,
        base_link: &str,
        tip_link: &str,
    ) -> Result<Self, AnalyticError> {
        let (axes, X_BT) = chain::axes(model, base_link, tip_link)?;
        let given = axes.len();
        let axes: [Axis; 6] =
            axes.try_into().map_err(|_| AnalyticError::JointCount { expected: 6, given })?;
        let core = || Core::new(&axes, &X_BT);
        Self::three_parallel(&axes, core).or_else(|three_parallel| {
            Self::spherical_wrist(&axes, core).map_err(|spherical_wrist| AnalyticError::SixAxes {
                three_parallel: Box::new(three_parallel),
                spherical_wrist: Box::new(spherical_wrist),
            })
        })
    }

    /// The arm with other position limits than the model's, one per joint.
    ///
    /// # Errors
    /// [`AnalyticError::LimitCount`] if there are not six.
    pub fn with_limits(mut self, limits: &[JointLimits]) -> Result<Self, AnalyticError> {
        self.core.set_limits(limits)?;
        Ok(self)
    }

    fn three_parallel(axes: &[Axis; 6], core: impl Fn() -> Core<6>) -> Result<Self, Mismatch> {
        let [_, a2, a3, a4, a5, a6] = axes;
        let mut deviation = Deviation::default();
        let normal = deviation.parallel(&[a2, a3, a4])?;
        let wrist_point = deviation.common_point(&[a5, a6])?;
        apart(a4, a5)?;
        let (fore, slack) = (a4.point - a3.point, deviation.slack(axes));
        long_enough(&in_plane(&normal, &fore), a3, a4)?;
        let kind = Kind::ThreeParallel {
            axes: [a5.direction, a6.direction],
            to_wrist_1: a4.point - wrist_point,
            wrist_sign: sign(a2, a4),
        };
        Ok(Self {
            wrist: Spherical::new([normal, a5.direction, a6.direction], slack),
            kind,
            ..Self::assembled(axes, (normal, wrist_point, fore, slack), core)?
        })
    }

    fn spherical_wrist(axes: &[Axis; 6], core: impl Fn() -> Core<6>) -> Result<Self, Mismatch> {
        let [_, a2, a3, a4, a5, a6] = axes;
        let mut deviation = Deviation::default();
        let wrist_point = deviation.common_point(&[a4, a5, a6])?;
        let normal = deviation.parallel(&[a2, a3])?;
        let (fore, slack) = (wrist_point - a3.point, deviation.slack(axes));
        long_enough(&in_plane(&normal, &fore), a3, a5)?;
        Self::assembled(axes, (normal, wrist_point, fore, slack), core)
    }

    /// The arm with a spherical wrist; `fore` leads from axis 3 to what the elbow places.
    fn assembled(
        axes: &[Axis; 6],
        (normal, wrist_point, fore, slack): (Vector3<f64>, Vector3<f64>, Vector3<f64>, f64),
        core: impl Fn() -> Core<6>,
    ) -> Result<Self, Mismatch> {
        let [a1, a2, a3, a4, a5, a6] = axes;
        apart(a1, a2)?;
        let upper = in_plane(&normal, &(a3.point - a2.point));
        long_enough(&upper, a2, a3)?;
        let elbow_sign = sign(a2, a3);
        Ok(Self {
            core: core(),
            shoulder: Shoulder {
                axis: a1.direction,
                point: a1.point,
                normal,
                offset: normal.dot(&(wrist_point - a1.point)),
                slack,
            },
            elbow: Elbow::new(normal * elbow_sign, upper, in_plane(&normal, &fore), slack),
            wrist: Spherical::new([a4.direction, a5.direction, a6.direction], slack),
            wrist_point,
            back: a1.point - a2.point,
            elbow_sign,
            kind: Kind::SphericalWrist,
        })
    }

    /// Which closed form the arm has.
    #[must_use]
    pub const fn family(&self) -> ArmFamily {
        match self.kind {
            Kind::ThreeParallel { .. } => ArmFamily::ThreeParallelAxes,
            Kind::SphericalWrist => ArmFamily::SphericalWrist,
        }
    }

    /// Names of the arm's joints, from base to tip.
    #[must_use]
    pub const fn joint_names(&self) -> &[String; 6] {
        &self.core.names
    }

    /// Where each of the arm's joints stands in the robot's position vector.
    #[must_use]
    pub const fn variables(&self) -> &[usize; 6] {
        &self.core.variables
    }

    /// All postures that bring the tip to `X_BT`, its pose in the base link.
    ///
    /// Limits are not applied. Where a joint can be anything it is zero.
    #[must_use]
    pub fn solve(&self, X_BT: &Isometry3<f64>) -> Branches {
        self.solve_near(X_BT, &[])
    }

    /// As [`solve`](Self::solve), but where a joint can be anything it keeps the value of
    /// `reference`, positions of the arm's joints \[rad\].
    #[must_use]
    pub fn solve_near(&self, X_BT: &Isometry3<f64>, reference: &[f64]) -> Branches {
        let kept = Core::<6>::padded(reference);
        let mut branches = Branches::none();
        let home = self.core.chain.home();
        let R_BT = (X_BT.rotation * home.rotation.inverse()).to_rotation_matrix();
        let wrist = X_BT.translation.vector + R_BT * (self.wrist_point - home.translation.vector);
        let roots = self.shoulder.roots(&wrist);
        if let Roots::Beyond { excess } = roots {
            branches.miss(excess);
        }
        for root in roots.each(kept[0]) {
            let turn_back = turning(&self.shoulder.axis, -root.angle);
            let p = turn_back * (wrist - self.shoulder.point) + self.back;
            let posture = Posture { R: turn_back * R_BT.matrix(), root, p };
            match &self.kind {
                Kind::ThreeParallel { .. } => {
                    self.place_wrist_1(&posture, &kept, X_BT, &mut branches);
                }
                Kind::SphericalWrist => self.place_wrist(&posture, &kept, X_BT, &mut branches),
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

    /// The posture for the pose `X_BT` of the tip in the base link that `selection` asks for, within
    /// limits and with whole turns as near to `reference`, the arm's joints \[rad\], as possible.
    ///
    /// # Errors
    /// [`BranchError::ReferenceLength`], [`BranchError::WeightLength`] and
    /// [`BranchError::NotFinite`] if an argument does not fit, [`BranchError::OutOfReach`] if there
    /// is no posture, [`BranchError::NotAvailable`] if there is another one only,
    /// [`BranchError::BeyondLimits`] if a limit forbids each that would do.
    #[expect(clippy::result_large_err, reason = "on the stack: selecting must not allocate")]
    pub fn select(
        &self,
        X_BT: &Isometry3<f64>,
        reference: &[f64],
        selection: &Selection,
    ) -> Result<Branch, BranchError> {
        Core::<6>::check(reference, selection, X_BT)?;
        self.core.select(&self.solve_near(X_BT, reference), reference, selection)
    }

    /// Joints 2 to 6 of an arm with a spherical wrist: the elbow, then the wrist.
    fn place_wrist(
        &self,
        posture: &Posture,
        kept: &[f64; 6],
        X_BT: &Isometry3<f64>,
        branches: &mut Branches,
    ) {
        let Posture { R, root, p } = posture;
        for bend in self.bends(p, kept, branches) {
            let q2 = self.lift(&bend, p, kept[1]);
            let normal = &self.shoulder.normal;
            let lift = q2 + bend.angle.signed(self.elbow_sign);
            let R_wrist = turning(normal, -lift) * R;
            for turns in self.wrist.turns(&R_wrist, Keep::First(kept[3])) {
                let [q4, q5, q6] = turns.angles;
                let joints = [root.angle, q2, bend.angle, q4, q5, q6];
                let letters = self.letters(root, &bend, turns.flip, turns.singular);
                if self.core.offer(joints, letters, X_BT, branches) && turns.singular {
                    break;
                }
            }
        }
    }

    /// Joints 2 to 6 of an arm with three parallel axes: the wrist, then the elbow.
    fn place_wrist_1(
        &self,
        posture: &Posture,
        kept: &[f64; 6],
        X_BT: &Isometry3<f64>,
        branches: &mut Branches,
    ) {
        for turns in self.wrist.turns(&posture.R, Keep::Last(kept[5])) {
            let mut is_found = self.place_elbow(posture, &turns, kept, X_BT, branches);
            if turns.singular && !is_found {
                let reached = self.turns_within_reach(posture, &turns, kept[5]);
                is_found = reached
                    .is_some_and(|turns| self.place_elbow(posture, &turns, kept, X_BT, branches));
            }
            if is_found && turns.singular {
                break;
            }
        }
    }

    /// Joints 2 to 4 of an arm with three parallel axes; whether they bring the tip there.
    fn place_elbow(
        &self,
        posture: &Posture,
        turns: &Turns,
        kept: &[f64; 6],
        X_BT: &Isometry3<f64>,
        branches: &mut Branches,
    ) -> bool {
        let Kind::ThreeParallel { axes, to_wrist_1, wrist_sign } = &self.kind else { return false };
        let Posture { R, root, p } = posture;
        let [sum, q5, q6] = turns.angles;
        let p = p + R * turned(&axes[1], -q6, &turned(&axes[0], -q5, to_wrist_1));
        let mut is_found = false;
        for bend in self.bends(&p, kept, branches) {
            let q2 = self.lift(&bend, &p, kept[1]);
            let q4 = (sum - q2 - bend.angle.signed(self.elbow_sign)).signed(*wrist_sign);
            let joints = [root.angle, q2, bend.angle, q4, q5, q6];
            let letters = self.letters(root, &bend, turns.flip, turns.singular);
            is_found |= self.core.offer(joints, letters, X_BT, branches);
        }
        is_found
    }

    /// The turns of a singular wrist with joint 6 as near to `kept` as the elbow can reach.
    ///
    /// Joint 6 takes axis 4 round a circle: where that leaves the elbow's reach is subproblem 3.
    fn turns_within_reach(&self, posture: &Posture, turns: &Turns, kept: f64) -> Option<Turns> {
        let Kind::ThreeParallel { axes, to_wrist_1, .. } = &self.kind else { return None };
        let centre = posture.R.tr_mul(&in_plane(&self.shoulder.normal, &posture.p));
        let arm = across(&axes[1], &turned(&axes[0], -turns.angles[1], to_wrist_1));
        let wave = Wave::of(&centre, &-axes[1], &arm);
        let squares = centre.norm_squared() + arm.norm_squared();
        let heights = self.elbow.limits().map(|limit| 0.5 * (limit * limit - squares));
        let roots = heights.iter().flat_map(|&height| wave.roots(height, 0.0).each(kept));
        let apart = |root: &Root| wrapped(root.angle.rad - kept).abs();
        let q6 = roots.min_by(|a, b| apart(a).total_cmp(&apart(b)))?.angle.rad;
        Some(self.wrist.kept(&posture.R, turns.angles[1], Keep::Last(q6)))
    }

    /// Values of joint 3 that bring the elbow's point to the distance of `p` from joint 2.
    fn bends(
        &self,
        p: &Vector3<f64>,
        kept: &[f64; 6],
        branches: &mut Branches,
    ) -> arrayvec::ArrayVec<Root, 2> {
        let roots = self.elbow.roots(in_plane(&self.shoulder.normal, p).norm());
        if let Roots::Beyond { excess } = roots {
            branches.miss(excess);
        }
        roots.each(kept[2])
    }

    /// The value of joint 2 that brings the elbow's point to `p` from joint 2.
    fn lift(&self, bend: &Root, p: &Vector3<f64>, kept: f64) -> Angle {
        let from = self.elbow.reach(bend.angle);
        // Folded onto joint 2: it can be anything.
        if from.norm_squared() < self.shoulder.slack * self.shoulder.slack {
            return Angle::of(kept);
        }
        angle_between(&self.shoulder.normal, &from, p)
    }

    fn letters(
        &self,
        root: &Root,
        bend: &Root,
        wrist: Wrist,
        is_wrist_singular: bool,
    ) -> (Configuration, Singularities) {
        let is_bent_positively = bend.falls == (self.elbow_sign > 0.0);
        let is_up = is_bent_positively == root.falls;
        let configuration = Configuration {
            shoulder: if root.falls { branch::Shoulder::Front } else { branch::Shoulder::Back },
            elbow: if is_up { branch::Elbow::Up } else { branch::Elbow::Down },
            wrist,
        };
        let (shoulder, elbow) = (root.singular, bend.singular);
        (configuration, Singularities { shoulder, elbow, wrist: is_wrist_singular })
    }
}
