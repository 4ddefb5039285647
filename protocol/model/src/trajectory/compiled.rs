//! A trajectory that was found legal, ready to be sampled.

use super::cubic::{Cubic, Knot, clamped_spline_slopes};
use super::error::{LimitedQuantity, TrajectoryError};
use super::motion_limits::{AxisLimits, MotionLimits};
use super::validate::{self, Knots, LIMIT_TOLERANCE, TrajectoryOptions};
use super::waypoints::{Interpolation, JointTrajectory};
use crate::JointVector;

/// How many segments a sample looks ahead of its hint before it searches.
const LOOK_AHEAD: usize = 4;

/// A piecewise cubic motion of all joints of one robot from rest to rest, inside all limits.
///
/// That it exists means that it is legal: the extremes of position, velocity and acceleration of
/// every joint were found exactly and lie within the limits. Sampling does not allocate.
#[derive(Clone, Debug, PartialEq)]
pub struct CompiledTrajectory {
    start: JointVector,
    end: JointVector,
    /// Time of each waypoint \[s\]; at least two.
    times: Vec<f64>,
    /// Per segment four rows of one value per joint: all `c0`, all `c1`, all `c2`, all `c3`. A
    /// sample reads one contiguous piece, and one row at a time, as vector instructions want it.
    coefficients: Vec<f64>,
}

/// What a trajectory asks for at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position of each joint \[rad or m\].
    pub position: JointVector,
    /// Velocity of each joint \[rad/s or m/s\].
    pub velocity: JointVector,
    /// Index of the last waypoint whose time has come.
    pub waypoint: usize,
}

impl CompiledTrajectory {
    /// Validates and interpolates `trajectory` for the robot whose joints are `joint_order`, with
    /// `limits` in the same order. Its joint names may come in any order.
    ///
    /// # Errors
    /// The first [`TrajectoryError`] that applies, in the order of the checks: names, number and
    /// shape of the waypoints, times, finite values, rest at both ends, limits. Of several
    /// violations of limits it is the earliest by segment, then by joint.
    pub fn compile(
        trajectory: &JointTrajectory,
        joint_order: &[impl AsRef<str>],
        limits: &MotionLimits,
        options: &TrajectoryOptions,
    ) -> Result<Self, TrajectoryError> {
        if joint_order.len() != limits.len() {
            let (joints, limits) = (joint_order.len(), limits.len());
            return Err(TrajectoryError::LimitCount { joints, limits });
        }
        let Knots { times, positions, velocities } =
            validate::knots(trajectory, joint_order, options)?;
        let joints = limits.len();
        let slopes = velocities.unwrap_or_else(|| match trajectory.interpolation {
            Interpolation::CubicSpline => clamped_spline_slopes(&times, &positions, joints),
        });
        let mut coefficients = vec![0.0; 4 * joints * (times.len() - 1)];
        let segments = coefficients.chunks_exact_mut(4 * joints);
        for (segment, (rows, ends)) in segments.zip(times.windows(2)).enumerate() {
            for (joint, axis) in limits.iter().enumerate() {
                let from = segment * joints + joint;
                let knot = |at: usize| Knot { position: positions[at], slope: slopes[at] };
                let cubic = Cubic::hermite(ends[1] - ends[0], knot(from), knot(from + joints));
                if let Some(violation) = violation(&cubic, axis) {
                    let joint = validate::name(joint_order, joint);
                    return Err(violation.into_error(joint, segment, ends[0]));
                }
                for (power, coefficient) in cubic.coefficients.into_iter().enumerate() {
                    rows[power * joints + joint] = coefficient;
                }
            }
        }
        let (start, end) = (row(&positions, joints, 0), row(&positions, joints, times.len() - 1));
        Ok(Self { start, end, times, coefficients })
    }

