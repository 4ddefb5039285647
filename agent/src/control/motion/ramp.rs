//! Bringing the robot to rest, and holding it there: the stream of set-points between motions.
//!
//! A trajectory is stopped **on its path**, jerk-limited: that is where the robot was said to be
//! able to go. It may take longer there than straight on, where the path bends or the limits of
//! jerk cost time; therefore it gets a deadline. The plain ramp straight on from what was sent last
//! would take `T`, which is known beforehand. At every tick the next step on the path is only taken
//! if a plain ramp from there would still end within `T` and the allowance, counted from when the
//! stop began; otherwise the plain ramp begins, now. So whatever the path says, the robot stands
//! after at most `T` + [`STOP_ALLOWANCE`] when a stop or a fault ended the motion, and `T` +
//! [`CALM_ALLOWANCE`] when a person did. One that is stopped on the way to rest is hurried up.
//!
//! A robot of a rigid group that is stopped in motion goes on at the common pace until that is zero
//! (`GroupMachine`), since robots that hold one thing are to brake alike; the same deadline holds, the
//! length of the common ramp added.

use serde::{Deserialize, Serialize};
use std::time::Duration;
use uuid::Uuid;

use armada_model::{JointVector, MotionLimits, MotionState, StopRamp};
use armada_protocol::messages::{ActionStatus, CommandMode, StopLevel};

use super::trajectory::TrajectoryMotion;
use super::{End, Source};
use crate::control::io::{LoopEvent, Refusal, Retired};
use crate::control::state::{LoopState, Tick};

/// How much longer than the plain ramp a stop on the path may take after a stop or a fault.
pub(in crate::control) const STOP_ALLOWANCE: Duration = Duration::from_millis(100);
/// The same after a cancel, a halt, a change of mode or a lost lease.
pub(super) const CALM_ALLOWANCE: Duration = Duration::from_millis(500);

/// What brings the robot to rest.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "the loop allocates nothing")]
pub(in crate::control) enum Brake {
    /// Straight on from what was sent last.
    Plain(StopRamp),
    /// On its path.
    OnPath(PathBrake),
}

/// A stop on a path, with its deadline.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct PathBrake {
    motion: TrajectoryMotion,
    /// Ticks that are left until the robot has to stand.
    left: u64,
    /// The group with which it comes to rest.
    group: Option<Uuid>,
}

/// How soon a motion that ends is to be at rest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Haste {
    /// After a stop or a fault.
    pub(super) urgent: bool,
    /// The group on whose common ramp it comes to rest, and how long that takes \[s\].
    pub(super) together: Option<(Uuid, f64)>,
}

impl Brake {
    /// The trajectory on which it comes to rest with this group, if it does.
    pub(in crate::control) fn of_group(&mut self, group: Uuid) -> Option<&mut TrajectoryMotion> {
        match self {
            Self::OnPath(PathBrake { motion, group: Some(id), .. }) if *id == group => Some(motion),
            _ => None,
        }
    }
}

impl PathBrake {
    /// The next state, if the robot can still be brought to rest in time from there.
    fn step(
        &mut self,
        last: &MotionState,
        limits: &MotionLimits,
        period: Duration,
    ) -> Option<(MotionState, bool)> {
        self.left = self.left.checked_sub(1)?;
        let (state, rests) = self.motion.stopping(period.as_secs_f64())?;
        let velocity = state.position.map_indexed(|joint, x| {
            (x - last.position.get(joint).copied().unwrap_or(x)) / period.as_secs_f64()
        });
        let in_time = ramp_ticks(&velocity, limits, period) <= self.left;
        // The robot is known to rest when a set-point is sent again.
        in_time.then_some((state, rests && state.position == last.position))
    }
}

impl LoopState {
    /// Begins a ramp to standstill, if the set-points move; one in progress goes on.
    ///
    /// It starts from what was sent last, whatever moved before, so it cannot be refused.
    pub(in crate::control) fn decelerate(&mut self, tick: &Tick<'_>) {
        let Some(last) = self.limiter.last().filter(|_| self.ramp.is_none()) else {
            return;
        };
        if last.velocity.iter().all(|&velocity| velocity == 0.0) {
            self.hold = last.position;
        } else {
            let ramp = StopRamp::plan(last, &self.limits, tick.params.period);
            self.ramp = Some(Brake::Plain(ramp));
        }
    }

