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

mod dead_man;
mod home;
mod jog;
mod ramp;
mod speed;
mod trajectory;
mod twist;

pub(super) use dead_man::{DeadManJog, Wanted};
pub(super) use home::{HomeMotion, OwnMotion};
pub(super) use jog::JogMotion;
pub(super) use speed::SpeedFollower;
pub(super) use trajectory::{StartPoint, TrajectoryMotion};

use armada_model::{JointVector, MonoTime, MotionLimits, MotionState};
use armada_protocol::messages::{ActionStatus, Executor, FaultCode, MotionKind, MotionProgress};
use uuid::Uuid;

use super::equipment::Equipment;
use super::io::{LoopEvent, MotionReport, Params, Refusal, Retired};
use super::state::{LoopState, Tick};
use super::verify::fault;
use crate::drivers::SetPoint;

/// How a motion ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum End {
    /// Its last set-point was sent.
    Complete,
    /// Somebody asked for it.
    Cancelled(Refusal),
    /// Something is wrong.
    Failed(Refusal),
}

/// A motion in progress, or waiting for its start.
#[derive(Debug)]
pub(super) struct Motion {
    pub(super) id: Uuid,
    pub(super) source: Source,
    /// Whether it ends with the ramp in progress.
    pub(super) cancelling: bool,
    /// Whether it was said that it waits.
    queued: bool,
    /// Time of its first set-point.
    started: Option<MonoTime>,
}

/// What makes the set-points of a motion.
#[derive(Debug)]
pub(super) enum Source {
    /// A move to a position.
    Jog(JogMotion),
    /// Joints or tools at a speed.
    DeadMan(DeadManJog),
    /// Homing.
    Home(HomeMotion),
    /// A trajectory.
    Trajectory(TrajectoryMotion),
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
    /// Its time has passed without it, by so much \[s\].
    Missed(f64),
    /// It cannot go on.
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
    pub(super) const fn new(id: Uuid, source: Source) -> Self {
        Self { id, source, cancelling: false, queued: false, started: None }
    }

    /// Whether it makes the set-points, which it does not while it waits.
    pub(super) const fn is_moving(&self) -> bool {
        match &self.source {
            Source::Jog(_) | Source::DeadMan(_) => true,
            Source::Home(_) => !self.cancelling,
            Source::Trajectory(trajectory) => trajectory.is_under_way(),
        }
    }

    pub(super) const fn kind(&self) -> MotionKind {
        match &self.source {
            Source::Jog(_) => MotionKind::JogFreespace,
            Source::DeadMan(jog) if jog.moves_tools() => MotionKind::JogCartesian,
            Source::DeadMan(_) => MotionKind::JogJoint,
            Source::Home(_) => MotionKind::Home,
            Source::Trajectory(_) => MotionKind::Trajectory,
        }
    }

    /// How near it wants the robot to its newest set-point; empty if it does not care.
    fn tolerance(&self) -> JointVector {
        match &self.source {
            Source::Jog(_) | Source::DeadMan(_) | Source::Home(_) => JointVector::EMPTY,
            Source::Trajectory(trajectory) => trajectory.tolerance(),
        }
    }

    pub(super) fn progress(&self, period_s: f64) -> MotionProgress {
        let (elapsed_s, duration_s, waypoint) = match &self.source {
            Source::Jog(jog) => (jog.elapsed_s(period_s), jog.duration_s(), 0),
            Source::DeadMan(jog) => (jog.elapsed_s(period_s), jog.duration_s(period_s), 0),
            Source::Home(home) => (home.elapsed_s(period_s), home.duration_s(), home.groups_done()),
            Source::Trajectory(trajectory) => {
                (trajectory.elapsed_s(period_s), trajectory.duration_s(), trajectory.waypoint())
            }
        };
        MotionProgress {
            id: self.id,
            elapsed_s,
            duration_s,
            waypoint,
            rate: 1.0,
            paused: false,
            queued: 0,
        }
    }

    fn next(&mut self, tick: &Tick<'_>, drive: &Drive<'_>) -> Next {
        match &mut self.source {
            Source::Jog(jog) => jog.next(drive),
            Source::DeadMan(jog) => jog.next(drive),
            Source::Home(home) => home.next(drive),
            Source::Trajectory(trajectory) => trajectory.next(tick.now, tick.params.period),
        }
    }

