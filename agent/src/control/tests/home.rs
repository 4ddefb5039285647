use std::time::Duration;

use armada_model::MAX_JOINTS;
use armada_protocol::messages::{
    ActionStatus, CommandMode, Executor, FaultCode, HomeMethod, MotionKind, StopLevel,
};
use uuid::Uuid;

use super::rig::{Rig, jog, joints, params};
use crate::control::{HomeOrder, LoopAbilities, Order, Params, Refusal};
use crate::drivers::{DriverRequest, JointSet};

use ActionStatus::{Cancelled, Complete, Failed, Running};
use CommandMode::{Halt, Homing, InvalidState, Jog};
use HomeMethod::{Controller, MoveToHome};

fn set(joints: &[usize]) -> JointSet {
    joints.iter().fold(JointSet::NONE, |set, &joint| set.with(joint))
}

fn home(id: u128, groups: &[&[usize]], method: HomeMethod) -> Order {
    let mut all = [JointSet::NONE; MAX_JOINTS];
    for (slot, group) in all.iter_mut().zip(groups) {
        *slot = set(group);
    }
    Order::Home(HomeOrder { id: Uuid::from_u128(id), groups: all, method })
}

/// In mode homing, with a controller that can home and homes for all joints but the last.
fn rig() -> Rig {
    let mut rig = Rig::with(Params {
        abilities: LoopAbilities { homing: true, ..LoopAbilities::default() },
        home: vec![Some(0.5), Some(-0.25), None],
        homing_timeout: Duration::from_secs(1),
        ..params()
    });
    rig.plant.finds_after = Some(20);
    rig.tick();
    rig.ask(Order::SetMode(Homing)).expect("granted");
    rig
}

fn count(rig: &Rig, request: DriverRequest) -> usize {
    rig.plant.asked.iter().filter(|asked| **asked == request).count()
}

#[test]
fn the_controller_homes_group_after_group_and_no_set_point_is_sent_meanwhile() {
    let mut rig = rig();
    rig.plant.homed = JointSet::NONE;
    let first = rig.ask(home(1, &[&[2], &[0, 1]], Controller));
    first.expect("granted");
    assert_eq!(rig.last.as_ref().expect("a tick").command, None, "from the first tick on");
    assert_eq!(
        rig.last.as_ref().expect("a tick").driver_request,
        Some(DriverRequest::Home(set(&[2])))
    );
    let sent = rig.commands.len();
    let running = rig.reports(1)[0];
    assert_eq!((running.kind, running.executor), (MotionKind::Home, Executor::Controller));
    rig.until("the second group", |rig| rig.plant.homing == set(&[0, 1]));
    assert!(rig.plant.homed.contains(2), "after the first");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Complete]);
    assert_eq!(rig.commands.len(), sent, "no set-point all the time");
    assert_eq!(rig.plant.homed, JointSet::first(3));
    rig.ticks(5);
    let begun = rig.commands[sent].joint_position;
    assert!(begun.max_abs_difference(&rig.plant.position) < 1e-12, "anew where the robot is");
    assert!(rig.command_rests());
    assert_eq!((rig.mode(), rig.fault_codes()), (Homing, vec![]));
}

#[test]
fn a_controller_that_takes_no_set_points_before_it_is_homed_can_be_homed() {
    let mut rig = Rig::with(Params {
        abilities: LoopAbilities { homing: true, ..LoopAbilities::default() },
        ..params()
    });
    (rig.plant.homed, rig.plant.ready) = (JointSet::NONE, false);
    rig.plant.finds_after = Some(20);
    rig.tick();
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::NotReady));
    rig.ask(Order::SetMode(Homing)).expect("granted");
    rig.ask(home(1, &[&[0, 1, 2]], Controller)).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!((rig.statuses(1), rig.fault_codes()), (vec![Running, Complete], vec![]));
    rig.plant.ready = true;
    rig.ticks(5);
    assert!(rig.last.as_ref().expect("a tick").command.is_some());
}

