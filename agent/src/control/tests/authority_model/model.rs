//! What ought to be, told without the loop's own words.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{AuthorityState, LeaseLoss, LeaseScope, Role, StopLevel};
use uuid::Uuid;

use crate::control::{
    DelegateReport, Granted, LeaseChange, LeaseReport, LoopEvent, MAX_DELEGATES, Order, Refusal,
    Snapshot,
};

/// What ought to be.
#[derive(Default)]
pub(super) struct Model {
    held: Option<Held>,
    /// Sub-leases in the order of their grants, with those that ran out while they drove a motion.
    subs: Vec<Sub>,
    stopped: bool,
    pub(super) local: bool,
    /// The motion in progress, as the loop told, with its lease and reaction.
    running: Option<Running>,
    /// What is asked in this tick, in its order.
    pub(super) asked: Vec<Asked>,
    pub(super) expected: Vec<LeaseChange>,
}

#[derive(Clone, Copy)]
pub(super) struct Held {
    lease: Uuid,
    role: Role,
    ttl: Duration,
    deadline: MonoTime,
    stale: bool,
}

#[derive(Clone, Copy)]
pub(super) struct Sub {
    lease: Uuid,
    scope: LeaseScope,
    ttl: Duration,
    deadline: MonoTime,
    stale: bool,
}

pub(super) struct Running {
    id: Uuid,
    lease: Option<Uuid>,
    reaction: LeaseLoss,
}

pub(super) struct Asked {
    pub(super) ticket: u64,
    pub(super) lease: Option<Uuid>,
    pub(super) order: Order,
}

/// Leases that are acquired or taken, and those that are delegated: more than there can be.
pub(super) const MAINS: u128 = 3;
pub(super) const SUBS: u128 = MAX_DELEGATES as u128 + 2;

pub(super) fn lease(who: u128) -> Uuid {
    Uuid::from_u128(5000 + who)
}

/// What a command is for, told without the loop's own table.
const fn needed(order: &Order) -> LeaseScope {
    match order {
        Order::SetParameter { .. } => LeaseScope::Io,
        _ => LeaseScope::Arm,
    }
}

impl Model {
    pub(super) fn begin_tick(&mut self, now: MonoTime, stop: Option<StopLevel>, local: bool) {
        if local && !self.local {
            self.release();
        }
        if stop.is_some() && !self.stopped {
            self.release();
        }
        (self.stopped, self.local) = (stop.is_some(), local);
        if let Some(held) = self.held.as_mut().filter(|held| now >= held.deadline && !held.stale) {
            held.stale = true;
            self.expected.push(LeaseChange::Expired(held.lease));
        }
        for sub in self.subs.iter_mut().filter(|sub| now >= sub.deadline && !sub.stale) {
            sub.stale = true;
            self.expected.push(LeaseChange::Expired(sub.lease));
        }
    }

    fn release(&mut self) {
        self.subs.clear();
        if let Some(held) = self.held.take() {
            self.expected.push(LeaseChange::Released(held.lease));
        }
    }

    fn is_held(&self, lease: Uuid) -> bool {
        self.held.is_some_and(|held| held.lease == lease)
    }

    fn is_in_force(&self) -> bool {
        self.held.is_some_and(|held| !held.stale)
    }

    /// The sub-leases there are: those that have not run out, or drive what may go on.
    fn there(&self) -> impl Iterator<Item = &Sub> {
        let driver = self.running.as_ref().and_then(|running| running.lease);
        self.subs.iter().filter(move |sub| !sub.stale || Some(sub.lease) == driver)
    }

    fn is_sub(&self, lease: Uuid) -> bool {
        self.there().any(|sub| sub.lease == lease)
    }

    fn scope(&self, lease: Uuid) -> Option<LeaseScope> {
        if !self.is_in_force() {
            return None;
        }
        let sub = self.subs.iter().find(|sub| sub.lease == lease && !sub.stale);
        if self.is_held(lease) { Some(LeaseScope::Arm) } else { sub.map(|sub| sub.scope) }
    }