    /// Brings a deadline forward that was set for a person, since now something is wrong; a stop leaves
    /// a robot that comes to rest with its group the time for that.
    pub(in crate::control) fn hurry(&mut self, tick: &Tick<'_>, end: End) {
        let period = tick.params.period;
        let group = match &self.ramp {
            Some(Brake::OnPath(brake)) if end.is_stop() => brake.group,
            _ => None,
        };
        let common_s = group.and_then(|group| self.common_ramp_s(group, tick.params));
        let common = whole_periods(common_s.unwrap_or_default(), period);
        if let (Some(Brake::OnPath(brake)), Some(last)) = (&mut self.ramp, self.limiter.last()) {
            let ticks = ramp_ticks(&last.velocity, &self.limits, period);
            brake.left = brake.left.min(ticks + allowance(true, period) + common);
        }
    }

    /// Takes over the trajectory of a motion that has ended: stops it on its path if it is in
    /// motion on one, and gives it back otherwise.
    pub(super) fn leave_behind(
        &mut self,
        tick: &mut Tick<'_>,
        mut motion: TrajectoryMotion,
        moves: bool,
        haste: Haste,
    ) {
        let period = tick.params.period;
        if let Some(exit) = &motion.course.exit {
            let (status, why) = (ActionStatus::Cancelled, Refusal::QueueBroken);
            tick.event(LoopEvent::Motion(exit.next.report(status, Some(why))));
        }
        let last = self.limiter.last().filter(|_| moves && self.ramp.is_none());
        let last = last.filter(|last| last.velocity.iter().any(|&velocity| velocity != 0.0));
        let period_s = period.as_secs_f64();
        let brakes = |motion: &mut TrajectoryMotion| match haste.together {
            Some(_) => motion.has_path(&self.limits, period_s),
            None => motion.stop(&self.limits, period_s),
        };
        match last {
            Some(last) if brakes(&mut motion) => {
                let ticks = ramp_ticks(&last.velocity, &self.limits, period);
                let (group, common_s) = haste.together.unzip();
                let common = whole_periods(common_s.unwrap_or_default(), period);
                let left = ticks + allowance(haste.urgent, period) + common;
                self.ramp = Some(Brake::OnPath(PathBrake { motion, left, group }));
            }
            _ => give_back(tick, motion),
        }
    }

    /// Ends the ramp, wherever it is.
    fn release_brake(&mut self, tick: &mut Tick<'_>) {
        if let Some(Brake::OnPath(brake)) = self.ramp.take() {
            give_back(tick, brake.motion);
        }
    }

    /// Ends the stream of set-points if the controller does not follow them or must not, and
    /// begins one at the measured position if it does; see the head of [`control`](super::super).
    ///
    /// While the pendant has control there is none either, once the robot is at rest: it may be
    /// moved by hand, and must not be sent back to where it stood before.
    pub(in crate::control) fn keep_stream(&mut self, tick: &mut Tick<'_>) {
        self.settle_own_motion(tick);
        let stop = self.stop.level();
        let pendant = self.check_local_control().is_err() && self.ramp.is_none();
        let followed = self.condition.follows() && !self.controller_moves() && !pendant;
        let feedback = self.condition.feedback().filter(|_| followed);
        let Some(feedback) = feedback.filter(|_| stop != Some(StopLevel::L0)) else {
            self.break_off(tick);
            return;
        };
        let wanted = self.mode != CommandMode::InvalidState || stop.is_some();
        if self.limiter.last().is_none() && wanted {
            self.hold = feedback.joint_position;
            self.limiter.begin(self.hold);
            let none = JointVector::EMPTY;
            self.tracking.record(tick.now, self.hold, none, (none, none));
        }
    }

    /// Ends the stream of set-points.
    pub(super) fn break_off(&mut self, tick: &mut Tick<'_>) {
        self.limiter.end();
        self.tracking.forget();
        self.release_brake(tick);
    }

