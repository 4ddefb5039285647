//! What the controller is asked about motions that it makes itself: searches and moves.
//!
//! ```text
//! told to end -> StopMotion, again and again --shown, standstill measured--> settled
//!                     |
//!                     +-- request_timeout passed --> fault stop_ignored, drives off
//! ```
//!
//! Until it is settled no set-point is sent: two masters would pull at the robot. A controller
//! that goes on all the same is not waited for without end: a fault is latched, which tells what
//! to do, and as long as that is latched the drives are asked off, so that the brakes end what the
//! controller does not. The fault stays until the controller has shown that its motion is over.

use armada_model::MonoTime;
use armada_protocol::messages::FaultCode;
use serde::{Deserialize, Serialize};

use super::delegated::is_over;
use super::{Motion, Source};
use crate::control::controller::REPEAT;
use crate::control::faults::fault;
use crate::control::io::LoopFault;
use crate::control::state::{LoopState, Tick};
use crate::drivers::DriverRequest;

/// What the controller is told about motions that it makes itself.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct OwnMotion {
    /// When each was sent last.
    asked: Option<MonoTime>,
    stopping: Option<Stopping>,
    /// Number of the newest move of its own.
    pub(super) number: u32,
    /// Whether what is to stop is such a move, after which the robot has to be seen to stand.
    pub(super) is_move: bool,
    /// Speed ratio that the controller was told last, if it was.
    told_ratio: Option<f64>,
}

/// The controller is to come to rest.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Stopping {
    first: Option<MonoTime>,
    last: Option<MonoTime>,
}

impl LoopState {
    /// Whether the controller moves the robot itself, or has not shown that it stopped doing so.
    pub(in crate::control) fn controller_moves(&self) -> bool {
        self.is_stopping_own() || self.motion.as_ref().is_some_and(Motion::is_handed_over)
    }

    /// Has the controller end a motion of its own.
    pub(in crate::control) fn stop_own_motion(&mut self) {
        self.own_motion.stopping.get_or_insert_default();
    }

    /// Whether the controller is to stop a motion of its own and has not shown that it did.
    pub(in crate::control) const fn is_stopping_own(&self) -> bool {
        self.own_motion.stopping.is_some()
    }

    /// Notes when the controller has shown that it stopped, and when it should have long ago.
    pub(in crate::control) fn settle_own_motion(&mut self, tick: &mut Tick<'_>) {
        let Some(first) = self.own_motion.stopping.and_then(|stopping| stopping.first) else {
            return;
        };
        let Some(feedback) = self.condition.feedback() else { return };
        // A report of before the request arrived says nothing.
        let shown =
            feedback.stamp >= first + REPEAT && feedback.homing.is_empty() && is_over(feedback);
        let stands = !self.own_motion.is_move || self.standstill.is_shown(tick.params);
        if stands && shown {
            let number = self.own_motion.number;
            self.own_motion = OwnMotion { number, ..OwnMotion::default() };
            return;
        }
        let (asked_for, limit) = (tick.now.saturating_since(first), tick.params.request_timeout);
        if asked_for > limit {
            let fault = fault(FaultCode::StopIgnored, tick.now, asked_for.as_secs_f64());
            self.latch(tick, LoopFault { limit: limit.as_secs_f64(), ..fault });
        }
    }

    /// The controller may be another run than before, or will be when it is heard again: it was
    /// told nothing, and what it is to end begins to count when it is asked.
    pub(in crate::control) fn forget_told(&mut self) {
        self.own_motion.told_ratio = None;
        if let Some(stopping) = &mut self.own_motion.stopping {
            *stopping = Stopping::default();
        }
    }

    /// What the controller is to be asked for about motions of its own; nothing else leaves in
    /// the same tick.
    pub(in crate::control) fn own_motion_request(
        &mut self,
        tick: &Tick<'_>,
    ) -> Option<DriverRequest> {
        let now = tick.now;
        let due =
            |last: Option<MonoTime>| last.is_none_or(|last| now.saturating_since(last) >= REPEAT);
        self.condition.feedback()?;
        if let Some(stopping) = self.own_motion.stopping.as_mut() {
            if !due(stopping.last) {
                return None;
            }
            stopping.first.get_or_insert(now);
            stopping.last = Some(now);
            return Some(DriverRequest::StopMotion);
        }
        let moves_itself = |motion: &Motion| {
            matches!(motion.source, Source::Delegated(_)) && motion.is_handed_over()
        };
        let is_own = self.motion.as_ref().is_some_and(|m| moves_itself(m) && !m.cancelling);
        let ratio = self.speed_ratio;
        if is_own && tick.params.abilities.pause && self.own_motion.told_ratio != Some(ratio) {
            self.own_motion.told_ratio = Some(ratio);
            return Some(DriverRequest::SetSpeedRatio(ratio));
        }
        let wanted = self.motion.as_ref().and_then(Motion::wants_of_controller);
        let Some(request) = wanted else {
            self.own_motion.asked = None;
            return None;
        };
        let tools_first = matches!(request, DriverRequest::Move(_)) && !self.knows_tools();
        if tools_first || !due(self.own_motion.asked) {
            return None;
        }
        self.own_motion.asked = Some(now);
        Some(request)
    }
}

impl Motion {
    /// Whether it is the controller's to make.
    pub(in crate::control) const fn is_controllers(&self) -> bool {
        match &self.source {
            Source::Home(home) => home.is_controllers(),
            Source::Delegated(_) => true,
            Source::Jog(_) | Source::DeadMan(_) | Source::Trajectory(_) | Source::Braked(..) => {
                false
            }
        }
    }

    /// Whether the controller has it, or is being asked for it: no set-points are sent then.
    pub(in crate::control) const fn is_handed_over(&self) -> bool {
        match &self.source {
            Source::Delegated(delegated) => delegated.is_handed_over(),
            _ => self.is_controllers(),
        }
    }

    /// What the controller is still to be asked for.
    fn wants_of_controller(&self) -> Option<DriverRequest> {
        match &self.source {
            Source::Home(home) if !self.cancelling => home.wants(),
            Source::Delegated(delegated) if !self.cancelling => delegated.wants(),
            _ => None,
        }
    }
}
