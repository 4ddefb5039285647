//! One search from one start.

#![allow(non_snake_case, reason = "R_BT is the rotation of frame T in frame B")]

use super::bounds::{Bounds, Keep};
use super::linear::{Columns, Factored, dot};
use super::target::{Errors, Residual, Task};
use crate::kinematics::Jacobian;
use crate::{Chain, MAX_JOINTS};

/// Damping per square of the error.
const DAMPING_PER_ERROR: f64 = 0.05;

/// Damping that stays when the error vanishes.
const LEAST_DAMPING: f64 = 1e-9;

/// Largest change of a variable in one iteration \[rad or m\].
const LARGEST_STEP: f64 = 1.0;

/// Iterations after which the square of the error must have fallen to [`FALLEN`] of what it was.
const PATIENCE: u32 = 6;

/// The same for the only start of a warm solution, which no other start replaces.
const WARM_PATIENCE: u32 = 12;

/// See [`PATIENCE`].
const FALLEN: f64 = 0.5;

/// Positions of up to [`MAX_JOINTS`] variables.
pub(super) type Positions = [f64; MAX_JOINTS];

/// What a search is about.
pub(super) struct Search<'s> {
    pub(super) chain: &'s Chain,
    pub(super) bounds: &'s Bounds,
    pub(super) task: &'s Task,
    /// Length \[m\] that weighs as much as a radian.
    pub(super) length: f64,
    pub(super) tolerance: Residual,
}

/// The best posture of one search.
#[derive(Clone, Copy)]
pub(super) struct Descent {
    pub(super) q: Positions,
    pub(super) residual: Residual,
    /// Half the square of the error, lengths in units of the length.
    pub(super) error: f64,
    pub(super) iterations: u32,
    pub(super) converged: bool,
}

/// Errors and their derivatives at one posture.
pub(super) struct Linearised {
    pub(super) errors: Errors,
    pub(super) columns: Columns,
}

impl Search<'_> {
    /// Goes down from `q` by Levenberg's and Marquardt's method until the target is reached, or
    /// nothing is gained any more, or after `most` iterations.
    ///
    /// Joints that stand at a limit and would go on take no part in a step.
    ///
    /// Source: T. Sugihara, "Solvability-unconcerned inverse kinematics by the
    /// Levenberg-Marquardt method", IEEE Trans. on Robotics 27(5), 2011: damping in proportion to
    /// the square of the error.
    pub(super) fn descend(&self, q: &Positions, keep: Keep, most: u32) -> Descent {
        let mut q = self.inside(q, keep);
        let mut best = Descent {
            q,
            residual: Residual::default(),
            error: f64::INFINITY,
            iterations: 0,
            converged: false,
        };
        let patience = if keep == Keep::Inside { WARM_PATIENCE } else { PATIENCE };
        let mut mark = (f64::INFINITY, 0);
        let mut jacobian = Jacobian::zeros(self.bounds.len());
        for iteration in 0..=most {
            let Some(at) = self.linearise(&q, &mut jacobian) else { break };
            let rows = &at.errors.rows;
            let error = 0.5 * dot(rows, rows);
            best.iterations = iteration;
            if error < best.error {
                best = Descent { q, residual: at.errors.residual, error, ..best };
            }
            if self.reached(&at.errors.residual) {
                return Descent { q, residual: at.errors.residual, error, converged: true, ..best };
            }
            if best.error < FALLEN * mark.0 {
                mark = (best.error, iteration);
            } else if iteration >= mark.1 + patience {
                break;
            }
            self.step(&mut q, &at, error, keep);
        }
        best
    }

    pub(super) fn reached(&self, residual: &Residual) -> bool {
        residual.position <= self.tolerance.position
            && residual.orientation <= self.tolerance.orientation
    }

    /// `q` as near as `keep` allows.
    pub(super) fn inside(&self, q: &Positions, keep: Keep) -> Positions {
        let mut inside = *q;
        for (k, q) in inside.iter_mut().take(self.bounds.len()).enumerate() {
            *q = self.bounds.keep(k, *q, keep);
        }
        inside
    }

    /// Errors and columns at `q`; `None` if they cannot be calculated.
    #[inline]
    pub(super) fn linearise(&self, q: &Positions, jacobian: &mut Jacobian) -> Option<Linearised> {
        let n = self.bounds.len();
        let (R_BT, p_BT) = self.chain.evaluate(&q[..n], jacobian).ok()?;
        let errors = self.task.errors(&R_BT, &p_BT, self.length);
        let mut columns = [[0.0; 6]; MAX_JOINTS];
        let (linear, angular) = self.task.counts();
        let scale = if linear { 1.0 / self.length } else { 0.0 };
        for (column, [v, w]) in columns.iter_mut().zip(jacobian.columns()) {
            let mut turn = if angular { *w } else { [0.0; 3] };
            if let Some(axis) = &errors.free {
                let along = w[0] * axis.x + w[1] * axis.y + w[2] * axis.z;
                turn = [w[0] - along * axis.x, w[1] - along * axis.y, w[2] - along * axis.z];
            }
            *column = [v[0] * scale, v[1] * scale, v[2] * scale, turn[0], turn[1], turn[2]];
        }
        Some(Linearised { errors, columns })
    }

    #[inline]
    fn step(&self, q: &mut Positions, at: &Linearised, error: f64, keep: Keep) {
        let n = self.bounds.len();
        let rows = &at.errors.rows;
        let mut blocked = [false; MAX_JOINTS];
        for k in 0..n {
            blocked[k] = self.bounds.blocks(k, q[k], dot(&at.columns[k], rows), keep);
        }
        let free = at.columns[..n].iter().zip(&blocked).filter(|(_, blocked)| !**blocked);
        let damping = DAMPING_PER_ERROR * error + LEAST_DAMPING;
        let y = Factored::of(free.map(|(column, _)| column), damping).solve(rows);
        let mut change = [0.0; MAX_JOINTS];
        let mut largest = LARGEST_STEP;
        for k in 0..n {
            if !blocked[k] {
                change[k] = dot(&at.columns[k], &y);
                largest = change[k].abs().max(largest);
            }
        }
        let scale = LARGEST_STEP / largest;
        for k in 0..n {
            q[k] = self.bounds.keep(k, q[k] + scale * change[k], keep);
        }
    }
}
