//! The pass from the end and the pass from the start.

use super::constraints::{Constraints, Next};
use super::grid::PathTable;
use super::{RetimeError, RetimeOptions};
use crate::LimitedQuantity;

/// Relative excess of a start or end velocity that is only rounding.
const VELOCITY_TOLERANCE: f64 = 1e-9;

/// Where and why there is no parametrisation.
pub(super) struct Failure {
    point: usize,
    joint: usize,
    quantity: LimitedQuantity,
    kind: FailureKind,
}

enum FailureKind {
    TooFast { value: f64, highest: f64 },
    TooSlow { value: f64, lowest: f64 },
    Empty,
}

impl Failure {
    pub(super) fn at(self, table: &PathTable) -> RetimeError {
        let Self { point, joint, quantity, kind } = self;
        let fraction = table.fraction(point);
        match kind {
            FailureKind::TooFast { value, highest } => {
                RetimeError::TooFast { fraction, value, highest, joint, quantity }
            }
            FailureKind::TooSlow { value, lowest } => {
                RetimeError::TooSlow { value, lowest, joint, quantity }
            }
            FailureKind::Empty => RetimeError::Infeasible { fraction, joint, quantity },
        }
    }
}

/// The largest squared path velocity at each grid point.
pub(super) fn solve(
    constraints: &Constraints,
    options: &RetimeOptions,
) -> Result<Vec<f64>, Failure> {
    let mut sets = controllable_sets(constraints, options.end_velocity)?;
    let start = start(constraints, &sets, options.start_velocity)?;
    let mut x = start;
    for (point, &step) in constraints.steps.iter().enumerate() {
        let (low, high) = sets[point + 1];
        let band = constraints.band(point, Next { low, high, step }, x);
        // Where rounding has emptied the band, its ends differ by rounding.
        let next = (x + step * band.high).max(low).min(high);
        sets[point].1 = x;
        x = next;
    }
    if let Some(last) = sets.last_mut() {
        last.1 = x;
    }
    Ok(sets.into_iter().map(|(_, x)| x).collect())
}

/// At each point the lowest and highest `x` from which the end can be reached.
fn controllable_sets(
    constraints: &Constraints,
    end_velocity: f64,
) -> Result<Vec<(f64, f64)>, Failure> {
    let last = constraints.steps.len();
    let highest = constraints.x_max[last];
    let x_end = end_velocity * end_velocity;
    if x_end > highest * (1.0 + VELOCITY_TOLERANCE) {
        let (joint, quantity) = constraints.x_max_from[last];
        let kind = FailureKind::TooFast { value: end_velocity, highest: highest.sqrt() };
        return Err(Failure { point: last, joint, quantity, kind });
    }
    let mut sets = vec![(x_end, x_end); last + 1];
    for point in (0..last).rev() {
        let (low, high) = sets[point + 1];
        let next = Next { low, high, step: constraints.steps[point] };
        let Some(set) = constraints.controllable(point, next) else {
            let (joint, quantity) = constraints.blame(point, next, constraints.x_max[point]);
            return Err(Failure { point, joint, quantity, kind: FailureKind::Empty });
        };
        sets[point] = set;
    }
    Ok(sets)
}

/// The squared start velocity, if the end can be reached from it.
fn start(
    constraints: &Constraints,
    sets: &[(f64, f64)],
    start_velocity: f64,
) -> Result<f64, Failure> {
    let (lowest, highest) = sets[0];
    let x = start_velocity * start_velocity;
    let next = Next { low: sets[1].0, high: sets[1].1, step: constraints.steps[0] };
    let refuse = |bound: f64, kind| {
        let (joint, quantity) = constraints.blame(0, next, bound);
        Err(Failure { point: 0, joint, quantity, kind })
    };
    if x > highest * (1.0 + VELOCITY_TOLERANCE) {
        let kind = FailureKind::TooFast { value: start_velocity, highest: highest.sqrt() };
        return refuse(highest, kind);
    }
    if x < lowest * (1.0 - VELOCITY_TOLERANCE) {
        let kind = FailureKind::TooSlow { value: start_velocity, lowest: lowest.sqrt() };
        return refuse(lowest, kind);
    }
    Ok(x.max(lowest).min(highest))
}
