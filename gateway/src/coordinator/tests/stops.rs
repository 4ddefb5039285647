//! Stops and resets of the cell.

use armada_protocol::messages::{
    ActionStatus, CellResetParams, CellVerdict, DenialCode, EventKind, ResetNeeds, ResetParams,
    RobotInfo, Severity, StopLatch, StopLevel, StopReport, StopRequest, StopScope, StopStage,
    StopVerdict,
};

use uuid::Uuid;

use super::bench::{Bench, Fate, ms, name, stop_request};
use crate::coordinator::{Action, AgentCall, CellAnswer, CellRequest, Input, Ticket};

fn report(bench: &Bench, ticket: Ticket) -> &StopReport {
    match bench.answer(ticket) {
        CellAnswer::Stopped(report) => report,
        other => panic!("expected a report, not {other:?}"),
    }
}

fn stop(bench: &mut Bench, id: u128, scope: StopScope) -> Ticket {
    bench.request(CellRequest::Stop(stop_request(id, scope)))
}

#[test]
fn the_stop_is_published_before_anything_else_is_done() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    let before = bench.actions.len();
    stop(&mut bench, 9, StopScope::Cell);
    let done: Vec<_> = bench.actions[before..].iter().map(|(_, action)| action).collect();
    assert!(matches!(done[0], Action::PublishStop(_)), "{done:?}");
    for action in &done[1..=3] {
        assert!(matches!(action, Action::Ask { call: AgentCall::Stop(_), .. }), "{action:?}");
    }
}

#[test]
fn the_verdict_is_complete_when_every_robot_is_measured_to_stand() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    let ticket = stop(&mut bench, 9, StopScope::Cell);
    bench.run(ms(150));
    assert!(bench.answers(ticket).is_empty(), "received is not standing still");
    bench.run(ms(100));
    let report = report(&bench, ticket);
    assert_eq!(report.verdict, StopVerdict::Complete);
    assert!(report.missing.is_empty());
    assert_eq!(report.acks.len(), 3);
    assert!(report.acks.iter().all(|ack| ack.stage == StopStage::Standstill));
    bench.run(ms(100));
    assert_eq!(bench.last_motion(1).status, ActionStatus::Failed);
    assert_eq!(bench.status().verdict, CellVerdict::Stopped);
}

#[test]
fn a_robot_that_never_answers_makes_it_incomplete_by_name_at_the_deadline() {
    let mut bench = Bench::new();
    bench.agents.remove(&name("right"));
    let ticket = stop(&mut bench, 9, StopScope::Cell);
    bench.run(ms(3_990));
    assert!(bench.answers(ticket).is_empty());
    bench.run(ms(20));
    let report = report(&bench, ticket);
    assert_eq!(report.verdict, StopVerdict::Incomplete);
    assert_eq!(report.missing, [name("right")]);
    assert_eq!(report.acks.len(), 2);
    let asked = bench.asked("right").filter(|(_, call)| matches!(call, AgentCall::Stop(_))).count();
    assert!(asked >= 3, "it was asked {asked} times only");
    let last = bench.events().filter(|event| event.kind == EventKind::Stop).last();
    assert_eq!(last.expect("an event").severity, Severity::Error);
}

#[test]
fn the_stop_is_repeated_until_every_robot_has_it() {
    let mut bench = Bench::new();
    bench.agents.remove(&name("right"));
    stop(&mut bench, 9, StopScope::Cell);
    bench.run(ms(495));
    let sent = |bench: &Bench| -> Vec<u64> {
        let stops = bench.actions.iter().filter_map(|(_, action)| match action {
            Action::PublishStop(request) => Some(request.seq),
            _ => None,
        });
        stops.collect()
    };
    let seqs = sent(&bench);
    assert!((48..=51).contains(&seqs.len()), "{} repetitions in 495 ms", seqs.len());
    assert!(seqs.windows(2).all(|pair| pair[1] == pair[0] + 1), "{seqs:?}");
    // It comes back, and hears the next one.
    bench.appear("right", 100);
    bench.run(ms(1_000));
    let after = sent(&bench).len();
    bench.run(ms(1_000));
    assert_eq!(sent(&bench).len(), after, "all have it");
}

#[test]
fn robots_that_are_not_in_scope_are_left_alone() {
    let mut bench = Bench::new();
    let ticket = stop(&mut bench, 9, StopScope::Robots(vec![name("left")]));
    bench.run(ms(400));
    assert_eq!(report(&bench, ticket).verdict, StopVerdict::Complete);
    assert!(!bench.asked("right").any(|(_, call)| matches!(call, AgentCall::Stop(_))));
    assert!(bench.agent("right").status.stop.is_none());
}

