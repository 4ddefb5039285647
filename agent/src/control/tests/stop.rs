use std::time::Duration;

use armada_protocol::messages::{
    ActionStatus, CommandMode, FaultCode, RobotFlags, StopLevel, StopStage,
};
use uuid::Uuid;

use super::rig::{PERIOD, Plant, Rig, follow, jog, joints, trajectory};
use crate::control::{LoopEvent, Order, Refusal};
use crate::drivers::DriverRequest;

use CommandMode::{Halt, InvalidState, Jog};
use StopLevel::{L0, L1, L2};
use StopStage::{Commanded, DrivesOff, Standstill};

/// A robot in the middle of a jog at full speed.
fn moving() -> Rig {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.8, 0.0, 0.0]).expect("granted");
    rig.ticks(120);
    assert!(rig.commands[rig.commands.len() - 1].joint_velocity[0] > 0.99);
    rig
}

#[test]
fn level_2_ramps_holds_and_leaves_the_drives_on() {
    let mut rig = moving();
    rig.stop = Some(L2);
    let output = rig.tick();
    assert_eq!(rig.stages(), [Commanded], "in the tick of the first decelerating set-point");
    let first = output.command.expect("a set-point");
    assert!(first.joint_velocity[0] < 1.0 - 0.9 * 4.0 * PERIOD.as_secs_f64());
    let stopped_at = rig.now;
    rig.until("standstill", |rig| rig.stages().contains(&Standstill));
    let took = rig.now.saturating_since(stopped_at);
    // Ramp of 1 rad/s at 4 rad/s², the plant's lag, and the hold.
    let expected = PERIOD * (63 + Plant::LAG as u32) + rig.params.standstill_hold;
    assert!(took >= expected - PERIOD * 2 && took <= expected + PERIOD * 3, "{took:?}");
    rig.ticks(200);
    assert_eq!(rig.stages(), [Commanded, Standstill]);
    assert!(rig.plant.enabled && rig.plant.asked.is_empty());
    assert!(rig.last.as_ref().expect("a tick").command.is_some(), "held");
    let end = rig.ended(1).expect("ended");
    assert_eq!((end.status, end.reason), (ActionStatus::Failed, Some(Refusal::Stopped(L2))));
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn level_1_switches_the_drives_off_after_measured_standstill() {
    let mut rig = moving();
    rig.stop = Some(L1);
    rig.until("the request", |rig| !rig.plant.asked.is_empty());
    assert_eq!(rig.plant.asked, [DriverRequest::Disable]);
    assert_eq!(rig.stages(), [Commanded, Standstill], "not before standstill");
    rig.until("drives off", |rig| rig.stages().contains(&DrivesOff));
    assert!(!rig.plant.enabled);
    assert_eq!(rig.mode(), Halt);
    assert_eq!(rig.fault_codes(), [], "drives that were switched off are no fault");
    rig.ticks(50);
    assert_eq!(rig.plant.asked, [DriverRequest::Disable], "asked once when obeyed");
}

#[test]
fn level_0_switches_off_at_once_and_sends_no_set_point() {
    let mut rig = moving();
    rig.stop = Some(L0);
    let output = rig.tick();
    assert_eq!((output.command, output.driver_request), (None, Some(DriverRequest::Disable)));
    assert_eq!(rig.stages(), [Commanded]);
    rig.until("drives off", |rig| rig.stages().contains(&DrivesOff));
    assert_eq!(rig.stages(), [Commanded, Standstill, DrivesOff]);
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn drives_off_is_not_told_before_standstill_since_it_would_be_taken_for_it() {
    let mut rig = moving();
    rig.stop = Some(L0);
    rig.plant.obeys_after = Some(1);
    rig.ticks(10);
    assert!(!rig.plant.enabled);
    assert_eq!(rig.stages(), [Commanded]);
    rig.until("standstill", |rig| rig.stages().contains(&Standstill));
    assert_eq!(rig.stages(), [Commanded, Standstill, DrivesOff]);
}

#[test]
fn a_request_that_shows_no_effect_is_repeated() {
    let mut rig = moving();
    rig.plant.obeys_after = None;
    rig.stop = Some(L0);
    rig.ticks(50);
    assert_eq!(rig.plant.asked, vec![DriverRequest::Disable; 4], "every 50 ms");
    assert_eq!(rig.stages(), [Commanded, Standstill], "never drives off without proof");
}

#[test]
fn a_robot_that_does_not_come_to_rest_has_its_drives_cut_after_a_level_1_ramp() {
    let mut rig = moving();
    rig.stop = Some(L1);
    rig.until("the end of the ramp", Rig::command_rests);
    let ramped = rig.now;
    rig.plant.blocked = true;
    rig.plant.creep = 1e-3;
    rig.until("the request", |rig| !rig.plant.asked.is_empty());
    assert_eq!(rig.stages(), [Commanded], "no standstill was measured");
    let waited = rig.now.saturating_since(ramped);
    let patience = rig.params.standstill_hold + Duration::from_millis(500);
    assert!(waited >= patience && waited <= patience + PERIOD * 3, "{waited:?}");
}

#[test]
fn a_robot_that_stands_already_has_to_show_it_for_the_hold_time() {
    let mut rig = Rig::in_mode(Halt);
    rig.ticks(100);
    rig.stop = Some(L2);
    rig.tick();
    assert_eq!(rig.stages(), [Commanded]);
    let from = rig.now;
    rig.until("standstill", |rig| rig.stages().contains(&Standstill));
    let took = rig.now.saturating_since(from);
    assert!(took >= rig.params.standstill_hold && took <= rig.params.standstill_hold + PERIOD);
}

#[test]
fn standstill_is_found_from_positions_where_no_speed_is_measured() {
    let mut rig = moving();
    rig.plant.reports_velocity = false;
    rig.stop = Some(L2);
    rig.until("the end of the ramp", Rig::command_rests);
    assert_eq!(rig.stages(), [Commanded]);
    let from = rig.now;
    rig.until("standstill", |rig| rig.stages().contains(&Standstill));
    let took = rig.now.saturating_since(from);
    assert!(took >= rig.params.standstill_hold, "{took:?}");
    assert!(took <= rig.params.standstill_hold + PERIOD * 8, "{took:?}");
}

#[test]
fn what_was_measured_before_the_stop_is_no_evidence() {
    let mut rig = Rig::in_mode(Halt);
    rig.ticks(100);
    rig.plant.silent = true;
    rig.ticks(9);
    rig.stop = Some(L2);
    rig.tick();
    let from = rig.now;
    rig.plant.silent = false;
    rig.until("standstill", |rig| rig.stages().contains(&Standstill));
    let took = rig.now.saturating_since(from);
    // The first report after the stop is a tick later.
    assert_eq!(took, rig.params.standstill_hold + PERIOD);
}

#[test]
fn a_robot_that_creeps_is_not_at_standstill_with_or_without_measured_speed() {
    for reports_velocity in [true, false] {
        let mut rig = Rig::in_mode(Halt);
        rig.plant.reports_velocity = reports_velocity;
        rig.plant.blocked = true;
        rig.plant.creep = 0.02 * PERIOD.as_secs_f64();
        rig.stop = Some(L2);
        rig.ticks(300);
        assert_eq!(rig.stages(), [Commanded], "speed measured: {reports_velocity}");
        rig.plant.creep = 0.0;
        rig.until("standstill", |rig| rig.stages().contains(&Standstill));
    }
}

#[test]
fn without_feedback_nothing_is_known_to_stand() {
    let mut rig = moving();
    rig.plant.silent = true;
    rig.stop = Some(L1);
    rig.ticks(300);
    assert_eq!(rig.stages(), [Commanded], "while it was still heard");
    assert_eq!(rig.fault_codes(), [FaultCode::CommunicationLost]);
    assert!(rig.plant.asked.contains(&DriverRequest::Disable), "asked for though nothing is heard");
}

#[test]
fn a_stop_without_communication_is_not_said_to_be_commanded() {
    let mut rig = moving();
    rig.plant.silent = true;
    rig.ticks(20);
    assert_eq!(rig.mode(), InvalidState);
    rig.plant.obeys_after = None;
    rig.stop = Some(L0);
    rig.ticks(20);
    assert_eq!(rig.stages(), []);
    assert!(!rig.plant.asked.is_empty());
    rig.plant.silent = false;
    rig.plant.obeys_after = Some(2);
    rig.until("drives off", |rig| rig.stages().contains(&DrivesOff));
    assert_eq!(rig.stages(), [Commanded, Standstill, DrivesOff]);
    assert_eq!(rig.mode(), InvalidState, "the fault is still latched");
}

#[test]
fn a_stop_in_invalid_state_sends_stay_where_you_are() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.silent = true;
    rig.ticks(20);
    rig.plant.silent = false;
    rig.tick();
    assert!(rig.last.as_ref().expect("a tick").command.is_none());
    rig.stop = Some(L2);
    let output = rig.tick();
    let command = output.command.expect("a set-point");
    assert_eq!(command.joint_position, rig.plant.position);
    assert_eq!(rig.stages(), [Commanded]);
    rig.until("standstill", |rig| rig.stages().contains(&Standstill));
}

#[test]
fn with_the_drives_off_a_stop_is_commanded_by_that() {
    let mut rig = Rig::in_mode(Halt);
    (rig.plant.enabled, rig.plant.ready) = (false, false);
    rig.tick();
    rig.stop = Some(L2);
    rig.tick();
    assert_eq!(rig.stages(), [Commanded]);
    rig.until("drives off", |rig| rig.stages().contains(&DrivesOff));
    assert_eq!(rig.stages(), [Commanded, Standstill, DrivesOff]);
    assert!(rig.plant.asked.is_empty());
}

#[test]
fn a_raised_level_is_a_stop_of_its_own() {
    let mut rig = moving();
    rig.stop = Some(L2);
    rig.until("standstill", |rig| rig.stages().contains(&Standstill));
    let epoch = rig.epoch();
    rig.stop = Some(L1);
    rig.tick();
    assert_eq!(rig.epoch(), epoch + 1);
    assert_eq!(rig.stages(), [Commanded, Standstill, Commanded]);
    rig.until("drives off", |rig| rig.stages().contains(&DrivesOff));
    assert_eq!(rig.stages(), [Commanded, Standstill, Commanded, Standstill, DrivesOff]);
}

#[test]
fn a_raise_to_level_0_during_the_ramp_cuts_it_short() {
    let mut rig = moving();
    rig.stop = Some(L1);
    rig.ticks(10);
    rig.stop = Some(L0);
    let output = rig.tick();
    assert_eq!((output.command, output.driver_request), (None, Some(DriverRequest::Disable)));
    assert_eq!(rig.stages(), [Commanded, Commanded]);
}

#[test]
fn a_raise_shortly_after_drives_off_was_asked_for_asks_again_at_once() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.obeys_after = None;
    rig.stop = Some(L1);
    rig.until("the request", |rig| !rig.plant.asked.is_empty());
    rig.stop = Some(L0);
    assert_eq!(rig.tick().driver_request, Some(DriverRequest::Disable));
    assert_eq!(rig.stages().last(), Some(&Commanded));
}

