//! Start-up, communication, and faults.

use std::time::Duration;

use armada_model::JointVector;
use armada_protocol::messages::{
    ActionStatus, CommandMode, ControllerState, FaultCode, OperationalMode, RobotFlags, StopLevel,
};

use super::rig::{JOINTS, PERIOD, Rig, follow, jog, joints, params, trajectory, trajectory_within};
use crate::control::{LoopEvent, LoopState, Order, ParamsError, Refusal, Snapshot};
use crate::drivers::DriverRequest;

use CommandMode::{Halt, InvalidState, Jog, Trajectory};

fn snapshot(rig: &Rig) -> Snapshot {
    rig.last.as_ref().expect("a tick").snapshot
}

#[test]
fn before_the_first_feedback_nothing_is_known_and_nothing_is_a_fault() {
    let mut rig = Rig::new();
    rig.plant.silent = true;
    rig.ticks(500);
    let state = snapshot(&rig);
    assert_eq!(state.command_mode, InvalidState);
    assert_eq!(state.controller_state, ControllerState::Undefined);
    assert_eq!(state.operational_mode, OperationalMode::Undefined);
    assert_eq!(state.flags, RobotFlags::COMMUNICATION_FAILURE);
    assert_eq!(state.joint_position, JointVector::EMPTY);
    assert!(rig.events.is_empty() && rig.commands.is_empty());
}

#[test]
fn every_order_but_a_stop_is_refused_before_the_first_feedback() {
    let path = trajectory(&[(0.0, [0.0; 3]), (1.0, [0.1; 3])]);
    let mut rig = Rig::new();
    rig.plant.silent = true;
    for order in [
        Order::SetMode(Halt),
        Order::SetMode(Jog),
        Order::Halt,
        Order::Enable,
        Order::Disable,
        Order::ResetErrors,
        jog(1, [0.0; 3]),
        follow(2, &path),
    ] {
        assert_eq!(rig.ask(order.clone()), Err(Refusal::CommunicationLost), "{order:?}");
    }
}

#[test]
fn the_first_good_feedback_leads_to_halt_and_holds_the_measured_position() {
    let mut rig = Rig::new();
    rig.plant.position = joints([0.4, -0.2, 9.0]);
    rig.tick();
    assert_eq!(rig.mode(), Halt);
    assert_eq!(snapshot(&rig).controller_state, ControllerState::MotorOn);
    assert_eq!(rig.commands[0].joint_position, joints([0.4, -0.2, 9.0]));
    rig.ticks(10);
    assert_eq!(rig.commands.len(), 11, "the stream stays alive in halt");
}

#[test]
fn an_error_at_start_up_is_latched_and_halt_needs_a_reset() {
    let mut rig = Rig::new();
    rig.plant.error_code = 3;
    rig.ticks(5);
    assert_eq!((rig.mode(), rig.fault_codes()), (InvalidState, vec![FaultCode::ControllerError]));
    rig.plant.error_code = 0;
    rig.ticks(5);
    assert_eq!(rig.mode(), InvalidState, "it does not leave by itself");
    assert!(rig.ask(Order::ResetErrors).is_ok());
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn silence_latches_a_fault_and_empties_the_state() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.0, 0.0, 0.0]).expect("granted");
    rig.ticks(50);
    rig.plant.silent = true;
    let sent = rig.commands.len();
    let timeout = rig.params.communication_timeout;
    rig.ticks((timeout.as_nanos() / PERIOD.as_nanos()) as usize);
    assert_eq!(rig.fault_codes(), [], "exactly the timeout is not too old");
    rig.tick();
    assert_eq!(rig.fault_codes(), [FaultCode::CommunicationLost]);
    let end = rig.ended(1).expect("the motion ended");
    assert_eq!(end.status, ActionStatus::Failed);
    assert_eq!(end.reason, Some(Refusal::CommunicationLost));
    let state = snapshot(&rig);
    assert_eq!(state.command_mode, InvalidState);
    assert_eq!(state.controller_state, ControllerState::Undefined);
    assert_eq!(state.joint_position, JointVector::EMPTY);
    assert_eq!(state.joint_position_command, JointVector::EMPTY);
    assert!(state.flags.contains(RobotFlags::COMMUNICATION_FAILURE));
    assert!(state.flags.contains(RobotFlags::ERROR));
    assert!(!state.flags.contains(RobotFlags::ENABLED));
    assert_eq!(rig.commands.len(), sent + 10);
    rig.ticks(50);
    assert_eq!(rig.commands.len(), sent + 10, "nothing is sent without feedback");
    assert_eq!(rig.fault_codes().len(), 1, "latched once");
}