    /// The refusal that authority is cause of, if it is.
    fn refusal(&self, now: MonoTime, asked: &Asked) -> Option<Refusal> {
        let required = |held: Held| Refusal::LeaseRequired {
            remaining_s: held.deadline.saturating_since(now).as_secs_f64(),
        };
        let stopped = self.stopped.then_some(Refusal::Stopped(StopLevel::L2));
        let local = self.local.then_some(Refusal::LocalControl);
        let stale = |is_there: bool| (!is_there).then_some(Refusal::LeaseStale);
        match &asked.order {
            Order::Halt => None,
            Order::AcquireLease { lease, .. } => stopped.or(local).or_else(|| {
                self.held.filter(|held| held.lease != *lease && !held.stale).map(required)
            }),
            Order::TakeLease { lease, .. } if self.is_held(*lease) => stopped.or(local),
            Order::TakeLease { role, .. } => stopped.or(local).or_else(|| {
                let holders = self.held.filter(|held| !held.stale).map(|held| held.role);
                let needed = holders.unwrap_or_default().max(Role::Operator);
                (*role < needed).then_some(Refusal::RoleTooLow { needed })
            }),
            Order::DelegateLease { parent, lease, .. } => stopped.or(local).or_else(|| {
                if !(self.is_held(*parent) && self.is_in_force()) {
                    let sub = self.is_sub(*parent);
                    return Some(if sub { Refusal::DelegatedAlready } else { Refusal::LeaseStale });
                }
                let full = !self.is_sub(*lease) && self.there().count() == MAX_DELEGATES;
                full.then_some(Refusal::TooManyDelegates { limit: MAX_DELEGATES })
            }),
            Order::RenewLease { lease, .. } => {
                stale(self.is_held(*lease) || (self.is_in_force() && self.is_sub(*lease)))
            }
            Order::ReleaseLease(lease) => stale(self.is_held(*lease) || self.is_sub(*lease)),
            order => local.or_else(|| match asked.lease {
                Some(lease) => match self.scope(lease) {
                    Some(scope) if scope > needed(order) => {
                        Some(Refusal::ScopeTooNarrow { scope, needed: needed(order) })
                    }
                    Some(_) => None,
                    None => stopped.or(Some(Refusal::LeaseStale)),
                },
                None => {
                    let held = self.held?;
                    let drives = self.running.as_ref().is_some_and(|r| r.lease.is_some());
                    (!held.stale || drives).then(|| required(held))
                }
            }),
        }
    }

    fn granted(&mut self, now: MonoTime, asked: &Asked) {
        match &asked.order {
            &Order::AcquireLease { lease, ttl, role } => {
                self.take(now, (lease, ttl, role), LeaseChange::Granted(lease));
            }
            &Order::TakeLease { lease, ttl, role } => {
                let from = self.held.map(|held| held.lease);
                let change = from
                    .map_or(LeaseChange::Granted(lease), |from| LeaseChange::Taken { lease, from });
                self.take(now, (lease, ttl, role), change);
            }
            &Order::DelegateLease { lease, ttl, .. } if self.is_sub(lease) => {
                self.renewed(now, lease, Some(ttl));
            }
            &Order::DelegateLease { lease, scope, ttl, .. } => {
                self.forget_gone();
                self.subs.push(Sub { lease, scope, ttl, deadline: now + ttl, stale: false });
                self.expected.push(LeaseChange::Delegated(lease));
            }
            &Order::RenewLease { lease, ttl } => self.renewed(now, lease, ttl),
            &Order::ReleaseLease(lease) if self.is_held(lease) => self.release(),
            &Order::ReleaseLease(lease) => {
                self.subs.retain(|sub| sub.lease != lease);
                self.expected.push(LeaseChange::Released(lease));
            }
            Order::Halt => {}
            order => {
                let (lease, id) = (asked.lease, order.motion_id());
                let reaction = match order {
                    Order::Follow(order) => order.on_lease_loss,
                    _ => LeaseLoss::StopOnPath,
                };
                if let Some(id) = id {
                    self.running = Some(Running { id, lease, reaction });
                }
                if lease.is_none() && self.held.is_some_and(|held| held.stale) {
                    self.release();
                }
            }
        }
    }

    fn take(
        &mut self,
        now: MonoTime,
        (lease, ttl, role): (Uuid, Duration, Role),
        change: LeaseChange,
    ) {
        if self.is_held(lease) {
            return self.renewed(now, lease, Some(ttl));
        }
        self.subs.clear();
        self.held = Some(Held { lease, role, ttl, deadline: now + ttl, stale: false });
        self.expected.push(change);
    }

    fn renewed(&mut self, now: MonoTime, lease: Uuid, given: Option<Duration>) {
        let held = self.held.as_mut().filter(|held| held.lease == lease);
        let held = held.map(|held| (&mut held.ttl, &mut held.deadline, &mut held.stale));
        let subs = self.subs.iter_mut().filter(|sub| sub.lease == lease);
        let subs = subs.map(|sub| (&mut sub.ttl, &mut sub.deadline, &mut sub.stale));
        let (ttl, deadline, stale) = held.into_iter().chain(subs).last().expect("it is there");
        *ttl = given.unwrap_or(*ttl);
        *deadline = now + *ttl;
        if std::mem::replace(stale, false) {
            self.expected.push(LeaseChange::Recovered(lease));
        }
    }

    fn forget_gone(&mut self) {
        let there: Vec<Uuid> = self.there().map(|sub| sub.lease).collect();
        self.subs.retain(|sub| there.contains(&sub.lease));
    }

