use armada_model::JointVector;
use armada_protocol::messages::{ActionStatus, CommandMode, MotionKind, RobotFlags};
use uuid::Uuid;

use super::rig::{PERIOD, Rig, jog, joints};
use crate::control::{JogOrder, Order, Refusal};

use ActionStatus::{Cancelled, Complete, Running};
use CommandMode::Jog;

fn order(goal: &[f64], speed: &[f64]) -> Order {
    let vector = |values| JointVector::from_slice(values).expect("finite");
    let (joint_position, max_velocity) = (vector(goal), vector(speed));
    Order::Jog(JogOrder { id: Uuid::from_u128(1), joint_position, max_velocity })
}

#[test]
fn what_nobody_waits_for_any_more_is_not_begun_but_it_is_ended() {
    let mut rig = Rig::in_mode(Jog);
    let until = rig.now + PERIOD * 2;
    let in_time = rig.order_until(until, jog(1, [0.5, 0.0, 0.0]));
    rig.tick();
    assert!(rig.answer(in_time).expect("at once").is_ok());
    let late = rig.order_until(until, jog(2, [0.0; 3]));
    let mode = rig.order_until(until, Order::SetMode(CommandMode::Halt));
    rig.late_tick(5);
    assert_eq!([late, mode].map(|ticket| rig.answer(ticket)), [Some(Err(Refusal::TooLate)); 2]);
    assert_eq!((rig.mode(), rig.statuses(2)), (Jog, vec![]));
    let halt = rig.order_until(until, Order::Halt);
    rig.tick();
    assert!(rig.answer(halt).expect("at once").is_ok());
    assert_eq!(rig.mode(), CommandMode::Halt);
    rig.finish();
}

#[test]
fn a_jog_ends_exactly_at_its_goal() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [0.7, -0.3, 4.0]).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Complete]);
    assert_eq!(rig.commands.last().expect("sent").joint_position, joints([0.7, -0.3, 4.0]));
    rig.ticks(100);
    assert_eq!(rig.plant.position, joints([0.7, -0.3, 4.0]));
    assert_eq!(rig.mode(), Jog, "the mode stays");
    assert_eq!(rig.last.as_ref().expect("a tick").snapshot.limited_setpoints, 0);
}

#[test]
fn a_jog_tells_its_progress() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [0.7, 0.0, 0.0]).expect("granted");
    let report = rig.reports(1)[0];
    assert_eq!((report.kind, report.started), (MotionKind::JogFreespace, Some(rig.now)));
    let progress = rig.tick().snapshot.motion.expect("in progress");
    assert_eq!(progress.id, Uuid::from_u128(1));
    assert!((progress.elapsed_s - 0.008).abs() < 1e-12 && progress.duration_s > 0.7);
    let flags = rig.last.as_ref().expect("a tick").snapshot.flags;
    assert!(!flags.contains(RobotFlags::TRAJECTORY_RUNNING), "it is no trajectory");
    rig.until("the end", |rig| rig.ended(1).is_some());
    let end = rig.ended(1).expect("ended");
    assert_eq!(end.progress.elapsed_s, end.progress.duration_s);
    assert_eq!(rig.last.as_ref().expect("a tick").snapshot.motion, None);
}

#[test]
fn a_jog_to_where_the_robot_is_completes_at_once() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [0.0; 3]).expect("granted");
    assert_eq!(rig.statuses(1), [Running, Complete]);
}

#[test]
fn goals_and_speeds_out_of_range_are_refused_with_joint_and_limit() {
    let mut rig = Rig::in_mode(Jog);
    let fast = &[1.0, 1.0, 1.0];
    for (goal, speed, joint, value, limit) in [
        (&[2.1, 0.0, 0.0], fast, 0, 2.1, 2.0),
        (&[0.0, -1.5, 0.0], fast, 1, -1.5, -1.0),
        (&[0.0, 0.0, 0.0], &[1.0, 1.0, 2.5], 2, 2.5, 2.0),
        (&[0.0, 0.0, 0.0], &[1.0, 0.0, 1.0], 1, 0.0, 0.0),
        (&[0.0, 0.0, 0.0], &[-0.5, 1.0, 1.0], 0, -0.5, 0.0),
    ] {
        let expected = Refusal::OutOfRange { joint, value, limit };
        assert_eq!(rig.ask(order(goal, speed)), Err(expected));
    }
    assert!(rig.command_rests() && rig.events.iter().all(|e| !format!("{e:?}").contains("Motion")));
}

#[test]
fn a_goal_that_is_not_finite_is_refused() {
    let mut rig = Rig::in_mode(Jog);
    let goal = joints([0.0; 3]).map_indexed(|joint, _| if joint == 1 { f64::NAN } else { 0.0 });
    let max_velocity = joints([1.0; 3]);
    let answer =
        rig.ask(Order::Jog(JogOrder { id: Uuid::nil(), joint_position: goal, max_velocity }));
    assert!(matches!(answer, Err(Refusal::OutOfRange { joint: 1, value, .. }) if value.is_nan()));
}

#[test]
fn vectors_of_another_length_are_refused() {
    let mut rig = Rig::in_mode(Jog);
    let wrong = |given| Err(Refusal::WrongLength { given, expected: 3 });
    assert_eq!(rig.ask(order(&[0.0; 2], &[1.0; 3])), wrong(2));
    assert_eq!(rig.ask(order(&[0.0; 3], &[1.0; 4])), wrong(4));
}

