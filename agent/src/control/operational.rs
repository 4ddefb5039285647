//! The operational mode: what the key switch allows.
//!
//! | mode | limits in force | jogs |
//! |---|---|---|
//! | `undefined`, `manual_reduced_speed` | reduced velocity and acceleration | allowed |
//! | `manual_full_speed`, `cobot` | full | allowed |
//! | `auto` | full | refused |
//!
//! A controller that does not report its mode is in the one of the robot file; one that is not
//! heard is in `undefined`.
//!
//! When the switch is turned in a motion mode, the epoch is raised: what moves fails with a ramp,
//! because it was begun under other limits. In halt and `invalid_state` it is only told. Silence
//! turns no switch: a mode is compared with the one of when the controller was last heard.

use armada_model::{JointLimits, MotionLimits, MotionLimitsError};
use armada_protocol::messages::{OperationalMode, ReducedLimits};

use super::io::{LoopEvent, Params, Refusal};
use super::motion::End;
use super::state::{LoopState, Tick};
use super::verify::is_motion_mode;

impl LoopState {
    /// The operational mode in force.
    pub(super) fn operational_mode(&self, params: &Params) -> OperationalMode {
        match self.condition.feedback().map(|feedback| feedback.operational_mode) {
            None => OperationalMode::Undefined,
            Some(OperationalMode::Undefined) => params.operational_mode,
            Some(reported) => reported,
        }
    }

    /// Sees whether the switch was turned, and ends what was begun before.
    pub(super) fn follow_key_switch(&mut self, tick: &mut Tick<'_>) {
        if self.condition.feedback().is_none() {
            return;
        }
        let to = self.operational_mode(tick.params);
        let Some(from) = self.condition.key_switch.replace(to).filter(|&from| from != to) else {
            return;
        };
        tick.event(LoopEvent::OperationalMode { from, to });
        if is_motion_mode(self.mode) {
            self.raise_epoch(tick, End::Failed(Refusal::OperationalModeChanged));
        }
    }

    /// What the joints may do in the operational mode in force, at a speed ratio of 1.
    pub(super) fn limits_in_force(&self, params: &Params) -> MotionLimits {
        if is_reduced(self.operational_mode(params)) { self.reduced } else { self.limits }
    }

    /// The limits at reduced speed, where they are in force.
    pub(super) fn reduced_in_force<'a>(&self, params: &'a Params) -> Option<&'a [ReducedLimits]> {
        is_reduced(self.operational_mode(params)).then_some(params.reduced.as_slice())
    }

    /// Refuses jogs where the key switch forbids them.
    pub(super) fn check_jogs_allowed(&self, params: &Params) -> Result<(), Refusal> {
        match self.operational_mode(params) {
            OperationalMode::Auto => Err(Refusal::OperationalMode(OperationalMode::Auto)),
            _ => Ok(()),
        }
    }
}

/// Whether reduced limits are in force: a switch of which nobody knows where it stands is taken for
/// one that asks for them.
const fn is_reduced(mode: OperationalMode) -> bool {
    match mode {
        OperationalMode::Undefined | OperationalMode::ManualReducedSpeed => true,
        OperationalMode::ManualFullSpeed | OperationalMode::Cobot | OperationalMode::Auto => false,
    }
}

impl Params {
    /// What the joints may do in `mode`, at a speed ratio of 1; joints whose limits at reduced speed
    /// are missing are not reduced. It allocates.
    ///
    /// # Errors
    /// [`MotionLimitsError`] if a joint's limits are not complete or make no sense.
    pub fn limits_in(&self, mode: OperationalMode) -> Result<MotionLimits, MotionLimitsError> {
        let reduced = if is_reduced(mode) { self.reduced.as_slice() } else { &[] };
        let each = self.limits.iter().enumerate().map(|(joint, limits)| {
            reduced.get(joint).map_or(*limits, |reduced| JointLimits {
                velocity: reduced.velocity.min(limits.velocity),
                acceleration: limits.acceleration.map(|highest| reduced.acceleration.min(highest)),
                ..*limits
            })
        });
        MotionLimits::new(&each.collect::<Vec<_>>())
    }
}
