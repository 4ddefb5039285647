//! Enable, disable, reset: answers that tell what was measured.

use armada_protocol::messages::{ActionStatus, CommandMode, FaultCode, StopLevel};

use super::rig::{PERIOD, Rig, jog, params, trajectory};
use crate::control::{LoopEvent, Order, Refusal};
use crate::drivers::DriverRequest;

use CommandMode::{Halt, InvalidState, Jog, Trajectory};

fn disabled() -> Rig {
    let mut rig = Rig::new();
    (rig.plant.enabled, rig.plant.ready) = (false, false);
    rig.tick();
    rig
}

#[test]
fn enable_is_granted_when_the_drives_are_reported_on() {
    let mut rig = disabled();
    let ticket = rig.order(Order::Enable);
    rig.tick();
    assert_eq!(rig.plant.asked, [DriverRequest::Enable]);
    assert_eq!(rig.answer(ticket), None);
    rig.until("the answer", |rig| rig.answer(ticket).is_some());
    assert!(rig.plant.enabled && rig.answer(ticket).is_some_and(|answer| answer.is_ok()));
    assert_eq!(rig.mode(), Halt, "enabling moves nothing and changes no mode");
    rig.ticks(50);
    assert_eq!(rig.plant.asked.len(), 1);
}

#[test]
fn enable_with_drives_on_is_granted_at_once() {
    let mut rig = Rig::in_mode(Halt);
    assert!(rig.ask(Order::Enable).is_ok());
    assert!(rig.plant.asked.is_empty());
}

#[test]
fn enable_without_effect_is_refused_in_bounded_time_with_what_is_missing() {
    let mut rig = disabled();
    rig.plant.obeys_after = None;
    let from = rig.now;
    assert_eq!(rig.ask_and_wait(Order::Enable), Err(Refusal::NotEnabled));
    let took = rig.now.saturating_since(from);
    assert!(took <= rig.params.request_timeout + PERIOD * 2, "{took:?}");
    rig.plant.enabled = true;
    assert_eq!(rig.ask_and_wait(Order::Enable), Err(Refusal::NotReady));
    let asked = rig.plant.asked.len();
    rig.ticks(100);
    assert_eq!(rig.plant.asked.len(), asked, "no longer asked for once refused");
}

#[test]
fn enable_is_refused_while_a_fault_is_latched() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.error_code = 1;
    assert_eq!(rig.ask(Order::Enable), Err(Refusal::Faulted(FaultCode::ControllerError)));
}

#[test]
fn a_stop_a_fault_and_a_disable_each_refuse_a_waiting_enable() {
    let stop = |rig: &mut Rig| rig.stop = Some(StopLevel::L2);
    let fault = |rig: &mut Rig| rig.plant.error_code = 1;
    let disable = |rig: &mut Rig| {
        rig.order(Order::Disable);
    };
    let silence = |rig: &mut Rig| rig.plant.silent = true;
    type Case = (fn(&mut Rig), Refusal);
    let cases: [Case; 4] = [
        (stop, Refusal::Stopped(StopLevel::L2)),
        (fault, Refusal::Faulted(FaultCode::ControllerError)),
        (disable, Refusal::Disabled),
        (silence, Refusal::CommunicationLost),
    ];
    for (happen, refusal) in cases {
        let mut rig = disabled();
        rig.plant.obeys_after = None;
        let ticket = rig.order(Order::Enable);
        rig.tick();
        happen(&mut rig);
        rig.ticks(15);
        assert_eq!(rig.answer(ticket), Some(Err(refusal)));
        let asked = rig.plant.asked.len();
        rig.ticks(30);
        let later = &rig.plant.asked[asked..];
        assert!(!later.contains(&DriverRequest::Enable), "withdrawn");
        rig.finish();
    }
}

