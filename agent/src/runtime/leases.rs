//! Whose leases they are: the loop knows identities only, people want names.

use std::collections::HashMap;

use armada_model::MonoTime;
use armada_protocol::messages::{AuthorityState, Delegate, Lease, LeaseScope, Role, Severity};
use serde_json::{Map, Value};
use uuid::Uuid;

use super::words::{role_name, scope_name};
use crate::control::{DelegateReport, LeaseChange, LeaseReport, Refusal, Snapshot};

/// Who holds a lease or sub-lease, or asks for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Holder {
    /// Name of the client.
    pub(super) name: String,
    /// How long the lease lasts without being renewed \[ms\].
    pub(super) ttl_ms: u64,
    /// As what it commands.
    pub(super) role: Role,
    /// What it has the right to.
    pub(super) scope: LeaseScope,
    /// Why it took the lease, if it did.
    pub(super) reason: Option<String>,
}

impl Holder {
    /// The name, with the role of a person.
    pub(super) fn title(&self) -> String {
        title(&self.name, self.role)
    }
}

/// A name, with the role of a person.
pub(super) fn title(name: &str, role: Role) -> String {
    match role {
        Role::Program => name.to_owned(),
        role => format!("{name} ({})", role_name(role)),
    }
}

/// What became of a lease, for the audit trail. A lease itself is a secret of its holder.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LeaseNews {
    pub(super) severity: Severity,
    /// For people.
    pub(super) message: String,
    /// The same as data.
    pub(super) details: Map<String, Value>,
}

/// The lease in force, its sub-leases, and those that are asked for just now.
#[derive(Debug, Default)]
pub(super) struct Leases {
    known: HashMap<Uuid, Holder>,
    granted: Option<Granted>,
    /// Sub-leases of the lease in force; some may have run out.
    delegates: Vec<Uuid>,
}

#[derive(Clone, Copy, Debug)]
struct Granted {
    lease: Uuid,
    since: MonoTime,
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

    /// Notes another time for a lease that was renewed with it; says how long it lasts \[ms\].
    pub(super) fn renewed(&mut self, lease: Uuid, ttl_ms: Option<u64>) -> u64 {
        let Some(holder) = self.known.get_mut(&lease) else {
            return ttl_ms.unwrap_or_default();
        };
        holder.ttl_ms = ttl_ms.unwrap_or(holder.ttl_ms);
        holder.ttl_ms
    }

    /// Name of the holder of a lease.
    pub(super) fn name(&self, lease: Uuid) -> &str {
        self.known.get(&lease).map_or("somebody", |holder| holder.name.as_str())
    }

    /// Who was granted the lease last, unless it has ended.
    pub(super) fn holder(&self) -> Option<&Holder> {
        self.known.get(&self.granted?.lease)
    }

    /// Since when a lease has been held, if it is the one in force.
    pub(super) fn since(&self, lease: Uuid) -> Option<MonoTime> {
        self.granted.filter(|granted| granted.lease == lease).map(|granted| granted.since)
    }

    /// What became of a lease at `stamp`; `now` is how things are by now.
    pub(super) fn take(
        &mut self,
        stamp: MonoTime,
        change: LeaseChange,
        now: &Snapshot,
    ) -> LeaseNews {
        let news = self.news(change);
        match change {
            LeaseChange::Granted(lease) | LeaseChange::Taken { lease, .. } => {
                self.end(|known| known != lease);
                self.granted = Some(Granted { lease, since: stamp });
            }
            LeaseChange::Delegated(lease) => {
                let there = |known: Uuid| {
                    known == lease || now.delegates.iter().flatten().any(|sub| sub.lease == known)
                };
                let gone = self.delegates.extract_if(.., |known| !there(*known));
                gone.for_each(|known| drop(self.known.remove(&known)));
                self.delegates.push(lease);
            }
            LeaseChange::Released(lease) if self.is_granted(lease) => self.end(|_| true),
            LeaseChange::Released(lease) => {
                self.known.remove(&lease);
                self.delegates.retain(|known| *known != lease);
            }
            LeaseChange::Expired(_) | LeaseChange::Recovered(_) => {}
        }
        news
    }