    /// Goes through what the loop said in a tick.
    pub(super) fn follow(&mut self, now: MonoTime, epoch_before: u64, events: &[LoopEvent]) {
        let mut asked = std::mem::take(&mut self.asked).into_iter().peekable();
        for event in events {
            match event {
                LoopEvent::Answer { ticket, result } => {
                    // Those before it were not answered, so they wait for the controller.
                    while let Some(waiting) = asked.next_if(|asked| asked.ticket < *ticket) {
                        assert_eq!(self.refusal(now, &waiting), None, "{:?}", waiting.order);
                        self.granted(now, &waiting);
                    }
                    let Some(asked) = asked.next_if(|asked| asked.ticket == *ticket) else {
                        continue;
                    };
                    match self.refusal(now, &asked) {
                        Some(refusal) => assert_eq!(*result, Err(refusal), "{:?}", asked.order),
                        None => self.check_answer(&asked, *result, epoch_before),
                    }
                    if result.is_ok() {
                        self.granted(now, &asked);
                    }
                }
                LoopEvent::Motion(report) if report.status.is_terminal() => {
                    self.running = self.running.take().filter(|running| running.id != report.id);
                }
                _ => {}
            }
        }
        for waiting in asked {
            assert_eq!(self.refusal(now, &waiting), None, "{:?}", waiting.order);
            self.granted(now, &waiting);
        }
    }

    fn check_answer(&self, asked: &Asked, result: Result<Granted, Refusal>, epoch_before: u64) {
        let order = &asked.order;
        let of_authority = matches!(
            result,
            Err(Refusal::LeaseStale
                | Refusal::LeaseRequired { .. }
                | Refusal::LocalControl
                | Refusal::RoleTooLow { .. }
                | Refusal::ScopeTooNarrow { .. }
                | Refusal::DelegatedAlready
                | Refusal::TooManyDelegates { .. })
        );
        assert!(!of_authority, "{order:?} under {:?}: {result:?}", asked.lease);
        match order {
            Order::AcquireLease { lease, .. } | Order::TakeLease { lease, .. }
                if !self.is_held(*lease) =>
            {
                let granted = result.expect("nothing speaks against it");
                assert!(granted.epoch > epoch_before, "a grant raises the epoch");
            }
            Order::ReleaseLease(lease) => {
                let granted = result.expect("nothing speaks against it");
                let moved = self.running.as_ref().is_some_and(|r| r.lease == Some(*lease));
                let raised = granted.epoch > epoch_before;
                assert!(raised || !(self.is_held(*lease) || moved), "a release raises the epoch");
            }
            Order::AcquireLease { .. }
            | Order::TakeLease { .. }
            | Order::DelegateLease { .. }
            | Order::RenewLease { .. } => assert!(result.is_ok(), "{order:?}: {result:?}"),
            _ => {}
        }
    }

    pub(super) fn check(&mut self, now: MonoTime, snapshot: &Snapshot) {
        let held = self.held.map(|held| LeaseReport {
            lease: held.lease,
            role: held.role,
            deadline: held.deadline,
            stale: held.stale,
        });
        assert_eq!(snapshot.lease, held);
        let report = |sub: &Sub| DelegateReport {
            lease: sub.lease,
            scope: sub.scope,
            deadline: sub.deadline,
            stale: sub.stale,
        };
        let subs: Vec<DelegateReport> = self.there().map(report).collect();
        assert_eq!(snapshot.delegates.iter().flatten().copied().collect::<Vec<_>>(), subs);
        let state = match held {
            _ if self.local => AuthorityState::Local,
            _ if self.stopped => AuthorityState::Inhibited,
            None => AuthorityState::Free,
            Some(held) if held.stale => AuthorityState::Stale,
            Some(_) => AuthorityState::Held,
        };
        assert_eq!(snapshot.authority, state);
        let motion = snapshot.motion.map(|motion| motion.id);
        assert!(motion.is_none() || !self.local, "nothing moves while the pendant has control");
        self.check_motion(now, motion);
        self.forget_gone();
    }

    /// What moves under a lease moves no longer than it may.
    fn check_motion(&self, now: MonoTime, motion: Option<Uuid>) {
        let running = self.running.as_ref().filter(|running| Some(running.id) == motion);
        let Some(Running { lease: Some(lease), reaction, .. }) = running else { return };
        let held = self.held.expect("what moves under a lease ends with it");
        let mut lost = held.stale.then_some(held.deadline);
        if held.lease != *lease {
            let sub = self.subs.iter().find(|sub| sub.lease == *lease);
            let sub = sub.expect("what moves under a sub-lease ends with it");
            lost = lost.into_iter().chain(sub.stale.then_some(sub.deadline)).min();
        }
        let Some(lost) = lost else { return };
        let since_s = now.saturating_since(lost).as_secs_f64();
        let may = match reaction {
            LeaseLoss::StopOnPath => false,
            LeaseLoss::Finish => true,
            LeaseLoss::ContinueS(time_s) => since_s < *time_s,
        };
        assert!(may, "{reaction:?} still moves {since_s} s after the end of its lease");
    }
}
