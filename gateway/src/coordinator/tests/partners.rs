//! Motions of robots that watch each other.

use armada_protocol::messages::{
    ActionStatus, CellExecuteTrajectory, CheckClearanceParams, Coupling, Denial, DenialCode,
    EventKind, GroupQuality, LeaseLoss, MotionStatus, PrepareParams, Severity,
};
use uuid::Uuid;

use super::bench::{Bench, Fate, clear, ms, name, trajectory};
use crate::coordinator::{Action, AgentCall, CellAnswer, CellRequest, Input, Ticket};

fn coupled(robots: &[&str], coupling: Coupling) -> CellExecuteTrajectory {
    CellExecuteTrajectory { coupling, ..CellExecuteTrajectory::new(None, trajectory(robots)) }
}

fn prepared<'b>(bench: &'b Bench, robot: &'b str) -> &'b PrepareParams {
    let prepares = bench.asked(robot).filter_map(|(_, call)| match call {
        AgentCall::Prepare(params) => Some(&**params),
        _ => None,
    });
    prepares.last().expect("was asked")
}

fn commits(bench: &Bench, robot: &str) -> Vec<armada_protocol::messages::CommitParams> {
    let commits = bench.asked(robot).filter_map(|(_, call)| match call {
        AgentCall::Commit(params) => Some(*params),
        _ => None,
    });
    commits.collect()
}

fn refused(bench: &Bench, ticket: Ticket) -> &Denial {
    let robots = ["left", "right"];
    let committed = robots.iter().any(|robot| !commits(bench, robot).is_empty());
    assert!(!committed, "something was committed");
    bench.denial(ticket)
}

#[test]
fn each_agent_is_told_its_partners_coupling_bounds_and_revision() {
    for (coupling, divergence_ms) in
        [(Coupling::Independent, 50.0), (Coupling::TimeSynced, 50.0), (Coupling::Rigid, 10.0)]
    {
        let mut bench = Bench::new();
        let model_rev = bench.agent("left").info.model_rev;
        let mut params = coupled(&["left", "right", "torso"], coupling);
        params.model_revs.insert(name("left"), model_rev);
        params.on_lease_loss = LeaseLoss::Finish;
        let ticket = bench.execute_with(1, params);
        bench.run(ms(1_000));
        bench.answer(ticket);
        let left = prepared(&bench, "left");
        assert_eq!(left.on_lease_loss, LeaseLoss::Finish);
        let group = left.group.as_ref().expect("has partners");
        assert_eq!(group.partners, ["right", "torso"].map(name));
        assert_eq!((group.coupling, group.loss_ms), (coupling, 60));
        assert_eq!(group.max_divergence_ms, divergence_ms);
        assert_eq!(group.model_rev, Some(model_rev));
        assert_eq!(prepared(&bench, "right").group.as_ref().expect("partners").model_rev, None);
        assert_eq!(bench.last_motion(1).coupling, coupling);
    }
}

#[test]
fn a_robot_alone_has_no_group_and_no_clearance() {
    let mut bench = Bench::new();
    bench.clearance = None;
    let ticket = bench.execute(1, &["left"]);
    bench.run(ms(1_000));
    bench.answer(ticket);
    assert_eq!(prepared(&bench, "left").group, None);
    assert_eq!(commits(&bench, "left")[0].rate_slope_s, None);
}

#[test]
fn all_get_the_lowest_slope_and_slow_controllers_start_earlier() {
    let mut bench = Bench::new();
    for (robot, slope, lag_ms) in [("left", 3.0, 8.0), ("right", 1.5, 0.0), ("torso", 2.0, 20.0)] {
        let readiness = bench.agent(robot).readiness.as_mut().expect("set");
        (readiness.rate_slope_s, readiness.controller_lag_ms) = (slope, lag_ms);
    }
    bench.execute(1, &["left", "right", "torso"]);
    bench.run(ms(1_000));
    let start = |robot| {
        let offset_ns = bench.agents[&name(robot)].offset_ns;
        let [commit] = commits(&bench, robot)[..] else { panic!("one commit") };
        assert_eq!(commit.rate_slope_s, Some(1.5));
        commit.start_ns.shifted(-offset_ns)
    };
    let (left, right, torso) = (start("left"), start("right"), start("torso"));
    assert_eq!(right.saturating_since(left), ms(8));
    assert_eq!(right.saturating_since(torso), ms(20));
    let (asked, _) = bench
        .asked("torso")
        .find(|(_, call)| matches!(call, AgentCall::Commit(_)))
        .expect("committed");
    assert_eq!(torso.saturating_since(asked), ms(150), "the earliest has the whole lead");
    let status = bench.last_motion(1);
    assert!(status.start_skew_ms.expect("started") < 0.001, "arms start together, not set-points");
    assert_eq!(status.start_travel, Some(0.001));
}

