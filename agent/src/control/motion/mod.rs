//! Motions: each yields a state per tick until it ends, once.
//!
//! ```text
//! accepted --start not yet--> queued --> running --last set-point sent--> complete
//!     |                         |          |
//!     |                         |          +--cancel--> ramp --standstill--> cancelled
//!     +-------------------------+----------+--epoch raised--> cancelled or failed, at once
//! ```
//!
//! `cancelled` after a cancel is said when the ramp has ended, so it means that the robot has been
//! brought to rest on purpose. When the epoch is raised the motion is over at once, and the ramp is
//! nobody's any more: a stop or halt must not wait for a report, nor be waited for.
//!
//! Trajectories, moves of the controller's own and jogs to a position may be paused and resumed; see
//! `adjust`. Behind the first two others may wait; see `queue`. A trajectory comes to rest on its
//! path where it can, however it ends; see `ramp`.

mod adjust;
mod blend;
mod course;
mod dead_man;
mod delegated;
mod home;
mod jog;
mod lead_in;
mod own;
mod queue;
mod ramp;
mod speed;
mod stream;
mod trajectory;
mod twist;
mod waiting;

pub(super) use dead_man::{DeadManJog, Wanted};
pub(super) use delegated::DelegatedMotion;
pub(super) use home::HomeMotion;
pub(super) use jog::JogMotion;
pub(super) use own::OwnMotion;
pub(super) use ramp::{Brake, STOP_ALLOWANCE};
pub(super) use speed::SpeedFollower;
pub(super) use stream::StreamFollower;
pub(super) use trajectory::TrajectoryMotion;
pub(super) use waiting::Queued;

use armada_model::{JointVector, MonoTime, MotionLimits, MotionState};
use armada_protocol::messages::{
    ActionStatus, Executor, FaultCode, LeaseLoss, MotionKind, MotionProgress, StopLevel,
};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use self::queue::Remains;
use self::ramp::Haste;
use super::equipment::Equipment;
use super::faults::fault;
use super::grouping::status_of;
use super::io::{LoopEvent, MotionReport, Params, Refusal};
use super::state::{LoopState, Tick};
use crate::drivers::SetPoint;

/// How a motion ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum End {
    /// Its last set-point was sent.
    Complete,
    /// Somebody asked for it.
    Cancelled(Refusal),
    /// Something is wrong.
    Failed(Refusal),
}

impl End {
    /// Whether the robot is to stand as soon as may be: after a stop or a fault.
    pub(super) fn is_urgent(self) -> bool {
        matches!(self, Self::Failed(why) if why != Refusal::LeaseLost)
    }

    /// Whether a stop asks for a controlled way to rest.
    pub(super) const fn is_stop(self) -> bool {
        matches!(self, Self::Failed(Refusal::Stopped(StopLevel::L2 | StopLevel::L1)))
    }
}

/// A motion in progress, or waiting for its start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Motion {
    pub(super) id: Uuid,
    pub(super) source: Source,
    /// Whether it ends with the ramp in progress.
    pub(super) cancelling: bool,
    /// Whether it was said that it waits.
    queued: bool,
    /// Time of its first set-point.
    started: Option<MonoTime>,
    /// The lease it was begun under, which [`LoopState::take`] writes.
    pub(super) lease: Option<Uuid>,
    /// What it does if that lease runs out.
    pub(super) on_lease_loss: LeaseLoss,
}

/// What makes the set-points of a motion.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "the loop allocates nothing")]
pub(super) enum Source {
    /// A move to a position.
    Jog(JogMotion),
    /// Joints or tools at a speed.
    DeadMan(DeadManJog),
    /// Homing.
    Home(HomeMotion),
    /// A trajectory.
    Trajectory(TrajectoryMotion),
    /// A move of the controller's own.
    Delegated(DelegatedMotion),
    /// What was a trajectory, and is now with the [`Brake`]; how far it came.
    Braked(MotionKind, MotionProgress),
}

/// What a motion has to say in one tick.
enum Next {
    /// Its time has not come.
    Waiting,
    /// On the way to where it begins.
    Approaching(MotionState),
    /// In progress.
    Moving(MotionState),
    /// Its end, which it reaches exactly.
    Last(MotionState),
    /// On the way into the next motion.
    Over(MotionState),
    /// It cannot begin, or not go on.
    Failed(Refusal),
}