#[test]
fn another_goal_on_the_way_ends_the_old_jog_and_keeps_the_velocity() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.5, 0.5, 0.0]).expect("granted");
    rig.ticks(120);
    let before = rig.commands[rig.commands.len() - 1].joint_velocity;
    assert!(before[0] > 0.9, "at speed: {before:?}");
    rig.jog(2, [-0.5, 0.5, 1.0]).expect("granted");
    let after = rig.commands[rig.commands.len() - 1].joint_velocity;
    assert!(before.max_abs_difference(&after) < 0.03, "{before:?} to {after:?}");
    let end = rig.ended(1).expect("the old one ended");
    assert_eq!((end.status, end.reason), (Cancelled, Some(Refusal::Cancelled)));
    rig.until("the end", |rig| rig.ended(2).is_some());
    assert_eq!(rig.statuses(2), [Running, Complete]);
    assert_eq!(rig.commands.last().expect("sent").joint_position, joints([-0.5, 0.5, 1.0]));
    assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
}

#[test]
fn another_goal_may_come_at_every_tick() {
    let mut rig = Rig::in_mode(Jog);
    for (count, id) in (1..=300).enumerate() {
        let side = if count / 40 % 2 == 0 { 1.9 } else { -0.9 };
        rig.jog(id, [side, -side / 2.0, side]).expect("granted");
    }
    rig.until("the end", |rig| rig.ended(300).is_some());
    assert_eq!(rig.last.as_ref().expect("a tick").snapshot.limited_setpoints, 0);
    rig.finish();
}

#[test]
fn a_jog_may_not_take_the_identity_of_the_one_in_progress() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.0, 0.0, 0.0]).expect("granted");
    assert_eq!(rig.jog(1, [0.5, 0.0, 0.0]), Err(Refusal::Busy(Uuid::from_u128(1))));
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Complete]);
}

#[test]
fn a_refused_goal_leaves_the_jog_in_progress() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.0, 0.0, 0.0]).expect("granted");
    rig.ticks(20);
    assert!(rig.jog(2, [9.0, 0.0, 0.0]).is_err());
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Complete]);
    assert!(rig.reports(2).is_empty());
}

#[test]
fn a_cancelled_jog_is_cancelled_when_it_stands() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.5, 0.0, 0.0]).expect("granted");
    rig.ticks(100);
    let epoch = rig.epoch();
    assert!(rig.ask(Order::Cancel(Uuid::from_u128(1))).is_ok());
    assert_eq!(rig.statuses(1), [Running], "it still moves");
    assert_eq!(rig.jog(2, [0.0; 3]), Err(Refusal::StillMoving));
    assert!(rig.ask(Order::Cancel(Uuid::from_u128(1))).is_ok(), "asking again is no error");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert!(rig.command_rests());
    assert_eq!(rig.ended(1).expect("ended").reason, Some(Refusal::Cancelled));
    assert_eq!((rig.mode(), rig.epoch()), (Jog, epoch), "mode and epoch stay");
    assert!(rig.jog(3, [0.0; 3]).is_ok());
}

#[test]
fn a_motion_that_is_not_in_progress_cannot_be_cancelled() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [0.1, 0.0, 0.0]).expect("granted");
    assert_eq!(rig.ask(Order::Cancel(Uuid::from_u128(2))), Err(Refusal::NoSuchMotion));
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.ask(Order::Cancel(Uuid::from_u128(1))), Err(Refusal::NoSuchMotion));
}

#[test]
fn a_halt_during_a_cancel_ends_the_motion_as_cancelled_at_once() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.5, 0.0, 0.0]).expect("granted");
    rig.ticks(100);
    rig.ask(Order::Cancel(Uuid::from_u128(1))).expect("granted");
    rig.ask(Order::Halt).expect("granted");
    let end = rig.ended(1).expect("ended");
    assert_eq!((end.status, end.reason), (Cancelled, Some(Refusal::Cancelled)));
    assert!(!rig.command_rests(), "while the ramp goes on");
    rig.finish();
}

#[test]
fn a_robot_beyond_its_limit_can_be_jogged_back_but_not_out() {
    let mut rig = Rig::new();
    rig.plant.position = joints([2.2, 0.0, 0.0]);
    rig.tick();
    rig.ticks(10);
    assert_eq!(rig.plant.position, joints([2.2, 0.0, 0.0]), "enabling does not pull it in");
    rig.ask(Order::SetMode(Jog)).expect("granted");
    assert!(rig.jog(1, [2.1, 0.0, 0.0]).is_err());
    rig.jog(2, [1.8, 0.0, 0.0]).expect("granted");
    rig.until("the end", |rig| rig.ended(2).is_some());
    assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
}

#[test]
fn many_jogs_in_one_tick_are_each_answered_and_ended() {
    let mut rig = Rig::in_mode(Jog);
    for id in 1..=8 {
        rig.order(jog(id, [0.1 * id as f64, 0.0, 0.0]));
    }
    rig.tick();
    for id in 1..=7 {
        assert_eq!(rig.statuses(id), [Cancelled], "never begun, so never running");
    }
    rig.until("the end", |rig| rig.ended(8).is_some());
    rig.finish();
}
