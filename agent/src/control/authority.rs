//! Who may command: the lease.
//!
//! ```text
//!        acquire                       time is up
//! FREE ----------> HELD(lease) ---------------------> STALE(lease)
//!  ^ ^              |   ^   ^ renew                     |  |  |
//!  | +---release----+   |   +---------------------------+  |  | released, or somebody
//!  |                    +--- acquire by another -----------+  | commands without a lease
//!  +----------------------------------------------------------+
//!  +--- a stop latches, from any; none can be acquired until its reset
//! ```
//!
//! * While nobody holds one, nothing is needed. While somebody does, what commands needs it; what
//!   only ends motion (halt, cancel, disable, every stop) never does.
//! * A grant, a release and a stop raise the epoch, which ends the motion of before with a ramp.
//!   A fault takes nothing away: whoever drove is to put it right.
//! * Time is looked at once in a tick, before its requests. A lease that has run out is not lost
//!   at once: its holder may renew it as long as nobody else commands. That changes no epoch, and
//!   what was ended stays ended.
//! * A motion reacts to the end of the lease that it was begun under as it was told to
//!   ([`LeaseLoss`]); one that was begun under none does not. While it goes on under a stale
//!   lease, others have to acquire one to command.
//!
//! Identities come from outside: nothing is random in here.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{CommandMode, LeaseLoss};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::io::{LeaseChange, LeaseReport, LoopEvent, Order, Refusal};
use super::motion::End;
use super::state::{LoopState, Tick};

/// Who may command, as far as the loop knows.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Authority {
    held: Option<Held>,
}

/// A lease that was granted, and not given back.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Held {
    lease: Uuid,
    ttl: Duration,
    deadline: MonoTime,
    stale: bool,
}

impl Authority {
    /// The lease for the snapshot.
    pub(super) fn report(&self) -> Option<LeaseReport> {
        let Held { lease, deadline, stale, .. } = self.held?;
        Some(LeaseReport { lease, deadline, stale })
    }

    fn stale(&self) -> Option<Uuid> {
        self.held.filter(|held| held.stale).map(|held| held.lease)
    }
}

impl LoopState {
    /// Whether this lease is in force: held, and not run out.
    pub(super) fn lease_in_force(&self, lease: Uuid) -> bool {
        self.authority.held.is_some_and(|held| held.lease == lease && !held.stale)
    }

    /// Sees whether the lease has run out, and brings what it drove to rest when it must.
    pub(super) fn watch_lease(&mut self, tick: &mut Tick<'_>) {
        let Some(held) = self.authority.held.as_mut().filter(|held| tick.now >= held.deadline)
        else {
            return;
        };
        if !std::mem::replace(&mut held.stale, true) {
            tick.event(LoopEvent::Lease(LeaseChange::Expired(held.lease)));
        }
        self.lease_lost(tick);
    }

    /// Grants the lease, if it is free.
    pub(super) fn acquire_lease(
        &mut self,
        tick: &mut Tick<'_>,
        lease: Uuid,
        ttl: Duration,
    ) -> Result<(), Refusal> {
        self.check_gate()?;
        let end = match &mut self.authority.held {
            Some(held) if held.lease == lease => {
                held.ttl = ttl;
                return self.renew_lease(tick, lease);
            }
            Some(held) if !held.stale => return Err(held.required(tick.now)),
            Some(held) if self.motion.as_ref().is_some_and(|m| m.lease == Some(held.lease)) => {
                End::Failed(Refusal::LeaseLost)
            }
            _ => End::Cancelled(Refusal::LeaseTaken),
        };
        let deadline = tick.now + ttl;
        self.authority.held = Some(Held { lease, ttl, deadline, stale: false });
        tick.event(LoopEvent::Lease(LeaseChange::Granted(lease)));
        self.raise_epoch(tick, end);
        Ok(())
    }

    /// Keeps the lease, one that has run out too.
    pub(super) fn renew_lease(&mut self, tick: &mut Tick<'_>, lease: Uuid) -> Result<(), Refusal> {
        let held = self.authority.held.as_mut().filter(|held| held.lease == lease);
        let held = held.ok_or(Refusal::LeaseStale)?;
        held.deadline = tick.now + held.ttl;
        if std::mem::replace(&mut held.stale, false) {
            tick.event(LoopEvent::Lease(LeaseChange::Recovered(lease)));
        }
        Ok(())
    }

    /// Gives the lease back, and ends what moves.
    pub(super) fn release_lease(
        &mut self,
        tick: &mut Tick<'_>,
        lease: Uuid,
    ) -> Result<(), Refusal> {
        self.authority.held.filter(|held| held.lease == lease).ok_or(Refusal::LeaseStale)?;
        self.clear_lease(tick);
        self.raise_epoch(tick, End::Cancelled(Refusal::Cancelled));
        Ok(())
    }