/// What a motion is given at each tick.
pub(super) struct Drive<'a> {
    pub(super) params: &'a Params,
    pub(super) now: MonoTime,
    pub(super) period_s: f64,
    /// Limits in force, at a speed ratio of 1.
    pub(super) limits: MotionLimits,
    pub(super) speed_ratio: f64,
    pub(super) equipment: &'a Equipment,
}

impl Motion {
    /// A motion of nobody's lease, to stop if it gets one that runs out.
    pub(super) const fn new(id: Uuid, source: Source) -> Self {
        let on_lease_loss = LeaseLoss::StopOnPath;
        let (cancelling, queued) = (false, false);
        Self { id, source, cancelling, queued, started: None, lease: None, on_lease_loss }
    }

    /// The same with another way to react to the loss of its lease.
    pub(super) const fn on_lease_loss(mut self, reaction: LeaseLoss) -> Self {
        self.on_lease_loss = reaction;
        self
    }

    /// Whether it makes the set-points, which it does not while it waits.
    pub(super) fn is_moving(&self) -> bool {
        match &self.source {
            Source::Jog(_) | Source::DeadMan(_) | Source::Braked(..) => true,
            Source::Home(_) => !self.cancelling,
            Source::Trajectory(trajectory) => trajectory.is_under_way(),
            Source::Delegated(delegated) => delegated.is_moving(),
        }
    }

    pub(super) const fn kind(&self) -> MotionKind {
        match &self.source {
            Source::Jog(_) => MotionKind::JogFreespace,
            Source::DeadMan(jog) if jog.moves_tools() => MotionKind::JogCartesian,
            Source::DeadMan(_) => MotionKind::JogJoint,
            Source::Home(_) => MotionKind::Home,
            Source::Trajectory(trajectory) => trajectory.kind(),
            Source::Braked(kind, _) => *kind,
            Source::Delegated(delegated) => delegated.kind(),
        }
    }

    const fn is_paused(&self) -> bool {
        match &self.source {
            Source::Trajectory(trajectory) => trajectory.is_paused(),
            Source::Delegated(delegated) => delegated.is_paused(),
            Source::Jog(jog) => jog.is_paused(),
            Source::DeadMan(_) | Source::Home(_) | Source::Braked(..) => false,
        }
    }

    /// How near it wants the robot to its newest set-point, in position and velocity; empty if it
    /// does not care.
    fn tolerance(&self, period_s: f64) -> (JointVector, JointVector) {
        match &self.source {
            Source::Trajectory(trajectory) => trajectory.tolerance(period_s),
            _ => (JointVector::EMPTY, JointVector::EMPTY),
        }
    }

    /// How far it has come by its own clock, which is that of its path: at half the speed it takes
    /// twice as long.
    pub(super) fn progress(&self, period_s: f64) -> MotionProgress {
        let (elapsed_s, duration_s, waypoint, rate, paused) = match &self.source {
            Source::Braked(_, progress) => return *progress,
            Source::Jog(jog) => {
                (jog.elapsed_s(period_s), jog.duration_s(), 0, jog.rate(), jog.is_paused())
            }
            Source::DeadMan(jog) => {
                (jog.elapsed_s(period_s), jog.duration_s(period_s), 0, 1.0, false)
            }
            Source::Home(home) => {
                (home.elapsed_s(period_s), home.duration_s(), home.groups_done(), 1.0, false)
            }
            Source::Trajectory(trajectory) => (
                trajectory.elapsed_s(period_s),
                trajectory.duration_s(),
                trajectory.waypoint(),
                trajectory.rate(),
                trajectory.is_paused(),
            ),
            // Of its time nothing is known: its clock is the share of the way.
            Source::Delegated(delegated) => {
                (delegated.progress(), 1.0, 0, delegated.rate(), delegated.is_paused())
            }
        };
        MotionProgress { id: self.id, elapsed_s, duration_s, waypoint, rate, paused, queued: 0 }
    }