#[test]
fn an_agent_that_knows_no_partners_is_named() {
    let mut bench = Bench::new();
    bench.agent("right").readiness = None;
    let ticket = bench.execute(1, &["left", "right"]);
    bench.run(ms(3_000));
    let denial = refused(&bench, ticket);
    assert_eq!(denial.code, DenialCode::NotSupported);
    assert_eq!(denial.details["robot"], "right");
    assert!(bench.asked("left").any(|(_, call)| matches!(call, AgentCall::Abort(_))));
}

#[test]
fn numbers_that_make_no_sense_are_named() {
    let mut bench = Bench::new();
    bench.agent("right").readiness.as_mut().expect("set").controller_lag_ms = 4_000.0;
    let ticket = bench.execute(1, &["left", "right"]);
    bench.run(ms(3_000));
    let denial = refused(&bench, ticket);
    assert_eq!(
        (denial.code, &denial.details["field"]),
        (DenialCode::OutOfRange, &"controller_lag_ms".into())
    );
}

#[test]
fn a_motion_for_another_revision_of_the_model_is_refused() {
    let mut bench = Bench::new();
    let model_rev = bench.agent("left").info.model_rev;
    let mut params = coupled(&["left", "right"], Coupling::TimeSynced);
    params.model_revs.insert(name("left"), model_rev + 1);
    let ticket = bench.execute_with(1, params.clone());
    assert_eq!(bench.denial(ticket).code, DenialCode::StaleModel);
    assert!(bench.denial(ticket).message.starts_with("left: "));
    // The tool was changed while the gateway had not heard of it yet.
    params.model_revs.insert(name("left"), model_rev);
    bench.agent("left").readiness.as_mut().expect("set").model_rev = model_rev + 1;
    let ticket = bench.execute_with(2, params);
    bench.run(ms(3_000));
    assert_eq!(refused(&bench, ticket).code, DenialCode::StaleModel);
}

#[test]
fn terms_about_robots_that_take_no_part_are_refused() {
    let mut bench = Bench::new();
    let mut params = coupled(&["left", "right"], Coupling::TimeSynced);
    params.leases.insert(name("torso"), Uuid::from_u128(5));
    let ticket = bench.execute_with(1, params);
    assert_eq!(bench.denial(ticket).code, DenialCode::InvalidArgument);
    assert_eq!(bench.denial(ticket).details["field"], "leases");
    let mut params = coupled(&["left", "right"], Coupling::TimeSynced);
    params.on_lease_loss = LeaseLoss::ContinueS(-1.0);
    let ticket = bench.execute_with(2, params);
    assert_eq!(bench.denial(ticket).code, DenialCode::OutOfRange);
}

#[test]
fn a_clock_beyond_its_budget_refuses_robots_that_are_tied_together() {
    let slow = |coupling| {
        let mut bench = Bench::empty();
        bench.fates = vec![Fate::Arrives(3)];
        for robot in ["left", "right"] {
            bench.appear(robot, 100);
        }
        bench.run(ms(300));
        let ticket = bench.execute_with(1, coupled(&["left", "right"], coupling));
        bench.run(ms(1_000));
        (bench, ticket)
    };
    for coupling in [Coupling::TimeSynced, Coupling::Rigid] {
        let (bench, ticket) = slow(coupling);
        let denial = refused(&bench, ticket);
        assert_eq!((denial.code, &denial.details["robot"]), (DenialCode::NotReady, &"left".into()));
        assert_eq!(denial.details["budget_ms"], 2.0);
        assert!(denial.details["bound_ms"].as_f64().expect("a number") >= 3.0, "{denial}");
    }
    let (bench, ticket) = slow(Coupling::Independent);
    bench.answer(ticket);
}

