//! Motions of several robots.

use armada_protocol::messages::{ActionStatus, DenialCode, EventKind, StopScope};
use uuid::Uuid;

use super::bench::{Bench, Fate, ms, name, stop_request};
use crate::coordinator::{AgentCall, CellAnswer, CellRequest, Input};

fn is_commit(call: &AgentCall) -> bool {
    matches!(call, AgentCall::Commit(_))
}

fn is_abort(call: &AgentCall) -> bool {
    matches!(call, AgentCall::Abort(_))
}

fn cancel(bench: &mut Bench, id: u128) -> crate::coordinator::Ticket {
    bench.request(CellRequest::Cancel { motion_id: Uuid::from_u128(id) })
}

#[test]
fn all_parts_start_at_one_instant_whatever_their_clocks_say() {
    let mut bench = Bench::new();
    let ticket = bench.execute(1, &["left", "right", "torso"]);
    bench.run(ms(1_000));
    let CellAnswer::Accepted(accepted) = bench.answer(ticket) else { panic!("accepted") };
    assert_eq!((accepted.motion_id, accepted.duration_s), (Uuid::from_u128(1), 2.0));
    let status = bench.last_motion(1);
    assert_eq!(status.status, ActionStatus::Running);
    assert_eq!(status.parts.len(), 3);
    let skew = status.start_skew_ms.expect("all have started");
    assert!(skew < 0.001, "{skew} ms on a network of equal delays");
}

#[test]
fn a_motion_ends_complete_once_and_says_so() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(5_000));
    let terminal: Vec<_> =
        bench.motion(1).into_iter().filter(|status| status.status.is_terminal()).collect();
    assert_eq!(terminal.len(), 1);
    assert_eq!(terminal[0].status, ActionStatus::Complete);
    assert!(terminal[0].parts.values().all(|part| part.status == ActionStatus::Complete));
    let kinds: Vec<_> = bench.events().map(|event| event.kind).collect();
    assert!(kinds.ends_with(&[EventKind::MotionAccepted, EventKind::MotionEnded]), "{kinds:?}");
    assert!(bench.status().motions.is_empty());
}

#[test]
fn the_start_is_as_far_ahead_as_the_timer_or_five_round_trips_say() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(100));
    let lead = |bench: &Bench, index: usize| {
        let offset_ns = bench.agents[&name("left")].offset_ns;
        let mut commits = bench.asked("left").filter(|(_, call)| is_commit(call));
        let (at, call) = commits.nth(index).expect("committed");
        let AgentCall::Commit(params) = call else { unreachable!() };
        params.start_ns.shifted(-offset_ns).saturating_since(at)
    };
    assert_eq!(lead(&bench, 0), ms(150));
    bench.run(ms(3_000));
    bench.fates = vec![Fate::Arrives(25)];
    bench.run(ms(5_000));
    bench.execute(2, &["left", "right"]);
    bench.run(ms(1_000));
    assert_eq!(lead(&bench, 1), ms(250));
}

#[test]
fn robots_in_halt_change_their_mode_and_others_do_not() {
    let mut bench = Bench::new();
    bench.execute(1, &["left"]);
    bench.run(ms(4_000));
    bench.execute(2, &["left", "right"]);
    bench.run(ms(1_000));
    let changes = |robot| {
        bench.asked(robot).filter(|(_, call)| matches!(call, AgentCall::SetMode(_))).count()
    };
    assert_eq!((changes("left"), changes("right")), (1, 1));
}