#[test]
fn disable_ramps_first_and_is_granted_when_the_drives_are_off() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.5, 0.0, 0.0]).expect("granted");
    rig.ticks(100);
    let ticket = rig.order(Order::Disable);
    rig.tick();
    let end = rig.ended(1).expect("ended");
    assert_eq!((end.status, end.reason), (ActionStatus::Cancelled, Some(Refusal::Disabled)));
    assert_eq!(rig.mode(), Halt);
    assert!(!rig.command_rests() && rig.plant.asked.is_empty());
    rig.until("the request", |rig| !rig.plant.asked.is_empty());
    assert!(rig.command_rests() && rig.answer(ticket).is_none());
    rig.until("the answer", |rig| rig.answer(ticket).is_some());
    assert!(!rig.plant.enabled && rig.answer(ticket).is_some_and(|answer| answer.is_ok()));
    assert_eq!(rig.fault_codes(), []);
}

#[test]
fn disable_of_a_standing_robot_is_asked_at_once() {
    let mut rig = Rig::in_mode(Halt);
    rig.ticks(100);
    rig.order(Order::Disable);
    assert_eq!(rig.tick().driver_request, Some(DriverRequest::Disable));
}

#[test]
fn disable_raises_the_epoch_and_forbids_motion_until_it_is_done() {
    let mut rig = Rig::in_mode(Halt);
    let epoch = rig.epoch();
    rig.plant.obeys_after = Some(20);
    rig.order(Order::Disable);
    rig.tick();
    assert_eq!(rig.epoch(), epoch + 1);
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::Disabled));
    assert_eq!(rig.ask(Order::Enable), Err(Refusal::Disabled));
    rig.until("drives off", |rig| !rig.plant.enabled);
    rig.tick();
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::NotEnabled));
    rig.ask_and_wait(Order::Enable).expect("granted");
}

#[test]
fn disable_with_drives_off_is_granted_at_once() {
    let mut rig = disabled();
    assert!(rig.ask(Order::Disable).is_ok());
    assert!(rig.plant.asked.is_empty());
}

#[test]
fn a_disable_without_effect_is_refused_in_bounded_time() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.obeys_after = None;
    assert_eq!(rig.ask_and_wait(Order::Disable), Err(Refusal::StillEnabled));
    rig.ask(Order::SetMode(Jog)).expect("the robot can be used again");
}

#[test]
fn a_disable_is_refused_when_communication_is_lost_meanwhile() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.obeys_after = None;
    let ticket = rig.order(Order::Disable);
    rig.tick();
    rig.plant.silent = true;
    rig.ticks(20);
    assert_eq!(rig.answer(ticket), Some(Err(Refusal::CommunicationLost)));
}

#[test]
fn reset_waits_for_the_controller_to_clear_its_error() {
    let mut rig = Rig::in_mode(Trajectory);
    let path = trajectory(&[(0.0, [0.0; 3]), (2.0, [1.0; 3])]);
    rig.follow(1, &path).expect("granted");
    rig.ticks(50);
    (rig.plant.error_code, rig.plant.ready) = (9, false);
    rig.tick();
    assert_eq!(rig.mode(), InvalidState);
    let ticket = rig.order(Order::ResetErrors);
    rig.tick();
    assert_eq!(rig.plant.asked, [DriverRequest::ResetErrors]);
    assert_eq!(rig.answer(ticket), None);
    let epoch = rig.epoch();
    rig.until("the answer", |rig| rig.answer(ticket).is_some());
    let granted = rig.answer(ticket).expect("answered").expect("granted");
    assert_eq!((granted.command_mode, granted.epoch), (Halt, epoch + 1));
    assert!(rig.events.contains(&LoopEvent::FaultsCleared));
    rig.finish();
}

#[test]
fn reset_is_refused_with_the_cause_that_remains() {
    let mut rig = Rig::in_mode(Halt);
    (rig.plant.emergency_stop, rig.plant.ready) = (true, false);
    rig.tick();
    let refusal = Refusal::CauseRemains(FaultCode::EmergencyStop);
    assert_eq!(rig.ask_and_wait(Order::ResetErrors), Err(refusal));
    assert_eq!(rig.mode(), InvalidState);
    rig.plant.emergency_stop = false;
    rig.tick();
    assert_eq!(rig.mode(), InvalidState, "its release alone changes nothing");
    assert!(rig.ask_and_wait(Order::ResetErrors).is_ok());
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn reset_without_a_fault_is_granted_and_still_forwarded() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [0.5, 0.0, 0.0]).expect("granted");
    let epoch = rig.epoch();
    assert!(rig.ask(Order::ResetErrors).is_ok());
    assert_eq!(rig.plant.asked, [DriverRequest::ResetErrors]);
    assert_eq!((rig.mode(), rig.epoch()), (Jog, epoch), "nothing else happens");
    assert!(!rig.events.contains(&LoopEvent::FaultsCleared));
    rig.ticks(50);
    assert_eq!(rig.plant.asked.len(), 1, "once");
}