#[test]
fn drives_that_go_off_in_mode_homing_are_a_fault() {
    let mut rig = rig();
    rig.ask(home(1, &[&[0]], Controller)).expect("granted");
    rig.ticks(5);
    (rig.plant.enabled, rig.plant.ready) = (false, false);
    rig.tick();
    assert_eq!((rig.fault_codes(), rig.mode()), (vec![FaultCode::NotReady], InvalidState));
    assert_eq!(rig.ended(1).expect("ended").status, Failed);
}

#[test]
fn joints_that_know_their_reference_already_are_searched_again() {
    let mut rig = rig();
    rig.ask(home(1, &[&[0]], Controller)).expect("granted");
    rig.until("the search", |rig| rig.plant.homing == set(&[0]));
    assert!(rig.ended(1).is_none() && !rig.plant.homed.contains(0));
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Complete]);
}

#[test]
fn a_search_that_does_not_end_is_a_fault_and_is_stopped() {
    let mut rig = rig();
    (rig.plant.homed, rig.plant.finds_after) = (JointSet::NONE, None);
    rig.ask(home(1, &[&[0]], Controller)).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    let end = rig.ended(1).expect("ended");
    assert_eq!((end.status, end.reason), (Failed, Some(Refusal::Faulted(FaultCode::HomingFailed))));
    rig.until("the controller's rest", |rig| rig.plant.homing.is_empty());
    assert!(count(&rig, DriverRequest::StopMotion) > 0);
    rig.ticks(50);
    assert!(rig.command_rests());
    rig.ask(Order::ResetErrors).expect("no cause remains");
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn a_search_that_never_begins_or_breaks_off_is_a_fault() {
    let mut rig = rig();
    (rig.plant.homed, rig.plant.obeys_after) = (JointSet::NONE, None);
    rig.ask(home(1, &[&[0]], Controller)).expect("granted");
    rig.until("the fault", |rig| rig.fault_codes() == [FaultCode::HomingFailed]);
    assert!(count(&rig, DriverRequest::Home(set(&[0]))) > 2, "it was asked again and again");

    let mut rig = self::rig();
    rig.plant.finds_after = None;
    rig.ask(home(1, &[&[0]], Controller)).expect("granted");
    rig.until("the search", |rig| !rig.plant.homing.is_empty());
    rig.ticks(5);
    rig.plant.homing = JointSet::NONE;
    rig.ticks(2);
    assert_eq!(rig.fault_codes(), [FaultCode::HomingFailed]);
}

#[test]
fn what_ends_homing_early_stops_the_controller_before_set_points_are_sent_again() {
    for end in ["cancel", "halt", "stop", "mode"] {
        let mut rig = rig();
        rig.plant.finds_after = None;
        rig.ask(home(1, &[&[0, 1]], Controller)).expect("granted");
        rig.until("the search", |rig| !rig.plant.homing.is_empty());
        rig.ticks(5);
        let sent = rig.commands.len();
        match end {
            "cancel" => rig.ask(Order::Cancel(Uuid::from_u128(1))).map(drop).expect("granted"),
            "halt" => rig.ask(Order::Halt).map(drop).expect("granted"),
            "mode" => rig.ask(Order::SetMode(Halt)).map(drop).expect("granted"),
            _ => rig.stop = Some(StopLevel::L2),
        }
        rig.tick();
        assert_eq!(rig.commands.len(), sent, "{end}: none while the controller moves");
        rig.until("the end", |rig| rig.ended(1).is_some());
        let status = if end == "stop" { Failed } else { Cancelled };
        assert_eq!(rig.ended(1).expect("ended").status, status, "{end}");
        rig.until("set-points", |rig| rig.commands.len() > sent);
        assert!(rig.plant.homing.is_empty(), "{end}: it stopped before");
        assert!(count(&rig, DriverRequest::StopMotion) > 0, "{end}");
        let begun = rig.commands[sent].joint_position;
        assert!(begun.max_abs_difference(&rig.plant.position) < 1e-12, "{end}");
    }
}

#[test]
fn a_controller_that_ignores_the_stop_gets_no_set_points_and_the_mode_of_motion_is_refused() {
    let mut rig = rig();
    rig.plant.finds_after = None;
    rig.ask(home(1, &[&[0]], Controller)).expect("granted");
    rig.until("the search", |rig| !rig.plant.homing.is_empty());
    rig.plant.obeys_after = None;
    let sent = rig.commands.len();
    rig.ask(Order::Halt).expect("granted");
    rig.ticks(45);
    assert!(count(&rig, DriverRequest::StopMotion) > 2, "asked for again and again");
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::StillMoving));
    assert_eq!(rig.fault_codes(), [], "it has its time");
    rig.until("the fault", |rig| rig.fault_codes() == [FaultCode::StopIgnored]);
    rig.ticks(100);
    assert!(count(&rig, DriverRequest::Disable) > 5, "the brakes are to end it");
    assert!(count(&rig, DriverRequest::StopMotion) > 5, "and it is asked on");
    assert_eq!(rig.commands.len(), sent);
    let refused = rig.ask(Order::SetMode(Jog));
    assert_eq!(refused, Err(Refusal::Faulted(FaultCode::StopIgnored)));
}