    fn next(
        &mut self,
        tick: &Tick<'_>,
        drive: &Drive<'_>,
        held: &MotionState,
        limits: &MotionLimits,
    ) -> Next {
        match &mut self.source {
            Source::Jog(jog) => jog.next(drive),
            Source::DeadMan(jog) => jog.next(drive),
            Source::Home(home) => home.next(drive),
            Source::Trajectory(trajectory) => trajectory.next(tick, held, limits),
            // With its ramp over it has ended; the controller's own move is looked after elsewhere,
            // and waits here for the robot to stand.
            Source::Braked(..) | Source::Delegated(_) => Next::Waiting,
        }
    }

    /// Says that it waits or has begun, once each.
    fn announce(&mut self, tick: &mut Tick<'_>, next: &Next) {
        let status = match next {
            Next::Waiting | Next::Approaching(_) if !self.queued => {
                self.queued = true;
                ActionStatus::Queued
            }
            Next::Moving(_) | Next::Last(_) | Next::Over(_) if self.started.is_none() => {
                self.started = Some(tick.now);
                if self.is_paused() {
                    return;
                }
                ActionStatus::Running
            }
            _ => return,
        };
        let report = self.report(status, None, tick.period_s());
        tick.event(LoopEvent::Motion(report));
    }

    /// What is said of it while it is in progress or waits.
    pub(super) const fn status(&self) -> ActionStatus {
        status_of(self.is_paused(), self.started.is_some())
    }

    /// Says that it has begun, if that is not said yet, though it makes no set-points.
    fn announce_running(&mut self, tick: &mut Tick<'_>) {
        if self.started.is_none() {
            self.started = Some(tick.now);
            if self.is_paused() {
                return;
            }
            let report = self.report(ActionStatus::Running, None, tick.period_s());
            tick.event(LoopEvent::Motion(report));
        }
    }

    pub(super) fn report(
        &self,
        status: ActionStatus,
        reason: Option<Refusal>,
        period_s: f64,
    ) -> MotionReport {
        let (kind, progress) = (self.kind(), self.progress(period_s));
        let executor = if self.is_controllers() { Executor::Controller } else { Executor::Agent };
        let started = self.started;
        let group = None;
        MotionReport { id: self.id, kind, executor, status, reason, started, progress, group }
    }
}

impl LoopState {
    /// The set-point of this tick, if a stream is alive.
    pub(super) fn set_point(&mut self, tick: &mut Tick<'_>) -> Option<SetPoint> {
        self.follow_homing(tick);
        self.follow_delegated(tick);
        if self.controller_moves() {
            self.break_off(tick);
        }
        self.limiter.last()?;
        self.look_ahead(tick);
        let (desired, end) = self.desired(tick)?;
        self.emit(tick, &desired, end)
    }

    /// Ends the motion, if there is one: its one terminal status. All that waits for it ends too,
    /// and one on a path is brought to rest on it; what else moves, the caller has to see to.
    pub(super) fn end_motion(&mut self, tick: &mut Tick<'_>, end: End) {
        self.finish_motion(tick, end, Remains::Braked);
    }

    fn finish_motion(&mut self, tick: &mut Tick<'_>, end: End, remains: Remains) {
        let Some(motion) = self.motion.take() else {
            return;
        };
        let (status, reason) = match end {
            End::Complete => (ActionStatus::Complete, None),
            End::Cancelled(_) if motion.cancelling => {
                (ActionStatus::Cancelled, Some(Refusal::Cancelled))
            }
            End::Cancelled(reason) => (ActionStatus::Cancelled, Some(reason)),
            End::Failed(reason) => (ActionStatus::Failed, Some(reason)),
        };
        if motion.is_handed_over() && status != ActionStatus::Complete && !motion.cancelling {
            self.stop_own_motion();
        }
        let report = motion.report(status, reason, tick.period_s());
        let group = self.group_quality(motion.id);
        tick.event(LoopEvent::Motion(MotionReport { group, ..report }));
        let together = match remains {
            Remains::Braked => self.stop_together(tick, &motion, end),
            Remains::GivenBack => None,
        };
        let together = together.map(|ramp_s| (motion.id, ramp_s));
        if together.is_none() {
            self.leave_group(tick.now, motion.id, end);
        }
        if let Source::Trajectory(trajectory) = motion.source {
            let moves = end != End::Complete && remains == Remains::Braked;
            self.leave_behind(tick, trajectory, moves, Haste { urgent: end.is_urgent(), together });
        }
        if end == End::Complete {
            self.promote(tick);
        } else {
            self.drop_waiting(tick, 0, Refusal::QueueBroken);
        }
    }