#[test]
fn communication_that_comes_back_changes_nothing_before_a_reset() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.silent = true;
    rig.ticks(20);
    assert_eq!(
        rig.ask(Order::ResetErrors),
        Err(Refusal::CauseRemains(FaultCode::CommunicationLost))
    );
    rig.plant.silent = false;
    let sent = rig.commands.len();
    rig.ticks(20);
    assert_eq!(rig.mode(), InvalidState);
    assert_eq!(rig.commands.len(), sent, "a stream that broke off does not begin by itself");
    assert!(rig.ask(Order::ResetErrors).is_ok());
    rig.plant.position = joints([0.5, 0.5, 0.5]);
    rig.tick();
    assert_eq!(rig.mode(), Halt);
    let begun = rig.commands.last().expect("a set-point").joint_position;
    assert_eq!(begun, joints([0.5, 0.5, 0.5]), "begun where the robot was measured");
}

#[test]
fn feedback_of_another_robot_is_no_feedback() {
    let mut rig = Rig::new();
    rig.plant.position = JointVector::from_slice(&[0.0; JOINTS + 1]).expect("four");
    rig.ticks(3);
    assert_eq!(rig.mode(), InvalidState);
    rig.plant.position = joints([0.0, 0.0, 0.0]).map_indexed(|_, _| f64::NAN);
    rig.ticks(3);
    assert_eq!(rig.mode(), InvalidState);
    rig.plant.position = joints([0.0; 3]);
    rig.ticks(2);
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn drives_or_readiness_lost_in_a_motion_mode_is_a_fault() {
    let lost: [fn(&mut Rig); 2] = [|rig| rig.plant.enabled = false, |rig| rig.plant.ready = false];
    for lose in lost {
        let mut rig = Rig::in_mode(Trajectory);
        let path = trajectory(&[(0.0, [0.0; 3]), (2.0, [1.0; 3])]);
        rig.follow(1, &path).expect("granted");
        rig.ticks(100);
        lose(&mut rig);
        let output = rig.tick();
        assert_eq!(output.command, None);
        assert_eq!((rig.mode(), rig.fault_codes()), (InvalidState, vec![FaultCode::NotReady]));
        let reason = rig.ended(1).expect("ended").reason;
        assert_eq!(reason, Some(Refusal::Faulted(FaultCode::NotReady)));
        assert_eq!(rig.retired.len(), 1);
        assert!(rig.ask(Order::ResetErrors).is_ok(), "drives off is no cause in halt");
        assert_eq!(rig.mode(), Halt);
    }
}

#[test]
fn the_controllers_emergency_stop_is_told_from_its_error() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.emergency_stop = true;
    rig.plant.error_code = 12;
    rig.tick();
    assert_eq!(rig.fault_codes(), [FaultCode::EmergencyStop, FaultCode::ControllerError]);
    let state = snapshot(&rig);
    assert_eq!(state.controller_state, ControllerState::EmergencyStop);
    for flag in [RobotFlags::ESTOP, RobotFlags::ESTOP_INTERNAL, RobotFlags::ERROR] {
        assert!(state.flags.contains(flag));
    }
    assert!(!state.flags.contains(RobotFlags::ESTOP_SOFTWARE));
    rig.plant.emergency_stop = false;
    rig.tick();
    assert_eq!(snapshot(&rig).controller_state, ControllerState::GuardStop);
}

#[test]
fn a_fault_tells_its_value_and_its_limit() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.error_code = 77;
    rig.tick();
    let fault = rig.events.iter().find_map(|event| match event {
        LoopEvent::FaultLatched(fault) => Some(*fault),
        _ => None,
    });
    let fault = fault.expect("latched");
    assert_eq!((fault.value, fault.stamp, fault.joint), (77.0, rig.now, None));
}

