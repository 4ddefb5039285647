//! Why a search found nothing.

use super::bounds::Keep;
use super::descent::{Descent, Positions, Search};
use super::outcome::{InverseCause, LimitSide};
use crate::Twist;
use crate::kinematics::Jacobian;

/// Singular value below which a posture counts as singular, lengths in units of half the reach.
const SINGULAR: f64 = 1e-2;

/// Part of the error that must lie along the lost direction.
const ALONG: f64 = 0.7;

/// Iterations of a search without limits.
const ITERATIONS: u32 = 40;

/// What a search without limits says.
pub(super) enum Unlimited {
    /// It found a posture inside them after all.
    Inside(Descent),
    /// It found postures, of which this one is the least beyond its limits.
    Beyond(InverseCause),
    /// It found nothing either.
    Nothing,
}

impl Search<'_> {
    /// Searches from `starts` without limits.
    pub(super) fn unlimited<'q>(&self, starts: impl Iterator<Item = &'q Positions>) -> Unlimited {
        let n = self.bounds.len();
        let mut least = f64::INFINITY;
        let mut found = Unlimited::Nothing;
        for start in starts {
            let mut end = self.descend(start, Keep::Ignored, ITERATIONS);
            if !end.converged {
                continue;
            }
            self.bounds.bring_inside(&mut end.q[..n], self.chain);
            match self.farthest_beyond(&end.q) {
                None => return Unlimited::Inside(end),
                Some((beyond, cause)) if beyond < least => {
                    least = beyond;
                    found = Unlimited::Beyond(cause);
                }
                Some(_) => {}
            }
        }
        found
    }

    /// The variable that is farthest beyond a limit, and by how much.
    fn farthest_beyond(&self, q: &Positions) -> Option<(f64, InverseCause)> {
        let mut worst = None;
        let mut farthest = 0.0;
        for (joint, &value) in q.iter().take(self.bounds.len()).enumerate() {
            let (lower, upper) = self.bounds.limits(joint);
            let sides = [
                (lower - value, LimitSide::Lower, lower),
                (value - upper, LimitSide::Upper, upper),
            ];
            for (beyond, side, limit) in sides {
                if beyond > farthest {
                    farthest = beyond;
                    worst = Some((beyond, InverseCause::JointLimit { joint, side, value, limit }));
                }
            }
        }
        worst
    }

    /// Whether the posture has lost a direction in which the target lies.
    pub(super) fn singular(&self, end: &Descent) -> Option<InverseCause> {
        let n = self.bounds.len();
        let mut jacobian = Jacobian::zeros(n);
        let at = self.linearise(&end.q, &mut jacobian)?;
        for (column, task) in jacobian.columns_mut().iter_mut().zip(&at.columns) {
            column.as_flattened_mut().copy_from_slice(task);
        }
        let singular = jacobian.singular_values(1.0);
        // Directions that the target leaves free have the value zero and no part in the error.
        let rank = self.task.rank().min(n);
        let (smallest, direction, _) = singular.parts().nth(rank.checked_sub(1)?)?;
        let rows = nalgebra::Vector6::from(at.errors.rows);
        let along = direction.dot(&rows).abs();
        if smallest > SINGULAR || along < ALONG * rows.norm() {
            return None;
        }
        let direction = Twist::from_vector(direction);
        let direction = Twist::new(direction.linear * self.length, direction.angular);
        Some(InverseCause::Singular { smallest, direction })
    }
}
