//! One pose of a path, from a posture near by.

use super::error::BlockReason;
use super::options::CartesianOptions;
use super::walk::Row;
use crate::{
    CartesianPath, Chain, Damping, InverseCause, InverseKinematics, InverseOptions, InverseTarget,
    JointVector, LimitSide, Residual,
};

/// Residual that counts as solved \[m\] and \[rad\]: far below any tolerance of a path, so that the
/// curve through solved poses is smooth.
const SOLVED: f64 = 1e-9;

/// A step of a tenth of a radian takes four or five iterations; near the end of an arm's reach many.
const MAX_ITERATIONS: u32 = 60;

/// How far inside the limits of a joint solutions are searched \[rad or m\]: room for the curve
/// between them, where a joint comes to its limit and others take over.
const LIMIT_MARGIN: f64 = 1e-4;

/// A solver that is exact enough for a curve through its solutions.
pub(super) fn solver(chain: &Chain) -> InverseKinematics {
    let options = InverseOptions {
        position_tolerance: SOLVED,
        orientation_tolerance: SOLVED,
        warm_iterations: MAX_ITERATIONS,
        limit_margin: LIMIT_MARGIN,
        ..InverseOptions::default()
    };
    InverseKinematics::new(chain, options)
}

/// What is needed to follow a path.
pub(super) struct Follower<'a> {
    pub(super) inverse: &'a InverseKinematics,
    pub(super) path: &'a CartesianPath,
    pub(super) options: &'a CartesianOptions,
}

/// Why a pose is not taken, and how near the solver came \[m\] and \[rad\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Miss {
    pub(super) reason: BlockReason,
    pub(super) position: f64,
    pub(super) angle: f64,
}

impl Miss {
    /// The pose itself can be taken, but is not.
    pub(super) const NONE: Self =
        Self { reason: BlockReason::Unreachable, position: 0.0, angle: 0.0 };
}

impl Follower<'_> {
    /// A posture near the solution at `s`, after those of `before` and `here`.
    ///
    /// Six joints or less go on as they did, which leads straight through a singularity; more would
    /// keep a motion of their null space up, so they begin where they are.
    pub(super) fn predict(&self, before: Option<&Row>, here: &Row, s: f64) -> JointVector {
        let Some(before) = before.filter(|_| self.inverse.chain().len() <= 6) else {
            return here.position;
        };
        let ratio = (s - here.s) / (here.s - before.s);
        here.position.map_indexed(|joint, value| {
            let moved = before.position.get(joint).map_or(0.0, |before| value - before);
            value + ratio * moved
        })
    }

    /// The posture at `s` that is reached from `here`, searched from `seed`.
    pub(super) fn step(&self, here: &Row, seed: &JointVector, s: f64) -> Result<JointVector, Miss> {
        let position = self.solve(seed, s)?;
        let refuse = |reason| Err(Miss { reason, ..Miss::NONE });
        let moved = position.iter().zip(here.position.iter()).map(|(to, from)| (to - from).abs());
        let limit = self.options.max_joint_step;
        let (joint, size) = largest(moved);
        if size > limit {
            return refuse(BlockReason::JointJump { joint, size, limit });
        }
        match self.check(&Row { s, position }) {
            Ok(()) => Ok(position),
            Err(reason) => refuse(reason),
        }
    }

    /// Refuses a posture near a singularity, or from which a joint moves too fast.
    pub(super) fn check(&self, row: &Row) -> Result<(), BlockReason> {
        const UNDAMPED: Damping = Damping { threshold: 0.0, maximum: 0.0, length: 1.0 };
        let Ok((_, jacobian)) = self.inverse.chain().forward_and_jacobian(&row.position) else {
            return Err(BlockReason::Unreachable);
        };
        let tangent = self.path.tangent_at(row.s);
        let resolved = jacobian.joint_velocity(&tangent, &UNDAMPED, &[]);
        let (value, limit) = (resolved.distance_to_singularity, self.options.min_singular_value);
        if value < limit {
            return Err(BlockReason::Singular { value, limit });
        }
        let (joint, rate) = largest(resolved.velocities.iter().map(|rate| rate.abs()));
        let limit = self.options.max_joint_rate;
        if rate > limit { Err(BlockReason::JointRate { joint, rate, limit }) } else { Ok(()) }
    }

    /// Distance \[m\] and angle \[rad\] of the tool from the path at `s`.
    pub(super) fn distance(&self, position: &JointVector, s: f64) -> Option<(f64, f64)> {
        let pose = crate::Pose::from_isometry(self.inverse.chain().forward(position).ok()?);
        Some(pose.distance(&self.path.pose_at(s)))
    }

    /// The limit that a joint is beyond, if it is.
    pub(super) fn beyond_limit(&self, joint: usize, value: f64) -> Option<f64> {
        let [lower, upper] = self.limits(joint)?;
        if value < lower { Some(lower) } else { (value > upper).then_some(upper) }
    }

    /// Joint positions inside their limits that put the tool at the path's pose at `s`.
    fn solve(&self, seed: &JointVector, s: f64) -> Result<JointVector, Miss> {
        let target = InverseTarget::Pose(*self.path.pose_at(s).isometry());
        let failure = match self.inverse.solve_warm(seed, &target) {
            Ok(solution) => return Ok(solution.positions),
            Err(failure) => failure,
        };
        let reason = match failure.cause {
            InverseCause::JointLimit { joint, side, limit, .. } => {
                let hard = self.limits(joint).map(|[lower, upper]| match side {
                    LimitSide::Lower => lower,
                    LimitSide::Upper => upper,
                });
                BlockReason::JointLimit { joint, limit: hard.unwrap_or(limit) }
            }
            InverseCause::Seed(_)
            | InverseCause::Target
            | InverseCause::OutOfReach { .. }
            | InverseCause::Singular { .. }
            | InverseCause::Iterations { .. } => BlockReason::Unreachable,
        };
        let Residual { position, orientation } = failure.residual;
        Err(Miss { reason, position, angle: orientation })
    }

    /// Lowest and highest position of a joint \[rad or m\].
    fn limits(&self, joint: usize) -> Option<[f64; 2]> {
        let limits = self.inverse.chain().variables().get(joint)?.limits;
        Some([limits.lower.unwrap_or(f64::NEG_INFINITY), limits.upper.unwrap_or(f64::INFINITY)])
    }
}

/// Index and value of the largest.
pub(super) fn largest(values: impl Iterator<Item = f64>) -> (usize, f64) {
    let mut largest = (0, 0.0);
    for (index, value) in values.enumerate() {
        // Written so that not a number is the largest.
        let smaller = value <= largest.1;
        if !smaller {
            largest = (index, value);
        }
    }
    largest
}