#[test]
fn a_level_does_not_fall_before_the_gate_opens() {
    let mut rig = Rig::in_mode(Halt);
    rig.stop = Some(L0);
    rig.ticks(2);
    let epoch = rig.epoch();
    rig.stop = Some(L2);
    rig.plant.obeys_after = None;
    rig.ticks(20);
    assert_eq!(rig.epoch(), epoch);
    assert!(rig.last.as_ref().expect("a tick").command.is_none(), "still level 0");
}

#[test]
fn every_motion_is_refused_while_stopped() {
    let path = trajectory(&[(0.0, [0.0; 3]), (1.0, [0.1; 3])]);
    for level in [L2, L1, L0] {
        let mut rig = Rig::in_mode(Jog);
        rig.stop = Some(level);
        for order in [jog(1, [0.1; 3]), follow(2, &path), Order::SetMode(Jog), Order::Enable] {
            assert_eq!(rig.ask(order), Err(Refusal::Stopped(level)));
        }
        assert_eq!(rig.ask(Order::Cancel(Uuid::from_u128(1))), Err(Refusal::NoSuchMotion));
        let flags = rig.last.as_ref().expect("a tick").snapshot.flags;
        assert!(flags.contains(RobotFlags::ESTOP) && flags.contains(RobotFlags::ESTOP_SOFTWARE));
        assert!(!flags.contains(RobotFlags::ERROR), "a stop is no error");
    }
}

