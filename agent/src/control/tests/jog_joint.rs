use std::time::Duration;

use armada_model::JointVector;
use armada_protocol::messages::{ActionStatus, CommandMode, MotionKind, OperationalMode};
use uuid::Uuid;

use super::rig::{JOINTS, PERIOD, Rig, jog, joints, params};
use crate::control::{JogJointOrder, JogOrder, LoopState, Order, Params, ParamsError, Refusal};
use crate::drivers::JointSet;

use ActionStatus::{Cancelled, Complete, Running};
use CommandMode::{Halt, Jog};

fn at_speed(id: u128, speed: [f64; JOINTS], timeout_s: f64) -> Order {
    Order::JogJoint(JogJointOrder {
        id: Uuid::from_u128(id),
        joint_velocity: joints(speed),
        timeout: Duration::from_secs_f64(timeout_s),
        renews: false,
    })
}

fn renewed(order: Order) -> Order {
    match order {
        Order::JogJoint(order) => Order::JogJoint(JogJointOrder { renews: true, ..order }),
        other => other,
    }
}

fn speed(rig: &Rig) -> JointVector {
    rig.commands.last().expect("sent").joint_velocity
}

fn limited(rig: &Rig) -> u64 {
    rig.last.as_ref().expect("a tick").snapshot.limited_setpoints
}

#[test]
fn joints_reach_their_speeds_and_brake_to_rest_after_the_dead_mans_time() {
    let mut rig = Rig::in_mode(Jog);
    rig.ask(at_speed(1, [1.0, -0.5, 0.0], 0.8)).expect("granted");
    rig.ticks(190);
    assert_eq!(speed(&rig), joints([1.0, -0.5, 0.0]));
    let report = rig.reports(1)[0];
    assert_eq!((report.kind, report.status), (MotionKind::JogJoint, Running));
    assert!((report.progress.duration_s - 0.8).abs() < 1e-9);
    rig.ticks(15);
    assert!(speed(&rig)[0] < 1.0, "it brakes after 0.8 s");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Complete]);
    rig.tick();
    assert!(rig.command_rests());
    assert_eq!(limited(&rig), 0);
}

#[test]
fn the_same_motion_again_goes_on_with_new_speeds_and_a_new_time() {
    let mut rig = Rig::in_mode(Jog);
    for _ in 0..40 {
        rig.ask(at_speed(1, [0.8, 0.0, 0.0], 0.1)).expect("granted");
        rig.ticks(9);
    }
    assert_eq!(speed(&rig)[0], 0.8, "nine ticks of 4 ms are less than the dead man's time");
    assert_eq!(rig.statuses(1), [Running]);
    for _ in 0..30 {
        rig.ask(renewed(at_speed(1, [-0.4, 0.3, 0.0], 0.1))).expect("granted");
        rig.ticks(9);
    }
    assert_eq!(speed(&rig), joints([-0.4, 0.3, 0.0]));
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Complete]);
    assert_eq!(limited(&rig), 0);
}

#[test]
fn an_order_while_it_brakes_revives_the_motion_and_one_after_its_end_is_refused() {
    let mut rig = Rig::in_mode(Jog);
    rig.ask(at_speed(1, [1.0, 0.0, 0.0], 0.5)).expect("granted");
    rig.ticks(130);
    assert!(!rig.command_rests() && speed(&rig)[0] < 1.0, "it brakes");
    rig.ask(renewed(at_speed(1, [1.0, 0.0, 0.0], 0.4))).expect("granted");
    rig.ticks(90);
    assert_eq!(speed(&rig)[0], 1.0);
    rig.until("the end", |rig| rig.ended(1).is_some());
    let late = renewed(at_speed(1, [1.0, 0.0, 0.0], 0.4));
    assert_eq!(rig.ask(late), Err(Refusal::NoSuchMotion));
    rig.tick();
    assert!(rig.command_rests());
}

#[test]
fn a_speed_of_zero_brakes_and_keeps_the_motion_until_its_time_has_passed() {
    let mut rig = Rig::in_mode(Jog);
    rig.ask(at_speed(1, [1.0, 0.0, 0.0], 2.0)).expect("granted");
    rig.ticks(100);
    rig.ask(at_speed(1, [0.0; 3], 2.0)).expect("granted");
    rig.ticks(150);
    assert!(rig.command_rests());
    assert_eq!(rig.statuses(1), [Running], "0.6 s of 2 s have passed");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Complete]);
}

#[test]
fn another_motion_takes_over_in_motion_and_the_old_one_ends_as_cancelled() {
    let mut rig = Rig::in_mode(Jog);
    rig.ask(at_speed(1, [1.0, 0.0, 0.0], 5.0)).expect("granted");
    rig.ticks(120);
    rig.ask(at_speed(2, [1.0, 0.5, 0.0], 5.0)).expect("granted");
    assert!((speed(&rig)[0] - 1.0).abs() < 1e-9, "it goes on");
    assert_eq!(rig.ended(1).expect("ended").reason, Some(Refusal::Cancelled));
    rig.ticks(60);
    rig.jog(3, [0.0, 0.0, 0.0]).expect("a position takes over from a speed");
    assert!(speed(&rig)[0] > 0.9, "{:?}", speed(&rig));
    rig.ticks(20);
    rig.ask(at_speed(4, [0.0, 0.0, 0.5], 0.3)).expect("and a speed from a position");
    rig.until("the end", |rig| rig.ended(4).is_some());
    for id in 1..=3 {
        assert_eq!(rig.statuses(id), [Running, Cancelled], "motion {id}");
    }
    assert_eq!(limited(&rig), 0);
}

