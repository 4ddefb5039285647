//! Who may command: the lease.
//!
//! ```text
//!        acquire, take               time is up
//! FREE ----------> HELD(lease) ---------------------> STALE(lease)
//!  ^ ^              |   ^   ^ renew                     |  |  |
//!  | +---release----+   |   +---------------------------+  |  | released, or somebody
//!  |                    +--- acquire by another -----------+  | commands without a lease
//!  |                HELD --- take, by a role not below ---> HELD'
//!  +----------------------------------------------------------+
//!  INHIBITED  while a stop is latched: it took the lease, none can be had until its reset
//!  LOCAL      while the pendant has control: the same, and nothing may be commanded at all
//! ```
//!
//! * While nobody holds one, nothing is needed. While somebody does, what commands needs it; what
//!   only ends motion (halt, cancel, disable, every stop) never does, in no state.
//! * A grant, a release, a stop and the pendant raise the epoch, which ends the motion of before
//!   with a ramp. A fault takes nothing away: whoever drove is to put it right.
//! * Time is looked at once in a tick, before its requests. A lease that has run out is not lost
//!   at once: its holder may renew it as long as nobody else commands. That changes no epoch, and
//!   what was ended stays ended.
//! * A motion reacts to the end of the lease that it was begun under as it was told to
//!   ([`LeaseLoss`]); one that was begun under none does not. While it goes on under a stale
//!   lease, others have to acquire one to command.
//! * The holder may let others command as well, in a scope: sub-leases, in force only while the
//!   lease is, each with a time of its own. They end with the lease. None can be delegated again.
//!   To grant one, to release one or to let one run out raises no epoch, unless something moves
//!   under it. One that has run out is gone, unless what moves under it may go on.
//! * What waits behind a motion is under the same lease as it, so that none outlives its own.
//!
//! Identities come from outside: nothing is random in here.

mod delegates;
mod needs;

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{AuthorityState, CommandMode, LeaseLoss, LeaseScope, Role};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use self::delegates::Delegates;
use self::needs::{appends, is_harmless, needed_scope};
use super::io::{
    DelegateReport, LeaseChange, LeaseReport, LoopEvent, MAX_DELEGATES, Order, Refusal,
};
use super::motion::End;
use super::state::{LoopState, Tick};
use crate::drivers::{DriverRequest, Feedback};

/// Who may command, as far as the loop knows.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Authority {
    held: Option<Held>,
    /// Empty while there is no lease.
    delegates: Delegates,
    /// Whether the pendant has control, as the controller said last.
    local: bool,
}

/// A lease that was granted, and not given back.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Held {
    lease: Uuid,
    role: Role,
    ttl: Duration,
    deadline: MonoTime,
    stale: bool,
}

impl Authority {
    /// The lease for the snapshot.
    pub(super) fn report(&self) -> Option<LeaseReport> {
        let Held { lease, role, deadline, stale, .. } = self.held?;
        Some(LeaseReport { lease, role, deadline, stale })
    }

    fn stale(&self) -> Option<Uuid> {
        self.held.filter(|held| held.stale).map(|held| held.lease)
    }

    /// What a lease gives the right to, if it is in force.
    fn scope(&self, lease: Uuid) -> Option<LeaseScope> {
        let held = self.held.filter(|held| !held.stale)?;
        if held.lease == lease { Some(LeaseScope::Arm) } else { self.delegates.scope(lease) }
    }

    /// When a lease ceased to be in force, if it has.
    fn lost_at(&self, lease: Uuid) -> Option<MonoTime> {
        let held = self.held?;
        let with_it = held.stale.then_some(held.deadline);
        if held.lease == lease {
            return with_it;
        }
        match (with_it, self.delegates.ran_out(lease)) {
            (Some(one), Some(other)) => Some(one.min(other)),
            (one, other) => one.or(other),
        }
    }
}

impl LoopState {
    /// Where the right to command is.
    pub(super) fn authority_state(&self) -> AuthorityState {
        match self.authority.held {
            _ if self.authority.local => AuthorityState::Local,
            _ if self.stop.level().is_some() => AuthorityState::Inhibited,
            None => AuthorityState::Free,
            Some(held) if held.stale => AuthorityState::Stale,
            Some(_) => AuthorityState::Held,
        }
    }

    /// The sub-leases for the snapshot.
    pub(super) fn delegates(&self) -> [Option<DelegateReport>; MAX_DELEGATES] {
        self.authority.delegates.report(self.driver())
    }

    /// Whether this lease gives the right to move the arm, and is in force.
    pub(super) fn lease_in_force(&self, lease: Uuid) -> bool {
        self.authority.scope(lease) == Some(LeaseScope::Arm)
    }