#[test]
fn a_clock_that_gets_worse_ends_a_motion_that_needs_it() {
    let mut bench = Bench::new();
    for robot in ["left", "right"] {
        // A link gets slow, and the clock steps: what was measured before is void.
        bench.agent(robot).published.clear();
    }
    bench.execute(1, &["left", "right"]);
    bench.run(ms(500));
    bench.agent("left").offset_ns += 50_000_000;
    bench.fates = vec![Fate::Arrives(12)];
    bench.run(ms(1_100));
    let event = bench.events().filter(|event| event.kind == EventKind::Group).last();
    let event = event.expect("told");
    assert!(event.message.contains("left: its clock is known to 12"), "{}", event.message);
    assert_eq!(event.severity, Severity::Error);
    bench.run(ms(1_000));
    let last = bench.last_motion(1);
    assert_eq!(last.status, ActionStatus::Failed);
    assert_eq!(last.reason.as_ref().expect("a reason").code, DenialCode::NotReady);
}

#[test]
fn what_is_not_clear_is_not_committed() {
    let mut bench = Bench::new();
    let collision = Denial::new(DenialCode::Collision, "left/hand and right/hand come within 0 m");
    let mut report = clear();
    report.refusal = Some(collision.clone());
    bench.clearance = Some((Ok(report), ms(10)));
    let ticket = bench.execute(1, &["left", "right"]);
    bench.run(ms(3_000));
    assert_eq!(refused(&bench, ticket), &collision);
    assert!(bench.asked("left").any(|(_, call)| matches!(call, AgentCall::Abort(_))));
}

#[test]
fn whoever_moves_by_itself_beside_a_motion_is_named() {
    let mut bench = Bench::new();
    let told = |bench: &Bench| {
        let mut events = bench.events().filter(|event| event.kind == EventKind::Group);
        events.any(|event| event.message.starts_with("torso moves by itself"))
    };
    bench.execute(1, &["left", "right"]);
    bench.run(ms(4_000));
    assert!(!told(&bench), "it stands");
    let torso = bench.agent("torso");
    let text = include_str!("../../../../protocol/golden/motion_status.json");
    let mut motion: MotionStatus = serde_json::from_str(text).expect("the golden sample");
    motion.status = ActionStatus::Running;
    torso.status.motion = Some(motion);
    torso.publish_status();
    bench.run(ms(100));
    let ticket = bench.execute(2, &["left", "right"]);
    bench.run(ms(1_000));
    bench.answer(ticket);
    assert!(told(&bench), "its clearance is known for where it is now");
}

#[test]
fn the_check_covers_the_way_to_rest_after_a_loss() {
    let mut bench = Bench::new();
    let readiness = bench.agent("right").readiness.as_mut().expect("set");
    (readiness.stop_time_s, readiness.controller_lag_ms) = (0.35, 40.0);
    bench.execute(1, &["left", "right"]);
    bench.run(ms(500));
    let request = bench.actions.iter().find_map(|(_, action)| match action {
        Action::CheckClearance { request, .. } => Some(request),
        _ => None,
    });
    let period_s = 1e-3 * bench.agents[&name("left")].info.period_ms;
    let offset_s = request.expect("checked").offset_s;
    assert!((offset_s - (0.05 + 0.06 + period_s + 0.04 + 0.35)).abs() < 1e-12, "{offset_s} s");
}

#[test]
fn a_check_that_does_not_end_refuses_the_motion_in_time() {
    let mut bench = Bench::new();
    bench.clearance = None;
    let ticket = bench.execute(1, &["left", "right"]);
    bench.run(ms(7_000));
    let denial = refused(&bench, ticket);
    assert_eq!(denial.code, DenialCode::Timeout);
    assert!(denial.message.contains("clearance"), "{denial}");
}

#[test]
fn checks_that_clients_ask_for_leave_a_place_for_motions() {
    let mut bench = Bench::new();
    bench.clearance = None;
    let ask = |bench: &mut Bench| {
        let params = CheckClearanceParams { trajectory: trajectory(&["left"]), offset_ms: 0.0 };
        bench.request(CellRequest::CheckClearance(Box::new(params)))
    };
    let first = ask(&mut bench);
    let second = ask(&mut bench);
    bench.run(ms(10));
    assert!(bench.answers(first).is_empty(), "it is under way");
    assert_eq!(bench.denial(second).code, DenialCode::Busy);
    bench.execute(1, &["left", "right"]);
    bench.run(ms(500));
    let is_check = |(_, action): &&(_, Action)| matches!(action, Action::CheckClearance { .. });
    assert_eq!(bench.actions.iter().filter(is_check).count(), 2, "the motion's own");
}