#[test]
fn one_refusal_aborts_those_that_were_prepared_and_is_the_answer() {
    let mut bench = Bench::new();
    let denial = armada_protocol::messages::Denial::new(DenialCode::OutOfRange, "elbow: 3.5 rad");
    bench.agent("right").refuse_prepare = Some(denial);
    let ticket = bench.execute(1, &["left", "right"]);
    bench.run(ms(3_000));
    let denial = bench.denial(ticket);
    assert_eq!(denial.code, DenialCode::OutOfRange);
    assert_eq!(denial.message, "right: elbow: 3.5 rad");
    assert_eq!(denial.details["robot"], "right");
    assert!(bench.asked("left").any(|(_, call)| is_abort(call)));
    assert!(!bench.asked("left").any(|(_, call)| is_commit(call)));
    assert!(bench.motion(1).is_empty(), "a motion that was not accepted has no status");
    let ticket = bench.execute(2, &["left", "right"]);
    bench.run(ms(500));
    bench.answer(ticket);
}

#[test]
fn a_refused_commit_aborts_all() {
    let mut bench = Bench::new();
    let denial = armada_protocol::messages::Denial::new(DenialCode::LeaseStale, "epoch is over");
    bench.agent("right").refuse_commit = Some(denial);
    let ticket = bench.execute(1, &["left", "right"]);
    bench.run(ms(3_000));
    assert_eq!(bench.denial(ticket).code, DenialCode::LeaseStale);
    assert!(bench.asked("left").any(|(_, call)| is_abort(call)));
    assert!(!bench.agent("left").moves());
    assert!(bench.motion(1).is_empty());
}

#[test]
fn a_commit_that_is_answered_after_the_start_moves_nothing() {
    let mut bench = Bench::new();
    let ticket = bench.execute(1, &["left", "right"]);
    while !bench.asked("left").any(|(_, call)| is_commit(call)) {
        bench.run(ms(1));
    }
    bench.fates = vec![Fate::Arrives(200)];
    bench.run(ms(1));
    bench.run(ms(3_000));
    assert_eq!(bench.denial(ticket).code, DenialCode::Timeout);
    assert!(bench.motion(1).is_empty());
    assert!(!bench.agent("left").moves() && !bench.agent("right").moves());
}

#[test]
fn one_failed_part_ends_the_others_at_once_with_its_reason() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right", "torso"]);
    bench.run(ms(1_000));
    let now = bench.now;
    bench.agent("right").fault(now);
    bench.run(ms(20));
    for robot in ["left", "torso"] {
        let (at, _) = bench.asked(robot).find(|(_, call)| is_abort(call)).expect("aborted");
        assert!(at.saturating_since(now) <= ms(10), "{robot}");
    }
    let early = bench.last_motion(1);
    assert_eq!(early.status, ActionStatus::Running, "it is not over before all stand still");
    assert_eq!(early.reason.as_ref().expect("is known").code, DenialCode::Tolerance);
    bench.run(ms(1_000));
    let last = bench.last_motion(1);
    assert_eq!(last.status, ActionStatus::Failed);
    let reason = last.reason.as_ref().expect("failed for a reason");
    assert_eq!(reason.message, "right: elbow_joint left its path");
    assert_eq!(last.parts[&name("left")].status, ActionStatus::Cancelled);
    assert!(!bench.agent("left").moves());
}

#[test]
fn an_agent_that_dies_ends_the_others() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    bench.vanish("left");
    bench.run(ms(1_000));
    let last = bench.last_motion(1);
    assert_eq!(last.status, ActionStatus::Failed);
    assert_eq!(last.reason.as_ref().expect("a reason").code, DenialCode::CommunicationLost);
    assert_eq!(last.parts[&name("left")].status, ActionStatus::Failed);
    assert!(!bench.agent("right").moves());
}

#[test]
fn an_agent_that_is_restarted_unnoticed_ends_the_others() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    bench.appear("left", 200);
    let status = bench.agent("left").status.clone();
    bench.feed(Input::Status(Box::new(status)));
    bench.run(ms(2_000));
    let last = bench.last_motion(1);
    assert_eq!(last.status, ActionStatus::Failed);
    assert!(last.reason.as_ref().expect("a reason").message.contains("restarted"), "{last:?}");
    assert!(!bench.agent("right").moves());
}