#[test]
fn moving_home_goes_group_after_group_and_leaves_the_other_joints() {
    let mut rig = rig();
    rig.ask(home(1, &[&[1], &[0]], MoveToHome)).expect("granted");
    rig.until("the first group", |rig| {
        rig.commands.last().is_some_and(|sent| sent.joint_position[1] == -0.25)
    });
    assert_eq!(rig.commands.last().expect("sent").joint_position[0], 0.0, "its turn comes later");
    rig.until("the end", |rig| rig.ended(1).is_some());
    let end = rig.ended(1).expect("ended");
    assert_eq!((rig.statuses(1), end.executor), (vec![Running, Complete], Executor::Agent));
    assert_eq!(rig.commands.last().expect("sent").joint_position, joints([0.5, -0.25, 0.0]));
    assert!((end.progress.elapsed_s - end.progress.duration_s).abs() < 1e-9, "{end:?}");
    assert_eq!(rig.last.as_ref().expect("a tick").snapshot.limited_setpoints, 0);
    assert_eq!(count(&rig, DriverRequest::StopMotion), 0);
}

#[test]
fn moving_home_can_be_cancelled_with_a_ramp() {
    let mut rig = rig();
    rig.ask(home(1, &[&[0, 1]], MoveToHome)).expect("granted");
    rig.ticks(60);
    rig.ask(Order::Cancel(Uuid::from_u128(1))).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Cancelled]);
    assert!(rig.command_rests());
}

#[test]
fn homing_that_this_robot_cannot_do_is_refused_by_name() {
    let mut rig = rig();
    let no_home = Err(Refusal::NoHome { joint: 2 });
    assert_eq!(rig.ask(home(1, &[&[0], &[2]], MoveToHome)), no_home);
    rig.plant.homed = set(&[0, 2]);
    assert_eq!(rig.ask(home(1, &[&[0]], MoveToHome)), Err(Refusal::NotHomed { joint: 1 }));
    rig.plant.homed = JointSet::first(3);
    rig.ask(home(1, &[&[0]], MoveToHome)).expect("granted");
    let busy = Err(Refusal::Busy(Uuid::from_u128(1)));
    assert_eq!(rig.ask(home(2, &[&[0]], Controller)), busy);
    let wrong = Refusal::WrongMode { mode: Homing, needed: Jog };
    assert_eq!(rig.ask(jog(3, [0.0; 3])), Err(wrong));

    let mut rig = Rig::with(Params { home: vec![Some(0.0); 3], ..params() });
    rig.tick();
    rig.ask(Order::SetMode(Homing)).expect("it has homes");
    let answer = rig.ask(home(1, &[&[0]], Controller));
    assert!(matches!(answer, Err(Refusal::NotSupported(_))), "{answer:?}");
    let mut rig = Rig::in_mode(Jog);
    let wrong = Refusal::WrongMode { mode: Jog, needed: Homing };
    assert_eq!(rig.ask(home(1, &[&[0]], Controller)), Err(wrong));
}

#[test]
fn drives_that_are_off_cannot_home() {
    let mut rig = Rig::with(Params { home: vec![Some(0.0); 3], ..params() });
    (rig.plant.enabled, rig.plant.ready) = (false, false);
    rig.tick();
    assert_eq!(rig.ask(Order::SetMode(Homing)), Err(Refusal::NotEnabled));
}
