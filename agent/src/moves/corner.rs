//! How far along the joints' way a tool is at a distance from a corner.

use armada_model::JointVector;

use super::MovePlanner;
use crate::control::EquippedChain;

/// Steps along a move in which the tool is looked at, and halvings between two.
const STEPS: u32 = 64;
const HALVINGS: u32 = 40;

/// A share of the way of a move, from its corner on: at most half of it.
const HALF: f64 = 0.5;

impl MovePlanner<'_> {
    /// How far from `corner`, along the straight ways to `before` and `after`, every tool is within
    /// `radius_m` of where it is in the corner; in the norm of all joints \[rad and m, mixed\].
    pub(super) fn joint_radius(
        &self,
        (before, corner, after): (&JointVector, &JointVector, &JointVector),
        radius_m: f64,
    ) -> f64 {
        let side = |to: &JointVector| {
            let share = self
                .equipment
                .chains
                .iter()
                .map(|chain| share_within(chain, (corner, to), radius_m))
                .fold(HALF, f64::min);
            share * distance(corner, to)
        };
        side(before).min(side(after))
    }
}

/// Share of the way from one to the other on which the tool stays within `radius_m`.
fn share_within(
    chain: &EquippedChain,
    (from, to): (&JointVector, &JointVector),
    radius_m: f64,
) -> f64 {
    let tool = |share: f64| {
        let at = from.map_indexed(|joint, start| {
            start + share * (to.get(joint).copied().unwrap_or(start) - start)
        });
        chain.tip(&at, &JointVector::EMPTY).ok().map(|tip| tip.tcp)
    };
    let Some(corner) = tool(0.0) else {
        return 0.0;
    };
    let is_within =
        |share: f64| tool(share).is_some_and(|pose| pose.distance(&corner).0 <= radius_m);
    let mut inside = 0.0;
    for step in 1..=STEPS {
        let mut outside = HALF * f64::from(step) / f64::from(STEPS);
        if is_within(outside) {
            inside = outside;
            continue;
        }
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(inside, outside);
            if is_within(middle) { inside = middle } else { outside = middle }
        }
        return inside;
    }
    HALF
}

/// In the Euclidean norm of all joints.
pub(super) fn distance(a: &JointVector, b: &JointVector) -> f64 {
    a.iter().zip(b.iter()).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}