#[test]
fn an_agent_alone_that_falls_silent_fails_after_the_timer() {
    let mut bench = Bench::new();
    bench.execute(1, &["left"]);
    bench.run(ms(1_000));
    // Its token stays, as with a process that hangs.
    bench.agents.remove(&name("left"));
    let silent = bench.now;
    bench.run(ms(1_200));
    let (at, _) = bench.asked("left").find(|(_, call)| is_abort(call)).expect("aborted");
    let after = at.saturating_since(silent);
    assert!(after > ms(850) && after <= ms(1_010), "{after:?}");
    bench.run(ms(4_000));
    let last = bench.last_motion(1);
    assert_eq!(last.status, ActionStatus::Failed);
    let left = last.parts[&name("left")].reason.as_ref().expect("a reason");
    assert_eq!(left.code, DenialCode::Timeout, "nobody knows whether it stands still");
}

#[test]
fn a_terminal_status_that_was_lost_is_asked_for() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(2_100));
    // Publications vanish; questions still come through.
    for _ in 0..40 {
        bench.run(ms(5));
        bench.agents.values_mut().for_each(|agent| agent.published.clear());
    }
    bench.run(ms(1_000));
    assert_eq!(bench.last_motion(1).status, ActionStatus::Complete);
}

#[test]
fn a_motion_ends_though_one_whose_end_nobody_heard_never_comes_back() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(2_000));
    // Its own clock runs a little ahead of the other's.
    let now = bench.now;
    bench.agent("right").end(Uuid::from_u128(1), ActionStatus::Complete, None, now);
    bench.run(ms(5));
    bench.vanish("left");
    bench.run(ms(2_000));
    let last = bench.last_motion(1);
    assert_eq!(last.status, ActionStatus::Failed, "{last:?}");
    assert_eq!(last.reason.as_ref().expect("a reason").code, DenialCode::CommunicationLost);
    assert_eq!(last.parts[&name("right")].status, ActionStatus::Complete);
}

#[test]
fn a_cancel_is_answered_when_every_ramp_has_begun() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    let ticket = cancel(&mut bench, 1);
    assert!(bench.answers(ticket).is_empty());
    bench.run(ms(10));
    assert_eq!(bench.answer(ticket), &CellAnswer::Cancelled);
    bench.run(ms(1_000));
    let last = bench.last_motion(1);
    assert_eq!((last.status, &last.reason), (ActionStatus::Cancelled, &None));
    assert!(!bench.agent("left").moves() && !bench.agent("right").moves());
}

#[test]
fn a_cancel_before_the_start_leaves_nothing_behind() {
    let mut bench = Bench::new();
    let execute = bench.execute(1, &["left", "right"]);
    let ticket = cancel(&mut bench, 1);
    bench.run(ms(3_000));
    assert_eq!(bench.denial(execute).code, DenialCode::NotReady);
    assert_eq!(bench.answer(ticket), &CellAnswer::Cancelled);
    assert!(bench.motion(1).is_empty());
    assert!(!bench.agent("left").moves());
}

#[test]
fn a_cancel_that_a_robot_does_not_hear_is_not_called_done() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    bench.agents.remove(&name("left"));
    let ticket = cancel(&mut bench, 1);
    bench.run(ms(4_000));
    let denial = bench.denial(ticket);
    assert_eq!(denial.code, DenialCode::Timeout);
    assert!(denial.message.starts_with("left did not answer"), "{denial}");
}

#[test]
fn a_stop_heard_from_somebody_else_ends_the_motion() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    let request = stop_request(9, StopScope::Robots(vec![name("left")]));
    let now = bench.now;
    bench.agent("left").stop(&request, now);
    bench.feed(Input::CellStop(request));
    bench.run(ms(1_000));
    let last = bench.last_motion(1);
    assert_eq!(last.status, ActionStatus::Failed);
    assert_eq!(last.reason.as_ref().expect("a reason").code, DenialCode::Stopped);
    assert!(!bench.agent("right").moves());
}
