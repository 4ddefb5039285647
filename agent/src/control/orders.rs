//! Requests: each is granted, refused, or left to wait for the controller.

use armada_model::MotionState;
use armada_protocol::messages::{CommandMode, FaultCode};

use super::authority::Attribution;
use super::io::{LoopRequest, Order, Refusal, Retired};
use super::motion::End;
use super::state::{LoopState, Tick};
use super::values::{ValueOrder, ValuePlace};
use crate::drivers::{DriverRequest, Values};

/// What becomes of a request that is not refused.
enum Verdict {
    Granted,
    /// The controller has to do something first.
    Waiting,
}

impl LoopState {
    /// Does what is asked, or says why not.
    pub(super) fn take(&mut self, tick: &mut Tick<'_>, request: LoopRequest) {
        let LoopRequest { ticket, lease, until, order } = request;
        let attribution = Attribution::of(&order, lease);
        if until.is_some_and(|until| tick.now > until) && !order.is_end() {
            give_back(tick, order);
            return tick.answer(ticket, Err(Refusal::TooLate));
        }
        if let Err(refusal) = self.check_lease(tick, &order, lease) {
            give_back(tick, order);
            return tick.answer(ticket, Err(refusal));
        }
        let granted = |()| Verdict::Granted;
        let verdict = match order {
            Order::SetMode(mode) => self.set_mode(tick, mode).map(granted),
            Order::Halt => self.halt(tick).map(granted),
            Order::Enable => self.enable(tick, ticket),
            Order::Disable => self.disable(tick, ticket),
            Order::ResetErrors => self.reset_errors(tick, ticket),
            Order::Jog(order) => self.jog(tick, &order).map(granted),
            Order::Follow(order) => self.follow(tick, order).map(granted),
            Order::Cancel(id) => self.cancel(tick, id).map(granted),
            Order::AcquireLease { lease, ttl, role } => {
                self.acquire_lease(tick, (lease, ttl, role)).map(granted)
            }
            Order::TakeLease { lease, ttl, role } => {
                self.take_lease(tick, (lease, ttl, role)).map(granted)
            }
            Order::DelegateLease { parent, lease, scope, ttl } => {
                self.delegate_lease(tick, parent, (lease, scope, ttl)).map(granted)
            }
            Order::RenewLease { lease, ttl } => self.renew_lease(tick, lease, ttl).map(granted),
            Order::ReleaseLease(lease) => self.release_lease(tick, lease).map(granted),
            Order::Home(order) => self.home(tick, &order).map(granted),
            Order::JogJoint(order) => self.jog_joint(tick, &order).map(granted),
            Order::JogCartesian(order) => self.jog_cartesian(tick, &order).map(granted),
            Order::Delegate(order) => self.delegate(tick, &order).map(granted),
            Order::Pause(id) => self.set_paused(tick, id, true).map(granted),
            Order::Resume(id) => self.set_paused(tick, id, false).map(granted),
            Order::SetSpeedRatio(ratio) => self.set_speed_ratio(tick, ratio).map(granted),
            Order::SetEquipment(order) => self.set_equipment(tick, order).map(granted),
            Order::SetSignal { signal, values, restricted, while_stopped } => {
                let place = ValuePlace::Signal(signal);
                let order = ValueOrder { place, values, restricted, while_stopped };
                self.set_value(tick, ticket, order).map(|()| Verdict::Waiting)
            }
            Order::SetParameter { parameter, value, restricted } => {
                let place = ValuePlace::Parameter(parameter);
                let values = Values::from_slice(&[value]).unwrap_or_default();
                // A setting moves nothing.
                let while_stopped = true;
                let order = ValueOrder { place, values, restricted, while_stopped };
                self.set_value(tick, ticket, order).map(|()| Verdict::Waiting)
            }
        };
        if verdict.is_ok() {
            self.attribute(tick, attribution);
        }
        match verdict {
            Ok(Verdict::Granted) => tick.answer(ticket, Ok(self.granted())),
            Ok(Verdict::Waiting) => {}
            Err(refusal) => tick.answer(ticket, Err(refusal)),
        }
    }

    fn enable(&mut self, tick: &Tick<'_>, ticket: u64) -> Result<Verdict, Refusal> {
        self.check_gate()?;
        if self.mode == CommandMode::InvalidState {
            return Err(self.invalid_because());
        }
        if self.controller.awaits(DriverRequest::Disable) {
            return Err(Refusal::Disabled);
        }
        if self.condition.follows() {
            return Ok(Verdict::Granted);
        }
        let until = tick.now + tick.params.request_timeout;
        self.controller.wait(ticket, DriverRequest::Enable, until)?;
        Ok(Verdict::Waiting)
    }

    fn disable(&mut self, tick: &mut Tick<'_>, ticket: u64) -> Result<Verdict, Refusal> {
        if self.condition.feedback().is_none() {
            return Err(Refusal::CommunicationLost);
        }
        self.refuse_pending(tick, DriverRequest::Enable, Refusal::Disabled);
        let mode = match self.mode {
            CommandMode::InvalidState => CommandMode::InvalidState,
            _ => CommandMode::Halt,
        };
        self.change_mode(tick, mode, End::Cancelled(Refusal::Disabled));
        if self.condition.drives_are_off() {
            return Ok(Verdict::Granted);
        }
        // The deadline is set when the controller is asked, after the ramp.
        self.controller.wait(ticket, DriverRequest::Disable, tick.now)?;
        Ok(Verdict::Waiting)
    }

    fn reset_errors(&mut self, tick: &mut Tick<'_>, ticket: u64) -> Result<Verdict, Refusal> {
        self.controller.reset_once();
        if let Some(fault) = self.faults.iter().find(|fault| fault.stamp == tick.now) {
            // Whoever asked cannot have known of it.
            return Err(Refusal::CauseRemains(fault.code));
        }
        match self.remaining_cause(tick) {
            None => {
                self.clear_faults(tick);
                Ok(Verdict::Granted)
            }
            Some(_) if self.condition.feedback().is_none() => Err(self.cause_of_silence()),
            Some(_) => {
                let until = tick.now + tick.params.request_timeout;
                self.controller.wait(ticket, DriverRequest::ResetErrors, until)?;
                Ok(Verdict::Waiting)
            }
        }
    }

    /// The state a motion begins in that does not follow another.
    pub(super) fn rest(&self) -> Result<MotionState, Refusal> {
        self.check_standing()?;
        let last = self.limiter.last().ok_or(Refusal::NotReady)?;
        Ok(MotionState { position: last.position, velocity: last.velocity.map_indexed(|_, _| 0.0) })
    }

    fn cause_of_silence(&self) -> Refusal {
        if self.faults.iter().any(|fault| fault.code == FaultCode::CommunicationLost) {
            Refusal::CauseRemains(FaultCode::CommunicationLost)
        } else {
            Refusal::CommunicationLost
        }
    }
}

/// Gives what an order owns back, if it is refused before it is looked at.
fn give_back(tick: &mut Tick<'_>, order: Order) {
    match order {
        Order::Follow(order) => tick.retire(Retired::Trajectory(order.trajectory)),
        Order::SetEquipment(order) => tick.retire(Retired::Equipment(order.equipment)),
        _ => {}
    }
}