#[test]
fn a_motion_of_another_kind_may_not_take_the_identity() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.0, 0.0, 0.0]).expect("granted");
    let busy = Err(Refusal::Busy(Uuid::from_u128(1)));
    assert_eq!(rig.ask(at_speed(1, [0.1, 0.0, 0.0], 0.3)), busy);
    rig.ask(at_speed(2, [0.1, 0.0, 0.0], 0.3)).expect("granted");
    assert_eq!(rig.jog(2, [0.0; 3]), Err(Refusal::Busy(Uuid::from_u128(2))));
}

#[test]
fn one_joint_rests_at_its_limit_and_the_others_go_on() {
    let mut rig = Rig::in_mode(Jog);
    rig.ask(at_speed(1, [1.5, 0.0, -1.0], 4.0)).expect("granted");
    rig.ticks(700);
    let sent = rig.commands.last().expect("sent");
    assert!((sent.joint_position[0] - 2.0).abs() < 1e-8, "{sent:?}");
    assert_eq!((sent.joint_velocity[0], sent.joint_velocity[2]), (0.0, -1.0));
    rig.ask(at_speed(1, [-0.5, 0.0, 0.0], 1.0)).expect("back");
    rig.ticks(100);
    assert!(rig.commands.last().expect("sent").joint_position[0] < 1.95);
    assert_eq!(limited(&rig), 0);
}

#[test]
fn speeds_above_the_limits_in_force_are_refused_in_both_directions() {
    let mut rig = Rig::in_mode(Jog);
    for (speed, joint, value, limit) in [
        ([1.6, 0.0, 0.0], 0, 1.6, 1.5),
        ([0.0, -1.1, 0.0], 1, -1.1, -1.0),
        ([0.0, 0.0, -50.0], 2, -50.0, -2.0),
    ] {
        let expected = Err(Refusal::OutOfRange { joint, value, limit });
        assert_eq!(rig.ask(at_speed(1, speed, 0.1)), expected);
    }
    rig.plant.operational_mode = OperationalMode::ManualReducedSpeed;
    let expected = Err(Refusal::OutOfRange { joint: 0, value: -1.0, limit: -0.375 });
    assert_eq!(rig.ask(at_speed(1, [-1.0, 0.0, 0.0], 0.1)), expected);
    let nan = joints([0.0; 3]).map_indexed(|joint, _| if joint == 1 { f64::NAN } else { 0.0 });
    let order = JogJointOrder {
        id: Uuid::from_u128(1),
        joint_velocity: nan,
        timeout: PERIOD,
        renews: false,
    };
    let answer = rig.ask(Order::JogJoint(order));
    assert!(matches!(answer, Err(Refusal::OutOfRange { joint: 1, value, .. }) if value.is_nan()));
    let short = JogJointOrder { joint_velocity: JointVector::EMPTY, ..order };
    let expected = Err(Refusal::WrongLength { given: 0, expected: 3 });
    assert_eq!(rig.ask(Order::JogJoint(short)), expected);
    assert!(rig.reports(1).is_empty() && rig.command_rests());
}

#[test]
fn reduced_speed_holds_for_jogs_to_a_position_too_unless_a_speed_is_left_out() {
    for mode in [OperationalMode::ManualReducedSpeed, OperationalMode::Undefined] {
        let mut rig = Rig::in_mode(Jog);
        rig.plant.operational_mode = mode;
        let expected = Refusal::OutOfRange { joint: 0, value: 1.0, limit: 0.375 };
        assert_eq!(rig.jog(1, [0.5, 0.0, 0.0]), Err(expected), "{mode:?}");
        let order = JogOrder {
            id: Uuid::from_u128(2),
            joint_position: joints([0.5, 0.0, 0.0]),
            max_velocity: JointVector::EMPTY,
        };
        rig.ask(Order::Jog(order)).expect("granted");
        rig.until("the end", |rig| rig.ended(2).is_some());
        let fastest = rig.commands.iter().map(|sent| sent.joint_velocity[0]).fold(0.0, f64::max);
        assert!((fastest - 0.375).abs() < 1e-9, "{mode:?}: {fastest}");
    }
}

