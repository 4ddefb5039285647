//! Names, and the words of the audit trail.

use std::time::Duration;

use armada_protocol::messages::AuthorityState;

use super::*;
use crate::control::{Input, LoopState, Params, step};

const NOW: MonoTime = MonoTime::from_nanos(1_000_000_000);

fn holder(name: &str) -> Holder {
    let (role, scope) = (Role::Program, LeaseScope::Arm);
    Holder { name: name.to_owned(), ttl_ms: 500, role, scope, reason: None }
}

/// A robot of which nothing is known.
fn snapshot() -> Snapshot {
    let limits = vec![armada_model::JointLimits {
        lower: Some(-1.0),
        upper: Some(1.0),
        velocity: 1.0,
        acceleration: Some(1.0),
        ..Default::default()
    }];
    let params = Params::for_joints(limits, Duration::from_millis(2)).expect("one joint");
    let mut state = LoopState::new(&params).expect("sensible parameters");
    step(&params, &mut state, &mut Input::at(NOW)).snapshot
}

fn held_by(lease: Uuid) -> LeaseReport {
    let deadline = NOW + Duration::from_millis(320);
    LeaseReport { lease, role: Role::Program, deadline, stale: false }
}

fn sub_lease(lease: Uuid, scope: LeaseScope) -> DelegateReport {
    let deadline = NOW + Duration::from_millis(100);
    DelegateReport { lease, scope, deadline, stale: false }
}

#[test]
fn a_lease_is_told_with_its_holder_its_time_and_its_delegates() {
    let mut leases = Leases::default();
    let [lease, sub] = [1, 2].map(Uuid::from_u128);
    leases.announce(lease, holder("planner"));
    let news = leases.take(NOW, LeaseChange::Granted(lease), &snapshot());
    assert_eq!(news.message, "lease granted to planner");
    leases.announce(sub, Holder { scope: LeaseScope::Io, ..holder("panel") });
    let news = leases.take(NOW, LeaseChange::Delegated(sub), &snapshot());
    assert_eq!(news.message, "planner lets panel command (io)");
    let (report, subs) = (held_by(lease), [Some(sub_lease(sub, LeaseScope::Io)), None]);
    let told = leases.lease(&report, &subs, NOW);
    assert_eq!((told.holder.as_str(), told.remaining_ms, told.stale), ("planner", 320, false));
    let delegate = told.delegates.first().expect("one");
    assert_eq!((delegate.holder.as_str(), delegate.remaining_ms), ("panel", 100));
    let stale = leases.lease(&LeaseReport { stale: true, ..report }, &subs, NOW);
    assert_eq!((stale.remaining_ms, stale.stale), (0, true));
    assert_eq!(stale.delegates.first().map(|sub| sub.remaining_ms), Some(0), "with its lease");
}

#[test]
fn a_lease_that_was_taken_is_told_with_who_from_whom_and_why() {
    let mut leases = Leases::default();
    let [planner, anna] = [1, 2].map(Uuid::from_u128);
    leases.announce(planner, holder("planner"));
    leases.take(NOW, LeaseChange::Granted(planner), &snapshot());
    let reason = Some("planner hangs".to_owned());
    leases.announce(anna, Holder { role: Role::Operator, reason, ..holder("anna") });
    let later = NOW + Duration::from_secs(1);
    let taken = LeaseChange::Taken { lease: anna, from: planner };
    let news = leases.take(later, taken, &snapshot());
    assert_eq!(news.message, "lease of planner taken by anna (operator): \"planner hangs\"");
    for (name, value) in [
        ("change", "taken"),
        ("holder", "anna"),
        ("from", "planner"),
        ("role", "operator"),
        ("reason", "planner hangs"),
    ] {
        assert_eq!(news.details[name], value, "{name}");
    }
    assert_eq!((leases.since(anna), leases.since(planner)), (Some(later), None));
    let report = LeaseReport { role: Role::Operator, ..held_by(anna) };
    let told = leases.lease(&report, &[], NOW);
    assert_eq!((told.role, told.reason.as_deref()), (Role::Operator, Some("planner hangs")));
    assert_eq!(leases.name(planner), "somebody", "forgotten");
}

#[test]
fn leases_that_are_over_are_forgotten_and_those_asked_for_are_not() {
    let mut leases = Leases::default();
    let [first, second, third, sub, old] = [1, 2, 3, 4, 5].map(Uuid::from_u128);
    for (lease, name) in [(first, "a"), (second, "b"), (third, "c"), (sub, "d"), (old, "e")] {
        leases.announce(lease, holder(name));
    }
    let now = snapshot();
    leases.take(NOW, LeaseChange::Granted(first), &now);
    leases.take(NOW, LeaseChange::Expired(first), &now);
    leases.take(NOW, LeaseChange::Granted(second), &now);
    assert_eq!((leases.name(first), leases.name(second)), ("somebody", "b"));
    leases.take(NOW, LeaseChange::Delegated(old), &now);
    leases.take(NOW, LeaseChange::Delegated(sub), &now);
    assert_eq!((leases.name(old), leases.name(sub)), ("somebody", "d"), "one ran out long ago");
    leases.take(NOW, LeaseChange::Released(second), &now);
    assert_eq!((leases.name(second), leases.name(third)), ("somebody", "c"));
    assert_eq!(leases.name(sub), "somebody", "with the lease it was under");
    leases.forget(third);
    assert!(leases.known.is_empty() && leases.granted.is_none() && leases.delegates.is_empty());
}

#[test]
fn who_may_move_the_arm_is_known_before_the_loop_is_asked() {
    let [lease, arm, io] = [1, 2, 3].map(Uuid::from_u128);
    let free = snapshot();
    assert_eq!(check_may_move(&free, None, NOW), Ok(()));
    let mut held = Snapshot { lease: Some(held_by(lease)), ..free };
    held.delegates[0] = Some(sub_lease(arm, LeaseScope::Arm));
    held.delegates[1] = Some(sub_lease(io, LeaseScope::Io));
    let required = Err(Refusal::LeaseRequired { remaining_s: 0.32 });
    let narrow = Refusal::ScopeTooNarrow { scope: LeaseScope::Io, needed: LeaseScope::Arm };
    for (given, expected) in [
        (None, required),
        (Some(Uuid::nil()), required),
        (Some(lease), Ok(())),
        (Some(arm), Ok(())),
        (Some(io), Err(narrow)),
    ] {
        assert_eq!(check_may_move(&held, given, NOW), expected, "{given:?}");
    }
    let local = Snapshot { authority: AuthorityState::Local, ..free };
    assert_eq!(check_may_move(&local, None, NOW), Err(Refusal::LocalControl));
}