    /// Says that it waits or has begun, once each.
    fn announce(&mut self, tick: &mut Tick<'_>, next: &Next) {
        let status = match next {
            Next::Waiting | Next::Approaching(_) if !self.queued => {
                self.queued = true;
                ActionStatus::Queued
            }
            Next::Moving(_) | Next::Last(_) if self.started.is_none() => {
                self.started = Some(tick.now);
                ActionStatus::Running
            }
            _ => return,
        };
        let report = self.report(status, None, tick.period_s());
        tick.event(LoopEvent::Motion(report));
    }

    /// Says that it has begun, if that is not said yet, though it makes no set-points.
    fn announce_running(&mut self, tick: &mut Tick<'_>) {
        if self.started.is_none() {
            self.started = Some(tick.now);
            let report = self.report(ActionStatus::Running, None, tick.period_s());
            tick.event(LoopEvent::Motion(report));
        }
    }

    fn report(&self, status: ActionStatus, reason: Option<Refusal>, period_s: f64) -> MotionReport {
        let (kind, progress) = (self.kind(), self.progress(period_s));
        let executor = if self.is_controllers() { Executor::Controller } else { Executor::Agent };
        let started = self.started;
        MotionReport { id: self.id, kind, executor, status, reason, started, progress }
    }
}

impl LoopState {
    /// The set-point of this tick, if a stream is alive.
    pub(super) fn set_point(&mut self, tick: &mut Tick<'_>) -> Option<SetPoint> {
        self.follow_homing(tick);
        if self.controller_moves() {
            self.break_off();
        }
        self.limiter.last()?;
        let (desired, end) = self.desired(tick)?;
        self.emit(tick, &desired, end)
    }

    /// Ends the motion, if there is one: its one terminal status.
    pub(super) fn end_motion(&mut self, tick: &mut Tick<'_>, end: End) {
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
        if motion.is_controllers() && status != ActionStatus::Complete && !motion.cancelling {
            self.stop_own_motion();
        }
        let report = motion.report(status, reason, tick.period_s());
        tick.event(LoopEvent::Motion(report));
        if let Source::Trajectory(trajectory) = motion.source {
            tick.retire(Retired::Trajectory(trajectory.into_trajectory()));
        }
    }

    /// What the source in charge asks for, and whether the motion ends with it.
    fn desired(&mut self, tick: &mut Tick<'_>) -> Option<(MotionState, Option<End>)> {
        if self.ramp.is_some() {
            return self.ramp_step();
        }
        let limits = self.limits_in_force(tick.params);
        let Some(motion) = self.motion.as_mut() else {
            return Some((self.limiter.toward(&self.hold)?, None));
        };
        let drive = Drive {
            params: tick.params,
            now: tick.now,
            period_s: tick.period_s(),
            limits,
            speed_ratio: self.speed_ratio,
            equipment: &self.equipment,
        };
        let next = motion.next(tick, &drive);
        motion.announce(tick, &next);
        match next {
            Next::Waiting => Some((self.limiter.toward(&self.hold)?, None)),
            Next::Approaching(state) | Next::Moving(state) => Some((state, None)),
            Next::Last(state) => {
                self.hold = state.position;
                Some((state, Some(End::Complete)))
            }
            Next::Missed(late_s) => self.give_up(tick, Refusal::StartMissed { late_s }),
            Next::Failed(refusal) => self.give_up(tick, refusal),
        }
    }

    /// Ends a motion that cannot go on.
    fn give_up(&mut self, tick: &mut Tick<'_>, why: Refusal) -> Option<(MotionState, Option<End>)> {
        self.end_motion(tick, End::Failed(why));
        self.decelerate(tick);
        self.ramp_step().or_else(|| Some((self.limiter.toward(&self.hold)?, None)))
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
        let tolerance = self.motion.as_ref().map_or(JointVector::EMPTY, Motion::tolerance);
        self.tracking.record(tick.now, set_point.joint_position, tolerance);
        if let Some(end) = end {
            self.end_motion(tick, end);
        }
        Some(set_point)
    }
}
