//! Sub-leases: whom the holder of the lease lets command as well.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::LeaseScope;
use arrayvec::ArrayVec;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::Tick;
use crate::control::io::{DelegateReport, LeaseChange, LoopEvent, MAX_DELEGATES, Refusal};

/// A part of the right to command, under the lease.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct SubLease {
    lease: Uuid,
    scope: LeaseScope,
    ttl: Duration,
    deadline: MonoTime,
    /// Whether it has run out. Then it is there only for the motion that goes on all the same.
    stale: bool,
}

/// The sub-leases of the lease, in the order in which they were granted.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Delegates(ArrayVec<SubLease, MAX_DELEGATES>);

impl Delegates {
    /// Those there are, while `driver` is the lease of the motion in progress.
    pub(super) fn report(&self, driver: Option<Uuid>) -> [Option<DelegateReport>; MAX_DELEGATES] {
        let mut report = [None; MAX_DELEGATES];
        let there = self.0.iter().filter(|sub| sub.is_there(driver));
        for (place, sub) in report.iter_mut().zip(there) {
            let SubLease { lease, scope, deadline, stale, .. } = *sub;
            *place = Some(DelegateReport { lease, scope, deadline, stale });
        }
        report
    }

    /// What a sub-lease gives the right to, if it has not run out.
    pub(super) fn scope(&self, lease: Uuid) -> Option<LeaseScope> {
        self.0.iter().find(|sub| sub.lease == lease && !sub.stale).map(|sub| sub.scope)
    }

    /// Whether it is one of these.
    pub(super) fn knows(&self, lease: Uuid, driver: Option<Uuid>) -> bool {
        self.0.iter().any(|sub| sub.lease == lease && sub.is_there(driver))
    }

    /// When a sub-lease ran out, if it has; long ago if there is none.
    pub(super) fn ran_out(&self, lease: Uuid) -> Option<MonoTime> {
        match self.0.iter().find(|sub| sub.lease == lease) {
            Some(sub) => sub.stale.then_some(sub.deadline),
            None => Some(MonoTime::ZERO),
        }
    }

    /// Sees which have run out, and forgets those that nothing is moved under.
    pub(super) fn watch(&mut self, tick: &mut Tick<'_>, driver: Option<Uuid>) {
        let now = tick.now;
        for sub in self.0.iter_mut().filter(|sub| !sub.stale && now >= sub.deadline) {
            sub.stale = true;
            tick.event(LoopEvent::Lease(LeaseChange::Expired(sub.lease)));
        }
        self.0.retain(|sub| sub.is_there(driver));
    }

    /// Grants another one.
    pub(super) fn grant(
        &mut self,
        now: MonoTime,
        (lease, scope, ttl): (Uuid, LeaseScope, Duration),
        driver: Option<Uuid>,
    ) -> Result<(), Refusal> {
        self.0.retain(|sub| sub.is_there(driver));
        let sub = SubLease { lease, scope, ttl, deadline: now + ttl, stale: false };
        self.0.try_push(sub).map_err(|_| Refusal::TooManyDelegates { limit: MAX_DELEGATES })
    }

    /// Keeps one, for another time if that is given.
    pub(super) fn renew(
        &mut self,
        tick: &mut Tick<'_>,
        (lease, ttl): (Uuid, Option<Duration>),
        driver: Option<Uuid>,
    ) -> Result<(), Refusal> {
        let there = |sub: &&mut SubLease| sub.lease == lease && sub.is_there(driver);
        let sub = self.0.iter_mut().find(there).ok_or(Refusal::LeaseStale)?;
        sub.ttl = ttl.unwrap_or(sub.ttl);
        sub.deadline = tick.now + sub.ttl;
        if std::mem::replace(&mut sub.stale, false) {
            tick.event(LoopEvent::Lease(LeaseChange::Recovered(lease)));
        }
        Ok(())
    }

    /// Takes one away.
    pub(super) fn remove(&mut self, lease: Uuid) {
        self.0.retain(|sub| sub.lease != lease);
    }

    /// Takes all away.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }
}

impl SubLease {
    fn is_there(&self, driver: Option<Uuid>) -> bool {
        !self.stale || driver == Some(self.lease)
    }
}
