//! At which path parameters limits are held, and the path's derivatives there.

use super::super::geometric::{GeometricPath, PathRows};
use super::{RetimeError, RetimeOptions};
use crate::{AxisLimits, LIMIT_TOLERANCE};

/// Fewest grid points: from rest to rest there must be one between.
pub(super) const MIN_GRID_POINTS: usize = 3;

/// Most grid points.
pub const MAX_GRID_POINTS: usize = 100_000;

/// Intervals of an adaptive grid before it is refined, and how often each may be halved.
const ADAPTIVE_INTERVALS: u32 = 512;
const ADAPTIVE_HALVINGS: u32 = 3;

/// An interval of an adaptive grid is halved if across it a joint's share `q'/limit` changes by
/// more than `MAX_TURN` of the largest share there, or leaves a line by more than `MAX_BEND`. With
/// constant `u` between, acceleration in the middle leaves the line between its values at the ends
/// by five times what `q' u` leaves its own, so that this bounds the excess there.
const MAX_TURN: f64 = 0.05;
const MAX_BEND: f64 = 0.0001;

/// Where a path is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Grid {
    /// As many points in equal steps of the path parameter; 3 to [`MAX_GRID_POINTS`].
    Uniform(usize),
    /// 512 intervals, halved where the path bends until it hardly does within one.
    #[default]
    Adaptive,
}

/// Derivatives of a path at the points of a grid.
pub(super) struct PathTable {
    /// Path parameters, increasing, three at least.
    pub(super) s: Vec<f64>,
    /// Number of coordinates, one at least.
    pub(super) joints: usize,
    /// One row of `dq/ds` per point.
    pub(super) first: Vec<f64>,
    /// One row of `d²q/ds²` per point.
    pub(super) second: Vec<f64>,
}

impl PathTable {
    /// Looks at `path` on the grid of `options`, and refuses what no motion can follow.
    pub(super) fn sample(
        path: &impl GeometricPath,
        limits: &[AxisLimits],
        options: &RetimeOptions,
    ) -> Result<Self, RetimeError> {
        let joints = path.coordinates();
        check_limits(limits, joints)?;
        let (start, end) = path.range();
        let is_range = start < end && (end - start).is_finite();
        if !is_range {
            return Err(RetimeError::Range { start, end });
        }
        let s = match options.grid {
            Grid::Uniform(points) => uniform(points, start, end)?,
            Grid::Adaptive => adaptive(path, limits),
        };
        let mut table = Self {
            first: vec![0.0; joints * s.len()],
            second: vec![0.0; joints * s.len()],
            s,
            joints,
        };
        table.fill(path, limits)?;
        Ok(table)
    }

    fn fill(
        &mut self,
        path: &impl GeometricPath,
        limits: &[AxisLimits],
    ) -> Result<(), RetimeError> {
        let mut position = vec![0.0; self.joints];
        let rows =
            self.first.chunks_exact_mut(self.joints).zip(self.second.chunks_exact_mut(self.joints));
        let fraction = fractions(&self.s);
        for (&s, (first, second)) in self.s.iter().zip(rows) {
            let mut rows = PathRows { position: &mut position, first, second };
            path.evaluate(s, &mut rows);
            check_rows(&rows, limits, fraction(s))?;
        }
        if self.first.iter().all(|&slope| slope == 0.0) {
            return Err(RetimeError::NoMotion);
        }
        Ok(())
    }

    /// Where grid point `index` lies, from 0 at the start to 1 at the end.
    pub(super) fn fraction(&self, index: usize) -> f64 {
        self.s.get(index).map_or(1.0, |&s| fractions(&self.s)(s))
    }
}

fn fractions(s: &[f64]) -> impl Fn(f64) -> f64 + use<> {
    let start = s.first().copied().unwrap_or_default();
    let end = s.last().copied().unwrap_or_default();
    move |s| (s - start) / (end - start)
}

fn check_limits(limits: &[AxisLimits], coordinates: usize) -> Result<(), RetimeError> {
    if coordinates == 0 || limits.len() != coordinates {
        return Err(RetimeError::LimitCount { limits: limits.len(), coordinates });
    }
    for (joint, axis) in limits.iter().enumerate() {
        let fields =
            [("velocity", axis.velocity), ("acceleration", axis.acceleration), ("jerk", axis.jerk)];
        for (quantity, value) in fields {
            let is_positive = value > 0.0 && value.is_finite();
            if !is_positive {
                return Err(RetimeError::Limit { joint, quantity, value });
            }
        }
    }
    Ok(())
}