    /// Time of the last waypoint \[s\].
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.times.last().copied().unwrap_or_default()
    }

    /// Number of waypoints, two at least.
    #[must_use]
    pub const fn waypoint_count(&self) -> usize {
        self.times.len()
    }

    /// Number of joints, one at least.
    #[must_use]
    pub fn joint_count(&self) -> usize {
        self.start.len()
    }

    /// Position at the first waypoint \[rad or m\].
    #[must_use]
    pub const fn start(&self) -> JointVector {
        self.start
    }

    /// Position at the last waypoint \[rad or m\].
    #[must_use]
    pub const fn end(&self) -> JointVector {
        self.end
    }

    /// The motion at `t_s` \[s since its start\]: at rest at the first waypoint before zero (and
    /// for not a number), at rest at exactly the last waypoint from the duration on.
    ///
    /// `hint` holds where the last sample was found; begin with zero. While time goes on by small
    /// steps the cost does not depend on the number of waypoints; for any other it is its logarithm.
    #[must_use]
    pub fn sample(&self, t_s: f64, hint: &mut usize) -> Sample {
        if t_s >= self.duration_s() {
            *hint = self.times.len().saturating_sub(2);
            return Sample {
                position: self.end,
                velocity: self.end.map_indexed(|_, _| 0.0),
                waypoint: self.times.len() - 1,
            };
        }
        let t_s = t_s.max(0.0);
        let segment = self.segment_at(t_s, *hint);
        *hint = segment;
        let u = t_s - self.times[segment];
        let joints = self.joint_count();
        let rows = &self.coefficients[4 * joints * segment..][..4 * joints];
        let (low, high) = rows.split_at(2 * joints);
        let ((c0, c1), (c2, c3)) = (low.split_at(joints), high.split_at(joints));
        let (mut position, mut velocity) = (self.start, self.start);
        for (joint, (x, v)) in position.iter_mut().zip(velocity.iter_mut()).enumerate() {
            *x = c0[joint] + u * (c1[joint] + u * (c2[joint] + u * c3[joint]));
            *v = c1[joint] + u * (2.0 * c2[joint] + u * 3.0 * c3[joint]);
        }
        Sample { position, velocity, waypoint: segment }
    }

    /// Beginning and end of segment `index` \[s\], and its four rows of coefficients; the index must
    /// be below the number of waypoints less one.
    pub(crate) fn segment(&self, index: usize) -> (f64, f64, &[f64]) {
        let size = 4 * self.joint_count();
        (self.times[index], self.times[index + 1], &self.coefficients[size * index..][..size])
    }

    /// The segment that holds `t_s`, which lies between zero and the duration.
    pub(crate) fn segment_at(&self, t_s: f64, hint: usize) -> usize {
        let near = self.times.get(hint..).filter(|times| times.first().is_some_and(|&t| t <= t_s));
        if let Some(times) = near {
            let ahead = times.iter().take(LOOK_AHEAD + 1).take_while(|&&t| t <= t_s).count();
            if ahead <= LOOK_AHEAD {
                return hint + ahead - 1;
            }
        }
        self.times.partition_point(|&t| t <= t_s).saturating_sub(1)
    }
}

struct Violation {
    quantity: LimitedQuantity,
    /// Where on the segment.
    u: f64,
    value: f64,
    limit: f64,
}

impl Violation {
    fn into_error(self, joint: String, segment: usize, segment_start_s: f64) -> TrajectoryError {
        let Self { quantity, u, value, limit } = self;
        let time_s = segment_start_s + u;
        TrajectoryError::BeyondLimit { quantity, joint, segment, time_s, value, limit }
    }
}

/// Where `cubic` breaks its limits most: of position if it does, else of velocity, else of
/// acceleration.
fn violation(cubic: &Cubic, limits: &AxisLimits) -> Option<Violation> {
    let outside = |x: f64| (limits.lower - x).max(x - limits.upper);
    let positions = cubic.position_extrema().into_iter().map(|u| (u, cubic.position(u)));
    if let Some((u, value)) = worst(positions, outside, LIMIT_TOLERANCE) {
        let limit = limits.nearer_limit(value);
        return Some(Violation { quantity: LimitedQuantity::Position, u, value, limit });
    }
    let velocities = cubic.velocity_extrema().into_iter().map(|u| (u, cubic.velocity(u)));
    let limit = limits.velocity;
    if let Some((u, value)) = worst(velocities, |v| v.abs() - limit, limit * LIMIT_TOLERANCE) {
        return Some(Violation { quantity: LimitedQuantity::Velocity, u, value, limit });
    }
    let ends = cubic.acceleration_extrema().into_iter().map(|u| (u, cubic.acceleration(u)));
    let limit = limits.acceleration;
    worst(ends, |a| a.abs() - limit, limit * LIMIT_TOLERANCE).map(|(u, value)| Violation {
        quantity: LimitedQuantity::Acceleration,
        u,
        value,
        limit,
    })
}

/// The candidate that is furthest outside, if that is further than `tolerance`.
fn worst(
    candidates: impl Iterator<Item = (f64, f64)>,
    excess: impl Fn(f64) -> f64,
    tolerance: f64,
) -> Option<(f64, f64)> {
    let mut worst = None;
    let mut most = tolerance;
    for (u, value) in candidates {
        let within = excess(value) <= most;
        // What overflowed to not a number is within nothing, so it is refused too.
        if !within {
            most = excess(value).max(most);
            worst = Some((u, value));
        }
    }
    worst
}

fn row(rows: &[f64], joints: usize, index: usize) -> JointVector {
    // Rows are finite and not longer than the limits are, so this never fails.
    JointVector::from_slice(&rows[index * joints..][..joints]).unwrap_or_default()
}