#[test]
fn clearing_a_stop_moves_nothing_and_enables_nothing() {
    for level in [L2, L1, L0] {
        let mut rig = moving();
        rig.stop = Some(level);
        rig.until("standstill", |rig| rig.stages().contains(&Standstill));
        rig.ticks(50);
        let (epoch, enabled, position) = (rig.epoch(), rig.plant.enabled, rig.plant.position);
        rig.stop = None;
        rig.tick();
        assert_eq!((rig.epoch(), rig.mode()), (epoch + 1, Halt));
        assert!(rig.events.contains(&LoopEvent::StopCleared));
        rig.ticks(300);
        assert_eq!(rig.plant.position, position);
        assert_eq!(rig.plant.enabled, enabled);
        assert!(!rig.plant.asked.contains(&DriverRequest::Enable));
    }
}

#[test]
fn a_stop_right_after_a_reset_is_a_stop_of_its_own() {
    for again in [L2, L1] {
        let mut rig = moving();
        rig.stop = Some(L1);
        rig.until("drives off", |rig| rig.stages().contains(&DrivesOff));
        let epoch = rig.epoch();
        rig.events.clear();
        // Reset and stopped again between two ticks.
        (rig.stop, rig.resets) = (Some(again), rig.resets.wrapping_add(1));
        rig.tick();
        assert!(rig.events.contains(&LoopEvent::StopCleared));
        assert_eq!(rig.epoch(), epoch + 2);
        rig.until("standstill anew", |rig| rig.stages().contains(&Standstill));
        let cleared = rig.events.iter().filter(|event| **event == LoopEvent::StopCleared);
        assert_eq!(cleared.count(), 1);
        rig.stop = None;
        rig.resets = rig.resets.wrapping_add(1);
        rig.tick();
        let cleared = rig.events.iter().filter(|event| **event == LoopEvent::StopCleared);
        assert_eq!(cleared.count(), 2);
        assert_eq!(rig.mode(), Halt);
    }
}

