//! Pause, resume and speed of motions that go on.

use armada_protocol::messages::{
    ActionStatus, CellAcquireLeaseParams, CellExecuteTrajectory, Coupling, DenialCode,
    SpeedRatioAnswer,
};
use uuid::Uuid;

use super::bench::{Bench, ms, name, trajectory};
use crate::coordinator::{AgentCall, CellAnswer, CellRequest, Control, Ticket};

fn control(bench: &mut Bench, control: Control) -> Ticket {
    let motion_id = Uuid::from_u128(1);
    bench.request(CellRequest::Control { motion_id, lease: None, control })
}

/// Left and right under way, under leases of the tester.
fn leased() -> (Bench, Uuid) {
    let mut bench = Bench::new();
    let robots = ["left", "right"].map(name).to_vec();
    let params = CellAcquireLeaseParams { robots, ttl_ms: 20_000, role: Default::default() };
    let ticket = bench.request(CellRequest::AcquireLease(params));
    bench.run(ms(100));
    let CellAnswer::Lease(granted) = bench.answer(ticket).clone() else { panic!("granted") };
    let mut params = CellExecuteTrajectory::new(None, trajectory(&["left", "right"]));
    params.leases = granted.leases.iter().map(|(r, grant)| (r.clone(), grant.lease)).collect();
    bench.execute_with(1, params);
    bench.run(ms(1_000));
    (bench, granted.leases[&name("left")].lease)
}

#[test]
fn a_pause_is_answered_when_every_robot_has_it_and_the_whole_is_paused() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    let ticket = control(&mut bench, Control::Pause);
    let asked = |bench: &Bench, robot| {
        let wanted = AgentCall::Control(Uuid::from_u128(1), Control::Pause);
        bench.asked(robot).filter(|(_, call)| **call == wanted).map(|(at, _)| at).last()
    };
    assert_eq!(asked(&bench, "left"), asked(&bench, "right"), "in parallel");
    assert!(asked(&bench, "left").is_some());
    assert!(bench.answers(ticket).is_empty());
    bench.run(ms(50));
    assert_eq!(bench.answer(ticket), &CellAnswer::Controlled);
    assert_eq!(bench.last_motion(1).status, ActionStatus::Paused);
    bench.run(ms(3_000));
    assert_eq!(bench.last_motion(1).status, ActionStatus::Paused, "silence is no failure");
    control(&mut bench, Control::Resume);
    bench.run(ms(1_000));
    assert_eq!(bench.last_motion(1).status, ActionStatus::Complete);
}

#[test]
fn a_speed_is_answered_with_what_is_in_force() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    let ticket = control(&mut bench, Control::SpeedRatio(0.25));
    bench.run(ms(50));
    let answer = SpeedRatioAnswer { speed_ratio: 0.25 };
    assert_eq!(bench.answer(ticket), &CellAnswer::SpeedRatio(answer));
    for ratio in [0.0, 1.01, f64::NAN] {
        let ticket = control(&mut bench, Control::SpeedRatio(ratio));
        assert_eq!(bench.denial(ticket).code, DenialCode::OutOfRange, "{ratio}");
    }
}

#[test]
fn a_robot_that_refuses_is_named_and_so_are_those_that_did_it() {
    let (mut bench, lease) = leased();
    // Somebody took the lease of one robot.
    let now = bench.now;
    bench.agent("right").lease = Some((Uuid::from_u128(9), "boss".to_owned(), now + ms(60_000)));
    let (motion_id, lease, control) = (Uuid::from_u128(1), Some(lease), Control::Pause);
    let ticket = bench.request(CellRequest::Control { motion_id, lease, control });
    bench.run(ms(50));
    let denial = bench.denial(ticket);
    assert_eq!(denial.code, DenialCode::LeaseRequired);
    assert_eq!(denial.message, "right: driven by boss");
    assert_eq!(denial.details["refused"][0], "right");
    assert_eq!(denial.details["done"][0], "left");
}

#[test]
fn a_robot_that_does_not_answer_is_named() {
    let mut bench = Bench::new();
    bench.execute(1, &["left", "right"]);
    bench.run(ms(1_000));
    bench.agents.remove(&name("right"));
    let ticket = control(&mut bench, Control::Pause);
    bench.run(ms(2_100));
    assert_eq!(bench.denial(ticket).code, DenialCode::Timeout);
    assert_eq!(bench.denial(ticket).details["robot"], "right");
}

#[test]
fn whoever_it_is_needs_a_lease_of_the_motion() {
    let (mut bench, lease) = leased();
    let motion_id = Uuid::from_u128(1);
    let ask = |bench: &mut Bench, lease| {
        // The name that the motion was begun under, which anybody may give himself.
        let ticket =
            bench.request(CellRequest::Control { motion_id, lease, control: Control::Pause });
        bench.run(ms(50));
        ticket
    };
    let ticket = ask(&mut bench, None);
    assert_eq!(bench.denial(ticket).code, DenialCode::LeaseRequired);
    let ticket = ask(&mut bench, Some(Uuid::from_u128(4)));
    assert_eq!(bench.denial(ticket).code, DenialCode::LeaseStale);
    let ticket = ask(&mut bench, Some(lease));
    assert_eq!(bench.answer(ticket), &CellAnswer::Controlled);
}

#[test]
fn what_does_not_run_or_has_no_common_phase_cannot_be_paused() {
    let mut bench = Bench::new();
    let ticket = control(&mut bench, Control::Pause);
    assert_eq!(bench.denial(ticket).code, DenialCode::NotAttached);
    let mut params = CellExecuteTrajectory::new(None, trajectory(&["left", "right"]));
    params.coupling = Coupling::Independent;
    bench.execute_with(1, params);
    let ticket = control(&mut bench, Control::Pause);
    assert_eq!(bench.denial(ticket).code, DenialCode::NotReady);
    bench.run(ms(1_000));
    let ticket = control(&mut bench, Control::Pause);
    assert_eq!(bench.denial(ticket).code, DenialCode::NotSupported);
    assert_eq!(bench.denial(ticket).details["field"], "coupling");
}
