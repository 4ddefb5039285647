//! Whatever is lost, late, doubled or out of order, and whatever happens in between.

use std::collections::{BTreeMap, BTreeSet};

use armada_protocol::messages::{
    ActionStatus, CellAcquireLeaseParams, CellResetParams, Denial, DenialCode, StopScope,
};
use proptest::prelude::*;
use uuid::Uuid;

use super::bench::{Bench, Fate, ms, name, stop_request};
use crate::coordinator::{Action, AgentAnswer, AgentCall, CellRequest, Control, Input, Ticket};

const ROBOTS: [&str; 3] = ["left", "right", "torso"];

#[derive(Clone, Debug)]
enum Op {
    Execute(Vec<&'static str>),
    ControlLast(Control),
    Acquire(Vec<&'static str>),
    LoseSight(&'static str),
    CancelLast,
    Stop,
    HearStop(&'static str),
    Reset,
    Die(&'static str),
    Restart(&'static str),
    Fault(&'static str),
    RefusePrepare(&'static str),
    RefuseCommit(&'static str),
}

fn robot() -> impl Strategy<Value = &'static str> {
    prop::sample::select(&ROBOTS[..])
}

fn op() -> impl Strategy<Value = Op> {
    prop_oneof![
        8 => prop::sample::subsequence(&ROBOTS[..], 1..=3).prop_map(Op::Execute),
        2 => Just(Op::CancelLast),
        1 => Just(Op::ControlLast(Control::Pause)),
        2 => Just(Op::ControlLast(Control::Resume)),
        1 => Just(Op::ControlLast(Control::SpeedRatio(0.5))),
        1 => prop::sample::subsequence(&ROBOTS[..], 0..=2).prop_map(Op::Acquire),
        1 => robot().prop_map(Op::LoseSight),
        1 => Just(Op::Stop),
        1 => robot().prop_map(Op::HearStop),
        3 => Just(Op::Reset),
        1 => robot().prop_map(Op::Die),
        2 => robot().prop_map(Op::Restart),
        2 => robot().prop_map(Op::Fault),
        1 => robot().prop_map(Op::RefusePrepare),
        1 => robot().prop_map(Op::RefuseCommit),
    ]
}

fn fate() -> impl Strategy<Value = Fate> {
    prop_oneof![
        20 => (0..15_u64).prop_map(Fate::Arrives),
        2 => (0..15_u64, 0..400_u64).prop_map(|(first, second)| Fate::Twice(first, second)),
        1 => (100..600_u64).prop_map(Fate::Arrives),
        1 => Just(Fate::Lost),
    ]
}

/// A reset of all that is latched.
fn shown(bench: &Bench) -> CellResetParams {
    let stopped = bench.agents.iter().filter_map(|(robot, agent)| {
        Some((robot.clone(), agent.status.stop.as_ref()?.reset_params()))
    });
    CellResetParams { resets: stopped.collect() }
}

/// Plays the script; returns the bench with the tickets, all quiet at its end.
fn play(script: Vec<(Op, u64)>, fates: Vec<Fate>) -> (Bench, Vec<Ticket>) {
    let mut bench = Bench::new();
    bench.fates = fates;
    let mut tickets = Vec::new();
    let mut next = 1_000;
    for (op, pause) in script {
        next += 1;
        let now = bench.now;
        match op {
            Op::Execute(robots) => tickets.push(bench.execute(next, &robots)),
            Op::CancelLast => {
                let motion_id = Uuid::from_u128(next - 1);
                tickets.push(bench.request(CellRequest::Cancel { motion_id }));
            }
            Op::ControlLast(control) => {
                let motion_id = Uuid::from_u128(next - 1);
                let request = CellRequest::Control { motion_id, lease: None, control };
                tickets.push(bench.request(request));
            }
            Op::Acquire(robots) => {
                let robots = robots.into_iter().map(name).collect();
                let params =
                    CellAcquireLeaseParams { robots, ttl_ms: 700, role: Default::default() };
                tickets.push(bench.request(CellRequest::AcquireLease(params)));
            }
            Op::LoseSight(robot) => {
                bench.feed(Input::Presence { robot: name(robot), online: false });
                bench.run(ms(200));
                let online = bench.agents.contains_key(&name(robot));
                bench.feed(Input::Presence { robot: name(robot), online });
            }
            Op::Stop => {
                let stop = stop_request(next, StopScope::Cell);
                tickets.push(bench.request(CellRequest::Stop(stop)));
            }
            Op::HearStop(robot) => {
                let request = stop_request(next, StopScope::Robots(vec![name(robot)]));
                if let Some(agent) = bench.agents.get_mut(&name(robot)) {
                    agent.stop(&request, now);
                }
                bench.feed(Input::CellStop(request));
            }
            Op::Reset => {
                let request = CellRequest::Reset(shown(&bench));
                tickets.push(bench.request(request));
            }
            Op::Die(robot) => bench.vanish(robot),
            Op::Restart(robot) => bench.appear(robot, next),
            Op::Fault(robot) => {
                if let Some(agent) = bench.agents.get_mut(&name(robot)) {
                    agent.fault(now);
                }
            }
            Op::RefusePrepare(robot) => {
                if let Some(agent) = bench.agents.get_mut(&name(robot)) {
                    let denial = Denial::new(DenialCode::OutOfRange, "beyond its limit");
                    agent.refuse_prepare = Some(denial);
                }
            }
            Op::RefuseCommit(robot) => {
                if let Some(agent) = bench.agents.get_mut(&name(robot)) {
                    let denial = Denial::new(DenialCode::LeaseStale, "epoch is over");
                    agent.refuse_commit = Some(denial);
                }
            }
        }
        bench.run(ms(pause));
    }
    bench.run(ms(15_000));
    // What is paused never ends by itself; everything else has.
    let paused: Vec<_> = (1_001..=next)
        .filter(|&id| bench.motion(id).last().is_some_and(|m| m.status == ActionStatus::Paused))
        .collect();
    for id in paused {
        let motion_id = Uuid::from_u128(id);
        tickets.push(bench.request(CellRequest::Cancel { motion_id }));
    }
    bench.run(ms(15_000));
    (bench, tickets)
}

/// Nothing is committed before all is prepared; statuses have no gap and one end, after which
/// every part was aborted or ended by itself; a refused motion is left with nobody.
fn check_motions(bench: &Bench) {
    let mut asked: BTreeMap<_, (String, AgentCall)> = BTreeMap::new();
    let mut prepared: BTreeMap<Uuid, BTreeSet<String>> = BTreeMap::new();
    let mut wanted: BTreeMap<Uuid, BTreeSet<String>> = BTreeMap::new();
    // By us, or ended by themselves.
    let mut aborted: BTreeMap<Uuid, BTreeSet<String>> = BTreeMap::new();
    let mut last: BTreeMap<Uuid, _> = BTreeMap::new();
    let mut accepted = BTreeSet::new();
    // Robots whose agents died or were restarted hold nothing any more.
    let mut gone: BTreeSet<String> = BTreeSet::new();
    // Inputs and actions in the order in which they happened.
    for entry in bench.history() {
        match entry {
            Ok(Input::Answer { ask, result: Ok(AgentAnswer::Prepared(answer)) }) => {
                // A second answer to the same question says nothing new.
                if let Some((robot, _)) = asked.remove(ask) {
                    // An abort before this answer may have overtaken the question.
                    aborted.entry(answer.motion_id).or_default().remove(&robot);
                    prepared.entry(answer.motion_id).or_default().insert(robot);
                }
            }
            Ok(Input::Motion(status)) if status.status.is_terminal() => {
                aborted.entry(status.id).or_default().insert(status.robot.to_string());
            }
            Ok(Input::Presence { robot, .. }) if !wanted.is_empty() => {
                gone.insert(robot.to_string());
            }
            Ok(_) => {}
            Err(Action::Ask { ask, robot, call, .. }) => {
                asked.insert(*ask, (robot.to_string(), call.clone()));
                match call {
                    AgentCall::Prepare(params) => {
                        let id = params.motion_id.expect("given");
                        wanted.entry(id).or_default().insert(robot.to_string());
                    }
                    AgentCall::Commit(params) => {
                        let id = params.motion_id;
                        assert_eq!(prepared[&id], wanted[&id], "committed before all prepared");
                    }
                    AgentCall::Abort(id) => {
                        aborted.entry(*id).or_default().insert(robot.to_string());
                    }
                    _ => {}
                }
            }
            Err(Action::PublishMotion(status)) => {
                accepted.insert(status.id);
                let before: Option<&(ActionStatus, u64)> = last.get(&status.id);
                let seqno = before.map_or(0, |(_, seqno)| seqno + 1);
                assert_eq!(status.seqno, seqno, "gap in the statuses of a motion");
                let ended = before.is_some_and(|(status, _)| status.is_terminal());
                assert!(!ended, "a status after the terminal one");
                if matches!(status.status, ActionStatus::Failed | ActionStatus::Cancelled) {
                    for (robot, part) in &status.parts {
                        assert!(part.status.is_terminal(), "{robot} is not settled");
                        let reached = aborted.get(&status.id);
                        let own_end =
                            part.reason.is_some() || part.status == ActionStatus::Complete;
                        let reached = reached.is_some_and(|robots| robots.contains(robot.as_str()));
                        assert!(reached || own_end, "{robot} was neither aborted nor ended");
                    }
                }
                last.insert(status.id, (status.status, status.seqno));
            }
            Err(_) => {}
        }
    }
    for (id, (status, _)) in last {
        assert!(status.is_terminal(), "motion {id} never ended");
    }
    for (id, robots) in &wanted {
        if !accepted.contains(id) {
            let mut reached = aborted.get(id).cloned().unwrap_or_default();
            reached.extend(gone.iter().cloned());
            let held = prepared.get(id).cloned().unwrap_or_default();
            let left: Vec<_> = held.difference(&reached).collect();
            assert!(left.is_empty(), "{left:?} of {robots:?} still hold motion {id}");
        }
    }
}

fn check_numbers(bench: &Bench) {
    for (expected, event) in (0..).zip(bench.events()) {
        assert_eq!(event.seqno, expected, "gap in the events");
    }
    for (expected, (_, status)) in (0..).zip(bench.statuses()) {
        assert_eq!(status.seqno, expected, "gap in the cell's statuses");
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        rng_seed: proptest::test_runner::RngSeed::Fixed(0x0A12_3ADA),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn whatever_happens_every_promise_is_kept(
        script in prop::collection::vec((op(), 0..1_500_u64), 1..14),
        fates in prop::collection::vec(fate(), 1..40),
    ) {
        let (bench, tickets) = play(script, fates);
        for ticket in tickets {
            prop_assert_eq!(bench.answers(ticket).len(), 1, "{:?}", ticket);
        }
        check_motions(&bench);
        check_numbers(&bench);
        prop_assert!(bench.is_idle(), "something is still in progress");
    }
}
