//! From waypoints to polynomials.

use super::blend;
use super::curve::{Curve, KnotRows};
use super::error::TrajectoryError;
use super::motion_limits::MotionLimits;
use super::options::Ends;
use super::piece::{Knot, Piece};
use super::spline::{SplineEnds, spline_slopes};
use super::validate::{Knots, moving_end, name};
use super::waypoints::Interpolation;

/// The curve through `knots` (near them, with blends). What the interpolation does not take is not
/// in `knots`.
pub(super) fn curve(
    interpolation: Interpolation,
    knots: Knots,
    names: &[&str],
    limits: &MotionLimits,
    ends: Ends,
) -> Result<Curve, TrajectoryError> {
    let joints = names.len();
    match interpolation {
        Interpolation::CubicSpline => Ok(cubic(knots, joints)),
        Interpolation::CubicSplineNatural => natural(knots, names, ends),
        Interpolation::JointLinear => blend::curve(&knots, names, limits),
        Interpolation::QuinticHermite => Ok(quintic(knots, joints)),
    }
}

fn cubic(knots: Knots, joints: usize) -> Curve {
    let Knots { times, positions, velocities, .. } = knots;
    let velocities = velocities
        .unwrap_or_else(|| spline_slopes(&times, &positions, joints, SplineEnds::Clamped));
    let rows = KnotRows { positions: &positions, velocities: &velocities, accelerations: &[] };
    Curve::cubic(joints, times, rows)
}

fn natural(knots: Knots, names: &[&str], ends: Ends) -> Result<Curve, TrajectoryError> {
    let Knots { times, positions, .. } = knots;
    let joints = names.len();
    let mut velocities = spline_slopes(&times, &positions, joints, SplineEnds::Natural);
    if ends == Ends::AtRest
        && let Some((waypoint, joint, velocity)) = moving_end(&mut velocities, joints)
    {
        let joint = name(names, joint);
        return Err(TrajectoryError::NaturalInMotion { waypoint, joint, velocity });
    }
    let rows = KnotRows { positions: &positions, velocities: &velocities, accelerations: &[] };
    Ok(Curve::cubic(joints, times, rows))
}

fn quintic(knots: Knots, joints: usize) -> Curve {
    let Knots { times, positions, velocities, accelerations, .. } = knots;
    let velocities = velocities
        .unwrap_or_else(|| spline_slopes(&times, &positions, joints, SplineEnds::Clamped));
    let accelerations = accelerations
        .unwrap_or_else(|| mean_accelerations(&times, &positions, &velocities, joints));
    let rows =
        KnotRows { positions: &positions, velocities: &velocities, accelerations: &accelerations };
    Curve::quintic(joints, times, rows)
}

/// A row per time: zero at both ends, between them the mean of the accelerations that the cubics
/// before and after have there.
fn mean_accelerations(
    times: &[f64],
    positions: &[f64],
    velocities: &[f64],
    joints: usize,
) -> Vec<f64> {
    let mut accelerations = vec![0.0; positions.len()];
    let knot =
        |at: usize| Knot { position: positions[at], velocity: velocities[at], acceleration: 0.0 };
    for (segment, ends) in times.windows(2).enumerate() {
        let length = ends[1] - ends[0];
        for from in segment * joints..(segment + 1) * joints {
            let to = from + joints;
            let cubic = Piece::<4>::hermite(length, knot(from), knot(to));
            if segment > 0 {
                accelerations[from] += 0.5 * cubic.acceleration(0.0);
            }
            if segment + 2 < times.len() {
                accelerations[to] += 0.5 * cubic.acceleration(length);
            }
        }
    }
    accelerations
}