#[test]
fn a_fault_that_comes_after_the_reset_was_asked_for_is_not_cleared_by_it() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.error_code = 9;
    rig.tick();
    let ticket = rig.order(Order::ResetErrors);
    rig.tick();
    rig.loop_error = true;
    rig.tick();
    rig.loop_error = false;
    rig.ticks(20);
    assert_eq!(rig.answer(ticket), Some(Err(Refusal::CauseRemains(FaultCode::LoopError))));
    assert_eq!(rig.mode(), InvalidState);
    assert!(rig.ask_and_wait(Order::ResetErrors).is_ok());
}

#[test]
fn a_fault_of_the_same_tick_is_not_cleared_by_a_reset_that_cannot_know_of_it() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.plant.ready = false;
    let refusal = Refusal::CauseRemains(FaultCode::NotReady);
    assert_eq!(rig.ask(Order::ResetErrors), Err(refusal));
    assert_eq!(rig.mode(), InvalidState);
    assert!(rig.ask(Order::ResetErrors).is_ok());
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn too_many_waiting_requests_are_refused_but_a_disable_always_has_room() {
    let mut rig = disabled();
    rig.plant.obeys_after = None;
    rig.plant.enabled = true;
    let tickets: Vec<u64> = (0..4).map(|_| rig.order(Order::Enable)).collect();
    rig.tick();
    assert_eq!(rig.answer(tickets[3]), Some(Err(Refusal::TooManyPending)));
    assert!(tickets[..3].iter().all(|&ticket| rig.answer(ticket).is_none()));
    let resets: Vec<u64> = (0..2).map(|_| rig.order(Order::Disable)).collect();
    rig.tick();
    assert!(tickets[..3].iter().all(|&t| rig.answer(t) == Some(Err(Refusal::Disabled))));
    assert!(resets.iter().all(|&ticket| rig.answer(ticket).is_none()), "both wait");
    rig.finish();
}

#[test]
fn a_disable_has_room_beside_waiting_resets() {
    let mut rig = Rig::in_mode(Halt);
    rig.ticks(50);
    (rig.plant.error_code, rig.plant.obeys_after) = (4, None);
    rig.tick();
    for _ in 0..3 {
        rig.order(Order::ResetErrors);
    }
    let disable = rig.order(Order::Disable);
    let another = rig.order(Order::Disable);
    rig.tick();
    assert_eq!(rig.answer(disable), None);
    assert_eq!(rig.answer(another), Some(Err(Refusal::TooManyPending)));
    assert!(rig.plant.asked.contains(&DriverRequest::Disable));
    rig.finish();
}

#[test]
fn drives_off_goes_before_every_other_request() {
    let mut rig = Rig::in_mode(Halt);
    rig.ticks(50);
    rig.order(Order::ResetErrors);
    rig.order(Order::Disable);
    assert_eq!(rig.tick().driver_request, Some(DriverRequest::Disable));
    assert_eq!(rig.tick().driver_request, Some(DriverRequest::ResetErrors));
}

#[test]
fn requests_of_one_tick_are_taken_in_their_order() {
    let mut rig = Rig::with(params());
    rig.tick();
    let tickets = [Order::SetMode(Jog), jog(1, [0.1; 3]), Order::Halt, jog(2, [0.1; 3])]
        .map(|order| rig.order(order));
    rig.tick();
    let answers: Vec<u64> = rig
        .events
        .iter()
        .filter_map(|event| match event {
            LoopEvent::Answer { ticket, .. } => Some(*ticket),
            _ => None,
        })
        .collect();
    assert_eq!(answers, tickets);
    let wrong_mode = Refusal::WrongMode { mode: Halt, needed: Jog };
    assert_eq!(rig.answer(tickets[3]), Some(Err(wrong_mode)));
}
