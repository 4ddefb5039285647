//! Limits of joints as limits of path velocity and path acceleration.

use super::grid::PathTable;
use super::{ConstraintScheme, RetimeError, RetimeOptions};
use crate::{AxisLimits, LimitedQuantity};

/// A joint whose path acceleration can use less than this share of its limit at a grid point does
/// not limit path acceleration there, only path velocity (a zero-inertia point).
const NEGLIGIBLE_SHARE: f64 = 1e-13;

/// How far beyond the fastest of all places `x` may go where the path stands still.
const STANDSTILL_FACTOR: f64 = 1e6;

/// Share of the highest `x` of the next point that it must be possible to keep there.
const CRAWL: f64 = 0.04;

/// `|u - slope x| <= reach`: one joint's limit of acceleration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    slope: f64,
    reach: f64,
}

/// Where the next `x` must be: `low <= x + step u <= high`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Next {
    pub(super) low: f64,
    pub(super) high: f64,
    /// Twice the length of the interval.
    pub(super) step: f64,
}

/// The path accelerations that are allowed at one `x`: the lowest and the highest, and how each of
/// them changes with `x`. There is none if `low` is above `high`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Band {
    pub(super) low: f64,
    low_slope: f64,
    pub(super) high: f64,
    high_slope: f64,
    /// Index of the row that limits on either side, none if the next point does.
    low_row: Option<usize>,
    high_row: Option<usize>,
    /// Below this a gap between `low` and `high` is only rounding.
    noise: f64,
}

/// All limits on a grid.
pub(super) struct Constraints {
    rows: Vec<Row>,
    rows_per_point: usize,
    joints: usize,
    /// Highest `x` at each point, finite, and the joint and limit that say so.
    pub(super) x_max: Vec<f64>,
    pub(super) x_max_from: Vec<(usize, LimitedQuantity)>,
    /// Twice the length of each interval.
    pub(super) steps: Vec<f64>,
}

impl Constraints {
    /// The limits at the points of `table`. `slowness` is empty or has a factor `k <= 1` for each
    /// point by which velocity is held below its limit there, and acceleration by `k²`.
    pub(super) fn new(
        table: &PathTable,
        limits: &[AxisLimits],
        options: &RetimeOptions,
        slowness: &[f64],
    ) -> Result<Self, RetimeError> {
        for (field, value, may_be_zero) in [
            ("start_velocity", options.start_velocity, true),
            ("end_velocity", options.end_velocity, true),
            ("max_velocity", options.max_velocity, false),
        ] {
            let is_velocity = value > 0.0 || (may_be_zero && value == 0.0);
            if !is_velocity {
                return Err(RetimeError::PathVelocity { field, value });
            }
        }
        let schemes = match options.scheme {
            ConstraintScheme::Collocation => 1,
            ConstraintScheme::Interpolation => 2,
        };
        let mut found = Self {
            rows: Vec::with_capacity(schemes * table.first.len()),
            rows_per_point: schemes * table.joints,
            joints: table.joints,
            x_max: Vec::with_capacity(table.s.len()),
            x_max_from: Vec::with_capacity(table.s.len()),
            steps: table.s.windows(2).map(|pair| 2.0 * (pair[1] - pair[0])).collect(),
        };
        let slowness = |point: usize| slowness.get(point).copied().unwrap_or(1.0);
        found.limit_velocity(table, limits, options, slowness);
        found.limit_acceleration(table, limits, slowness);
        Ok(found)
    }

    fn limit_velocity(
        &mut self,
        table: &PathTable,
        limits: &[AxisLimits],
        options: &RetimeOptions,
        slowness: impl Fn(usize) -> f64,
    ) {
        for (point, first) in table.first.chunks_exact(table.joints).enumerate() {
            let (mut highest, mut from) = (options.max_velocity, 0);
            for (joint, (slope, axis)) in first.iter().zip(limits).enumerate() {
                let speed = axis.velocity / slope.abs();
                if speed < highest {
                    (highest, from) = (speed, joint);
                }
            }
            let highest = highest * slowness(point);
            self.x_max.push(highest * highest);
            self.x_max_from.push((from, LimitedQuantity::Velocity));
        }
        let finite = self.x_max.iter().copied().filter(|x| x.is_finite());
        let cap = (STANDSTILL_FACTOR * finite.fold(f64::MIN_POSITIVE, f64::max)).min(1e300);
        for x_max in &mut self.x_max {
            *x_max = x_max.min(cap);
        }
    }

