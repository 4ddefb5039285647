//! Faults: what is latched, and what clears it.
//!
//! | level | clears | faults |
//! |---|---|---|
//! | halt | `halt`, or `set_mode` to halt | `not_ready` |
//! | reset errors | `reset_errors`, which asks the controller too | `communication_lost`, `controller_error`, `tracking_error`, `velocity_error`, `homing_failed`, `stop_ignored`, `loop_error` |
//! | controller | a person at the controller, then `reset_errors` | `fatal_error`, `emergency_stop`, `guard_stop` |
//!
//! Each level clears what those before it do. Nothing clears by itself, and nothing is cleared
//! whose cause is still there, or that came in the same tick as the order: who gave it cannot have
//! known. Halt clears only if no fault of a higher level is latched.

use armada_model::MonoTime;
use armada_protocol::messages::{ClearBy, CommandMode, FaultCode, RobotFlags};

use super::io::{LoopEvent, LoopFault, Refusal};
use super::motion::End;
use super::state::{LoopState, Tick};

/// What clears a fault of this kind.
#[must_use]
pub const fn clear_by(code: FaultCode) -> ClearBy {
    match code {
        FaultCode::NotReady => ClearBy::Halt,
        FaultCode::CommunicationLost
        | FaultCode::ControllerError
        | FaultCode::TrackingError
        | FaultCode::VelocityError
        | FaultCode::HomingFailed
        | FaultCode::StopIgnored
        | FaultCode::LoopError => ClearBy::ResetErrors,
        FaultCode::FatalError | FaultCode::EmergencyStop | FaultCode::GuardStop => {
            ClearBy::Controller
        }
    }
}

/// A fault of no joint and no limit.
pub(super) const fn fault(code: FaultCode, stamp: MonoTime, value: f64) -> LoopFault {
    LoopFault { code, stamp, joint: None, value, limit: 0.0 }
}

/// What a fault means for whoever wanted to move.
pub(super) const fn refusal_of(code: FaultCode) -> Refusal {
    match code {
        FaultCode::CommunicationLost => Refusal::CommunicationLost,
        code => Refusal::Faulted(code),
    }
}

impl LoopState {
    /// Latches a fault: the motion fails, the robot decelerates, the mode is invalid.
    pub(super) fn latch(&mut self, tick: &mut Tick<'_>, fault: LoopFault) {
        if self.is_latched(fault.code) || self.faults.try_push(fault).is_err() {
            return;
        }
        tick.event(LoopEvent::FaultLatched(fault));
        self.change_mode(tick, CommandMode::InvalidState, End::Failed(refusal_of(fault.code)));
        self.fail_pending(tick, fault.code);
    }

    /// Whether a fault of this kind is latched.
    pub(super) fn is_latched(&self, code: FaultCode) -> bool {
        self.faults.iter().any(|fault| fault.code == code)
    }

    /// Clears all faults; the caller has seen to it that no cause remains.
    pub(super) fn clear_faults(&mut self, tick: &mut Tick<'_>) {
        if self.faults.is_empty() {
            return;
        }
        self.faults.clear();
        tick.event(LoopEvent::FaultsCleared);
        self.change_mode(tick, CommandMode::Halt, End::Cancelled(Refusal::ModeLeft));
        self.reseed(tick);
    }

    /// Clears what halt clears, and enters halt; refused if that is not all that is wrong.
    pub(super) fn clear_by_halt(&mut self, tick: &mut Tick<'_>) -> Result<(), Refusal> {
        if self.condition.feedback().is_none() || self.faults.is_empty() {
            return Err(self.invalid_because());
        }
        let stays =
            |fault: &&LoopFault| clear_by(fault.code) > ClearBy::Halt || fault.stamp == tick.now;
        if let Some(fault) = self.faults.iter().find(stays) {
            return Err(Refusal::Faulted(fault.code));
        }
        self.clear_faults(tick);
        Ok(())
    }

    /// A fault whose cause is still there, of which a reset would be a lie.
    pub(super) fn remaining_cause(&self, tick: &Tick<'_>) -> Option<FaultCode> {
        let Some(feedback) = self.condition.feedback() else {
            return Some(FaultCode::CommunicationLost);
        };
        let fatal = feedback.conditions.contains(RobotFlags::FATAL_ERROR);
        let ignoring = self.is_stopping_own() && self.is_latched(FaultCode::StopIgnored);
        let ramping = |code| self.ramp.is_some() && self.is_latched(code);
        [
            (feedback.emergency_stop, FaultCode::EmergencyStop),
            (feedback.guard_stop, FaultCode::GuardStop),
            (fatal, FaultCode::FatalError),
            (feedback.error_code != 0, FaultCode::ControllerError),
            (tick.loop_error, FaultCode::LoopError),
            (ignoring, FaultCode::StopIgnored),
            (ramping(FaultCode::TrackingError), FaultCode::TrackingError),
            (ramping(FaultCode::VelocityError), FaultCode::VelocityError),
        ]
        .into_iter()
        .find_map(|(present, code)| present.then_some(code))
    }

    /// Why nothing is possible in `invalid_state`.
    pub(super) fn invalid_because(&self) -> Refusal {
        match self.faults.first() {
            _ if self.condition.feedback().is_none() => Refusal::CommunicationLost,
            Some(fault) => Refusal::Faulted(fault.code),
            None => Refusal::NotReady,
        }
    }
}
