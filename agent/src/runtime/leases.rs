//! Whose leases they are: the loop knows identities only, people want names.

use std::collections::HashMap;

use armada_model::MonoTime;
use armada_protocol::messages::{Lease, Role};
use uuid::Uuid;

use crate::control::{LeaseChange, LeaseReport};

/// Who holds a lease, or asks for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Holder {
    /// Name of the client.
    pub(super) name: String,
    /// How long the lease lasts without being renewed \[ms\].
    pub(super) ttl_ms: u64,
}

/// The lease in force and those that are asked for just now.
#[derive(Debug, Default)]
pub(super) struct Leases {
    known: HashMap<Uuid, Holder>,
    granted: Option<Uuid>,
}

impl Leases {
    /// Notes for whom a lease is about to be asked.
    pub(super) fn announce(&mut self, lease: Uuid, holder: Holder) {
        self.known.insert(lease, holder);
    }

    /// Forgets a lease that was not granted.
    pub(super) fn forget(&mut self, lease: Uuid) {
        self.known.remove(&lease);
    }

    /// How long a lease lasts without being renewed \[ms\]; 0 if it is not known.
    pub(super) fn ttl_ms(&self, lease: Uuid) -> u64 {
        self.known.get(&lease).map_or(0, |holder| holder.ttl_ms)
    }

    /// Name of the holder of a lease.
    pub(super) fn name(&self, lease: Uuid) -> &str {
        self.known.get(&lease).map_or("somebody", |holder| holder.name.as_str())
    }

    /// What became of the lease: the holder it is about, and words for it.
    pub(super) fn take(&mut self, change: LeaseChange) -> (String, String) {
        let (LeaseChange::Granted(lease)
        | LeaseChange::Released(lease)
        | LeaseChange::Expired(lease)
        | LeaseChange::Recovered(lease)) = change;
        let name = self.name(lease).to_owned();
        let words = match change {
            LeaseChange::Granted(_) => format!("lease granted to {name}"),
            LeaseChange::Released(_) => format!("lease of {name} ended"),
            LeaseChange::Expired(_) => format!("lease of {name} ran out"),
            LeaseChange::Recovered(_) => format!("lease of {name} renewed after it had run out"),
        };
        match change {
            LeaseChange::Granted(lease) => {
                if let Some(before) = self.granted.replace(lease).filter(|&old| old != lease) {
                    self.known.remove(&before);
                }
            }
            LeaseChange::Released(lease) => {
                self.known.remove(&lease);
                self.granted = self.granted.filter(|&granted| granted != lease);
            }
            LeaseChange::Expired(_) | LeaseChange::Recovered(_) => {}
        }
        (name, words)
    }

    /// The lease in words for a status.
    pub(super) fn lease(&self, report: &LeaseReport, now: MonoTime) -> Lease {
        let remaining = report.deadline.saturating_since(now);
        let left = if report.stale { 0 } else { remaining.as_millis() };
        Lease {
            holder: self.name(report.lease).to_owned(),
            remaining_ms: u64::try_from(left).unwrap_or(u64::MAX),
            stale: report.stale,
            role: Role::Program,
            reason: None,
            delegates: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn holder(name: &str) -> Holder {
        Holder { name: name.to_owned(), ttl_ms: 500 }
    }

    #[test]
    fn a_lease_is_told_with_its_holder_and_its_time() {
        let mut leases = Leases::default();
        let (lease, now) = (Uuid::from_u128(1), MonoTime::from_nanos(1_000_000_000));
        leases.announce(lease, holder("planner"));
        let (name, words) = leases.take(LeaseChange::Granted(lease));
        assert_eq!((name.as_str(), words.as_str()), ("planner", "lease granted to planner"));
        let deadline = now + Duration::from_millis(320);
        let report = LeaseReport { lease, deadline, stale: false };
        let told = leases.lease(&report, now);
        assert_eq!((told.holder.as_str(), told.remaining_ms, told.stale), ("planner", 320, false));
        let stale = leases.lease(&LeaseReport { stale: true, ..report }, now);
        assert_eq!((stale.remaining_ms, stale.stale), (0, true));
    }

    #[test]
    fn leases_that_are_over_are_forgotten_and_those_asked_for_are_not() {
        let mut leases = Leases::default();
        let [first, second, third] = [1, 2, 3].map(Uuid::from_u128);
        for (lease, name) in [(first, "a"), (second, "b"), (third, "c")] {
            leases.announce(lease, holder(name));
        }
        leases.take(LeaseChange::Granted(first));
        leases.take(LeaseChange::Expired(first));
        leases.take(LeaseChange::Granted(second));
        assert_eq!((leases.name(first), leases.name(second)), ("somebody", "b"));
        leases.take(LeaseChange::Released(second));
        assert_eq!((leases.name(second), leases.name(third)), ("somebody", "c"));
        leases.forget(third);
        assert!(leases.known.is_empty() && leases.granted.is_none());
    }
}
