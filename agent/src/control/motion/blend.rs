//! Ways from one trajectory into the next, in motion.

use armada_model::{CompiledTrajectory, JointVector, MotionLimits, MotionState, OnlineState};
use armada_protocol::messages::ActionStatus;

use super::course::{Entry, Exit};
use super::trajectory::TrajectoryMotion;
use super::waiting::{Queued, Waiting};
use super::{Motion, Source};
use crate::control::io::{LoopEvent, Retired};
use crate::control::state::{LoopState, Tick};

/// How much of the tolerance is used to look for a way from one trajectory into the next.
pub(super) const SHARES: [f64; 5] = [0.9, 0.6, 0.35, 0.2, 0.1];
/// At which clocks a replacement may be joined \[s\], before the latest.
pub(super) const JOINS: [f64; 4] = [0.0, 0.15, 0.3, LATEST_JOIN_S];
/// How much of a replacement may be cut off \[s\].
pub(super) const LATEST_JOIN_S: f64 = 0.5;
/// How often the stretch is halved in which a curve enters a tolerance.
const HALVINGS: u32 = 24;

impl LoopState {
    /// Looks for a way from the trajectory in progress into the next, of which one is tried.
    pub(super) fn look_ahead(&mut self, tick: &Tick<'_>) {
        let period_s = tick.period_s();
        let speed = self.speed(tick);
        let Some(Queued::Trajectory(next)) = self.queue.first() else { return };
        if !next.blended {
            return;
        }
        let Some(Motion { source: Source::Trajectory(now), cancelling: false, .. }) =
            &mut self.motion
        else {
            return;
        };
        // Partners know where this motion ends, not where another would lead.
        let alone = now.has_begun() && !now.has_partners();
        let share = SHARES.get(usize::from(now.attempts)).filter(|_| alone);
        let Some(share) = share.filter(|_| now.course.exit.is_none()) else { return };
        now.attempts += 1;
        let tolerance = blend_tolerance(now, next, &tick.params.tracking_tolerance);
        let around = tolerance.map_indexed(|_, value| share * value);
        let from_s = now.committed_s(period_s) + period_s;
        let found = blend(now, &next.trajectory, from_s, &around, &tolerance, &self.limits);
        if let Some((leave_s, entry)) = found {
            // It was looked at above.
            let Some(Queued::Trajectory(next)) = self.queue.pop_at(0) else { return };
            let exit = Exit { leave_s, next, entry };
            if let Some(exit) = now.attach(exit, &speed, &self.limits, period_s) {
                // There is room: it was taken out just now.
                self.queue.insert(0, Queued::Trajectory(exit.next));
            }
        }
    }

    /// Goes over to the next motion, on the way into which the robot is.
    pub(super) fn go_over(&mut self, tick: &mut Tick<'_>) {
        let speed = self.speed(tick);
        let Some(motion) = self.motion.take() else { return };
        let report = motion.report(ActionStatus::Complete, None, tick.period_s());
        tick.event(LoopEvent::Motion(report));
        let Source::Trajectory(trajectory) = motion.source else { return };
        let Some((next, trajectory, left)) = trajectory.go_over(&speed) else { return };
        tick.retire(Retired::Trajectory(left.leg.trajectory));
        let mut motion = next.motion(trajectory);
        motion.started = Some(tick.now);
        let status = if motion.is_paused() { ActionStatus::Paused } else { ActionStatus::Running };
        let report = motion.report(status, None, tick.period_s());
        tick.event(LoopEvent::Motion(report));
        self.motion = Some(motion);
    }
}

/// The quickest way from `state` onto `trajectory`, cutting off its beginning as far as it may.
pub(super) fn way_onto(
    state: &OnlineState,
    trajectory: &CompiledTrajectory,
    limits: &MotionLimits,
) -> Option<Entry> {
    let longest_s = 0.5 * trajectory.duration_s();
    let ways = JOINS.into_iter().filter(|&join_s| join_s <= longest_s).filter_map(|join_s| {
        let entry = Entry::plan(state, trajectory, join_s, limits)?;
        Some((entry.duration_s() - join_s, entry))
    });
    ways.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, entry)| entry)
}

/// How far the way may leave the end of the one and the beginning of the other.
fn blend_tolerance(now: &TrajectoryMotion, next: &Waiting, own: &JointVector) -> JointVector {
    let trajectory = &now.course.leg.trajectory;
    let last = trajectory.waypoint_count() - 1;
    let rows = [
        trajectory.tolerance(last.saturating_sub(1)).position,
        trajectory.tolerance(last).position,
        next.trajectory.tolerance(0).position,
    ];
    own.map_indexed(|joint, limit| {
        let asked = rows.iter().filter_map(|row| row.get(joint).copied());
        asked.fold(limit, f64::min)
    })
}

/// Where to leave the trajectory in progress, not before `from_s`, and the way from there into the
/// next; none if it would be further than `tolerance` from the end or not be quicker than a rest.
fn blend(
    now: &mut TrajectoryMotion,
    next: &CompiledTrajectory,
    from_s: f64,
    around: &JointVector,
    tolerance: &JointVector,
    limits: &MotionLimits,
) -> Option<(f64, Entry)> {
    let trajectory = &now.course.leg.trajectory;
    let corner = trajectory.end();
    let duration_s = trajectory.duration_s();
    let earliest_s = 0.5 * duration_s;
    let leave_clock_s = crossing(trajectory, &corner, around, duration_s, earliest_s)?;
    let join_s = crossing(next, &corner, around, 0.0, 0.5 * next.duration_s())?;
    let leave_s = now.course.leg.phase_s(leave_clock_s);
    if leave_s <= from_s || now.course.leg.is_entry(leave_s) {
        return None;
    }
    let state = now.course.state(leave_s, &mut 0);
    let entry = Entry::plan(&state, next, join_s, limits)?;
    let quicker = entry.duration_s() < duration_s - leave_clock_s + join_s;
    (quicker && entry.stays_near(&corner, tolerance)).then_some((leave_s, entry))
}

/// A clock between `inside_s`, where the curve is near `corner`, and `outside_s` up to which it is
/// so; none if it is not at all.
fn crossing(
    trajectory: &CompiledTrajectory,
    corner: &JointVector,
    around: &JointVector,
    inside_s: f64,
    outside_s: f64,
) -> Option<f64> {
    let is_near = |clock_s: f64| {
        let MotionState { position, .. } = at(trajectory, clock_s);
        let joints = position.iter().zip(corner.iter()).zip(around.iter());
        joints.into_iter().all(|((x, corner), limit)| (x - corner).abs() <= *limit)
    };
    if !is_near(inside_s) {
        return None;
    }
    let (mut inside_s, mut outside_s) = (inside_s, outside_s);
    for _ in 0..HALVINGS {
        let middle_s = 0.5 * (inside_s + outside_s);
        if is_near(middle_s) {
            inside_s = middle_s;
        } else {
            outside_s = middle_s;
        }
    }
    Some(inside_s)
}

fn at(trajectory: &CompiledTrajectory, clock_s: f64) -> MotionState {
    let sample = trajectory.sample(clock_s, &mut 0);
    MotionState { position: sample.position, velocity: sample.velocity }
}
