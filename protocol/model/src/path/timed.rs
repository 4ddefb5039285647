//! A path with a time for each of its points.

use super::geometric::{GeometricPath, PathRows};
use super::retime::RetimeError;
use crate::{AxisLimits, JointVector, LimitedQuantity, MAX_JOINTS};

/// A motion along a path: `q(s(t))`, with `s(t)` piecewise cubic (quadratic if only velocity and
/// acceleration are limited).
///
/// Evaluation is exact by the chain rule and allocates nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedPath<P> {
    path: P,
    limits: Vec<AxisLimits>,
    /// Two at least; jerk is constant from each to the next.
    knots: Vec<PathKnot>,
}

/// How far a motion along a path has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathKnot {
    /// Time since the start \[s\].
    pub time_s: f64,
    /// Path parameter `s`.
    pub s: f64,
    /// `ds/dt`.
    pub velocity: f64,
    /// `d²s/dt²`.
    pub acceleration: f64,
    /// `d³s/dt³`.
    pub jerk: f64,
}

/// Motion of all joints at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSample {
    /// Position of each joint \[rad or m\].
    pub position: JointVector,
    /// Velocity of each joint \[rad/s or m/s\].
    pub velocity: JointVector,
    /// Acceleration of each joint \[rad/s² or m/s²\].
    pub acceleration: JointVector,
}

/// Which limit decides how fast a part of a path is passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saturation {
    /// Where the part begins, from 0 at the start of the path to 1 at its end.
    pub from_fraction: f64,
    /// Where it ends.
    pub to_fraction: f64,
    /// The joint that is nearest to one of its limits, counted from zero.
    pub joint: usize,
    /// Which limit.
    pub quantity: LimitedQuantity,
    /// Highest share of that limit that is used: 1 if it is reached, a little less or more within
    /// what the grid can tell.
    pub share: f64,
}

impl PathKnot {
    /// The state `tau` \[s\] later, if jerk stays.
    pub(super) fn after(&self, tau: f64) -> Self {
        let Self { time_s, s, velocity, acceleration, jerk } = *self;
        Self {
            time_s: time_s + tau,
            s: s + tau * (velocity + tau * (0.5 * acceleration + tau * jerk / 6.0)),
            velocity: velocity + tau * (acceleration + tau * 0.5 * jerk),
            acceleration: acceleration + tau * jerk,
            jerk,
        }
    }
}

impl<P: GeometricPath> TimedPath<P> {
    /// The motion that has the squared path velocity `squared[i]` at `s[i]` and constant path
    /// acceleration between.
    pub(super) fn from_squared_velocities(
        path: P,
        limits: &[AxisLimits],
        s: &[f64],
        squared: &[f64],
    ) -> Result<Self, RetimeError> {
        let mut knots = Vec::with_capacity(s.len());
        let mut time_s = 0.0;
        for (ends, x) in s.windows(2).zip(squared.windows(2)) {
            let length = ends[1] - ends[0];
            let (from, to) = (x[0].sqrt(), x[1].sqrt());
            let acceleration = (x[1] - x[0]) / (2.0 * length);
            knots.push(PathKnot { time_s, s: ends[0], velocity: from, acceleration, jerk: 0.0 });
            time_s += 2.0 * length / (from + to);
        }
        let (end, x) = (s.last().copied(), squared.last().copied());
        let (end, velocity) = (end.unwrap_or_default(), x.unwrap_or_default().sqrt());
        knots.push(PathKnot { time_s, s: end, velocity, acceleration: 0.0, jerk: 0.0 });
        if !time_s.is_finite() {
            let fraction = squared.iter().skip(1).position(|&x| x == 0.0).unwrap_or_default();
            return Err(RetimeError::Standstill { fraction: fraction as f64 / s.len() as f64 });
        }
        Ok(Self::from_knots(path, limits, knots))
    }

    pub(super) fn from_knots(path: P, limits: &[AxisLimits], knots: Vec<PathKnot>) -> Self {
        Self { path, limits: limits.to_vec(), knots }
    }

    /// The path that is followed.
    #[must_use]
    pub const fn path(&self) -> &P {
        &self.path
    }

    /// The limits that are kept, one per coordinate.
    #[must_use]
    pub fn limits(&self) -> &[AxisLimits] {
        &self.limits
    }

    /// States of the path parameter between which its jerk is constant; two at least, the first at
    /// the start and the last at the end.
    #[must_use]
    pub fn knots(&self) -> &[PathKnot] {
        &self.knots
    }