    /// Brings the motion to rest that is being cancelled.
    fn brake_motion(&mut self, tick: &mut Tick<'_>) {
        let Some(id) = self.motion.as_ref().map(|motion| motion.id) else { return };
        self.leave_group(tick.now, id, End::Cancelled(Refusal::Cancelled));
        let Some(motion) = self.motion.as_mut() else { return };
        if let Source::Trajectory(trajectory) = &motion.source {
            let braked = Source::Braked(trajectory.kind(), motion.progress(tick.period_s()));
            if let Source::Trajectory(trajectory) = std::mem::replace(&mut motion.source, braked) {
                self.leave_behind(tick, trajectory, true, Haste::default());
            }
        }
        self.decelerate(tick);
    }

    /// What the source in charge asks for, and whether the motion ends with it.
    fn desired(&mut self, tick: &mut Tick<'_>) -> Option<(MotionState, Option<End>)> {
        if self.ramp.is_some() {
            return self.ramp_step(tick);
        }
        let held = *self.limiter.last()?;
        let limits = self.limits_in_force(tick.params);
        let Some(motion) = self.motion.as_mut() else {
            let state = self.stream_step(tick).or_else(|| self.limiter.toward(&self.hold))?;
            return Some((state, None));
        };
        let drive = Drive {
            params: tick.params,
            now: tick.now,
            period_s: tick.period_s(),
            limits,
            speed_ratio: self.speed_ratio,
            equipment: &self.equipment,
        };
        let next = motion.next(tick, &drive, &held, &self.limits);
        motion.announce(tick, &next);
        match next {
            Next::Waiting => Some((self.limiter.toward(&self.hold)?, None)),
            Next::Approaching(state) | Next::Moving(state) => Some((state, None)),
            Next::Over(state) => {
                self.go_over(tick);
                Some((state, None))
            }
            Next::Last(state) => {
                self.hold = state.position;
                Some((state, Some(End::Complete)))
            }
            Next::Failed(refusal) => self.give_up(tick, refusal),
        }
    }

    /// Ends a motion that cannot go on.
    fn give_up(&mut self, tick: &mut Tick<'_>, why: Refusal) -> Option<(MotionState, Option<End>)> {
        self.end_motion(tick, End::Failed(why));
        self.decelerate(tick);
        self.ramp_step(tick).or_else(|| Some((self.limiter.toward(&self.hold)?, None)))
    }

    /// What a motion is given at this tick, under these limits.
    pub(super) fn drive<'a>(&'a self, tick: &Tick<'a>, limits: MotionLimits) -> Drive<'a> {
        Drive {
            params: tick.params,
            now: tick.now,
            period_s: tick.period_s(),
            limits,
            speed_ratio: self.speed_ratio,
            equipment: &self.equipment,
        }
    }

    /// Sends what the limiter makes of `desired`; then, and only then, the motion has ended.
    pub(super) fn emit(
        &mut self,
        tick: &mut Tick<'_>,
        desired: &MotionState,
        end: Option<End>,
    ) -> Option<SetPoint> {
        let Ok(set_point) = self.limiter.pass(desired) else {
            self.latch(tick, fault(FaultCode::LoopError, tick.now, 0.0));
            return None;
        };
        let none = (JointVector::EMPTY, JointVector::EMPTY);
        let tolerance = self.motion.as_ref().map_or(none, |m| m.tolerance(tick.period_s()));
        let velocity = self.limiter.last().map_or(JointVector::EMPTY, |last| last.velocity);
        self.tracking.record(tick.now, set_point.joint_position, velocity, tolerance);
        if let Some(end) = end {
            self.end_motion(tick, end);
        }
        Some(set_point)
    }
}
