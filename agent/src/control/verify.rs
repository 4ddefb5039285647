//! First phase: what the controller reports, and what is wrong with it.
//!
//! ```text
//!              first feedback, no error            a fault
//! unheard ---------------------------> halt, .. ------------> invalid_state
//!  (invalid_state, no fault)            ^                         |
//!                                       +----- reset_errors ------+
//! ```
//!
//! Before the first feedback nothing is known, which is no fault. After it, feedback older than
//! the timeout is one. A report that is not of this robot's number of joints, or not finite, is
//! not taken: if no better one follows, it ends as a loss of communication.
//!
//! Faults latch; see [`faults`](super::faults) for what clears them. Drives that go off, or a
//! controller that stops taking commands, are a fault in a motion mode only: in halt the flags
//! tell. In mode `homing` the controller need not take commands, and while it moves joints to
//! their references, it is not compared with set-points.
//!
//! What differs from Robot Raconteur's abstract robot: its first 250 ms are healthy without data,
//! it leaves `invalid_state` by itself, and its streams are stale after ten steps, however long
//! those take. Here nothing is known before the first report, faults latch, and every age is a
//! time. Alike: a report exactly as old as the timeout is young enough, and without reports the
//! operational mode and the controller's state are `undefined` and the joint arrays empty.

use armada_protocol::messages::{CommandMode, FaultCode, OperationalMode, RobotFlags};
use serde::{Deserialize, Serialize};

use super::faults::fault;
use super::io::{LoopFault, Refusal};
use super::motion::End;
use super::state::{LoopState, Tick};
use crate::drivers::Feedback;

/// What is known of the controller at this tick.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Condition {
    /// Newest report that could be taken.
    latest: Option<Feedback>,
    /// Whether it is young enough to go by.
    fresh: bool,
    /// Whether the loop has left its first `invalid_state`, or found a fault in it.
    started: bool,
    /// The operational mode when the controller was last heard.
    pub(super) key_switch: Option<OperationalMode>,
}

impl Condition {
    /// The newest report, if the controller is heard.
    pub(super) const fn feedback(&self) -> Option<&Feedback> {
        if self.fresh { self.latest.as_ref() } else { None }
    }

    /// Whether the drives are known to be on.
    pub(super) fn is_enabled(&self) -> bool {
        self.feedback().is_some_and(|feedback| feedback.enabled)
    }

    /// Whether the controller is known to have its drives off.
    pub(super) fn drives_are_off(&self) -> bool {
        self.feedback().is_some_and(|feedback| !feedback.enabled)
    }

    /// Whether the controller follows set-points.
    pub(super) fn follows(&self) -> bool {
        self.feedback().is_some_and(|feedback| feedback.enabled && feedback.ready)
    }

    /// Whether the controller can do what `mode` is for: a search of references needs drives only.
    pub(super) fn serves(&self, mode: CommandMode) -> bool {
        if mode == CommandMode::Homing { self.is_enabled() } else { self.follows() }
    }

    /// Why the robot cannot be moved, if so.
    pub(super) fn check_follows(&self) -> Result<(), Refusal> {
        match self.feedback() {
            None => Err(Refusal::CommunicationLost),
            Some(feedback) if !feedback.enabled => Err(Refusal::NotEnabled),
            Some(feedback) if !feedback.ready => Err(Refusal::NotReady),
            Some(_) => Ok(()),
        }
    }

    /// Takes what the driver has; returns its age at `now`.
    fn take(&mut self, tick: &Tick<'_>, joints: usize, feedback: Option<&Feedback>) {
        if let Some(feedback) = feedback.filter(|feedback| is_usable(feedback, joints)) {
            self.latest = Some(*feedback);
        }
        self.fresh = self.latest.is_some_and(|f| {
            tick.now.saturating_since(f.stamp) <= tick.params.communication_timeout
        });
    }
}

impl LoopState {
    /// Takes the feedback, latches what it shows to be wrong, and leaves the first
    /// `invalid_state` if nothing is.
    pub(super) fn verify(&mut self, tick: &mut Tick<'_>, feedback: Option<&Feedback>) {
        self.condition.take(tick, self.limits.len(), feedback);
        self.watch_session();
        if tick.loop_error {
            self.latch(tick, fault(FaultCode::LoopError, tick.now, 1.0));
        }
        let Some(feedback) = self.condition.feedback().copied() else {
            return self.verify_silence(tick);
        };
        self.follow_local_control(tick, &feedback);
        if feedback.emergency_stop {
            self.latch(tick, fault(FaultCode::EmergencyStop, tick.now, 1.0));
        }
        if feedback.guard_stop {
            self.latch(tick, fault(FaultCode::GuardStop, tick.now, 1.0));
        }
        if feedback.conditions.contains(RobotFlags::FATAL_ERROR) {
            self.latch(tick, fault(FaultCode::FatalError, tick.now, 1.0));
        }
        if feedback.error_code != 0 {
            let code = f64::from(feedback.error_code);
            self.latch(tick, fault(FaultCode::ControllerError, tick.now, code));
        }
        if is_motion_mode(self.mode) {
            if !self.condition.serves(self.mode) {
                self.latch(tick, fault(FaultCode::NotReady, tick.now, 0.0));
            } else if feedback.homing.is_empty() {
                self.verify_tracking(tick, &feedback);
            }
        }
        self.follow_key_switch(tick);
        self.start_up(tick, &feedback);
    }

    fn verify_silence(&mut self, tick: &mut Tick<'_>) {
        let Some(latest) = self.condition.latest.filter(|_| self.condition.started) else {
            return;
        };
        let age_s = tick.now.saturating_since(latest.stamp).as_secs_f64();
        let limit = tick.params.communication_timeout.as_secs_f64();
        let fault = fault(FaultCode::CommunicationLost, tick.now, age_s);
        self.latch(tick, LoopFault { limit, ..fault });
    }

    fn verify_tracking(&mut self, tick: &mut Tick<'_>, feedback: &Feedback) {
        if self.limiter.last().is_none() {
            return;
        }
        if let Some(excess) = self.tracking.excess(tick.params, feedback) {
            let fault = fault(excess.code, tick.now, excess.error);
            self.latch(tick, LoopFault { joint: Some(excess.joint), limit: excess.limit, ..fault });
        }
    }

    fn start_up(&mut self, tick: &mut Tick<'_>, feedback: &Feedback) {
        if std::mem::replace(&mut self.condition.started, true) || !self.faults.is_empty() {
            return;
        }
        self.change_mode(tick, CommandMode::Halt, End::Cancelled(Refusal::ModeLeft));
        let stopped = tick.stopped || self.stop.level().is_some();
        let wanted = tick.params.enable_on_start && !stopped && self.check_local_control().is_ok();
        if wanted && !feedback.enabled {
            self.controller.enable_until(tick.now + tick.params.request_timeout);
        }
    }
}

/// Whether `mode` is one in which the robot may be moved.
pub(super) const fn is_motion_mode(mode: CommandMode) -> bool {
    !matches!(mode, CommandMode::InvalidState | CommandMode::Halt)
}

fn is_usable(feedback: &Feedback, joints: usize) -> bool {
    let measured = [&feedback.joint_velocity, &feedback.joint_effort];
    feedback.joint_position.len() == joints
        && feedback.joint_position.is_finite()
        && measured.iter().all(|v| (v.is_empty() || v.len() == joints) && v.is_finite())
}
