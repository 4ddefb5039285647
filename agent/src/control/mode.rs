//! The command mode.
//!
//! ```text
//!                    first feedback good, or faults cleared          +--> jog
//!   invalid_state <------------------------------------> halt <------+--> trajectory
//!         ^                      fault                               +--> position_command
//!         |                                                          +--> velocity_command
//!         +------------------------- fault ---- any of those --------+--> homing
//! ```
//!
//! | from \ to | `halt` | another motion mode | the mode in force | `invalid_state` |
//! |---|---|---|---|---|
//! | `halt` | granted, nothing changes | granted if the robot can serve it and stands | – | not supported |
//! | a motion mode | granted, with a ramp | through halt | granted, nothing changes | not supported |
//! | `invalid_state` | granted if halt clears its faults, else refused with the first that stays | refused with its fault | – | not supported |
//!
//! Asked in this order, and the first that holds is the refusal:
//!
//! | | refusal |
//! |---|---|
//! | the mode does not exist for this robot: `invalid_state`, or `homing` where neither the controller searches references nor a home position is given | `ModeNotSupported` |
//! | a stop is latched, for every mode but halt | `Stopped` |
//! | no communication | `CommunicationLost` |
//! | a fault is latched | `Faulted` |
//! | another motion mode is in force | `ThroughHalt` |
//! | drives are being switched off; are off | `Disabled`; `NotEnabled` |
//! | the controller takes no commands, which a search of references does not need | `NotReady` |
//! | a ramp is in progress | `StillMoving` |
//!
//! The order "halt" is more than the mode: it raises the epoch in halt too, so that whatever was
//! prepared before it is void. Robot Raconteur's abstract robot enters `homing` from
//! `invalid_state` too; here the fault has to be cleared first. Where its key switch forbids a
//! motion, the mode is granted all the same and the motion refused.

use armada_protocol::messages::CommandMode;

use super::io::{Params, Refusal};
use super::motion::End;
use super::state::{LoopState, Tick};
use crate::drivers::DriverRequest;

impl LoopState {
    /// Enters `wanted`, if there is a way.
    pub(super) fn set_mode(
        &mut self,
        tick: &mut Tick<'_>,
        wanted: CommandMode,
    ) -> Result<(), Refusal> {
        if !is_supported(wanted, tick.params) {
            return Err(Refusal::ModeNotSupported(wanted));
        }
        if self.mode == wanted {
            return Ok(());
        }
        if wanted == CommandMode::Halt {
            return self.halt(tick);
        }
        self.check_gate()?;
        if self.mode == CommandMode::InvalidState {
            return Err(self.invalid_because());
        }
        if self.mode != CommandMode::Halt {
            return Err(Refusal::ThroughHalt { mode: self.mode, wanted });
        }
        if wanted == CommandMode::Homing {
            // A controller that has to home first may take no set-points before.
            self.check_homable()?;
        } else {
            self.check_movable(wanted)?;
        }
        self.change_mode(tick, wanted, End::Cancelled(Refusal::ModeLeft));
        Ok(())
    }

    /// Ramps to standstill in halt, in a new epoch; clears the faults that halt clears.
    pub(super) fn halt(&mut self, tick: &mut Tick<'_>) -> Result<(), Refusal> {
        if self.mode == CommandMode::InvalidState {
            return self.clear_by_halt(tick);
        }
        self.change_mode(tick, CommandMode::Halt, End::Cancelled(Refusal::ModeLeft));
        Ok(())
    }

    /// Refuses what needs the mode `needed` and a robot that is ready to begin a motion in it.
    pub(super) fn check_motion_mode(&self, needed: CommandMode) -> Result<(), Refusal> {
        self.check_gate()?;
        if self.mode == CommandMode::InvalidState {
            return Err(self.invalid_because());
        }
        if self.mode != needed {
            return Err(Refusal::WrongMode { mode: self.mode, needed });
        }
        Ok(())
    }

    /// Refuses if the robot cannot serve `mode`, or is still decelerating.
    fn check_movable(&self, mode: CommandMode) -> Result<(), Refusal> {
        if self.controller.awaits(DriverRequest::Disable) {
            return Err(Refusal::Disabled);
        }
        if !self.condition.serves(mode) {
            self.condition.check_follows()?;
        }
        if self.condition.follows() { self.check_standing() } else { Ok(()) }
    }

    /// Refuses while a ramp is in progress, or the way back to the measured position.
    pub(super) fn check_standing(&self) -> Result<(), Refusal> {
        let held = self.limiter.last().is_some_and(|last| last.position == self.hold);
        if self.ramp.is_some() || !held { Err(Refusal::StillMoving) } else { Ok(()) }
    }
}

fn is_supported(mode: CommandMode, params: &Params) -> bool {
    match mode {
        CommandMode::InvalidState => false,
        CommandMode::Homing => params.abilities.homing || params.home.iter().any(Option::is_some),
        CommandMode::Halt
        | CommandMode::Jog
        | CommandMode::Trajectory
        | CommandMode::PositionCommand
        | CommandMode::VelocityCommand => true,
    }
}
