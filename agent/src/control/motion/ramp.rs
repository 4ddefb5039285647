//! Bringing the robot to rest, and holding it there: the stream of set-points between motions.

use armada_model::{JointVector, MotionState, StopRamp};
use armada_protocol::messages::{CommandMode, StopLevel};

use super::End;
use crate::control::io::Refusal;
use crate::control::state::{LoopState, Tick};

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
            self.ramp = Some(StopRamp::plan(last, &self.limits, tick.params.period));
        }
    }

    /// Ends the stream of set-points if the controller does not follow them or must not, and
    /// begins one at the measured position if it does; see the head of [`control`](super::super).
    pub(in crate::control) fn keep_stream(&mut self, tick: &Tick<'_>) {
        self.settle_own_motion(tick);
        let stop = self.stop.level();
        let followed = self.condition.follows() && !self.controller_moves();
        let feedback = self.condition.feedback().filter(|_| followed);
        let Some(feedback) = feedback.filter(|_| stop != Some(StopLevel::L0)) else {
            self.break_off();
            return;
        };
        let wanted = self.mode != CommandMode::InvalidState || stop.is_some();
        if self.limiter.last().is_none() && wanted {
            self.hold = feedback.joint_position;
            self.limiter.begin(self.hold);
            self.tracking.record(tick.now, self.hold, JointVector::EMPTY);
        }
    }

    /// Ends the stream of set-points.
    pub(super) fn break_off(&mut self) {
        self.limiter.end();
        self.tracking.forget();
        self.ramp = None;
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
    pub(super) fn ramp_step(&mut self) -> Option<(MotionState, Option<End>)> {
        let ramp = self.ramp.as_mut()?;
        let state = ramp.step();
        if !ramp.is_standstill() {
            return Some((state, None));
        }
        self.ramp = None;
        self.hold = state.position;
        let cancelled = self.motion.as_ref().is_some_and(|motion| motion.cancelling);
        Some((state, cancelled.then_some(End::Cancelled(Refusal::Cancelled))))
    }
}

fn is_away(measured: &JointVector, held: &JointVector, tolerance: &JointVector) -> bool {
    let joints = measured.iter().zip(held.iter()).zip(tolerance.iter());
    joints.into_iter().any(|((measured, held), tolerance)| (measured - held).abs() > *tolerance)
}
