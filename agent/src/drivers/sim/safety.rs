//! Buttons, guards, switches and the fatal error of the emulated controller.

use armada_protocol::messages::{OperationalMode, RobotFlags};

use super::EmulatorConfig;

const BUTTONS: [RobotFlags; 4] = [
    RobotFlags::ESTOP_BUTTON1,
    RobotFlags::ESTOP_BUTTON2,
    RobotFlags::ESTOP_BUTTON3,
    RobotFlags::ESTOP_BUTTON4,
];
const GUARDS: [RobotFlags; 4] = [
    RobotFlags::ESTOP_GUARD1,
    RobotFlags::ESTOP_GUARD2,
    RobotFlags::ESTOP_GUARD3,
    RobotFlags::ESTOP_GUARD4,
];

/// What makes an emergency stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StopSource {
    /// The controller's own circuit.
    Internal,
    /// A button, 1 to 4.
    Button(u8),
    /// A fault of the circuit.
    Fault,
    /// Something outside.
    Other,
}

/// State of everything that permits or forbids motion, but for errors.
///
/// An emergency stop is in force as long as one source acts; once all are released that shows until
/// the next reset or until drives go on. A guard stop stays in force until every guard is closed
/// and then a reset comes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Safety {
    internal: bool,
    /// The sources that have flags.
    sources: RobotFlags,
    released: bool,
    guards: [bool; 4],
    guard_stop: bool,
    enabling_held: bool,
    enabling_required: bool,
    mode: OperationalMode,
    local_control: bool,
    fatal: bool,
}

impl Safety {
    pub(super) const fn new(config: &EmulatorConfig) -> Self {
        Self {
            internal: false,
            sources: RobotFlags::NONE,
            released: false,
            guards: [false; 4],
            guard_stop: false,
            enabling_held: false,
            enabling_required: config.enabling_switch_required,
            mode: config.operational_mode,
            local_control: config.local_control,
            fatal: false,
        }
    }

    pub(super) fn press(&mut self, source: StopSource) {
        let flag = match source {
            StopSource::Internal => {
                self.internal = true;
                RobotFlags::NONE
            }
            StopSource::Button(button) => flag_of(&BUTTONS, button),
            StopSource::Fault => RobotFlags::ESTOP_FAULT,
            StopSource::Other => RobotFlags::ESTOP_OTHER,
        };
        self.sources = self.sources.with(flag, true);
        self.released = false;
    }

    pub(super) fn release_all(&mut self) {
        self.released |= self.emergency_stop();
        self.internal = false;
        self.sources = RobotFlags::NONE;
    }

    /// Opens or closes a guard, 1 to 4.
    pub(super) fn set_guard(&mut self, guard: u8, open: bool) {
        if let Some(slot) = self.guards.get_mut(usize::from(guard).wrapping_sub(1)) {
            *slot = open;
            self.guard_stop |= open;
        }
    }

    pub(super) const fn hold_enabling_switch(&mut self, held: bool) {
        self.enabling_held = held;
    }

    pub(super) const fn turn_key(&mut self, mode: OperationalMode) {
        self.mode = mode;
    }

    pub(super) const fn set_local_control(&mut self, local: bool) {
        self.local_control = local;
    }

    pub(super) const fn local_control(&self) -> bool {
        self.local_control
    }

    pub(super) const fn set_fatal(&mut self, fatal: bool) {
        self.fatal = fatal;
    }

    /// Clears what may be cleared.
    pub(super) fn reset(&mut self) {
        self.released = false;
        self.guard_stop = self.guards.contains(&true);
    }

    pub(super) const fn drives_went_on(&mut self) {
        self.released = false;
    }

    pub(super) fn emergency_stop(&self) -> bool {
        self.internal || self.sources != RobotFlags::NONE
    }

    pub(super) const fn guard_stop(&self) -> bool {
        self.guard_stop
    }

    pub(super) const fn fatal(&self) -> bool {
        self.fatal
    }

    pub(super) const fn mode(&self) -> OperationalMode {
        self.mode
    }

    /// Whether drives may be on as far as the enabling switch is concerned.
    pub(super) const fn is_enabled_by_hand(&self) -> bool {
        let manual = matches!(
            self.mode,
            OperationalMode::ManualReducedSpeed | OperationalMode::ManualFullSpeed
        );
        self.enabling_held || !(self.enabling_required && manual)
    }

    /// As the status reports it.
    pub(super) fn conditions(&self) -> RobotFlags {
        let guards = GUARDS.into_iter().zip(self.guards);
        guards
            .fold(self.sources, |flags, (guard, open)| flags.with(guard, open))
            .with(RobotFlags::FATAL_ERROR, self.fatal)
            .with(RobotFlags::ESTOP_RELEASED, self.released)
            .with(RobotFlags::ENABLING_SWITCH, self.enabling_held)
    }
}

fn flag_of(flags: &[RobotFlags; 4], number: u8) -> RobotFlags {
    flags.get(usize::from(number).wrapping_sub(1)).copied().unwrap_or_default()
}