#[test]
fn a_stop_of_robots_that_do_not_exist_is_never_complete() {
    let mut bench = Bench::new();
    let ticket = stop(&mut bench, 9, StopScope::Robots(vec![name("left"), name("nobody")]));
    bench.run(ms(4_100));
    let report_ = report(&bench, ticket);
    assert_eq!(report_.verdict, StopVerdict::Incomplete);
    assert_eq!(report_.missing, [name("nobody")]);
    let ticket = stop(&mut bench, 10, StopScope::Robots(Vec::new()));
    bench.run(ms(4_100));
    assert_eq!(report(&bench, ticket).verdict, StopVerdict::Incomplete);
}

#[test]
fn the_same_stop_asked_for_twice_answers_both() {
    let mut bench = Bench::new();
    let first = stop(&mut bench, 9, StopScope::Cell);
    let second = stop(&mut bench, 9, StopScope::Cell);
    bench.run(ms(400));
    assert_eq!(report(&bench, first), report(&bench, second));
}

#[test]
fn no_motion_begins_while_a_stop_is_in_progress() {
    let mut bench = Bench::new();
    bench.agents.remove(&name("torso"));
    stop(&mut bench, 9, StopScope::Cell);
    bench.run(ms(1_000));
    let ticket = bench.execute(1, &["left", "right"]);
    assert_eq!(bench.denial(ticket).code, DenialCode::Stopped);
}

/// Resets of these robots, of what their agents have latched.
fn shown(bench: &mut Bench, robots: &[&str]) -> CellRequest {
    let reset = |robot: &&str| {
        let agent = bench.agents.get(&name(robot));
        let latch = agent.and_then(|agent| agent.status.stop.as_ref());
        let nothing = ResetParams { stop_ids: vec![], nonce: Uuid::nil(), signature: None };
        (name(robot), latch.map_or(nothing, StopLatch::reset_params))
    };
    CellRequest::Reset(CellResetParams { resets: robots.iter().map(reset).collect() })
}

#[test]
fn a_reset_clears_what_was_shown_of_each_robot_and_nothing_else() {
    let mut bench = Bench::new();
    stop(&mut bench, 9, StopScope::Cell);
    stop(&mut bench, 10, StopScope::Robots(vec![name("left")]));
    bench.run(ms(1_000));
    let late = shown(&mut bench, &["right"]);
    stop(&mut bench, 11, StopScope::Robots(vec![name("right")]));
    bench.run(ms(100));
    let ticket = bench.request(late);
    bench.run(ms(100));
    let CellAnswer::Reset(answer) = bench.answer(ticket) else { panic!("a reset") };
    assert!(answer.reset.is_empty() && answer.refused.len() == 1, "a stop came since: {answer:?}");
    assert!(bench.agent("right").status.stop.is_some());
    let all = shown(&mut bench, &["left", "right", "torso"]);
    bench.vanish("torso");
    let ticket = bench.request(all);
    bench.run(ms(100));
    let CellAnswer::Reset(answer) = bench.answer(ticket) else { panic!("a reset") };
    let cleared: Vec<_> =
        answer.reset.iter().map(|(robot, ids)| (robot.as_str(), ids.len())).collect();
    assert_eq!(cleared, [("left", 2), ("right", 2)]);
    let (robot, denial) = &answer.refused[0];
    assert_eq!((robot.as_str(), denial.code), ("torso", DenialCode::Unreachable));
    assert!(bench.agent("left").status.stop.is_none());
    let ticket = bench.execute(1, &["left", "right"]);
    bench.run(ms(500));
    bench.answer(ticket);
}

#[test]
fn a_reset_reports_per_robot_what_went_wrong() {
    let mut bench = Bench::new();
    let now = bench.now;
    bench.agent("left").stop(&stop_request(3, StopScope::Cell), now);
    let all = shown(&mut bench, &["left", "right", "torso", "nobody"]);
    bench.agents.remove(&name("right"));
    let ticket = bench.request(all);
    bench.run(ms(2_100));
    let CellAnswer::Reset(answer) = bench.answer(ticket) else { panic!("a reset") };
    let cleared: Vec<_> =
        answer.reset.iter().map(|(robot, ids)| (robot.as_str(), ids.len())).collect();
    assert_eq!(cleared, [("left", 1), ("torso", 0)]);
    let refused: Vec<_> =
        answer.refused.iter().map(|(robot, denial)| (robot.as_str(), denial.code)).collect();
    assert_eq!(refused, [("nobody", DenialCode::InvalidArgument), ("right", DenialCode::Timeout)]);
}