fn check_rows(
    rows: &PathRows<'_>,
    limits: &[AxisLimits],
    fraction: f64,
) -> Result<(), RetimeError> {
    let named = [
        ("position", &*rows.position),
        ("first derivative", &*rows.first),
        ("second derivative", &*rows.second),
    ];
    for (row, values) in named {
        if let Some(joint) = values.iter().position(|value| !value.is_finite()) {
            return Err(RetimeError::NotFinite { joint, row, fraction, value: values[joint] });
        }
    }
    for (joint, (axis, &value)) in limits.iter().zip(&*rows.position).enumerate() {
        if value < axis.lower - LIMIT_TOLERANCE || value > axis.upper + LIMIT_TOLERANCE {
            let limit = axis.nearer_limit(value);
            return Err(RetimeError::PositionBeyondLimit { joint, fraction, value, limit });
        }
    }
    Ok(())
}

fn uniform(points: usize, start: f64, end: f64) -> Result<Vec<f64>, RetimeError> {
    if !(MIN_GRID_POINTS..=MAX_GRID_POINTS).contains(&points) {
        return Err(RetimeError::GridPoints { points });
    }
    let last = points - 1;
    let step = |index: usize| start + (end - start) * (index as f64 / last as f64);
    Ok((0..last).map(step).chain([end]).collect())
}

fn adaptive(path: &impl GeometricPath, limits: &[AxisLimits]) -> Vec<f64> {
    let (start, end) = path.range();
    let mut scratch = Bend::new(path, limits);
    let mut s = vec![start];
    let corner = |i: u32| start + (end - start) * (f64::from(i) / f64::from(ADAPTIVE_INTERVALS));
    for interval in 0..ADAPTIVE_INTERVALS {
        // Intervals still to do, the next one last, each with how often it was halved.
        let to = if interval + 1 == ADAPTIVE_INTERVALS { end } else { corner(interval + 1) };
        let mut ahead = vec![(corner(interval), to, 0)];
        while let Some((from, to, halvings)) = ahead.pop() {
            let middle = from + 0.5 * (to - from);
            let may_halve = halvings < ADAPTIVE_HALVINGS && from < middle && middle < to;
            if may_halve && scratch.is_bent(from, middle, to) {
                ahead.push((middle, to, halvings + 1));
                ahead.push((from, middle, halvings + 1));
            } else if s.last().is_none_or(|&last| last < to) {
                s.push(to);
            }
        }
    }
    s
}

/// Looks how much a path bends.
struct Bend<'a, P> {
    path: &'a P,
    limits: &'a [AxisLimits],
    /// Rows at the beginning, in the middle and at the end of an interval.
    rows: [Vec<f64>; 3],
}

impl<'a, P: GeometricPath> Bend<'a, P> {
    fn new(path: &'a P, limits: &'a [AxisLimits]) -> Self {
        let row = vec![0.0; 3 * limits.len()];
        Self { path, limits, rows: [row.clone(), row.clone(), row] }
    }

    fn is_bent(&mut self, from: f64, middle: f64, to: f64) -> bool {
        for (row, s) in self.rows.iter_mut().zip([from, middle, to]) {
            self.path.evaluate(s, &mut PathRows::split(row));
        }
        self.is_bent_against(|axis| axis.velocity) || self.is_bent_against(|axis| axis.acceleration)
    }

    fn is_bent_against(&self, limit: impl Fn(&AxisLimits) -> f64) -> bool {
        let joints = self.limits.len();
        let rows = self.rows.each_ref().map(|row| &row[joints..2 * joints]);
        let (mut largest, mut turn, mut bend) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (joint, axis) in self.limits.iter().enumerate() {
            let limit = limit(axis);
            let [from, middle, to] = rows.map(|row| row[joint] / limit);
            largest = largest.max(from.abs()).max(middle.abs()).max(to.abs());
            turn = turn.max((to - from).abs());
            bend = bend.max((middle - 0.5 * (from + to)).abs());
        }
        turn > MAX_TURN * largest || bend > MAX_BEND * largest
    }
}
