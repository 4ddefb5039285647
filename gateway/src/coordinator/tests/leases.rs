//! Leases of several robots: all or none, whatever is lost.

use armada_protocol::RobotName;
use armada_protocol::messages::{CellAcquireLeaseParams, CellLeaseParams, DenialCode, GroupLease};
use proptest::prelude::*;
use uuid::Uuid;

use super::bench::{Bench, Fate, ms, name};
use crate::coordinator::{AgentCall, CellAnswer, CellRequest, Ticket};

const ROBOTS: [&str; 3] = ["left", "right", "torso"];

fn acquire(bench: &mut Bench, client: &str, robots: &[&str], ttl_ms: u64) -> Ticket {
    let robots = robots.iter().copied().map(name).collect();
    let params = CellAcquireLeaseParams { robots, ttl_ms, role: Default::default() };
    bench.request_of(client, CellRequest::AcquireLease(params))
}

fn leases(granted: &GroupLease) -> CellLeaseParams {
    let leases = granted.leases.iter().map(|(robot, grant)| (robot.clone(), grant.lease));
    CellLeaseParams { leases: leases.collect() }
}

fn granted(bench: &Bench, ticket: Ticket) -> GroupLease {
    let CellAnswer::Lease(granted) = bench.answer(ticket) else { panic!("a lease") };
    granted.clone()
}

fn holders(bench: &Bench) -> Vec<(RobotName, String)> {
    let held = bench
        .agents
        .iter()
        .filter_map(|(robot, agent)| Some((robot.clone(), agent.holder(bench.now)?.to_owned())));
    held.collect()
}

#[test]
fn robots_are_asked_in_their_order_for_a_short_time_and_then_renewed() {
    let mut bench = Bench::new();
    let ticket = acquire(&mut bench, "a", &["torso", "left", "right"], 5_000);
    bench.run(ms(100));
    let granted = granted(&bench, ticket);
    assert_eq!(granted.leases.len(), 3);
    assert!(granted.leases.values().all(|grant| grant.ttl_ms == 5_000));
    let asked = |robot| {
        let acquires = bench.asked(robot).filter_map(|(at, call)| match call {
            AgentCall::AcquireLease(params) => Some((at, params.ttl_ms)),
            _ => None,
        });
        acquires.collect::<Vec<_>>()
    };
    let [[left], [right], [torso]] =
        ROBOTS.map(|robot| <[_; 1]>::try_from(asked(robot)).expect("one"));
    assert!(left.0 < right.0 && right.0 < torso.0, "in the order of their names");
    assert!([left, right, torso].iter().all(|(_, ttl_ms)| *ttl_ms == 500));
    bench.run(ms(3_000));
    assert_eq!(holders(&bench).len(), 3);
}

#[test]
fn one_refusal_gives_all_back_and_names_who_refused() {
    let mut bench = Bench::new();
    acquire(&mut bench, "b", &["right"], 20_000);
    bench.run(ms(100));
    let ticket = acquire(&mut bench, "a", &[], 5_000);
    bench.run(ms(100));
    let denial = bench.denial(ticket);
    assert_eq!(denial.code, DenialCode::LeaseRequired);
    assert_eq!(denial.message, "right: driven by b");
    assert_eq!(holders(&bench), [(name("right"), "b".to_owned())]);
    assert!(!bench.asked("torso").any(|(_, call)| matches!(call, AgentCall::AcquireLease(_))));
}

#[test]
fn a_robot_that_is_silent_gives_all_back_in_time() {
    let mut bench = Bench::new();
    bench.agents.remove(&name("torso"));
    let ticket = acquire(&mut bench, "a", &[], 5_000);
    bench.run(ms(500));
    let denial = bench.denial(ticket);
    assert_eq!((denial.code, &denial.details["robot"]), (DenialCode::Timeout, &"torso".into()));
    assert!(holders(&bench).is_empty());
}

#[test]
fn a_lost_renewal_is_asked_for_again() {
    let mut bench = Bench::new();
    let ticket = acquire(&mut bench, "a", &["left", "right"], 5_000);
    while !bench.asked("left").any(|(_, call)| matches!(call, AgentCall::RenewLease(_))) {
        bench.run(ms(1));
    }
    // The questions get through, the answers do not.
    bench.fates = vec![Fate::Lost];
    bench.run(ms(10));
    bench.fates = vec![Fate::Arrives(1)];
    bench.run(ms(600));
    assert_eq!(granted(&bench, ticket).leases.len(), 2);
}

#[test]
fn one_renewal_keeps_all_and_names_what_is_lost() {
    let mut bench = Bench::new();
    let ticket = acquire(&mut bench, "a", &["left", "right"], 1_000);
    bench.run(ms(100));
    let params = leases(&granted(&bench, ticket));
    bench.run(ms(700));
    let ticket = bench.request_of("a", CellRequest::RenewLease(params.clone()));
    bench.run(ms(700));
    assert_eq!(granted(&bench, ticket).leases.len(), 2);
    assert_eq!(holders(&bench).len(), 2);
    bench.agent("right").lease = None;
    let ticket = bench.request_of("a", CellRequest::RenewLease(params));
    bench.run(ms(100));
    let denial = bench.denial(ticket);
    assert_eq!(denial.code, DenialCode::LeaseStale);
    assert_eq!(
        (&denial.details["refused"][0], &denial.details["renewed"][0]),
        (&"right".into(), &"left".into())
    );
}