    /// Follows who has control at the controller; before its other news, since a controller that is
    /// under local control may cease to take commands, and that is no fault.
    pub(super) fn follow_local_control(&mut self, tick: &mut Tick<'_>, feedback: &Feedback) {
        let local = feedback.local_control;
        if std::mem::replace(&mut self.authority.local, local) == local {
            return;
        }
        tick.event(LoopEvent::LocalControl(local));
        if local {
            self.clear_lease(tick);
            let mode = match self.mode {
                CommandMode::InvalidState => CommandMode::InvalidState,
                _ => CommandMode::Halt,
            };
            self.change_mode(tick, mode, End::Failed(Refusal::LocalControl));
            self.refuse_pending(tick, DriverRequest::Enable, Refusal::LocalControl);
        }
    }

    /// Refuses what the pendant's control forbids.
    pub(super) const fn check_local_control(&self) -> Result<(), Refusal> {
        if self.authority.local { Err(Refusal::LocalControl) } else { Ok(()) }
    }

    /// Sees which leases have run out, and brings what they drove to rest when it must.
    pub(super) fn watch_lease(&mut self, tick: &mut Tick<'_>) {
        let Some(held) = self.authority.held.as_mut() else { return };
        if tick.now >= held.deadline && !std::mem::replace(&mut held.stale, true) {
            tick.event(LoopEvent::Lease(LeaseChange::Expired(held.lease)));
        }
        let driver = self.driver();
        self.authority.delegates.watch(tick, driver);
        self.lease_lost(tick);
    }

    /// Grants the lease, if it is free.
    pub(super) fn acquire_lease(
        &mut self,
        tick: &mut Tick<'_>,
        (lease, ttl, role): (Uuid, Duration, Role),
    ) -> Result<(), Refusal> {
        self.check_gate()?;
        self.check_local_control()?;
        match self.authority.held {
            Some(held) if held.lease == lease => return self.renew_lease(tick, lease, Some(ttl)),
            Some(held) if !held.stale => return Err(held.required(tick.now)),
            _ => {}
        }
        self.grant(tick, (lease, ttl, role), LeaseChange::Granted(lease));
        Ok(())
    }

    /// Gives the lease to somebody whose role is that of a person and not below the holder's.
    pub(super) fn take_lease(
        &mut self,
        tick: &mut Tick<'_>,
        (lease, ttl, role): (Uuid, Duration, Role),
    ) -> Result<(), Refusal> {
        self.check_gate()?;
        self.check_local_control()?;
        let change = match self.authority.held {
            Some(held) if held.lease == lease => return self.renew_lease(tick, lease, Some(ttl)),
            Some(held) => {
                // Who is late to renew has nothing that would have to be taken.
                let holders = if held.stale { Role::Operator } else { held.role };
                check_role(role, holders)?;
                LeaseChange::Taken { lease, from: held.lease }
            }
            None => {
                check_role(role, Role::Operator)?;
                LeaseChange::Granted(lease)
            }
        };
        self.grant(tick, (lease, ttl, role), change);
        Ok(())
    }

    /// Lets somebody command as well, for as long as `parent` is in force.
    pub(super) fn delegate_lease(
        &mut self,
        tick: &mut Tick<'_>,
        parent: Uuid,
        (lease, scope, ttl): (Uuid, LeaseScope, Duration),
    ) -> Result<(), Refusal> {
        self.check_gate()?;
        self.check_local_control()?;
        let driver = self.driver();
        let Authority { held, delegates, .. } = &mut self.authority;
        if held.is_none_or(|held| held.lease != parent || held.stale) {
            let sub = delegates.knows(parent, driver);
            return Err(if sub { Refusal::DelegatedAlready } else { Refusal::LeaseStale });
        }
        if delegates.knows(lease, driver) {
            return delegates.renew(tick, (lease, Some(ttl)), driver);
        }
        delegates.grant(tick.now, (lease, scope, ttl), driver)?;
        tick.event(LoopEvent::Lease(LeaseChange::Delegated(lease)));
        Ok(())
    }

    /// Keeps a lease, for another time if that is given; one that has run out too, but a sub-lease
    /// only while the lease above it is in force.
    pub(super) fn renew_lease(
        &mut self,
        tick: &mut Tick<'_>,
        lease: Uuid,
        ttl: Option<Duration>,
    ) -> Result<(), Refusal> {
        let driver = self.driver();
        let Authority { held, delegates, .. } = &mut self.authority;
        let held = held.as_mut().ok_or(Refusal::LeaseStale)?;
        if held.lease != lease {
            return match held.stale {
                true => Err(Refusal::LeaseStale),
                false => delegates.renew(tick, (lease, ttl), driver),
            };
        }
        held.ttl = ttl.unwrap_or(held.ttl);
        held.deadline = tick.now + held.ttl;
        if std::mem::replace(&mut held.stale, false) {
            tick.event(LoopEvent::Lease(LeaseChange::Recovered(lease)));
        }
        Ok(())
    }

