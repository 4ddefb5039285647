//! Trajectories one after the other: appended, blended, or one in the place of another.
//!
//! ```text
//! append          |--- 1 ---|rest|--- 2 ---|           2 begins where 1 ends
//! append_blended  |--- 1 --\___/-- 2 ---|              leaves 1 before its end, at speed
//! replace         |--- 1 -\_____/-- 2 ---|             leaves 1 now; what waited is cancelled
//! ```
//!
//! * What is appended must begin within the start tolerance of where the last one before it **ends**,
//!   wherever the robot is now. Each motion keeps its identity and has one terminal status.
//! * A motion that ends early takes all behind it along: they are cancelled, for none of them
//!   begins where the robot then stands. So does one that is cancelled while it waits; those before
//!   it go on.
//! * **Blends** are planned here, of two bounded pieces: no more than one way (a
//!   [`JerkLimitedMove`](armada_model::JerkLimitedMove), some 10 µs) in a tick, of at most
//!   [`SHARES`] ways for each pair. A way may leave the end of the one and the beginning of the
//!   other by the position tolerances that they give there, or by the robot's own. If none of
//!   the ways does, or all come too late, the robot comes to rest in between, as if appended.
//! * **A replacement** is planned at once, of at most [`JOINS`] ways. It may cut off the first
//!   [`LATEST_JOIN_S`] of its trajectory, which may begin anywhere within [`REACH_S`] at full
//!   speed of where the robot is. Where no way is legal, or the rate just changes, the robot first
//!   comes to rest on its old path.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use armada_model::{CompiledTrajectory, JointVector, MotionState, OnlineState};
use armada_protocol::messages::{
    ActionStatus, CommandMode, Executor, LeaseLoss, MotionKind, MotionProgress, OperationalMode,
    Queue,
};
use uuid::Uuid;

use super::course::{Entry, Exit, Leg};
use super::trajectory::{Speed, StartPoint, TrajectoryMotion, check_near, check_suits};
use super::{End, Motion, Source};
use crate::control::grouping::check_group;
use crate::control::io::{FollowOrder, LoopEvent, MAX_QUEUED, MotionReport, Refusal, Retired};
use crate::control::state::{LoopState, Tick};

/// How much of the tolerance is used to look for a way from one trajectory into the next.
const SHARES: [f64; 5] = [0.9, 0.6, 0.35, 0.2, 0.1];
/// At which clocks a replacement may be joined \[s\], before the latest.
const JOINS: [f64; 4] = [0.0, 0.15, 0.3, LATEST_JOIN_S];
/// How much of a replacement may be cut off \[s\].
const LATEST_JOIN_S: f64 = 0.5;
/// How far away a replacement may begin: as far as a joint goes at full speed in that time \[s\].
const REACH_S: f64 = 0.5;
/// How often the stretch is halved in which a curve enters a tolerance.
const HALVINGS: u32 = 24;

/// A motion that waits for the end of another.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct Waiting {
    pub(in crate::control) id: Uuid,
    pub(super) kind: MotionKind,
    #[serde(with = "crate::control::shared")]
    pub(super) trajectory: Arc<CompiledTrajectory>,
    blended: bool,
    /// The lease it was ordered under.
    pub(in crate::control) lease: Option<Uuid>,
    on_lease_loss: LeaseLoss,
}

impl Waiting {
    fn new(order: FollowOrder) -> Self {
        Self {
            id: order.id,
            kind: order.kind,
            trajectory: order.trajectory,
            blended: order.queue == Queue::AppendBlended,
            lease: None,
            on_lease_loss: order.on_lease_loss,
        }
    }

    pub(super) fn leg(&self) -> Leg {
        Leg::new(Arc::clone(&self.trajectory))
    }

    pub(super) fn report(&self, status: ActionStatus, reason: Option<Refusal>) -> MotionReport {
        let progress = MotionProgress {
            id: self.id,
            elapsed_s: 0.0,
            duration_s: self.trajectory.duration_s(),
            waypoint: 0,
            rate: 0.0,
            paused: false,
            queued: 0,
        };
        let (id, kind, executor) = (self.id, self.kind, Executor::Agent);
        MotionReport { id, kind, executor, status, reason, started: None, progress, group: None }
    }

    fn motion(&self, trajectory: TrajectoryMotion) -> Motion {
        let mut motion = Motion::new(self.id, Source::Trajectory(trajectory));
        motion.lease = self.lease;
        motion.queued = true;
        motion.on_lease_loss(self.on_lease_loss)
    }
}

impl LoopState {
    /// Follows a trajectory, or lets it wait.
    pub(in crate::control) fn follow(
        &mut self,
        tick: &mut Tick<'_>,
        order: FollowOrder,
    ) -> Result<(), Refusal> {
        let trajectory = Arc::clone(&order.trajectory);
        let result = self.take_trajectory(tick, order);
        if result.is_err() {
            tick.retire(Retired::Trajectory(trajectory));
        }
        result
    }

