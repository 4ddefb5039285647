//! The latched stop.
//!
//! ```text
//!         gate closes                  sent             measured             read back
//! open ---------------> asked(level) ------> commanded ----------> standstill ---------> drives off
//!   ^                     ^                     |                      |                     |
//!   |                     +---- level raised ---+----------------------+---------------------+
//!   +------------------------------- gate opens, from any -----------------------------------+
//! ```
//!
//! The gate outside latches; the loop reads it at each tick and only lets a level rise until the
//! gate opens. On the rising edge, and on each raise, the epoch is raised, which fails the motion,
//! and the mode is halt unless it is invalid. Then, by level:
//!
//! | level | set-points | drives |
//! |---|---|---|
//! | L2 | ramp, then hold | stay on |
//! | L1 | ramp, then hold until the drives are off | off after measured standstill |
//! | L0 | none | off at once |
//!
//! Standstill has to be measured within the robot's stop time, or the level is raised by one: whoever
//! does not come to rest, or cannot prove it, is stopped harder, up to L0. What a raise says has to
//! be entered in the gate outside, which keeps it until a reset.
//!
//! If standstill after an L1 ramp is not measured half a second after the hold time, the drives go
//! off all the same: something moves that should not.
//!
//! The stages are reported in their order and never skipped, since whoever reads the highest takes
//! it for proof of the lower: a robot whose drives are off need not stand. `Commanded` is said in
//! the tick whose set-point or request is the first of the stop, or when the controller reports that it
//! follows none or its pendant's. Without communication nothing is said, though drives-off is still asked for.
//! Standstill has to be shown anew after each raise, by a robot that stood before as well.
//!
//! Outputs of the controller stay as they are; see `values`. When the gate opens nothing moves and
//! nothing is enabled.

use armada_model::MonoTime;
use armada_protocol::messages::{CommandMode, StopLevel, StopStage};
use serde::{Deserialize, Serialize};

use super::io::{LoopEvent, Refusal};
use super::motion::End;
use super::state::{LoopState, Tick};
use crate::drivers::DriverRequest;

/// How hard the robot is stopped, and how far it has come.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Stop {
    level: Option<StopLevel>,
    stage: Option<StopStage>,
    /// When it came to this level.
    since: MonoTime,
    /// How often the gate had been opened when it was looked at last.
    resets: u16,
}

impl Stop {
    /// The level in force; none while the gate is open.
    pub(super) const fn level(&self) -> Option<StopLevel> {
        self.level
    }
}

impl LoopState {
    /// Follows the gate outside.
    pub(super) fn follow_stop(
        &mut self,
        tick: &mut Tick<'_>,
        gate: Option<StopLevel>,
        resets: u16,
    ) {
        let was_open = std::mem::replace(&mut self.stop.resets, resets) != resets;
        if was_open && gate.is_some() && self.stop.level.is_some() {
            // It was reset and stopped again since the last tick: that is a stop of its own.
            self.open_gate(tick);
        }
        match gate {
            None if self.stop.level.is_some() => self.open_gate(tick),
            // None orders before every level.
            Some(level) if gate > self.stop.level => self.close_gate(tick, level),
            Some(_) => self.raise_overdue(tick),
            None => {}
        }
    }

    /// Refuses what a stop forbids.
    pub(super) fn check_gate(&self) -> Result<(), Refusal> {
        self.stop.level.map_or(Ok(()), |level| Err(Refusal::Stopped(level)))
    }

    /// Whether a stop wants the drives off now.
    pub(super) fn stop_wants_drives_off(&self, tick: &Tick<'_>) -> bool {
        match self.stop.level {
            None | Some(StopLevel::L2) => false,
            Some(StopLevel::L1) => self.has_settled(tick),
            Some(StopLevel::L0) => true,
        }
    }

    /// Whether the ramp is over and the robot stands, or should have stood long ago.
    pub(super) fn has_settled(&self, tick: &Tick<'_>) -> bool {
        let standing = self.standstill.is_shown(tick.params)
            || self.standstill.is_overdue(tick.params, tick.now)
            || self.condition.feedback().is_none();
        self.ramp.is_none() && standing
    }

    /// Reports each stage that was reached in this tick; the command has been made.
    pub(super) fn climb(&mut self, tick: &mut Tick<'_>) {
        if self.stop.level.is_none() || self.condition.feedback().is_none() {
            return;
        }
        let pendant = self.check_local_control().is_err();
        let sent = tick.output.command.is_some()
            || matches!(
                tick.output.driver_request,
                Some(DriverRequest::Disable | DriverRequest::StopMotion)
            );
        let stages = [
            (StopStage::Commanded, sent || !self.condition.follows() || pendant),
            (StopStage::Standstill, self.standstill.is_shown(tick.params)),
            (StopStage::DrivesOff, self.condition.drives_are_off()),
        ];
        for (stage, reached) in stages {
            if self.stop.stage >= Some(stage) {
                continue;
            }
            if !reached {
                return;
            }
            self.stop.stage = Some(stage);
            tick.event(LoopEvent::StopStage(stage));
        }
    }

    /// Stops harder if the robot should have been measured to stand by now.
    fn raise_overdue(&mut self, tick: &mut Tick<'_>) {
        let overdue = tick.now.saturating_since(self.stop.since) > tick.params.stop_time;
        let harder = self.stop.level.and_then(StopLevel::harder);
        if let Some(level) =
            harder.filter(|_| overdue && self.stop.stage < Some(StopStage::Standstill))
        {
            tick.event(LoopEvent::StopRaised(level));
            self.close_gate(tick, level);
        }
    }

    fn close_gate(&mut self, tick: &mut Tick<'_>, level: StopLevel) {
        self.stop = Stop { level: Some(level), stage: None, since: tick.now, ..self.stop };
        self.clear_lease(tick);
        self.standstill.restart();
        self.controller.ask_at_once(DriverRequest::Disable);
        let why = Refusal::Stopped(level);
        let mode = match self.mode {
            CommandMode::InvalidState => CommandMode::InvalidState,
            _ => CommandMode::Halt,
        };
        self.change_mode(tick, mode, End::Failed(why));
        self.refuse_pending(tick, DriverRequest::Enable, why);
        self.refuse_values(tick, why);
    }

    fn open_gate(&mut self, tick: &mut Tick<'_>) {
        self.stop = Stop { resets: self.stop.resets, ..Stop::default() };
        self.raise_epoch(tick, End::Cancelled(Refusal::ModeLeft));
        self.reseed(tick);
        tick.event(LoopEvent::StopCleared);
    }
}