    /// The lease in words for a status.
    pub(super) fn lease(
        &self,
        report: &LeaseReport,
        delegates: &[Option<DelegateReport>],
        now: MonoTime,
    ) -> Lease {
        let delegate = |sub: &DelegateReport| Delegate {
            holder: self.name(sub.lease).to_owned(),
            scope: sub.scope,
            remaining_ms: remaining_ms(sub.deadline, sub.stale || report.stale, now),
        };
        Lease {
            holder: self.name(report.lease).to_owned(),
            role: report.role,
            reason: self.known.get(&report.lease).and_then(|holder| holder.reason.clone()),
            remaining_ms: remaining_ms(report.deadline, report.stale, now),
            stale: report.stale,
            delegates: delegates.iter().flatten().map(delegate).collect(),
        }
    }

    fn is_granted(&self, lease: Uuid) -> bool {
        self.granted.is_some_and(|granted| granted.lease == lease)
    }

    /// Forgets the lease in force and its sub-leases, those of them that are to be forgotten.
    fn end(&mut self, forget: impl Fn(Uuid) -> bool) {
        let granted = self.granted.take().map(|granted| granted.lease);
        for lease in self.delegates.drain(..).chain(granted).filter(|&lease| forget(lease)) {
            self.known.remove(&lease);
        }
    }

    fn news(&self, change: LeaseChange) -> LeaseNews {
        let (LeaseChange::Granted(lease)
        | LeaseChange::Taken { lease, .. }
        | LeaseChange::Delegated(lease)
        | LeaseChange::Released(lease)
        | LeaseChange::Expired(lease)
        | LeaseChange::Recovered(lease)) = change;
        let holder = self.known.get(&lease);
        let name = self.name(lease);
        let who = holder.map_or_else(|| name.to_owned(), Holder::title);
        let mut details = Map::new();
        let mut detail = |name: &str, value: &str| {
            details.insert(name.to_owned(), Value::from(value));
        };
        detail("holder", name);
        if let Some(role) = holder.map(|holder| holder.role).filter(|role| *role != Role::Program) {
            detail("role", &role_name(role));
        }
        let of = if self.delegates.contains(&lease) { "sub-lease" } else { "lease" };
        let (severity, what, message) = match change {
            LeaseChange::Granted(_) => {
                (Severity::Info, "granted", format!("lease granted to {who}"))
            }
            LeaseChange::Taken { from, .. } => {
                let from = self.name(from);
                detail("from", from);
                let reason = holder.and_then(|holder| holder.reason.as_deref());
                let why = reason.map(|reason| format!(": {reason:?}")).unwrap_or_default();
                reason.into_iter().for_each(|reason| detail("reason", reason));
                (Severity::Warning, "taken", format!("lease of {from} taken by {who}{why}"))
            }
            LeaseChange::Delegated(_) => {
                let by = self.holder().map_or("somebody", |holder| holder.name.as_str());
                let scope = scope_name(holder.map_or(LeaseScope::Arm, |holder| holder.scope));
                detail("by", by);
                detail("scope", &scope);
                (Severity::Info, "delegated", format!("{by} lets {who} command ({scope})"))
            }
            LeaseChange::Released(_) => {
                (Severity::Info, "released", format!("{of} of {who} ended"))
            }
            LeaseChange::Expired(_) => {
                (Severity::Warning, "expired", format!("{of} of {who} ran out"))
            }
            LeaseChange::Recovered(_) => {
                let text = format!("{of} of {who} renewed after it had run out");
                (Severity::Info, "recovered", text)
            }
        };
        detail("change", what);
        LeaseNews { severity, message, details }
    }
}

/// Whether whoever was `given` this lease, or none, may move the arm as things stand; the loop has
/// the last word.
pub(super) fn check_may_move(
    snapshot: &Snapshot,
    given: Option<Uuid>,
    now: MonoTime,
) -> Result<(), Refusal> {
    if snapshot.authority == AuthorityState::Local {
        return Err(Refusal::LocalControl);
    }
    let Some(held) = snapshot.lease.filter(|held| !held.stale && given != Some(held.lease)) else {
        return Ok(());
    };
    let mut subs = snapshot.delegates.iter().flatten().filter(|sub| !sub.stale);
    match given.and_then(|given| subs.find(|sub| sub.lease == given)).map(|sub| sub.scope) {
        Some(LeaseScope::Arm) => Ok(()),
        Some(scope) => Err(Refusal::ScopeTooNarrow { scope, needed: LeaseScope::Arm }),
        None => {
            let remaining_s = held.deadline.saturating_since(now).as_secs_f64();
            Err(Refusal::LeaseRequired { remaining_s })
        }
    }
}

fn remaining_ms(deadline: MonoTime, stale: bool, now: MonoTime) -> u64 {
    let left = if stale { 0 } else { deadline.saturating_since(now).as_millis() };
    u64::try_from(left).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests;