#[test]
fn a_stop_that_is_cleared_during_its_ramp_ramps_to_the_end() {
    let mut rig = moving();
    rig.stop = Some(L2);
    rig.ticks(5);
    rig.stop = None;
    rig.tick();
    assert!(!rig.command_rests());
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::StillMoving));
    rig.until("standstill", Rig::command_rests);
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn after_clearing_the_robot_can_move_again() {
    let mut rig = moving();
    rig.stop = Some(L0);
    rig.until("drives off", |rig| rig.stages().contains(&DrivesOff));
    rig.plant.position = joints([0.9, 0.1, -0.3]);
    rig.stop = None;
    rig.ask_and_wait(Order::Enable).expect("granted");
    assert_eq!(rig.commands.last().expect("sent").joint_position, joints([0.9, 0.1, -0.3]));
    rig.ask(Order::SetMode(Jog)).expect("granted");
    rig.jog(2, [0.0; 3]).expect("granted");
    rig.until("the end", |rig| rig.ended(2).is_some());
    assert_eq!(rig.fault_codes(), []);
    rig.finish();
}

#[test]
fn a_stop_during_a_fault_ramp_goes_on_with_it() {
    let mut rig = moving();
    rig.loop_error = true;
    rig.tick();
    rig.loop_error = false;
    rig.stop = Some(L2);
    rig.until("standstill", |rig| rig.stages().contains(&Standstill));
    assert_eq!(rig.mode(), InvalidState);
    assert!(rig.ask(Order::ResetErrors).is_ok(), "errors can be reset under a stop");
    assert_eq!(rig.mode(), Halt);
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::Stopped(L2)));
}

#[test]
fn a_reset_of_errors_under_a_stop_moves_nothing_and_clearing_the_stop_takes_the_robots_place() {
    let mut rig = Rig::in_mode(Jog);
    let held = rig.plant.position;
    rig.plant.blocked = true;
    rig.plant.position = joints([0.3, 0.0, 0.0]);
    rig.tick();
    assert_eq!(rig.fault_codes(), [FaultCode::TrackingError]);
    rig.stop = Some(L2);
    rig.tick();
    assert!(rig.ask(Order::ResetErrors).is_ok());
    rig.ticks(100);
    assert_eq!(rig.commands.last().expect("held").joint_position, held);
    rig.stop = None;
    rig.ticks(400);
    let place = joints([0.3, 0.0, 0.0]);
    assert_eq!(rig.commands.last().expect("held").joint_position, place);
    assert_eq!(
        rig.plant.position, place,
        "the set-point came to the robot, not it to the set-point"
    );
}