    /// Takes the lease away from whoever has it.
    pub(super) fn clear_lease(&mut self, tick: &mut Tick<'_>) {
        if let Some(held) = self.authority.held.take() {
            tick.event(LoopEvent::Lease(LeaseChange::Released(held.lease)));
        }
    }

    /// Refuses an order that needs the lease and was `given` another or none.
    pub(super) fn check_lease(
        &self,
        tick: &Tick<'_>,
        order: &Order,
        given: Option<Uuid>,
    ) -> Result<(), Refusal> {
        if !needs_lease(order) {
            return Ok(());
        }
        match (&self.authority.held, given) {
            (_, Some(given)) if self.lease_in_force(given) => Ok(()),
            (_, Some(_)) => {
                // It was the stop that took it: to acquire another would be refused.
                self.check_gate()?;
                Err(Refusal::LeaseStale)
            }
            (Some(held), None) if !held.stale || self.is_driven_by(held.lease) => {
                Err(held.required(tick.now))
            }
            (_, None) => Ok(()),
        }
    }

    /// Notes under which lease a granted order was given.
    ///
    /// What waits in a queue has to be told by whoever puts it there.
    pub(super) fn attribute(&mut self, tick: &mut Tick<'_>, granted: Attribution) {
        let Attribution { commands, motion, lease } = granted;
        if let Some(motion) = self.motion.as_mut().filter(|begun| Some(begun.id) == motion) {
            motion.lease = lease;
        } else if let Some(waiting) = motion {
            self.attribute_waiting(waiting, lease);
        }
        if commands && lease.is_none() && self.authority.stale().is_some() {
            // Somebody else drives now, so the holder must not find itself in charge again.
            self.clear_lease(tick);
        }
    }

    fn is_driven_by(&self, lease: Uuid) -> bool {
        self.motion.as_ref().is_some_and(|motion| motion.lease == Some(lease))
    }

    /// Lets the motion of a lease that has run out go on for as long as it may.
    fn lease_lost(&mut self, tick: &mut Tick<'_>) {
        let (Some(held), Some(motion)) = (self.authority.held, self.motion.as_ref()) else {
            return;
        };
        if motion.lease != Some(held.lease) || motion.cancelling {
            return;
        }
        let may_go_on = match motion.on_lease_loss {
            LeaseLoss::StopOnPath => false,
            LeaseLoss::Finish => true,
            LeaseLoss::ContinueS(time_s) => {
                tick.now.saturating_since(held.deadline).as_secs_f64() < time_s
            }
        };
        if !may_go_on && self.end_together(Refusal::LeaseLost) {
            // It comes to rest with its partners.
            self.drop_waiting(tick, 0, Refusal::LeaseLost);
        } else if !may_go_on {
            self.end_motion(tick, End::Failed(Refusal::LeaseLost));
            self.decelerate(tick);
        } else {
            self.end_after_this(tick, Refusal::LeaseLost);
        }
    }
}

impl Held {
    fn required(&self, now: MonoTime) -> Refusal {
        Refusal::LeaseRequired { remaining_s: self.deadline.saturating_since(now).as_secs_f64() }
    }
}

/// What is to be remembered of an order that was granted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attribution {
    /// Whether it commands.
    commands: bool,
    /// The motion it begins or keeps going.
    motion: Option<Uuid>,
    /// The lease it was given under.
    lease: Option<Uuid>,
}

impl Attribution {
    pub(super) const fn of(order: &Order, lease: Option<Uuid>) -> Self {
        Self { commands: needs_lease(order), motion: order.motion_id(), lease }
    }
}

/// Whether an order commands the robot, which only the holder of a lease may while there is one.
const fn needs_lease(order: &Order) -> bool {
    match order {
        Order::SetMode(CommandMode::Halt)
        | Order::Halt
        | Order::Cancel(_)
        | Order::Disable
        | Order::AcquireLease { .. }
        | Order::RenewLease(_)
        | Order::ReleaseLease(_) => false,
        Order::SetMode(_)
        | Order::Enable
        | Order::ResetErrors
        | Order::Jog(_)
        | Order::Follow(_)
        | Order::Home(_)
        | Order::JogJoint(_)
        | Order::JogCartesian(_)
        | Order::Delegate(_)
        | Order::Pause(_)
        | Order::Resume(_)
        | Order::SetSpeedRatio(_)
        | Order::SetEquipment(_)
        | Order::SetSignal { .. }
        | Order::SetParameter { .. } => true,
    }
}
