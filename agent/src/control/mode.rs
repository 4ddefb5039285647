//! The command mode.
//!
//! ```text
//!                    first feedback good, or faults reset
//!   invalid_state <------------------------------------> halt <------> jog
//!         ^                      fault                    ^
//!         |                                               +----------> trajectory
//!         +--- fault ---- jog, trajectory
//! ```
//!
//! | from \ to | halt | jog, trajectory | the mode in force | others |
//! |---|---|---|---|---|
//! | halt | granted | granted if the robot follows and stands | granted, nothing changes | not supported |
//! | jog, trajectory | granted, with a ramp | through halt | granted, nothing changes | not supported |
//! | invalid_state | refused with its fault | refused with its fault | – | not supported |
//!
//! A latched stop refuses every mode but halt. The order "halt" is more than the mode: it raises
//! the epoch in halt too, so that whatever was prepared before it is void.

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
            self.check_movable()?;
        }
        self.change_mode(tick, wanted, End::Cancelled(Refusal::ModeLeft));
        Ok(())
    }

    /// Ramps to standstill in halt, in a new epoch.
    pub(super) fn halt(&mut self, tick: &mut Tick<'_>) -> Result<(), Refusal> {
        if self.mode == CommandMode::InvalidState {
            return Err(self.invalid_because());
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

    /// Refuses if the robot does not follow, or is still decelerating.
    fn check_movable(&self) -> Result<(), Refusal> {
        if self.controller.awaits(DriverRequest::Disable) {
            return Err(Refusal::Disabled);
        }
        self.condition.check_follows()?;
        self.check_standing()
    }

    /// Refuses while a ramp is in progress, or the way back to the measured position.
    pub(super) fn check_standing(&self) -> Result<(), Refusal> {
        let held = self.limiter.last().is_some_and(|last| last.position == self.hold);
        if self.ramp.is_some() || !held { Err(Refusal::StillMoving) } else { Ok(()) }
    }
}

fn is_supported(mode: CommandMode, params: &Params) -> bool {
    match mode {
        CommandMode::Halt | CommandMode::Jog | CommandMode::Trajectory => true,
        CommandMode::Homing => params.abilities.homing || params.home.iter().any(Option::is_some),
        _ => false,
    }
}