    /// How long the motion takes \[s\].
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.knots.last().map_or(0.0, |last| last.time_s)
    }

    /// How far along the path the motion is at `t_s` \[s since the start\]: 0 at the start of the
    /// path parameter's range and before, 1 at its end and after.
    #[must_use]
    pub fn fraction_at(&self, t_s: f64) -> f64 {
        self.fraction(self.state_at(t_s).s)
    }

    /// State of the path parameter at `t_s` \[s since the start\]: the start before zero (and for
    /// not a number), from the duration on the end, with its velocity and without acceleration.
    #[must_use]
    pub fn state_at(&self, t_s: f64) -> PathKnot {
        let after = self.knots.partition_point(|knot| knot.time_s <= t_s);
        let Some(knot) = self.knots.get(after.saturating_sub(1)) else {
            return PathKnot::default();
        };
        match self.knots.get(after.max(1)) {
            Some(next) => {
                let state = knot.after((t_s - knot.time_s).max(0.0));
                PathKnot { s: state.s.max(knot.s).min(next.s), ..state }
            }
            None => *knot,
        }
    }

    /// Motion of all joints at `t_s` \[s since the start\], taken as by
    /// [`state_at`](Self::state_at); `None` if there are more than [`MAX_JOINTS`] of them, for
    /// which there is [`write_at`](Self::write_at).
    #[must_use]
    pub fn at(&self, t_s: f64) -> Option<PathSample> {
        let joints = self.path.coordinates();
        if joints > MAX_JOINTS {
            return None;
        }
        let zeros = JointVector::zeros(joints).ok()?;
        let (mut position, mut velocity, mut acceleration) = (zeros, zeros, zeros);
        self.write_at(
            t_s,
            &mut PathRows {
                position: &mut position,
                first: &mut velocity,
                second: &mut acceleration,
            },
        );
        Some(PathSample { position, velocity, acceleration })
    }

    /// Writes positions, and first and second derivatives by *time*, at `t_s` \[s since the
    /// start\] into rows of one value per coordinate.
    pub fn write_at(&self, t_s: f64, out: &mut PathRows<'_>) {
        self.write_state(&self.state_at(t_s), out);
    }

    pub(super) fn write_state(&self, state: &PathKnot, out: &mut PathRows<'_>) {
        self.path.evaluate(state.s, out);
        let (v, a) = (state.velocity, state.acceleration);
        for (first, second) in out.first.iter_mut().zip(&mut *out.second) {
            *second = *first * a + *second * v * v;
            *first *= v;
        }
    }

    /// For each interval between two knots the joint and limit nearest to saturation, for people
    /// who ask why a motion takes as long as it does. Jerk is not looked at. In a few intervals
    /// nothing is reached, where braking for one limit changes to another.
    #[must_use]
    pub fn saturations(&self) -> Vec<Saturation> {
        let mut scratch = vec![0.0; 3 * self.limits.len()];
        self.knots
            .windows(2)
            .map(|ends| {
                let start = self.nearest(&ends[0], &mut scratch);
                let end = ends[0].after(ends[1].time_s - ends[0].time_s);
                let end = self.nearest(&PathKnot { s: ends[1].s, ..end }, &mut scratch);
                let (joint, quantity, share) = if start.2 < end.2 { end } else { start };
                Saturation {
                    from_fraction: self.fraction(ends[0].s),
                    to_fraction: self.fraction(ends[1].s),
                    joint,
                    quantity,
                    share,
                }
            })
            .collect()
    }

    fn nearest(&self, state: &PathKnot, scratch: &mut [f64]) -> (usize, LimitedQuantity, f64) {
        let mut rows = PathRows::split(scratch);
        self.write_state(state, &mut rows);
        let mut nearest = (0, LimitedQuantity::Velocity, 0.0);
        for (joint, axis) in self.limits.iter().enumerate() {
            let velocity = rows.first[joint].abs() / axis.velocity;
            let acceleration = rows.second[joint].abs() / axis.acceleration;
            if velocity > nearest.2 {
                nearest = (joint, LimitedQuantity::Velocity, velocity);
            }
            if acceleration >= nearest.2 {
                nearest = (joint, LimitedQuantity::Acceleration, acceleration);
            }
        }
        nearest
    }

    fn fraction(&self, s: f64) -> f64 {
        let (start, end) = self.path.range();
        ((s - start) / (end - start)).clamp(0.0, 1.0)
    }
}