#[test]
fn what_has_no_shape_is_told_by_name() {
    let mut bench = Bench::new();
    let mut report = clear();
    report.answer.without_shape = vec!["right/gripper".to_owned()];
    bench.clearance = Some((Ok(report), ms(10)));
    let ticket = bench.execute(1, &["left", "right"]);
    bench.run(ms(500));
    bench.answer(ticket);
    let event = bench.events().find(|event| event.kind == EventKind::Group).expect("told");
    assert_eq!(event.severity, Severity::Warning);
    assert!(event.message.contains("right/gripper"), "{}", event.message);
}

#[test]
fn partners_end_by_themselves_before_the_gateway_knows() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    // Its token stays, as with a process that hangs.
    bench.agents.remove(&name("left"));
    bench.run(ms(290));
    assert!(!bench.agent("right").moves(), "it went on alone");
    assert!(!bench.asked("right").any(|(_, call)| matches!(call, AgentCall::Abort(_))));
    bench.run(ms(4_000));
    let last = bench.last_motion(1);
    assert_eq!(last.status, ActionStatus::Failed);
    assert_eq!(last.parts[&name("left")].status, ActionStatus::Failed);
}

#[test]
fn an_agent_that_only_the_gateway_has_lost_does_not_end_the_others() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    bench.feed(Input::Presence { robot: name("left"), online: false });
    bench.run(ms(600));
    assert!(bench.agent("left").moves() && bench.agent("right").moves());
    bench.feed(Input::Presence { robot: name("left"), online: true });
    bench.run(ms(1_500));
    assert_eq!(bench.last_motion(1).status, ActionStatus::Complete);
}

#[test]
fn the_end_of_the_gateway_leaves_what_runs_to_itself() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    let waiting = bench.execute(2, &["torso"]);
    bench.feed(Input::Ending);
    assert_eq!(bench.denial(waiting).code, DenialCode::CommunicationLost);
    bench.run(ms(300));
    assert!(bench.is_idle());
    assert!(bench.agent("left").moves() && bench.agent("right").moves());
    assert!(!bench.asked("left").any(|(_, call)| matches!(call, AgentCall::Abort(_))));
    assert!(bench.events().any(|event| event.message.contains("goes on without the gateway")));
}

#[test]
fn the_worst_divergence_of_all_parts_is_reported() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    assert_eq!(bench.last_motion(1).max_divergence_ms, None, "nobody has measured it");
    for (robot, max_divergence_ms) in [("left", 0.7), ("right", 1.9)] {
        let mut status: MotionStatus =
            serde_json::from_str(include_str!("../../../../protocol/golden/motion_status.json"))
                .expect("golden sample");
        (status.id, status.robot) = (Uuid::from_u128(1), name(robot));
        (status.boot_id, status.seqno) = (bench.agent(robot).boot_id, 1_000);
        (status.status, status.reason) = (ActionStatus::Running, None);
        status.group = Some(GroupQuality { max_divergence_ms, max_silence_ms: 21.0 });
        bench.feed(Input::Motion(Box::new(status)));
    }
    bench.run(ms(150));
    assert_eq!(bench.last_motion(1).max_divergence_ms, Some(1.9));
}

#[test]
fn every_step_is_asked_under_the_lease_of_the_robot() {
    let mut bench = Bench::new();
    let ticket = bench.request(CellRequest::AcquireLease(
        armada_protocol::messages::CellAcquireLeaseParams {
            robots: ["left", "right"].map(name).to_vec(),
            ttl_ms: 20_000,
            role: Default::default(),
        },
    ));
    bench.run(ms(100));
    let CellAnswer::Lease(granted) = bench.answer(ticket).clone() else { panic!("granted") };
    let refused = bench.execute(1, &["left", "right"]);
    bench.run(ms(3_000));
    assert_eq!(bench.denial(refused).code, DenialCode::LeaseRequired);
    let mut params = coupled(&["left", "right"], Coupling::TimeSynced);
    params.leases = granted.leases.iter().map(|(r, grant)| (r.clone(), grant.lease)).collect();
    let ticket = bench.execute_with(2, params);
    bench.run(ms(1_000));
    bench.answer(ticket);
    assert!(bench.agent("left").moves());
}
