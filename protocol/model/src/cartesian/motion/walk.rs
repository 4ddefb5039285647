//! Along a path from pose to pose.

use super::error::PathBlock;
use super::solve::{Follower, Miss};
use crate::JointVector;

/// Fewest solved poses of a leg, and longest way between two of them \[m\].
const MIN_STEPS: f64 = 8.0;
const MAX_STEP: f64 = 0.05;

/// How exactly it is found where a path is blocked, and over how short a way a joint jumps, as a
/// share of the whole path.
pub(super) const RESOLUTION: f64 = 1e-6;

/// Most solved poses of a path.
pub(super) const MAX_ROWS: usize = 20_000;

/// One solved pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Row {
    pub(super) s: f64,
    pub(super) position: JointVector,
}

/// The part of a path that has no stop inside, solved at some of its poses: two at least.
pub(super) type Leg = Vec<Row>;

/// Solves poses of `path` in order, as far as they can be followed from `start`, which is at its
/// beginning. A leg ends at every stop.
pub(super) fn walk(
    follower: &Follower<'_>,
    start: &JointVector,
) -> (Vec<Leg>, Option<Box<PathBlock>>) {
    let path = follower.path;
    let mut legs = Vec::new();
    let mut here = Row { s: 0.0, position: *start };
    for stop in path.stops().chain([path.length()]) {
        let (leg, block) = walk_leg(follower, here, stop);
        if let Some(&last) = leg.last() {
            here = last;
        }
        if leg.len() > 1 {
            legs.push(leg);
        }
        if block.is_some() {
            return (legs, block);
        }
    }
    (legs, None)
}

/// Solves poses from `start` to `end` in order, until one cannot be followed.
pub(super) fn walk_leg(
    follower: &Follower<'_>,
    start: Row,
    end: f64,
) -> (Leg, Option<Box<PathBlock>>) {
    let resolution = RESOLUTION * follower.path.length();
    let longest = ((end - start.s) / MIN_STEPS).min(MAX_STEP);
    let mut leg = vec![start];
    let mut step = longest;
    // The start itself may be where nothing is allowed.
    if let Err(reason) = follower.check(&start) {
        let miss = Miss { reason, ..Miss::NONE };
        return (leg, Some(block_at(follower, &start, start.s, miss)));
    }
    let (mut before, mut here) = (None, start);
    while here.s < end {
        // Without a last step that is next to nothing.
        let s = if here.s + 1.5 * step > end { end } else { here.s + step };
        let seed = follower.predict(before.as_ref(), &here, s);
        match follower.step(&here, &seed, s) {
            Ok(position) => {
                before = Some(here);
                here = Row { s, position };
                leg.push(here);
                step = longest.min(2.0 * step);
            }
            Err(miss) if s - here.s <= resolution || leg.len() >= MAX_ROWS => {
                return (leg, Some(block_at(follower, &here, s, miss)));
            }
            Err(_) => step = 0.5 * (s - here.s),
        }
    }
    (leg, None)
}

/// What is told about a path that cannot be followed from `here` to `s`.
pub(super) fn block_at(follower: &Follower<'_>, here: &Row, s: f64, miss: Miss) -> Box<PathBlock> {
    Box::new(PathBlock {
        fraction: here.s / follower.path.length(),
        pose: follower.path.pose_at(s),
        joint_position: here.position,
        position_residual: miss.position,
        angle_residual: miss.angle,
        reason: miss.reason,
    })
}