#[test]
fn a_robot_that_does_not_follow_is_stopped_within_its_limits() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.0, 0.0, 0.0]).expect("granted");
    rig.ticks(60);
    rig.plant.blocked = true;
    rig.until("the fault", |rig| !rig.fault_codes().is_empty());
    assert_eq!(rig.fault_codes(), [FaultCode::TrackingError]);
    let fault = rig.events.iter().find_map(|event| match event {
        LoopEvent::FaultLatched(fault) => Some(*fault),
        _ => None,
    });
    let fault = fault.expect("latched");
    assert_eq!((fault.joint, fault.limit), (Some(0), 0.02));
    assert!(fault.value > 0.02 && fault.value < 0.03, "seen at once: {}", fault.value);
    assert_eq!(rig.mode(), InvalidState, "from the fault on, not from the end of the ramp");
    assert_eq!(
        rig.ended(1).expect("the motion is over").reason,
        Some(Refusal::Faulted(FaultCode::TrackingError))
    );
    assert!(!rig.command_rests(), "a ramp, not a jump to standstill");
    rig.until("standstill", Rig::command_rests);
    rig.ticks(5);
    assert!(rig.last.expect("a tick").command.is_some(), "then it is held");
}

#[test]
fn a_trajectory_narrows_the_tolerance_and_never_widens_it() {
    for (asked, limit) in [(0.004, 0.004), (1.0, 0.02)] {
        let mut rig = Rig::in_mode(Trajectory);
        let rows = [(0.0, [0.0; 3]), (2.0, [0.5, 0.0, 0.0])];
        rig.follow(1, &trajectory_within(&[asked; 3], &rows)).expect("granted");
        rig.ticks(60);
        rig.plant.blocked = true;
        rig.until("the fault", |rig| !rig.fault_codes().is_empty());
        let fault = rig.events.iter().find_map(|event| match event {
            LoopEvent::FaultLatched(fault) => Some(*fault),
            _ => None,
        });
        let fault = fault.expect("latched");
        assert_eq!((fault.code, fault.joint), (FaultCode::TrackingError, Some(0)));
        assert_eq!(fault.limit, limit);
    }
}

#[test]
fn after_a_tracking_error_the_set_point_goes_to_the_robot_and_it_moves_again() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.0, 0.0, 0.0]).expect("granted");
    rig.ticks(60);
    rig.plant.blocked = true;
    rig.until("the fault", |rig| !rig.fault_codes().is_empty());
    let measured = rig.plant.position;
    rig.until("standstill", Rig::command_rests);
    rig.plant.blocked = false;
    rig.plant.ready = false;
    rig.tick();
    rig.plant.position = measured;
    rig.plant.ready = true;
    assert!(rig.ask(Order::ResetErrors).is_ok());
    rig.ticks(2);
    assert_eq!(rig.commands.last().expect("sent").joint_position, measured);
    assert!(rig.ask(Order::SetMode(Jog)).is_ok());
    rig.jog(2, [1.0, 0.0, 0.0]).expect("granted");
    rig.until("the end", |rig| rig.ended(2).is_some());
    assert_eq!(rig.statuses(2).last(), Some(&ActionStatus::Complete));
}

#[test]
fn a_set_point_of_a_live_stream_goes_to_a_robot_that_was_pushed_within_the_limits() {
    let mut rig = Rig::in_mode(Jog);
    rig.plant.blocked = true;
    rig.plant.position = joints([0.3, 0.0, 0.0]);
    rig.tick();
    assert_eq!(rig.fault_codes(), [FaultCode::TrackingError]);
    assert!(rig.ask(Order::ResetErrors).is_ok());
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::StillMoving));
    // The watch of the rig sees to it that this goes within velocity and acceleration.
    rig.until("the set-point", |rig| {
        rig.commands.last().is_some_and(|c| c.joint_position == joints([0.3, 0.0, 0.0]))
    });
    assert!(rig.ask(Order::SetMode(Jog)).is_ok());
    rig.ticks(20);
    assert_eq!(rig.fault_codes().len(), 1, "no second fault");
}

#[test]
fn a_good_robot_at_full_speed_is_no_tracking_error_even_after_late_wakes() {
    let params = crate::control::Params { tracking_tolerance: joints([1e-6; JOINTS]), ..params() };
    let mut rig = Rig::with(params);
    rig.tick();
    rig.ask(Order::SetMode(Jog)).expect("granted");
    rig.jog(1, [1.5, -0.5, 3.0]).expect("granted");
    for late in [1, 1, 5, 1, 9, 2].into_iter().cycle().take(60) {
        rig.late_tick(late);
    }
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.fault_codes(), []);
}

