//! Whether a curve keeps the limits, by its exact extremes.

use super::curve::{Curve, Degree};
use super::error::{LimitedQuantity, TrajectoryError};
use super::motion_limits::{AxisLimits, MotionLimits};
use super::options::{Ends, JerkLimit, TrajectoryOptions};
use super::piece::{Candidates, Extrema, Piece};
use super::validate::{LIMIT_TOLERANCE, name};
use crate::MAX_JOINTS;

/// Rows of bounds per segment: velocity, acceleration, jerk.
pub(super) const BOUNDS: usize = 3;

/// For each segment the highest magnitude of velocity of each joint, then of acceleration, then of
/// jerk; if these and the positions are within `limits`.
pub(super) fn check(
    curve: &Curve,
    names: &[&str],
    limits: &MotionLimits,
    options: &TrajectoryOptions,
) -> Result<Vec<f64>, TrajectoryError> {
    let bounds = match curve.degree() {
        Degree::Three => bounds::<4>(curve, names, limits, options.jerk),
        Degree::Five => bounds::<6>(curve, names, limits, options.jerk),
    }?;
    if options.jerk == JerkLimit::Enforced {
        match curve.degree() {
            Degree::Three => check_jumps::<4>(curve, names, limits, options.ends),
            Degree::Five => check_jumps::<6>(curve, names, limits, options.ends),
        }?;
    }
    Ok(bounds)
}

fn bounds<const N: usize>(
    curve: &Curve,
    names: &[&str],
    limits: &MotionLimits,
    jerk: JerkLimit,
) -> Result<Vec<f64>, TrajectoryError>
where
    Piece<N>: Extrema,
{
    let joints = curve.joints();
    let mut bounds = vec![0.0; BOUNDS * joints * curve.segments()];
    for (segment, rows) in bounds.chunks_exact_mut(BOUNDS * joints).enumerate() {
        for (joint, axis) in limits.iter().enumerate() {
            let peaks = peaks(&curve.piece::<N>(segment, joint), axis, jerk);
            let peaks = peaks.map_err(|Violation { quantity, peak, limit }| {
                TrajectoryError::BeyondLimit {
                    quantity,
                    joint: name(names, joint),
                    segment: curve.waypoint(segment),
                    time_s: curve.span(segment).0 + peak.u,
                    value: peak.value,
                    limit,
                }
            })?;
            for (row, peak) in peaks.into_iter().enumerate() {
                rows[row * joints + joint] = peak.value.abs();
            }
        }
    }
    Ok(bounds)
}

struct Violation {
    quantity: LimitedQuantity,
    peak: Peak,
    limit: f64,
}

/// The largest value and where on the segment it is.
#[derive(Clone, Copy)]
struct Peak {
    u: f64,
    value: f64,
}

/// Highest magnitudes of velocity, acceleration and jerk, or where `piece` breaks its limits most:
/// of position if it does, else of velocity, and so on.
fn peaks<const N: usize>(
    piece: &Piece<N>,
    limits: &AxisLimits,
    jerk: JerkLimit,
) -> Result<[Peak; BOUNDS], Violation>
where
    Piece<N>: Extrema,
{
    let velocity = most(piece.velocity_extrema(), |u| piece.velocity(u), f64::abs);
    if !is_surely_inside(piece, velocity, limits) {
        let outside = |x: f64| (limits.lower - x).max(x - limits.upper);
        let position = most(piece.position_extrema(), |u| piece.position(u), outside);
        let within = outside(position.value) <= LIMIT_TOLERANCE;
        if !within {
            let limit = limits.nearer_limit(position.value);
            return Err(Violation { quantity: LimitedQuantity::Position, peak: position, limit });
        }
    }
    let velocity = bounded(LimitedQuantity::Velocity, velocity, limits.velocity)?;
    let acceleration = most(piece.acceleration_extrema(), |u| piece.acceleration(u), f64::abs);
    let acceleration = bounded(LimitedQuantity::Acceleration, acceleration, limits.acceleration)?;
    let jerk_limit = match jerk {
        JerkLimit::Ignored => f64::INFINITY,
        JerkLimit::Enforced => limits.jerk,
    };
    let jerk = most(piece.jerk_extrema(), |u| piece.jerk(u), f64::abs);
    let jerk = bounded(LimitedQuantity::Jerk, jerk, jerk_limit)?;
    Ok([velocity, acceleration, jerk])
}

/// Whether a piece cannot leave the position limits, since it is not fast enough to leave them and
/// come back. That is so for most pieces, and costs less than their extremes.
fn is_surely_inside<const N: usize>(piece: &Piece<N>, speed: Peak, limits: &AxisLimits) -> bool {
    let (from, to) = (piece.position(0.0), piece.position(piece.length));
    let (middle, reach) = (0.5 * (from + to), 0.5 * speed.value.abs() * piece.length);
    limits.lower <= middle - reach && middle + reach <= limits.upper
}

fn bounded(quantity: LimitedQuantity, peak: Peak, limit: f64) -> Result<Peak, Violation> {
    // Written so that what overflowed to not a number is refused as well.
    let within = peak.value.abs() <= limit * (1.0 + LIMIT_TOLERANCE);
    if within { Ok(peak) } else { Err(Violation { quantity, peak, limit }) }
}

/// The candidate whose value has the highest measure, of equal ones (but for rounding) the first;
/// not a number is the highest of all.
fn most(candidates: Candidates, value: impl Fn(f64) -> f64, measure: impl Fn(f64) -> f64) -> Peak {
    const ROUNDING: f64 = 4.0 * f64::EPSILON;
    let mut most = Peak { u: 0.0, value: value(0.0) };
    for u in candidates {
        let value = value(u);
        let higher = measure(value) > measure(most.value) * (1.0 + ROUNDING) || value.is_nan();
        if higher && !most.value.is_nan() {
            most = Peak { u, value };
        }
    }
    most
}

/// Refuses a curve whose acceleration is not continuous.
fn check_jumps<const N: usize>(
    curve: &Curve,
    names: &[&str],
    limits: &MotionLimits,
    ends: Ends,
) -> Result<(), TrajectoryError> {
    let mut last: Option<[f64; MAX_JOINTS]> = (ends == Ends::AtRest).then_some([0.0; MAX_JOINTS]);
    let compare = |time_s, joint: usize, before: f64, after: f64| {
        let continuous = (after - before).abs() <= limits[joint].acceleration * LIMIT_TOLERANCE;
        if continuous {
            return Ok(());
        }
        let joint = name(names, joint);
        Err(TrajectoryError::AccelerationJump { joint, time_s, before, after })
    };
    for segment in 0..curve.segments() {
        let mut next = [0.0; MAX_JOINTS];
        for (joint, next) in next.iter_mut().enumerate().take(curve.joints()) {
            let piece = curve.piece::<N>(segment, joint);
            if let Some(before) = last {
                let after = piece.acceleration(0.0);
                compare(curve.span(segment).0, joint, before[joint], after)?;
            }
            *next = piece.acceleration(piece.length);
        }
        last = Some(next);
    }
    if let (Ends::AtRest, Some(before)) = (ends, last) {
        for (joint, &before) in before.iter().enumerate().take(curve.joints()) {
            compare(curve.duration_s(), joint, before, 0.0)?;
        }
    }
    Ok(())
}