#[test]
fn a_stop_works_when_half_of_the_messages_are_lost() {
    let mut bench = Bench::new();
    bench.fates = vec![Fate::Lost, Fate::Arrives(3), Fate::Arrives(40), Fate::Lost];
    let ticket = stop(&mut bench, 9, StopScope::Cell);
    bench.run(ms(4_100));
    assert_eq!(bench.answers(ticket).len(), 1);
    for robot in ["left", "right", "torso"] {
        assert!(bench.agent(robot).status.stop.is_some(), "{robot}");
    }
}

fn stops_of(bench: &Bench, robot: &str) -> Vec<StopRequest> {
    let asked = bench.asked(robot).filter_map(|(_, call)| match call {
        AgentCall::Stop(request) => Some(request.clone()),
        _ => None,
    });
    asked.collect()
}

#[test]
fn a_robot_that_does_not_come_to_rest_in_time_is_stopped_harder_and_others_are_not() {
    let mut bench = Bench::new();
    bench.agent("right").deaf_below = Some(StopLevel::L1);
    bench.agent("torso").deaf_below = Some(StopLevel::L0);
    let ticket = stop(&mut bench, 9, StopScope::Cell);
    bench.run(ms(1_490));
    assert_eq!(stops_of(&bench, "right").len(), 1);
    bench.run(ms(2_400));
    let report = report(&bench, ticket);
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:?}");
    let levels = |robot| {
        let stops = stops_of(&bench, robot);
        assert!(stops.iter().all(|stop| stop.stop_id == Uuid::from_u128(9)), "one stop");
        stops.iter().map(|stop| stop.level).collect::<Vec<_>>()
    };
    assert_eq!(levels("left"), [StopLevel::L2]);
    assert_eq!(levels("right"), [StopLevel::L2, StopLevel::L1]);
    assert_eq!(levels("torso"), [StopLevel::L2, StopLevel::L1, StopLevel::L0]);
    let raised = bench.actions.iter().filter_map(|(_, action)| match action {
        Action::PublishStop(request) if request.level > StopLevel::L2 => Some(request),
        _ => None,
    });
    for request in raised {
        assert!(!request.scope.includes(&name("left")), "{request:?}");
    }
    let event = bench.events().find(|event| event.message.contains("raised: right, torso"));
    assert_eq!(event.expect("told").severity, Severity::Error);
}

#[test]
fn a_robot_that_declares_a_long_stop_time_is_given_it() {
    let mut bench = Bench::new();
    let info = RobotInfo { stop_time_s: 2.0, ..bench.agent("torso").info.clone() };
    bench.feed(Input::Info(Box::new(info)));
    for robot in ["right", "torso"] {
        bench.agent(robot).deaf_below = Some(StopLevel::L1);
    }
    stop(&mut bench, 9, StopScope::Cell);
    let levels = |bench: &Bench, robot| stops_of(bench, robot).last().map(|stop| stop.level);
    bench.run(ms(1_600));
    assert_eq!(levels(&bench, "right"), Some(StopLevel::L1));
    bench.run(ms(600));
    assert_eq!(levels(&bench, "torso"), Some(StopLevel::L2), "it has 2 s, and the ways");
    bench.run(ms(200));
    assert_eq!(levels(&bench, "torso"), Some(StopLevel::L1));
}

#[test]
fn a_level_never_falls_and_l0_is_not_raised() {
    let mut bench = Bench::new();
    bench.agents.remove(&name("right"));
    let request = StopRequest { level: StopLevel::L0, ..stop_request(9, StopScope::Cell) };
    bench.request(CellRequest::Stop(request));
    bench.run(ms(4_100));
    let published = bench.actions.iter().filter_map(|(_, action)| match action {
        Action::PublishStop(request) => Some(request.level),
        _ => None,
    });
    assert!(published.into_iter().all(|level| level == StopLevel::L0));
}

#[test]
fn a_reset_passes_on_numbers_and_signatures() {
    let mut bench = Bench::new();
    stop(&mut bench, 9, StopScope::Cell);
    bench.run(ms(1_000));
    let nonce = Uuid::from_u128(77);
    let latch = bench.agent("left").status.stop.as_mut().expect("latched");
    latch.reset = ResetNeeds { nonce, signed: true, ..ResetNeeds::default() };
    let own =
        ResetParams { stop_ids: vec![Uuid::from_u128(9)], nonce, signature: Some("ab".repeat(32)) };
    let params = CellResetParams { resets: [(name("left"), own.clone())].into() };
    let ticket = bench.request(CellRequest::Reset(params));
    bench.run(ms(100));
    let CellAnswer::Reset(answer) = bench.answer(ticket) else { panic!("a reset") };
    assert_eq!(answer.reset.len(), 1, "{answer:?}");
    assert!(bench.asked("left").any(|(_, call)| *call == AgentCall::Reset(Box::new(own.clone()))));
    assert!(bench.agent("right").status.stop.is_some(), "who is not named is not touched");
}
