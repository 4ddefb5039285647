//! A smooth curve through solved poses that stays near the path between them.

use super::error::{BlockReason, PathBlock};
use super::solve::{Follower, Miss, largest};
use super::walk::{Leg, MAX_ROWS, RESOLUTION, Row, block_at, walk_leg};
use crate::{GeometricPath, JointPath, JointVector, PathError, PathRows, SplineEnds};

/// Where between two solved poses the curve is compared with the path.
const CHECKED: [f64; 3] = [0.25, 0.5, 0.75];

/// Share of the tolerances that is used where the curve is compared, for the places between.
const USED: f64 = 0.8;

/// Most times that poses are added; each halves the distance of those around.
const MAX_ROUNDS: usize = 16;

/// Why there is no curve.
pub(super) enum FitError {
    Path(PathError),
    /// The curve would be blocked; the leg has been cut to the solved poses before.
    Blocked(Box<PathBlock>),
}

impl From<PathError> for FitError {
    fn from(error: PathError) -> Self {
        Self::Path(error)
    }
}

/// The curve through `leg`, to which poses are added until it is within tolerance of the path and
/// within the joints' limits everywhere between.
pub(super) fn fit(follower: &Follower<'_>, leg: &mut Leg) -> Result<JointPath, FitError> {
    for round in 0..=MAX_ROUNDS {
        let spline = spline(leg)?;
        let mut refined = Vec::with_capacity(2 * leg.len());
        let mut fits = true;
        for (from, to) in leg.iter().zip(leg.iter().skip(1)) {
            refined.push(*from);
            let Some(miss) = deviation(follower, &spline, (from.s, to.s)) else {
                continue;
            };
            fits = false;
            // More poses do not help where they are next to each other.
            let narrow = to.s - from.s <= 2.0 * RESOLUTION * follower.path.length();
            let (rows, block) = if narrow || round == MAX_ROUNDS || refined.len() > MAX_ROWS {
                (Vec::new(), Some(block_at(follower, from, to.s, miss)))
            } else {
                between(follower, [from, to], &spline)
            };
            refined.extend(rows);
            if let Some(block) = block {
                *leg = refined;
                return Err(FitError::Blocked(block));
            }
        }
        if fits {
            return Ok(spline);
        }
        refined.extend(leg.last());
        *leg = refined;
    }
    Ok(spline(leg)?)
}

/// Solved poses between two others, and what blocks the way to the second: one in the middle, or
/// more where that is not on the way.
fn between(
    follower: &Follower<'_>,
    [from, to]: [&Row; 2],
    spline: &JointPath,
) -> (Vec<Row>, Option<Box<PathBlock>>) {
    let limit = follower.options.max_joint_step;
    let s = 0.5 * (from.s + to.s);
    if let Ok(position) = follower.step(from, &position(spline, s), s)
        && position.max_abs_difference(&to.position) <= limit
    {
        return (vec![Row { s, position }], None);
    }
    // The curve led to another branch of solutions: smaller steps keep to this one.
    let (mut rows, mut block) = walk_leg(follower, *from, to.s);
    rows.remove(0);
    if block.is_none() {
        let last = rows.pop().unwrap_or(*from);
        let moved = last.position.iter().zip(to.position.iter()).map(|(a, b)| (a - b).abs());
        let (joint, size) = largest(moved);
        if size > 0.5 * limit {
            let reason = BlockReason::JointJump { joint, size, limit };
            let here = rows.last().unwrap_or(from);
            block = Some(block_at(follower, here, to.s, Miss { reason, ..Miss::NONE }));
        }
    }
    (rows, block)
}

fn spline(leg: &Leg) -> Result<JointPath, PathError> {
    let parameters: Vec<f64> = leg.iter().map(|row| row.s).collect();
    let rows: Vec<&[f64]> = leg.iter().map(|row| &*row.position).collect();
    JointPath::with_parameters(&parameters, &rows, SplineEnds::NotAKnot)
}

/// The first place between two solved poses where the curve is out of limits or tolerance.
fn deviation(follower: &Follower<'_>, spline: &JointPath, (from, to): (f64, f64)) -> Option<Miss> {
    if let Some((joint, limit)) = beyond_limit(follower, spline, (from, to)) {
        let reason = BlockReason::JointLimit { joint, limit };
        return Some(Miss { reason, ..Miss::NONE });
    }
    CHECKED.iter().find_map(|share| {
        let s = from + share * (to - from);
        let (distance, angle) = follower.distance(&position(spline, s), s)?;
        let options = follower.options;
        let outside =
            distance > USED * options.position_tolerance || angle > USED * options.angle_tolerance;
        let reason = BlockReason::Deviation { distance, angle };
        outside.then_some(Miss { reason, position: distance, angle })
    })
}

/// The first joint whose cubic between two solved poses, which are inside its limits, turns beyond
/// one, and the limit.
fn beyond_limit(
    follower: &Follower<'_>,
    spline: &JointPath,
    (from, to): (f64, f64),
) -> Option<(usize, f64)> {
    let [_, slope, bend, third] = derivatives(spline, from);
    let turns = |joint: usize| {
        // Where the velocity, slope + bend u + third u² / 2, is zero; not a number if it is not.
        let (slope, bend, third) = (slope[joint], bend[joint], third[joint]);
        let root = -(bend + (bend * bend - 2.0 * slope * third).sqrt().copysign(bend));
        [root / third, 2.0 * slope / root]
    };
    (0..slope.len()).find_map(|joint| {
        turns(joint).into_iter().filter(|&u| u > 0.0 && u < to - from).find_map(|u| {
            let value = *position(spline, from + u).get(joint)?;
            Some((joint, follower.beyond_limit(joint, value)?))
        })
    })
}

/// Position of the curve at `s`, and its three derivatives.
fn derivatives(spline: &JointPath, s: f64) -> [JointVector; 4] {
    let zeros = JointVector::zeros(spline.coordinates()).unwrap_or_default();
    let [mut position, mut first, mut second, mut third] = [zeros; 4];
    let mut rows = PathRows { position: &mut position, first: &mut first, second: &mut second };
    spline.evaluate(s, &mut rows);
    spline.third_derivative(s, &mut third);
    [position, first, second, third]
}

/// The position of the curve at `s`.
fn position(spline: &JointPath, s: f64) -> JointVector {
    let [position, ..] = derivatives(spline, s);
    position
}
