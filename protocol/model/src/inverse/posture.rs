//! Coming near a preferred posture without leaving the target.

use super::bounds::Keep;
use super::descent::{Descent, Positions, Search};
use super::linear::{Factored, dot};
use super::options::PreferredPosture;
use crate::MAX_JOINTS;
use crate::kinematics::Jacobian;

/// Iterations that bring a posture back to the target after a step.
const CORRECTIONS: u32 = 4;

/// How often a step that gains nothing is halved.
const HALVINGS: u32 = 4;

/// Damping of the projection onto postures that keep the target.
const DAMPING: f64 = 1e-9;

/// Part of the squared distance that a step must gain to be worth another.
const GAIN: f64 = 1e-6;

impl Search<'_> {
    /// From the solution `at`, `most` steps towards `preferred` at the same target.
    ///
    /// Source: B. Siciliano et al., "Robotics: Modelling, Planning and Control", 2009, section
    /// 3.5.1, equation 3.54, with the gradient of the weighted squared distance; joints at a limit
    /// take no part in steps that lead out.
    pub(super) fn approach(&self, at: Descent, preferred: &PreferredPosture, most: u32) -> Descent {
        let n = self.bounds.len();
        let mut now = at;
        let mut jacobian = Jacobian::zeros(n);
        for _ in 0..most {
            let Some(change) = self.tangent(&now.q, preferred, &mut jacobian) else { break };
            let before = preferred.squared_distance(&now.q[..n]);
            let Some(next) = self.shortened(&now, &change, preferred, before) else { break };
            let gained = before - preferred.squared_distance(&next.q[..n]);
            now = next;
            if gained < GAIN * before {
                break;
            }
        }
        now
    }

    /// Direction towards the preferred posture along postures with the same target.
    fn tangent(
        &self,
        q: &Positions,
        preferred: &PreferredPosture,
        jacobian: &mut Jacobian,
    ) -> Option<Positions> {
        let n = self.bounds.len();
        let at = self.linearise(q, jacobian)?;
        let weight = (0..n).map(|k| preferred.weight(k)).fold(0.0, f64::max);
        if weight <= 0.0 {
            return None;
        }
        let mut wish = [0.0; MAX_JOINTS];
        for (k, wanted) in preferred.positions.iter().take(n).enumerate() {
            wish[k] = preferred.weight(k) / weight * (wanted - q[k]);
        }
        // Joints that the projected step would push out of their limits are held; then once more.
        let mut held = [false; MAX_JOINTS];
        let mut change = [0.0; MAX_JOINTS];
        for _ in 0..n {
            change = project(&at.columns, &at.errors.rows, &wish, &held[..n]);
            let out =
                (0..n).find(|&k| !held[k] && self.bounds.blocks(k, q[k], change[k], Keep::Inside));
            let Some(out) = out else { break };
            held[out] = true;
        }
        Some(change)
    }

    /// The solution after `change`, or after a part of it, that is nearer than `before`.
    fn shortened(
        &self,
        from: &Descent,
        change: &Positions,
        preferred: &PreferredPosture,
        before: f64,
    ) -> Option<Descent> {
        let n = self.bounds.len();
        let mut scale = 1.0;
        for _ in 0..=HALVINGS {
            let mut q = from.q;
            for (q, change) in q.iter_mut().zip(change) {
                *q += scale * change;
            }
            let next = self.descend(&q, Keep::Inside, CORRECTIONS);
            if next.converged && preferred.squared_distance(&next.q[..n]) < before {
                let iterations = from.iterations + next.iterations;
                return Some(Descent { iterations, ..next });
            }
            scale *= 0.5;
        }
        None
    }
}

/// `wish - J^T (J J^T)^-1 (J wish - errors)` over the variables that are not held.
fn project(columns: &[[f64; 6]], errors: &[f64; 6], wish: &Positions, held: &[bool]) -> Positions {
    let free = || columns.iter().zip(held).enumerate().filter(|(_, (_, held))| !**held);
    let mut side = [0.0; 6];
    for (i, side) in side.iter_mut().enumerate() {
        let moved: f64 = free().map(|(k, (column, _))| column[i] * wish[k]).sum();
        *side = moved - errors[i];
    }
    let y = Factored::of(free().map(|(_, (column, _))| column), DAMPING).solve(&side);
    let mut change = [0.0; MAX_JOINTS];
    for (k, (column, _)) in free() {
        change[k] = wish[k] - dot(column, &y);
    }
    change
}