#[test]
fn a_failed_step_is_a_fault_and_a_ramp() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.0, 0.0, 0.0]).expect("granted");
    rig.ticks(60);
    let epoch = rig.epoch();
    rig.loop_error = true;
    rig.tick();
    assert_eq!((rig.mode(), rig.fault_codes()), (InvalidState, vec![FaultCode::LoopError]));
    assert_eq!(rig.epoch(), epoch + 1);
    let reset = rig.order(Order::ResetErrors);
    rig.ticks(3);
    assert_eq!(rig.answer(reset), None, "a reset waits for the cause to go");
    rig.loop_error = false;
    rig.tick();
    assert!(rig.answer(reset).is_some_and(|answer| answer.is_ok()));
    rig.until("standstill", Rig::command_rests);
}

#[test]
fn a_set_point_that_is_not_finite_is_dropped_and_latches_a_loop_error() {
    use armada_model::MotionState;

    use crate::control::motion::End;
    use crate::control::state::Tick;

    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.0, 0.0, 0.0]).expect("granted");
    rig.ticks(60);
    let nan = joints([0.0; 3]).map_indexed(|_, _| f64::NAN);
    let mut output = rig.last.clone().expect("a tick");
    output.events.clear();
    let mut tick = Tick {
        params: &rig.params,
        now: rig.now,
        loop_error: false,
        stopped: false,
        output: &mut output,
    };
    let desired = MotionState { position: nan, velocity: nan };
    let sent = rig.state.emit(&mut tick, &desired, Some(End::Complete));
    assert_eq!(sent, None);
    assert!(output.events.iter().any(
        |event| matches!(event, LoopEvent::FaultLatched(f) if f.code == FaultCode::LoopError)
    ));
    assert!(
        output
            .events
            .iter()
            .any(|event| matches!(event, LoopEvent::Motion(m) if m.status == ActionStatus::Failed))
    );
    rig.until("standstill", Rig::command_rests);
    assert_eq!(rig.mode(), InvalidState);
}

#[test]
fn drives_are_switched_on_once_at_start_up_if_asked_for() {
    let mut rig = Rig::with(crate::control::Params { enable_on_start: true, ..params() });
    (rig.plant.enabled, rig.plant.ready) = (false, false);
    rig.until("the drives", |rig| rig.plant.enabled);
    rig.tick();
    assert_eq!(rig.plant.asked, [DriverRequest::Enable]);
    (rig.plant.enabled, rig.plant.ready) = (false, false);
    rig.ticks(200);
    assert!(!rig.plant.enabled, "once only");
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn start_up_does_not_enable_under_a_latched_stop_nor_after_its_reset() {
    for silent_ticks in [0, 3] {
        let mut rig = Rig::with(crate::control::Params { enable_on_start: true, ..params() });
        (rig.plant.enabled, rig.plant.ready) = (false, false);
        rig.stop = Some(StopLevel::L2);
        rig.plant.silent = true;
        rig.ticks(silent_ticks);
        rig.plant.silent = false;
        rig.ticks(10);
        rig.stop = None;
        rig.ticks(100);
        assert_eq!(rig.plant.asked, []);
        assert_eq!(rig.mode(), Halt);
    }
}

#[test]
fn start_up_gives_up_enabling_when_its_time_is_up() {
    let mut rig = Rig::with(crate::control::Params { enable_on_start: true, ..params() });
    (rig.plant.enabled, rig.plant.ready) = (false, false);
    rig.plant.obeys_after = None;
    rig.ticks(500);
    assert_eq!(rig.plant.asked.len(), 4, "every 50 ms for 200 ms");
}

#[test]
fn parameters_that_make_no_sense_are_refused_with_their_name() {
    let refusal = |change: fn(&mut crate::control::Params)| {
        let mut params = params();
        change(&mut params);
        LoopState::new(&params).expect_err("refused")
    };
    assert!(matches!(refusal(|p| p.limits[1].acceleration = None), ParamsError::Limits(_)));
    assert_eq!(
        refusal(|p| p.tracking_tolerance = JointVector::EMPTY).to_string(),
        "tracking_tolerance has 0 values, expected one above 0 for each of 3 joints"
    );
    assert_eq!(
        refusal(|p| p.period = Duration::ZERO).to_string(),
        "period is 0ns, expected above 0 and at most the timeout of 40ms"
    );
}
