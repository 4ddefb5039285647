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
//!   [`SHARES`](super::blend::SHARES) ways for each pair. A way may leave the end of the one and the beginning of the
//!   other by the position tolerances that they give there, or by the robot's own. If none of
//!   the ways does, or all come too late, the robot comes to rest in between, as if appended.
//! * **A replacement** is planned at once, of at most [`JOINS`](super::blend::JOINS) ways.
//!   It may cut off the first [`LATEST_JOIN_S`](super::blend::LATEST_JOIN_S) of its trajectory, which may begin anywhere within [`REACH_S`] at full
//!   speed of where the robot is. Where no way is legal, or the rate just changes, the robot first
//!   comes to rest on its old path.
//! * Moves of the controller's own wait and are waited for in the same queue, always with a rest in
//!   between; see `delegated`.

use std::sync::Arc;

use armada_model::JointVector;
use armada_protocol::messages::{ActionStatus, CommandMode, Queue};
use uuid::Uuid;

use super::blend::way_onto;
use super::trajectory::{Speed, StartPoint, TrajectoryMotion, check_near, check_suits};
use super::waiting::{Queued, Waiting};
use super::{End, Motion, Source};
use crate::control::grouping::check_group;
use crate::control::io::{FollowOrder, LoopEvent, MAX_QUEUED, Refusal, Retired};
use crate::control::state::{LoopState, Tick};

/// How far away a replacement may begin: as far as a joint goes at full speed in that time \[s\].
const REACH_S: f64 = 0.5;

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
        if self.motion.as_ref().is_some_and(|motion| motion.cancelling) {
            return Err(Refusal::Busy(running));
        }
        let what = "trajectories behind a move whose end only the controller knows";
        let end = self.tail().ok_or(Refusal::NotSupported(what))?;
        check_near(&order.trajectory.start(), &end, &tick.params.start_tolerance)?;
        self.wait_for_end(tick, Queued::Trajectory(Waiting::new(order)))
    }

    /// Puts a motion behind all others.
    pub(super) fn wait_for_end(
        &mut self,
        tick: &mut Tick<'_>,
        waiting: Queued,
    ) -> Result<(), Refusal> {
        if self.waiting_count() >= MAX_QUEUED {
            return Err(Refusal::QueueFull { limit: MAX_QUEUED });
        }
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

    /// Lets the next one begin, after one that is complete.
    pub(super) fn promote(&mut self, tick: &Tick<'_>) {
        if self.queue.is_empty() {
            return;
        }
        self.motion = Some(match self.queue.remove(0) {
            Queued::Trajectory(next) => {
                let (speed, trajectory) = (self.speed(tick), Arc::clone(&next.trajectory));
                let limits = &self.limits;
                next.motion(TrajectoryMotion::later(trajectory, next.kind, &speed, false, limits))
            }
            Queued::Delegated(next) => next.motion(true),
        });
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
            waiting.retire(tick);
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
        if let Some(waiting) = self.queue.iter_mut().find(|waiting| waiting.id() == id) {
            waiting.set_lease(lease);
        }
    }

    /// How many motions wait.
    pub(in crate::control) fn waiting_count(&self) -> usize {
        self.queue.len() + usize::from(self.attached().is_some())
    }

    pub(super) fn knows(&self, id: Uuid) -> bool {
        self.motion.as_ref().is_some_and(|motion| motion.id == id)
            || self.attached() == Some(id)
            || self.queue.iter().any(|waiting| waiting.id() == id)
    }

    /// The motion into which the way of the one in progress leads.
    pub(super) fn attached(&self) -> Option<Uuid> {
        match &self.motion.as_ref()?.source {
            Source::Trajectory(trajectory) => Some(trajectory.course.exit.as_ref()?.next.id),
            _ => None,
        }
    }

    /// Lets the motion in progress end at its own end, and the next one wait for that.
    pub(super) fn detach(&mut self, tick: &Tick<'_>) -> bool {
        let speed = self.speed(tick);
        let Some(Motion { source: Source::Trajectory(trajectory), .. }) = &mut self.motion else {
            return false;
        };
        let Some(next) = trajectory.detach(&speed, tick.period_s()) else { return false };
        // There is room: it came from there.
        self.queue.insert(0, Queued::Trajectory(next));
        true
    }

    /// Where what is appended must begin; none if that is not known.
    fn tail(&self) -> Option<JointVector> {
        if let Some(last) = self.queue.last() {
            return last.end();
        }
        match &self.motion.as_ref()?.source {
            Source::Trajectory(now) => {
                let course = &now.course;
                let last = course.exit.as_ref().map(|exit| &exit.next.trajectory);
                Some(last.unwrap_or(&course.leg.trajectory).end())
            }
            Source::Delegated(now) => now.end(),
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