    fn take_trajectory(&mut self, tick: &mut Tick<'_>, order: FollowOrder) -> Result<(), Refusal> {
        self.check_gate()?;
        if let Some(given) = order.epoch.filter(|&given| given != self.epoch) {
            return Err(Refusal::EpochPassed { given, current: self.epoch });
        }
        self.check_motion_mode(CommandMode::Trajectory)?;
        self.check_homed()?;
        let feedback = self.condition.feedback().ok_or(Refusal::CommunicationLost)?;
        check_suits(&order, tick.params, !feedback.joint_velocity.is_empty())?;
        check_group(&order, tick.now)?;
        if self.knows(order.id) {
            return Err(Refusal::Busy(order.id));
        }
        let running = self.motion.as_ref().filter(|_| self.ramp.is_none()).map(|m| m.id);
        match (running, order.queue) {
            (None, _) => self.begin_trajectory(tick, &order),
            (Some(id), Queue::Refuse) => Err(Refusal::Busy(id)),
            (Some(_), _) if order.start.is_some() => {
                Err(Refusal::NotSupported("a start at an instant for a motion that waits"))
            }
            (Some(id), Queue::Append | Queue::AppendBlended) => self.append(tick, id, order),
            (Some(id), Queue::Replace) => self.replace(tick, id, &order),
        }
    }

    fn begin_trajectory(&mut self, tick: &Tick<'_>, order: &FollowOrder) -> Result<(), Refusal> {
        let held = self.rest()?;
        let measured = self.condition.feedback().ok_or(Refusal::CommunicationLost)?;
        let from = StartPoint { held: &held, measured: &measured.joint_position };
        let speed = self.speed(tick);
        let planned = TrajectoryMotion::plan(order, &from, &speed, &self.limits, tick);
        let trajectory = match planned {
            Err(Refusal::StartTolerance { .. }) if order.queue == Queue::Replace => {
                self.check_reach(order, &held.position)?;
                self.later(order, &speed)
            }
            planned => planned?,
        };
        self.set_motion(order, trajectory);
        self.join_group(order);
        Ok(())
    }

    fn append(
        &mut self,
        tick: &mut Tick<'_>,
        running: Uuid,
        order: FollowOrder,
    ) -> Result<(), Refusal> {
        let end = self.tail().ok_or(Refusal::Busy(running))?;
        if self.waiting_count() >= MAX_QUEUED {
            return Err(Refusal::QueueFull { limit: MAX_QUEUED });
        }
        check_near(&order.trajectory.start(), &end, &tick.params.start_tolerance)?;
        let waiting = Waiting::new(order);
        tick.event(LoopEvent::Motion(waiting.report(ActionStatus::Queued, None)));
        if self.queue.is_empty()
            && let Some(Motion { source: Source::Trajectory(now), .. }) = &mut self.motion
        {
            now.attempts = 0;
        }
        // There is room: it was counted above.
        self.queue.push(waiting);
        Ok(())
    }

    fn replace(
        &mut self,
        tick: &mut Tick<'_>,
        running: Uuid,
        order: &FollowOrder,
    ) -> Result<(), Refusal> {
        let last = *self.limiter.last().ok_or(Refusal::NotReady)?;
        self.check_reach(order, &last.position)?;
        let speed = self.speed(tick);
        let period_s = tick.period_s();
        let motion = self.motion.as_mut().ok_or(Refusal::NoSuchMotion)?;
        let fresh = motion.started.is_none();
        let Source::Trajectory(old) = &mut motion.source else {
            return Err(Refusal::Busy(running));
        };
        if fresh && old.has_begun() {
            // It has taken the place of another in this tick: one plan a tick is enough.
            return Err(Refusal::Busy(running));
        }
        let entry = old
            .steady_state(period_s)
            .and_then(|(_, state)| way_onto(&state, &order.trajectory, &self.limits));
        let begun =
            entry.and_then(|entry| old.give_way(entry, order, &speed, &self.limits, period_s));
        match begun {
            Some(trajectory) => {
                self.finish_motion(tick, End::Cancelled(Refusal::Cancelled), Remains::GivenBack);
                self.set_motion(order, trajectory);
            }
            None => {
                self.end_motion(tick, End::Cancelled(Refusal::Cancelled));
                self.decelerate(tick);
                let trajectory = self.later(order, &speed);
                self.set_motion(order, trajectory);
            }
        }
        Ok(())
    }