    fn limit_acceleration(
        &mut self,
        table: &PathTable,
        limits: &[AxisLimits],
        slowness: impl Fn(usize) -> f64,
    ) {
        let n = table.joints;
        let row = |rows: &[f64], point: usize, joint: usize| rows[point * n + joint];
        for point in 0..self.steps.len() {
            let step = self.steps[point];
            let x_max = self.x_max[point].max(self.x_max[point + 1]);
            for at in 0..self.rows_per_point / n {
                let held = slowness(point + at) * slowness(point + at);
                for (joint, axis) in limits.iter().enumerate() {
                    let reach = axis.acceleration * held;
                    // q' u + q'' x, at the next point with x + step u in the place of x.
                    let b = row(&table.second, point + at, joint);
                    let ahead = if at == 0 { 0.0 } else { step * b };
                    let a = row(&table.first, point + at, joint) + ahead;
                    if a.abs() * x_max > NEGLIGIBLE_SHARE * reach * step {
                        self.rows.push(Row { slope: -b / a, reach: reach / a.abs() });
                        continue;
                    }
                    self.rows.push(Row { slope: 0.0, reach: f64::INFINITY });
                    if reach < self.x_max[point] * b.abs() {
                        self.x_max[point] = reach / b.abs();
                        self.x_max_from[point] = (joint, LimitedQuantity::Acceleration);
                    }
                }
            }
        }
    }

    /// What is allowed at `x` on the interval after `point`.
    pub(super) fn band(&self, point: usize, next: Next, x: f64) -> Band {
        let slope = -1.0 / next.step;
        let mut band = Band {
            low: (next.low - x) / next.step,
            low_slope: slope,
            high: (next.high - x) / next.step,
            high_slope: slope,
            low_row: None,
            high_row: None,
            noise: (next.high.abs() + x) / next.step,
        };
        let rows = &self.rows[point * self.rows_per_point..][..self.rows_per_point];
        for (index, row) in rows.iter().enumerate() {
            let middle = row.slope * x;
            if middle + row.reach < band.high {
                band.high = middle + row.reach;
                band.high_slope = row.slope;
                band.high_row = Some(index);
            }
            if middle - row.reach > band.low {
                band.low = middle - row.reach;
                band.low_slope = row.slope;
                band.low_row = Some(index);
            }
        }
        for row in [band.low_row, band.high_row].into_iter().flatten() {
            band.noise += rows[row].reach + (rows[row].slope * x).abs();
        }
        band.noise *= 4.0 * f64::EPSILON;
        band
    }

    /// The interval of `x` at `point` from which `next` can be reached, if there is one.
    pub(super) fn controllable(&self, point: usize, next: Next) -> Option<(f64, f64)> {
        let x_max = self.x_max[point];
        // With rest allowed next, rest is allowed here: u = 0 and x = 0 keep every limit.
        let low = if next.low <= 0.0 { 0.0 } else { self.root(point, next, (0.0, x_max))? };
        // The highest x may force full braking, on a coarse grid even to a standstill that time
        // cannot leave. So it must leave the choice of some speed at the next point.
        let moving = Next { low: next.low.max(CRAWL * next.high), ..next };
        let high = self.root(point, moving, (x_max, low));
        let high = high.or_else(|| self.root(point, next, (x_max, low)))?;
        Some((low, high))
    }

    /// The first `x` from `from` towards `to` at which the band is not empty. Its width is concave
    /// and piecewise linear in `x`, so Newton's method comes to the root from one side, in no more
    /// steps than there are pairs of rows.
    fn root(&self, point: usize, next: Next, (from, to): (f64, f64)) -> Option<f64> {
        let sign = if from <= to { 1.0 } else { -1.0 };
        let mut x = from;
        for _ in 0..=self.rows_per_point * self.rows_per_point + 1 {
            let band = self.band(point, next, x);
            let width = band.high - band.low;
            if width >= -band.noise {
                return Some(x);
            }
            let growth = sign * (band.high_slope - band.low_slope);
            let step = -width / growth;
            let is_inside = growth > 0.0 && step <= sign * (to - x) + 8.0 * f64::EPSILON * x.abs();
            if !is_inside {
                return None;
            }
            let nearer = x + sign * step;
            if nearer == x {
                return Some(x);
            }
            x = if sign > 0.0 { nearer.min(to) } else { nearer.max(to) };
        }
        None
    }

    /// Which joint, and which of its limits, keeps `x` at `point` from being higher (or, at the
    /// `x` where the band ends, lower).
    pub(super) fn blame(&self, point: usize, next: Next, x: f64) -> (usize, LimitedQuantity) {
        let band = self.band(point, next, x);
        let is_velocity = x >= self.x_max[point] && band.high - band.low >= -band.noise;
        match band.low_row.or(band.high_row) {
            Some(row) if !is_velocity => (row % self.joints, LimitedQuantity::Acceleration),
            _ => self.x_max_from[point],
        }
    }
}