#[test]
fn a_release_says_what_was_given_back_and_what_not() {
    let mut bench = Bench::new();
    let ticket = acquire(&mut bench, "a", &["left", "right"], 5_000);
    bench.run(ms(100));
    let params = leases(&granted(&bench, ticket));
    bench.agent("right").lease = None;
    let ticket = bench.request_of("a", CellRequest::ReleaseLease(params));
    bench.run(ms(100));
    let CellAnswer::LeaseReleased(answer) = bench.answer(ticket) else { panic!("released") };
    assert_eq!(answer.released, [name("left")]);
    assert_eq!(
        (answer.refused[0].0.as_str(), answer.refused[0].1.code),
        ("right", DenialCode::LeaseStale)
    );
    assert!(holders(&bench).is_empty());
}

#[test]
fn what_makes_no_sense_is_refused_before_anybody_is_asked() {
    let mut bench = Bench::new();
    bench.vanish("torso");
    let before = bench.actions.len();
    let ticket = acquire(&mut bench, "a", &["nobody"], 5_000);
    assert_eq!(bench.denial(ticket).code, DenialCode::InvalidArgument);
    let ticket = acquire(&mut bench, "a", &[], 5_000);
    assert_eq!(bench.denial(ticket).code, DenialCode::Unreachable);
    for ttl_ms in [199, 60_001] {
        let ticket = acquire(&mut bench, "a", &["left"], ttl_ms);
        assert_eq!(bench.denial(ticket).code, DenialCode::OutOfRange);
    }
    let none = CellLeaseParams { leases: Default::default() };
    let ticket = bench.request_of("a", CellRequest::RenewLease(none));
    assert_eq!(bench.denial(ticket).details["field"], "leases");
    let stranger = CellLeaseParams { leases: [(name("nobody"), Uuid::nil())].into() };
    let ticket = bench.request_of("a", CellRequest::ReleaseLease(stranger));
    assert_eq!(bench.denial(ticket).code, DenialCode::InvalidArgument);
    let asked = bench.actions[before..].iter().any(|(_, action)| {
        matches!(action, crate::coordinator::Action::Ask { call: AgentCall::AcquireLease(_), .. })
    });
    assert!(!asked);
}

fn fate() -> impl Strategy<Value = Fate> {
    prop_oneof![
        12 => (0..15_u64).prop_map(Fate::Arrives),
        3 => (0..15_u64, 0..400_u64).prop_map(|(first, second)| Fate::Twice(first, second)),
        2 => (100..700_u64).prop_map(Fate::Arrives),
        3 => Just(Fate::Lost),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 400,
        rng_seed: proptest::test_runner::RngSeed::Fixed(0x0A12_3ADB),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Two clients want leases of the same robots at once, round after round.
    #[test]
    fn all_or_none_are_held_whatever_is_lost_late_or_doubled(
        rounds in prop::collection::vec(
            (
                prop::sample::subsequence(&ROBOTS[..], 1..=3),
                prop::sample::subsequence(&ROBOTS[..], 1..=3),
                0..30_u64,
            ),
            1..5,
        ),
        fates in prop::collection::vec(fate(), 1..60),
    ) {
        let mut bench = Bench::new();
        for (first, second, pause) in rounds {
            bench.fates.clone_from(&fates);
            let mut wanted = vec![("a", first)];
            let mut tickets = vec![acquire(&mut bench, "a", &wanted[0].1, 60_000)];
            bench.run(ms(pause));
            tickets.push(acquire(&mut bench, "b", &second, 60_000));
            wanted.push(("b", second));
            // Longer than any of the timers, and than a provisional lease lasts.
            bench.run(ms(7_000));
            let mut unreleased = Vec::new();
            for (ticket, (client, robots)) in tickets.iter().zip(&wanted) {
                let answers = bench.answers(*ticket);
                prop_assert_eq!(answers.len(), 1);
                match answers[0] {
                    Ok(CellAnswer::Lease(granted)) => {
                        prop_assert_eq!(granted.leases.len(), robots.len());
                        for (robot, grant) in &granted.leases {
                            prop_assert_eq!(grant.ttl_ms, 60_000);
                            let held = bench.agents[robot].lease.as_ref();
                            let (lease, holder, _) = held.expect("held");
                            prop_assert_eq!((*lease, holder.as_str()), (grant.lease, *client));
                        }
                    }
                    Ok(other) => prop_assert!(false, "{:?}", other),
                    Err(denial) => {
                        let named = denial.details.get("unreleased").and_then(|v| v.as_array());
                        let named = named.into_iter().flatten().filter_map(|v| v.as_str());
                        unreleased.extend(named.map(|robot| (name(robot), (*client).to_owned())));
                    }
                }
            }
            for (robot, holder) in holders(&bench) {
                let (client, robots) = wanted.iter().find(|(client, _)| *client == holder).expect("one");
                let index = usize::from(*client == "b");
                let got_it = bench.answers(tickets[index])[0].is_ok();
                prop_assert!(
                    (got_it && robots.contains(&robot.as_str()))
                        || unreleased.contains(&(robot.clone(), holder.clone())),
                    "{} is left with {}", robot, holder
                );
            }
            // The next round begins with nobody holding anything.
            bench.fates = vec![Fate::Arrives(1)];
            bench.agents.values_mut().for_each(|agent| agent.lease = None);
        }
        bench.run(ms(5_000));
        prop_assert!(bench.is_idle());
    }
}