    /// Gives a lease back, and ends what moves; a sub-lease ends only what moves under it.
    pub(super) fn release_lease(
        &mut self,
        tick: &mut Tick<'_>,
        lease: Uuid,
    ) -> Result<(), Refusal> {
        let held = self.authority.held.ok_or(Refusal::LeaseStale)?;
        let end = End::Cancelled(Refusal::Cancelled);
        if held.lease == lease {
            self.clear_lease(tick);
            self.raise_epoch(tick, end);
            return Ok(());
        }
        let driver = self.driver();
        if !self.authority.delegates.knows(lease, driver) {
            return Err(Refusal::LeaseStale);
        }
        self.authority.delegates.remove(lease);
        tick.event(LoopEvent::Lease(LeaseChange::Released(lease)));
        if driver == Some(lease) {
            self.raise_epoch(tick, end);
        }
        Ok(())
    }

    /// Takes the lease away from whoever has it, and with it all that its holder delegated.
    pub(super) fn clear_lease(&mut self, tick: &mut Tick<'_>) {
        self.authority.delegates.clear();
        if let Some(held) = self.authority.held.take() {
            tick.event(LoopEvent::Lease(LeaseChange::Released(held.lease)));
        }
    }

    /// Refuses an order that needs the lease and was `given` another, one of too little or none.
    pub(super) fn check_lease(
        &self,
        tick: &Tick<'_>,
        order: &Order,
        given: Option<Uuid>,
    ) -> Result<(), Refusal> {
        let Some(needed) = needed_scope(order) else {
            return Ok(());
        };
        self.check_local_control()?;
        match (&self.authority.held, given) {
            (_, Some(given)) => match self.authority.scope(given) {
                Some(scope) if scope > needed => Err(Refusal::ScopeTooNarrow { scope, needed }),
                Some(_) => self.check_queue(order, Some(given)),
                None => {
                    // It was the stop that took it: to acquire another would be refused.
                    self.check_gate()?;
                    Err(Refusal::LeaseStale)
                }
            },
            (Some(held), None) if !held.stale || self.driver().is_some() => {
                Err(held.required(tick.now))
            }
            (_, None) if tick.params.lease_required && !is_harmless(order) => {
                // A stop, after which no lease is given either, is the better answer.
                self.check_gate()?;
                Err(Refusal::NoLease)
            }
            (_, None) => self.check_queue(order, None),
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

    /// The lease that the motion in progress is under.
    fn driver(&self) -> Option<Uuid> {
        self.motion.as_ref().and_then(|motion| motion.lease)
    }

    /// Refuses to let something wait behind a motion of another lease.
    fn check_queue(&self, order: &Order, given: Option<Uuid>) -> Result<(), Refusal> {
        match &self.motion {
            Some(motion) if appends(order) && motion.lease != given => {
                Err(Refusal::Busy(motion.id))
            }
            _ => Ok(()),
        }
    }

    /// Makes a lease the one in force, which ends what moved before.
    fn grant(
        &mut self,
        tick: &mut Tick<'_>,
        (lease, ttl, role): (Uuid, Duration, Role),
        change: LeaseChange,
    ) {
        let lost = self.authority.stale().is_some() && self.driver().is_some();
        let end = match lost {
            true => End::Failed(Refusal::LeaseLost),
            false => End::Cancelled(Refusal::LeaseTaken),
        };
        self.authority.delegates.clear();
        let deadline = tick.now + ttl;
        self.authority.held = Some(Held { lease, role, ttl, deadline, stale: false });
        tick.event(LoopEvent::Lease(change));
        self.raise_epoch(tick, end);
    }

    /// Lets the motion of a lease that has run out go on for as long as it may.
    fn lease_lost(&mut self, tick: &mut Tick<'_>) {
        let Some(motion) = self.motion.as_ref().filter(|motion| !motion.cancelling) else {
            return;
        };
        let lost = motion.lease.and_then(|lease| self.authority.lost_at(lease));
        let Some(lost) = lost else { return };
        let may_go_on = match motion.on_lease_loss {
            LeaseLoss::StopOnPath => false,
            LeaseLoss::Finish => true,
            LeaseLoss::ContinueS(time_s) => tick.now.saturating_since(lost).as_secs_f64() < time_s,
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

/// Refuses to take the lease in a role below the holder's, or one that takes none.
fn check_role(role: Role, holders: Role) -> Result<(), Refusal> {
    let needed = holders.max(Role::Operator);
    if role < needed { Err(Refusal::RoleTooLow { needed }) } else { Ok(()) }
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
        Self { commands: needed_scope(order).is_some(), motion: order.motion_id(), lease }
    }
}
