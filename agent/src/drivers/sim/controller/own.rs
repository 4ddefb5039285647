//! What the emulated controller does on its own: homing, moves, and orders that move nothing.

use armada_protocol::messages::OperationalMode;

use super::super::error_code;
use super::super::homing::HomingFailed;
use super::{Axis, Controller, Motion, Power, SETTLED};
use crate::drivers::{DelegatedMove, DriverRequest, JointSet};

impl Controller {
    /// Does what the client orders, as far as it can.
    pub(in super::super) fn take_order(&mut self, order: &DriverRequest) {
        match order {
            // They have places of their own in the packet.
            DriverRequest::Enable | DriverRequest::Disable | DriverRequest::ResetErrors => {}
            DriverRequest::Home(joints) => self.begin_homing(*joints),
            DriverRequest::Move(wanted) => self.take_move(wanted),
            DriverRequest::StopMotion => self.stop_own_motion(),
            DriverRequest::PauseMotion => self.program.set_paused(true),
            DriverRequest::ResumeMotion => self.program.set_paused(false),
            DriverRequest::SetSpeedRatio(ratio) => self.program.set_ratio(*ratio),
            DriverRequest::SetSignal { signal, values } => {
                let moving = self.is_moving();
                self.board.set_signal(*signal, values, moving);
            }
            DriverRequest::SetParameter { parameter, value } => {
                let moving = self.is_moving();
                self.board.set_parameter(*parameter, *value, moving);
            }
            DriverRequest::SetLoad { chain, load } => {
                if let Some(slot) = self.loads.get_mut(usize::from(*chain)) {
                    *slot = *load;
                }
            }
            DriverRequest::SetTool { chain, tool } => {
                self.planner.set_tool(*chain, tool);
            }
        }
    }

    /// The client has gone silent: what the controller does on its own comes to rest.
    pub(in super::super) fn client_is_silent(&mut self) {
        self.stop_own_motion();
    }

    fn begin_homing(&mut self, joints: JointSet) {
        if !self.ready() || self.program.is_running() {
            return;
        }
        let Some(start) = self.rest_position() else { return };
        if self.homing.begin(joints, &start) {
            self.hold = start;
            self.motion = Motion::Own;
        }
    }

    fn take_move(&mut self, wanted: &DelegatedMove) {
        let homing = !self.homing.homing().is_empty();
        let refusal = if !self.own_moves {
            Some(error_code::NOT_OFFERED)
        } else if !self.ready() {
            Some(error_code::NOT_READY)
        } else if homing || self.motion == Motion::Stop {
            Some(error_code::NOT_AT_REST)
        } else if !self.homing.is_all_homed() {
            Some(error_code::NOT_HOMED)
        } else {
            None
        };
        match refusal {
            Some(code) => self.program.refuse(wanted, code),
            None => self.program.take(*wanted),
        }
    }

    /// Begins the moves that are complete.
    pub(super) fn begin_moves(&mut self) {
        if !self.program.is_ready() || self.motion == Motion::Own {
            return;
        }
        let Some(start) = self.rest_position().filter(|_| self.ready()) else {
            self.program.fail(error_code::NOT_AT_REST);
            return;
        };
        let slow = self.safety.mode() == OperationalMode::ManualReducedSpeed;
        self.hold = start;
        let begun = self.program.begin(&self.planner, &start, slow);
        self.motion = if begun { Motion::Own } else { Motion::Hold };
    }

    pub(super) fn follow_own(&mut self, dt: f64) {
        let reference = match self.homing.advance(dt) {
            Err(HomingFailed) => return self.fail(error_code::HOMING),
            Ok(reference) => reference.or_else(|| self.program.advance(dt)),
        };
        let Some(reference) = reference else {
            self.hold_here();
            return;
        };
        self.follow(reference, dt);
        let near = |(axis, &goal): (&Axis, &f64)| (goal - axis.joint.position).abs() <= SETTLED;
        let settled = self.axes.iter().zip(reference.iter()).all(near);
        if self.homing.end_if_over(settled) || self.program.end_if_over(settled) {
            self.hold = reference;
            self.motion = if self.power == Power::On { Motion::Hold } else { self.motion };
        }
    }

    /// Ends homing and moves of its own as failed.
    pub(super) fn end_own_motion(&mut self, code: u32) {
        self.homing.abandon();
        self.program.fail(code);
    }

    /// Brings homing and moves of its own to rest, as asked for.
    pub(super) fn stop_own_motion(&mut self) {
        let homing = !self.homing.homing().is_empty();
        self.homing.abandon();
        self.program.stop();
        if homing && self.motion == Motion::Own {
            self.motion = Motion::Stop;
        }
    }

    /// Decelerates at the limits of the drives, whatever moves the joints, and then holds.
    pub(super) fn stop_controlled(&mut self, code: u32) {
        self.end_own_motion(code);
        if self.power == Power::On {
            self.motion = Motion::Stop;
        }
    }
}