#[test]
fn the_mode_of_the_robot_file_counts_where_the_controller_reports_none() {
    let operational_mode = OperationalMode::Cobot;
    let mut rig = Rig::with(Params { operational_mode, ..params() });
    rig.plant.operational_mode = OperationalMode::Undefined;
    rig.tick();
    rig.ask(Order::SetMode(Jog)).expect("granted");
    rig.ask(at_speed(1, [1.5, 0.0, 0.0], 0.1)).expect("full speed");
    rig.plant.operational_mode = OperationalMode::Auto;
    let expected = Err(Refusal::OperationalMode(OperationalMode::Auto));
    assert_eq!(rig.ask(at_speed(1, [0.1, 0.0, 0.0], 0.1)), expected, "what is reported wins");
}

#[test]
fn in_automatic_mode_no_jog_is_granted() {
    let mut rig = Rig::in_mode(Jog);
    rig.plant.operational_mode = OperationalMode::Auto;
    let expected = Err(Refusal::OperationalMode(OperationalMode::Auto));
    assert_eq!(rig.ask(at_speed(1, [0.1, 0.0, 0.0], 0.1)), expected);
    assert_eq!(rig.jog(1, [0.1, 0.0, 0.0]), expected);
}

#[test]
fn a_joint_that_is_not_homed_refuses_every_jog_by_its_number() {
    let mut rig = Rig::in_mode(Jog);
    rig.plant.homed = JointSet::first(1).with(2);
    let expected = Err(Refusal::NotHomed { joint: 1 });
    assert_eq!(rig.ask(at_speed(1, [0.1, 0.0, 0.0], 0.1)), expected);
    assert_eq!(rig.jog(1, [0.1, 0.0, 0.0]), expected);
}

#[test]
fn jogs_need_their_mode_and_no_stop() {
    let mut rig = Rig::in_mode(Halt);
    let wrong = Refusal::WrongMode { mode: Halt, needed: Jog };
    assert_eq!(rig.ask(at_speed(1, [0.1, 0.0, 0.0], 0.1)), Err(wrong));
    let level = armada_protocol::messages::StopLevel::L2;
    rig.stop = Some(level);
    assert_eq!(rig.ask(at_speed(1, [0.1, 0.0, 0.0], 0.1)), Err(Refusal::Stopped(level)));
}

#[test]
fn halting_or_cancelling_a_jog_at_speed_brings_it_to_rest_with_one_terminal_status() {
    for (order, status) in
        [(Order::Halt, Cancelled), (Order::Cancel(Uuid::from_u128(1)), Cancelled)]
    {
        let mut rig = Rig::in_mode(Jog);
        rig.ask(at_speed(1, [1.0, 0.0, 0.0], 5.0)).expect("granted");
        rig.ticks(100);
        rig.ask(order).expect("granted");
        let again = rig.ask(at_speed(1, [1.0, 0.0, 0.0], 5.0));
        assert!(again.is_err(), "nothing revives what is ending: {again:?}");
        rig.until("the end", |rig| rig.ended(1).is_some() && rig.command_rests());
        assert_eq!(rig.ended(1).expect("ended").status, status);
        assert_eq!(rig.statuses(1).len(), 2);
    }
}

#[test]
fn the_speed_ratio_slows_jogs_and_changes_those_in_progress() {
    let mut rig = Rig::in_mode(Jog);
    rig.state.speed_ratio = 0.5;
    rig.ask(at_speed(1, [1.0, 0.0, 0.0], 5.0)).expect("granted");
    rig.ticks(120);
    assert_eq!(speed(&rig)[0], 0.5);
    rig.jog(2, [1.9, 0.0, 0.0]).expect("granted");
    rig.ticks(60);
    assert!((speed(&rig)[0] - 0.5).abs() < 1e-9, "{:?}", speed(&rig));
    let before = rig.tick().snapshot.motion.expect("in progress");
    rig.state.speed_ratio = 1.0;
    rig.ticks(60);
    assert!(speed(&rig)[0] > 0.8, "{:?}", speed(&rig));
    let after = rig.tick().snapshot.motion.expect("in progress");
    assert!(after.elapsed_s > before.elapsed_s && after.duration_s < before.duration_s);
    rig.until("the end", |rig| rig.ended(2).is_some());
    assert_eq!(rig.commands.last().expect("sent").joint_position, joints([1.9, 0.0, 0.0]));
    assert_eq!(limited(&rig), 0);
}

#[test]
fn eight_jogs_of_different_kinds_in_one_tick_are_each_answered_and_ended() {
    let mut rig = Rig::in_mode(Jog);
    for id in 1..=4 {
        rig.order(jog(2 * id, [0.1 * id as f64, 0.0, 0.0]));
        rig.order(at_speed(2 * id + 1, [0.0, 0.1, 0.0], 0.1));
    }
    rig.tick();
    for id in 2..=8 {
        assert_eq!(rig.statuses(id), [Cancelled], "never begun, so never running");
    }
    rig.until("the end", |rig| rig.ended(9).is_some());
    rig.finish();
}

#[test]
fn reduced_limits_that_make_no_sense_are_refused_before_the_first_tick() {
    let mut params = params();
    params.reduced[1].velocity = 0.0;
    let error = LoopState::new(&params).expect_err("refused");
    assert!(matches!(error, ParamsError::Limits(_)), "{error}");
}
