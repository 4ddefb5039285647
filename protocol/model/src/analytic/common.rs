//! What arms of any number of joints have in common: checking, limits, selection.

#![allow(non_snake_case, reason = "X_BT is the pose of the tip T in the base B")]

use std::f64::consts::TAU;

use arrayvec::ArrayVec;
use nalgebra::Isometry3;

use super::branch::{Branch, Branches, Configuration, Singularities};
use super::chain::{Axis, Chain, EXACT};
use super::error::{AnalyticError, BeyondLimit, BranchError};
use super::subproblem::{Angle, wrapped};
use crate::{JointLimits, JointVector};

/// Error of position \[m\] and orientation \[rad\] above which an answer is none.
const ACCEPTED: f64 = 1e-6;

/// Rounding at a limit \[rad\]: a value this little beyond is put on it.
const LIMIT_SLACK_RAD: f64 = 1e-9;

/// Which of the postures to take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Selection {
    /// The one within limits that is nearest to the reference: least sum of weighted squares.
    Nearest {
        /// Weight of each joint, not negative; [`JointVector::EMPTY`] for equal ones.
        weights: JointVector,
    },
    /// This one; it may be a singular one that stands for it.
    Configuration(Configuration),
}

#[derive(Clone, Debug)]
pub(super) struct Core<const N: usize> {
    pub(super) chain: Chain<N>,
    pub(super) names: [String; N],
    pub(super) variables: [usize; N],
    ranges: [(f64, f64); N],
}

impl<const N: usize> Core<N> {
    pub(super) fn new(axes: &[Axis; N], X_BT: &Isometry3<f64>) -> Self {
        Self {
            chain: Chain::new(axes, X_BT),
            names: std::array::from_fn(|index| axes[index].name.clone()),
            variables: std::array::from_fn(|index| axes[index].variable),
            ranges: std::array::from_fn(|index| axes[index].range),
        }
    }

    pub(super) fn set_limits(&mut self, limits: &[JointLimits]) -> Result<(), AnalyticError> {
        if limits.len() != N {
            return Err(AnalyticError::LimitCount { expected: N, given: limits.len() });
        }
        for (range, limit) in self.ranges.iter_mut().zip(limits) {
            *range =
                (limit.lower.unwrap_or(f64::NEG_INFINITY), limit.upper.unwrap_or(f64::INFINITY));
        }
        Ok(())
    }

    /// Makes `angles` exact and adds them to `branches` if they reach the target.
    pub(super) fn offer(
        &self,
        angles: [Angle; N],
        (configuration, singular): (Configuration, Singularities),
        X_BT: &Isometry3<f64>,
        branches: &mut Branches,
    ) -> bool {
        let mut error = self.chain.miss(&angles, X_BT);
        let mut joints = angles.map(|angle| angle.rad);
        if error > EXACT || error.is_nan() {
            error = self.chain.refine(&mut joints, X_BT);
        }
        if error > ACCEPTED || error.is_nan() {
            branches.miss(error);
            return false;
        }
        let Ok(joint_position) = JointVector::from_slice(&joints.map(wrapped)) else {
            return false;
        };
        branches.add(Branch { joint_position, configuration, singular });
        true
    }

    /// `reference` as an array, zeros where it lacks values.
    pub(super) fn padded(reference: &[f64]) -> [f64; N] {
        std::array::from_fn(|index| {
            reference.get(index).copied().filter(|value| value.is_finite()).unwrap_or_default()
        })
    }

    pub(super) fn within_limits(
        &self,
        branch: &Branch,
        reference: &[f64],
    ) -> Result<Branch, BeyondLimit> {
        let reference = Self::padded(reference);
        let mut within = *branch;
        for (joint, value) in within.joint_position.iter_mut().enumerate() {
            let (Some(&range), Some(&near)) = (self.ranges.get(joint), reference.get(joint)) else {
                continue;
            };
            *value = nearest_turn(*value, near, range)
                .map_err(|(value_rad, limit_rad)| BeyondLimit { joint, value_rad, limit_rad })?;
        }
        Ok(within)
    }

    #[expect(clippy::result_large_err, reason = "on the stack: selecting must not allocate")]
    pub(super) fn select(
        &self,
        branches: &Branches,
        reference: &[f64],
        selection: &Selection,
    ) -> Result<Branch, BranchError> {
        if let Some(excess_m) = branches.out_of_reach_m() {
            return Err(BranchError::OutOfReach { excess_m });
        }
        let wanted = |branch: &&Branch| match selection {
            Selection::Nearest { .. } => true,
            Selection::Configuration(wanted) => branch.is(wanted),
        };
        let (mut best, mut beyond) = (None, ArrayVec::new());
        for branch in branches.iter().filter(wanted) {
            match self.within_limits(branch, reference) {
                Ok(branch) => {
                    let cost = cost(&branch.joint_position, reference, selection);
                    if best.is_none_or(|(least, _)| cost < least) {
                        best = Some((cost, branch));
                    }
                }
                Err(limit) => beyond.push((branch.configuration, limit)),
            }
        }
        match (best, selection) {
            (Some((_, branch)), _) => Ok(branch),
            (None, &Selection::Configuration(wanted)) if beyond.is_empty() => {
                let available = branches.iter().map(|branch| branch.configuration).collect();
                Err(BranchError::NotAvailable { wanted, available })
            }
            (None, _) => Err(BranchError::BeyondLimits { beyond }),
        }
    }

    #[expect(clippy::result_large_err, reason = "on the stack: selecting must not allocate")]
    pub(super) fn check(
        reference: &[f64],
        selection: &Selection,
        X_BT: &Isometry3<f64>,
    ) -> Result<(), BranchError> {
        if reference.len() != N {
            return Err(BranchError::ReferenceLength { expected: N, given: reference.len() });
        }
        if let Selection::Nearest { weights } = selection
            && !weights.is_empty()
            && weights.len() != N
        {
            return Err(BranchError::WeightLength { expected: N, given: weights.len() });
        }
        if !reference.iter().all(|value| value.is_finite()) {
            return Err(BranchError::NotFinite { field: "reference" });
        }
        let mut numbers = X_BT.translation.vector.iter().chain(X_BT.rotation.coords.iter());
        if !numbers.all(|value| value.is_finite()) {
            return Err(BranchError::NotFinite { field: "target" });
        }
        Ok(())
    }
}

/// `value` and whole turns, within the range and as near to `near` as that allows.
///
/// Fails with the value that is nearest to the range, and the limit that it passes.
fn nearest_turn(value: f64, near: f64, (lower, upper): (f64, f64)) -> Result<f64, (f64, f64)> {
    let turns = ((near - value) / TAU).round();
    // The fewest and the most turns that stay within.
    let fewest = ((lower - LIMIT_SLACK_RAD - value) / TAU).ceil();
    let most = ((upper + LIMIT_SLACK_RAD - value) / TAU).floor();
    if fewest <= most {
        return Ok((value + TAU * turns.max(fewest).min(most)).max(lower).min(upper));
    }
    let (above, below) = (value + TAU * fewest, value + TAU * most);
    Err(if above - upper < lower - below { (above, upper) } else { (below, lower) })
}

fn cost(position: &JointVector, reference: &[f64], selection: &Selection) -> f64 {
    let weight = |joint: usize| match selection {
        Selection::Nearest { weights } => weights.get(joint).copied().unwrap_or(1.0),
        Selection::Configuration(_) => 1.0,
    };
    let pairs = position.iter().zip(reference).enumerate();
    pairs.map(|(joint, (a, b))| weight(joint) * (a - b) * (a - b)).sum()
}