    /// After a fault or stop was cleared: holds the robot where it is.
    ///
    /// If the stream broke off, it begins anew at the measured position by itself. If it did not
    /// and the robot is where it was told to be, there is nothing to change: to take the measured
    /// position then would make noise and load a motion, and clearing never moves. But if the robot
    /// was pushed away, the set-point goes to it, within the limits, rather than it back.
    pub(in crate::control) fn reseed(&mut self, tick: &Tick<'_>) {
        if self.ramp.is_some() || self.stop.level().is_some() {
            // Nothing begins to move under a stop. When it is cleared there is another occasion.
            return;
        }
        let Some(feedback) = self.condition.feedback() else {
            return;
        };
        let Some(last) = self.limiter.last() else {
            return;
        };
        if is_away(&feedback.joint_position, &last.position, &tick.params.start_tolerance) {
            self.hold = feedback.joint_position;
        }
    }

    /// The next set-point of the ramp; a motion that was cancelled ends with its last.
    pub(super) fn ramp_step(&mut self, tick: &mut Tick<'_>) -> Option<(MotionState, Option<End>)> {
        let (state, rests) = self.brake_step(tick)?;
        let cancelling = self.motion.as_mut().filter(|motion| motion.cancelling);
        if let (Some(motion), Some(Brake::OnPath(brake))) = (cancelling, &self.ramp)
            && let Source::Braked(_, progress) = &mut motion.source
        {
            progress.elapsed_s = brake.motion.elapsed_s(tick.period_s());
            progress.waypoint = brake.motion.waypoint();
            progress.rate = brake.motion.rate();
        }
        if !rests {
            return Some((state, None));
        }
        self.release_brake(tick);
        self.hold = state.position;
        let cancelled = self.motion.as_ref().is_some_and(|motion| motion.cancelling);
        Some((state, cancelled.then_some(End::Cancelled(Refusal::Cancelled))))
    }

    /// The next state of the brake, and whether the robot is at rest with it.
    fn brake_step(&mut self, tick: &mut Tick<'_>) -> Option<(MotionState, bool)> {
        let last = *self.limiter.last()?;
        if let Some(Brake::OnPath(brake)) = &mut self.ramp {
            let step = brake.step(&last, &self.limits, tick.params.period);
            if step.is_some() {
                return step;
            }
            self.release_brake(tick);
            let ramp = StopRamp::plan(&last, &self.limits, tick.params.period);
            self.ramp = Some(Brake::Plain(ramp));
        }
        let Some(Brake::Plain(ramp)) = &mut self.ramp else { return None };
        let state = ramp.step();
        Some((state, ramp.is_standstill()))
    }
}

/// In how many ticks a plain ramp from differences of `velocity` is at rest.
fn ramp_ticks(velocity: &JointVector, limits: &MotionLimits, period: Duration) -> u64 {
    let joints = velocity.iter().zip(limits.iter());
    let longest_s = joints.map(|(v, axis)| v.abs() / axis.acceleration).fold(0.0, f64::max);
    whole_periods(longest_s, period)
}

/// How many ticks a time \[s\] takes.
fn whole_periods(time_s: f64, period: Duration) -> u64 {
    (time_s / period.as_secs_f64()).ceil() as u64
}

const fn allowance(hurry: bool, period: Duration) -> u64 {
    let allowance = if hurry { STOP_ALLOWANCE } else { CALM_ALLOWANCE };
    // Durations of a second at most, and a period is never zero.
    allowance.as_nanos() as u64 / period.as_nanos() as u64
}

fn give_back(tick: &mut Tick<'_>, motion: TrajectoryMotion) {
    let course = motion.into_course();
    tick.retire(Retired::Trajectory(course.leg.trajectory));
    if let Some(exit) = course.exit {
        tick.retire(Retired::Trajectory(exit.next.trajectory));
    }
}

fn is_away(measured: &JointVector, held: &JointVector, tolerance: &JointVector) -> bool {
    let joints = measured.iter().zip(held.iter()).zip(tolerance.iter());
    joints.into_iter().any(|((measured, held), tolerance)| (measured - held).abs() > *tolerance)
}