    /// Takes a motion off, in progress or waiting.
    pub(in crate::control) fn cancel(
        &mut self,
        tick: &mut Tick<'_>,
        id: Uuid,
    ) -> Result<(), Refusal> {
        if let Some(at) = self.queue.iter().position(|waiting| waiting.id == id) {
            self.drop_waiting(tick, at, Refusal::Cancelled);
            return Ok(());
        }
        if self.attached() == Some(id) {
            return match self.detach(tick) {
                true => self.cancel(tick, id),
                false => Err(Refusal::StillMoving),
            };
        }
        let motion = self.motion.as_mut().filter(|motion| motion.id == id);
        let motion = motion.ok_or(Refusal::NoSuchMotion)?;
        if motion.cancelling {
            return Ok(());
        }
        motion.cancelling = true;
        if self.end_together(Refusal::Cancelled) {
            self.drop_waiting(tick, 0, Refusal::QueueBroken);
            return Ok(());
        }
        if self.motion.as_ref().is_some_and(Motion::is_controllers) {
            // Ends when the controller has shown that it stopped.
            self.stop_own_motion();
            return Ok(());
        }
        self.drop_waiting(tick, 0, Refusal::QueueBroken);
        self.brake_motion(tick);
        if self.ramp.is_none() {
            self.end_motion(tick, End::Cancelled(Refusal::Cancelled));
        }
        Ok(())
    }

    /// Brings the motion in progress to rest on its path, or lets it go on.
    pub(in crate::control) fn set_paused(
        &mut self,
        tick: &mut Tick<'_>,
        id: Uuid,
        paused: bool,
    ) -> Result<(), Refusal> {
        if self.queue.iter().any(|waiting| waiting.id == id) || self.attached() == Some(id) {
            return Err(Refusal::NotPausable);
        }
        let motion = self.motion.as_mut().filter(|motion| motion.id == id);
        let motion = motion.ok_or(Refusal::NoSuchMotion)?;
        if motion.cancelling {
            return Err(Refusal::StillMoving);
        }
        if let Some(group) = self.shared_pace() {
            // Said to be paused when all are to be.
            group.set_paused(paused);
            return Ok(());
        }
        let motion = self.motion.as_mut().ok_or(Refusal::NoSuchMotion)?;
        let period_s = tick.period_s();
        match &mut motion.source {
            Source::Trajectory(trajectory) if !trajectory.is_common() => {
                if !trajectory.set_paused(paused, &self.limits, period_s) {
                    return Ok(());
                }
            }
            Source::Delegated(delegated) if tick.params.abilities.pause => {
                if delegated.wants_pause == paused {
                    return Ok(());
                }
                // Said to be paused when the controller reports it.
                delegated.wants_pause = paused;
                return Ok(());
            }
            _ => return Err(Refusal::NotPausable),
        }
        let report = motion.report(motion.status(), None, period_s);
        tick.event(LoopEvent::Motion(report));
        Ok(())
    }

    /// Changes the speed of all motions.
    pub(in crate::control) fn set_speed_ratio(
        &mut self,
        tick: &Tick<'_>,
        ratio: f64,
    ) -> Result<(), Refusal> {
        if !(0.01..=1.0).contains(&ratio) {
            return Err(Refusal::NotSupported("speed ratios beyond 0.01 to 1"));
        }
        if let Some(Motion { id, source: Source::Trajectory(trajectory), .. }) = &self.motion
            && trajectory.is_common()
        {
            // Its partners would go on at their own speed.
            return Err(Refusal::Busy(*id));
        }
        self.speed_ratio = ratio;
        if let Some(group) = self.shared_pace() {
            group.set_ratio(ratio);
            return Ok(());
        }
        if let Some(Motion { source: Source::Trajectory(trajectory), .. }) = &mut self.motion {
            trajectory.set_ratio(ratio, &self.limits, tick.period_s());
        }
        Ok(())
    }

