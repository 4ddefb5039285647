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
use armada_protocol::messages::OperationalMode;

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
        match self.operational_mode(params) {
            OperationalMode::Undefined | OperationalMode::ManualReducedSpeed => self.reduced,
            OperationalMode::ManualFullSpeed | OperationalMode::Cobot | OperationalMode::Auto => {
                self.limits
            }
        }
    }

    /// Refuses jogs where the key switch forbids them.
    pub(super) fn check_jogs_allowed(&self, params: &Params) -> Result<(), Refusal> {
        match self.operational_mode(params) {
            OperationalMode::Auto => Err(Refusal::OperationalMode(OperationalMode::Auto)),
            _ => Ok(()),
        }
    }
}

/// The limits at reduced speed; what is missing is not reduced.
pub(super) fn reduced_limits(params: &Params) -> Result<MotionLimits, MotionLimitsError> {
    let reduced = params.limits.iter().enumerate().map(|(joint, limits)| {
        params.reduced.get(joint).map_or(*limits, |reduced| JointLimits {
            velocity: reduced.velocity.min(limits.velocity),
            acceleration: limits.acceleration.map(|highest| reduced.acceleration.min(highest)),
            ..*limits
        })
    });
    MotionLimits::new(&reduced.collect::<Vec<_>>())
}