    /// Looks for a way from the trajectory in progress into the next, of which one is tried.
    pub(super) fn look_ahead(&mut self, tick: &Tick<'_>) {
        let period_s = tick.period_s();
        let speed = self.speed(tick);
        let Some(next) = self.queue.first().filter(|next| next.blended) else { return };
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
            let next = self.queue.remove(0);
            let exit = Exit { leave_s, next, entry };
            if let Some(exit) = now.attach(exit, &speed, &self.limits, period_s) {
                // There is room: it was taken out just now.
                self.queue.insert(0, exit.next);
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

    /// Lets the next one begin, after one that is complete.
    pub(super) fn promote(&mut self, tick: &Tick<'_>) {
        if self.queue.is_empty() {
            return;
        }
        let speed = self.speed(tick);
        let next = self.queue.remove(0);
        let trajectory = Arc::clone(&next.trajectory);
        let motion = TrajectoryMotion::later(trajectory, next.kind, &speed, false, &self.limits);
        self.motion = Some(next.motion(motion));
    }

    /// Ends what waits from place `from` on; the first of them for `why`.
    pub(in crate::control) fn drop_waiting(
        &mut self,
        tick: &mut Tick<'_>,
        from: usize,
        why: Refusal,
    ) {
        let mut why = why;
        while self.queue.len() > from {
            let waiting = self.queue.remove(from);
            tick.event(LoopEvent::Motion(waiting.report(ActionStatus::Cancelled, Some(why))));
            tick.retire(Retired::Trajectory(waiting.trajectory));
            why = Refusal::QueueBroken;
        }
    }

    /// Ends all that waits behind the motion in progress, which goes on to its end; one into which
    /// the way has begun already is ended with it.
    pub(in crate::control) fn end_after_this(&mut self, tick: &mut Tick<'_>, why: Refusal) {
        if self.attached().is_some() {
            self.detach(tick);
        }
        self.drop_waiting(tick, 0, why);
    }

    /// Notes the lease under which something was ordered that waits.
    pub(in crate::control) fn attribute_waiting(&mut self, id: Uuid, lease: Option<Uuid>) {
        if let Some(waiting) = self.queue.iter_mut().find(|waiting| waiting.id == id) {
            waiting.lease = lease;
        }
    }

    /// How many motions wait.
    pub(in crate::control) fn waiting_count(&self) -> usize {
        self.queue.len() + usize::from(self.attached().is_some())
    }

    pub(super) fn speed<'a>(&self, tick: &Tick<'a>) -> Speed<'a> {
        let reduced = self.is_reduced(tick).then_some(tick.params.reduced.as_slice());
        Speed { ratio: self.speed_ratio, reduced }
    }

    /// Whether reduced speed is in force.
    fn is_reduced(&self, tick: &Tick<'_>) -> bool {
        let mode = self.operational_mode(tick.params);
        matches!(mode, OperationalMode::ManualReducedSpeed | OperationalMode::Undefined)
    }

    fn knows(&self, id: Uuid) -> bool {
        self.motion.as_ref().is_some_and(|motion| motion.id == id)
            || self.attached() == Some(id)
            || self.queue.iter().any(|waiting| waiting.id == id)
    }

    /// The motion into which the way of the one in progress leads.
    fn attached(&self) -> Option<Uuid> {
        match &self.motion.as_ref()?.source {
            Source::Trajectory(trajectory) => Some(trajectory.course.exit.as_ref()?.next.id),
            _ => None,
        }
    }

    /// Lets the motion in progress end at its own end, and the next one wait for that.
    fn detach(&mut self, tick: &Tick<'_>) -> bool {
        let speed = self.speed(tick);
        let Some(Motion { source: Source::Trajectory(trajectory), .. }) = &mut self.motion else {
            return false;
        };
        let Some(next) = trajectory.detach(&speed, tick.period_s()) else { return false };
        // There is room: it came from there.
        self.queue.insert(0, next);
        true
    }

    /// Where what is appended must begin; none if that is not known.
    fn tail(&self) -> Option<JointVector> {
        if let Some(last) = self.queue.last() {
            return Some(last.trajectory.end());
        }
        match &self.motion.as_ref()?.source {
            Source::Trajectory(now) => {
                let course = &now.course;
                let last = course.exit.as_ref().map(|exit| &exit.next.trajectory);
                Some(last.unwrap_or(&course.leg.trajectory).end())
            }
            _ => None,
        }
    }

    fn check_reach(&self, order: &FollowOrder, from: &JointVector) -> Result<(), Refusal> {
        let reach = from.map_indexed(|joint, _| {
            self.limits.get(joint).map_or(0.0, |axis| REACH_S * axis.velocity)
        });
        check_near(&order.trajectory.start(), from, &reach)
    }

    fn later(&self, order: &FollowOrder, speed: &Speed<'_>) -> TrajectoryMotion {
        let trajectory = Arc::clone(&order.trajectory);
        TrajectoryMotion::later(trajectory, order.kind, speed, true, &self.limits)
    }

    fn set_motion(&mut self, order: &FollowOrder, trajectory: TrajectoryMotion) {
        let motion = Motion::new(order.id, Source::Trajectory(trajectory));
        self.motion = Some(motion.on_lease_loss(order.on_lease_loss));
    }
}

/// What becomes of the trajectory of a motion that ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Remains {
    /// The robot is brought to rest on it, if it moves on it.
    Braked,
    /// Nothing: something else moves the robot.
    GivenBack,
}

/// The quickest way from `state` onto `trajectory`, cutting off its beginning as far as it may.
fn way_onto(
    state: &OnlineState,
    trajectory: &CompiledTrajectory,
    limits: &armada_model::MotionLimits,
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
    limits: &armada_model::MotionLimits,
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
