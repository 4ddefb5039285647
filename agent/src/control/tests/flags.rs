//! What clears a fault, what the flags tell, and what a turned key switch does.

use armada_protocol::messages::{
    ActionStatus, ClearBy, CommandMode, ControllerState, FaultCode, OperationalMode, RobotFlags,
    StopLevel,
};

use super::rig::{JOINTS, Rig, params, trajectory};
use crate::control::{LoopEvent, Order, Params, Refusal, Snapshot, clear_by};
use crate::drivers::JointSet;

use CommandMode::{Halt, InvalidState, Jog, Trajectory};

fn snapshot(rig: &Rig) -> Snapshot {
    rig.last.as_ref().expect("a tick").snapshot
}

fn flags(rig: &Rig) -> Vec<&'static str> {
    snapshot(rig).flags.names().collect()
}

fn switched(rig: &Rig) -> Vec<(OperationalMode, OperationalMode)> {
    let switched = |event: &LoopEvent| match event {
        LoopEvent::OperationalMode { from, to } => Some((*from, *to)),
        _ => None,
    };
    rig.events.iter().filter_map(switched).collect()
}

#[test]
fn halt_clears_a_fault_of_its_level_and_no_other() {
    let mut rig = Rig::in_mode(Jog);
    rig.plant.ready = false;
    rig.tick();
    assert_eq!((rig.mode(), rig.fault_codes()), (InvalidState, vec![FaultCode::NotReady]));
    assert_eq!(clear_by(FaultCode::NotReady), ClearBy::Halt);
    assert!(rig.ask(Order::SetMode(Halt)).is_ok());
    assert_eq!((rig.mode(), rig.events.contains(&LoopEvent::FaultsCleared)), (Halt, true));

    let mut rig = Rig::in_mode(Jog);
    (rig.plant.ready, rig.plant.guard_stop) = (false, true);
    rig.tick();
    assert_eq!(rig.fault_codes(), [FaultCode::GuardStop]);
    (rig.plant.ready, rig.plant.guard_stop) = (true, false);
    rig.tick();
    assert_eq!(rig.ask(Order::Halt), Err(Refusal::Faulted(FaultCode::GuardStop)));
    assert!(rig.ask(Order::ResetErrors).is_ok());
}

#[test]
fn halt_does_not_clear_a_fault_that_nobody_can_have_seen() {
    let mut rig = Rig::in_mode(Jog);
    rig.plant.ready = false;
    assert_eq!(rig.ask(Order::Halt), Err(Refusal::Faulted(FaultCode::NotReady)));
    assert_eq!(rig.mode(), InvalidState);
    assert!(rig.ask(Order::Halt).is_ok());
}

#[test]
fn what_a_person_must_clear_at_the_controller_waits_for_it() {
    type Set = fn(&mut Rig, bool);
    let causes: [(Set, FaultCode); 3] = [
        (|rig, on| rig.plant.emergency_stop = on, FaultCode::EmergencyStop),
        (|rig, on| rig.plant.guard_stop = on, FaultCode::GuardStop),
        (
            |rig, on| {
                rig.plant.conditions = RobotFlags::NONE.with(RobotFlags::FATAL_ERROR, on);
            },
            FaultCode::FatalError,
        ),
    ];
    for (set, code) in causes {
        let mut rig = Rig::in_mode(Halt);
        set(&mut rig, true);
        rig.tick();
        assert_eq!((rig.mode(), rig.fault_codes()), (InvalidState, vec![code]));
        assert_eq!(clear_by(code), ClearBy::Controller);
        rig.tick();
        assert_eq!(rig.ask_and_wait(Order::ResetErrors), Err(Refusal::CauseRemains(code)));
        set(&mut rig, false);
        rig.ticks(10);
        assert_eq!(rig.mode(), InvalidState, "its end alone changes nothing");
        assert!(rig.ask(Order::ResetErrors).is_ok());
        assert_eq!(rig.mode(), Halt);
    }
}

#[test]
fn a_good_robot_in_halt_has_three_flags() {
    let rig = Rig::in_mode(Halt);
    assert_eq!(flags(&rig), ["enabled", "ready", "homed"]);
}

#[test]
fn the_controllers_conditions_are_told_and_others_are_not_taken_from_it() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.conditions = RobotFlags::ENABLING_SWITCH
        .with(RobotFlags::ESTOP_GUARD3, true)
        .with(RobotFlags::ESTOP_SOFTWARE, true)
        .with(RobotFlags::TRAJECTORY_RUNNING, true);
    rig.tick();
    assert_eq!(flags(&rig), ["estop_guard3", "enabling_switch", "enabled", "ready", "homed"]);
}

#[test]
fn an_emergency_stop_is_told_with_its_source_and_then_that_it_waits_for_its_reset() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.emergency_stop = true;
    rig.tick();
    let all = ["error", "estop", "estop_internal", "enabled", "ready", "homed"];
    assert_eq!(flags(&rig), all, "nobody says which");
    rig.plant.conditions = RobotFlags::ESTOP_BUTTON2;
    rig.tick();
    assert_eq!(flags(&rig), ["error", "estop", "estop_button2", "enabled", "ready", "homed"]);
    assert_eq!(snapshot(&rig).controller_state, ControllerState::EmergencyStop);
    (rig.plant.emergency_stop, rig.plant.conditions) = (false, RobotFlags::NONE);
    rig.tick();
    assert_eq!(flags(&rig), ["error", "estop_released", "enabled", "ready", "homed"]);
    assert_eq!(snapshot(&rig).controller_state, ControllerState::EmergencyStopReset);
    rig.ask(Order::ResetErrors).expect("released");
    assert_eq!(flags(&rig), ["enabled", "ready", "homed"]);
    assert_eq!(snapshot(&rig).controller_state, ControllerState::MotorOn);
}

#[test]
fn a_fatal_error_is_told_until_it_is_reset() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.conditions = RobotFlags::FATAL_ERROR;
    rig.tick();
    rig.plant.conditions = RobotFlags::NONE;
    rig.tick();
    assert_eq!(flags(&rig), ["error", "fatal_error", "enabled", "ready", "homed"]);
}

#[test]
fn a_joint_without_its_reference_is_told() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.homed = JointSet::first(JOINTS - 1);
    rig.tick();
    assert_eq!(flags(&rig), ["enabled", "ready", "homing_required"]);
}

#[test]
fn without_communication_a_stop_and_a_fault_are_still_told() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.operational_mode = OperationalMode::Auto;
    rig.stop = Some(StopLevel::L2);
    rig.tick();
    rig.plant.silent = true;
    rig.ticks(20);
    assert_eq!(flags(&rig), ["error", "estop", "estop_software", "communication_failure"]);
    assert_eq!(snapshot(&rig).operational_mode, OperationalMode::Undefined);
}

#[test]
fn the_controller_state_follows_its_table() {
    type Set = fn(&mut Rig);
    let table: [(Set, ControllerState); 6] = [
        (|rig| rig.plant.guard_stop = true, ControllerState::GuardStop),
        (|rig| rig.plant.error_code = 1, ControllerState::GuardStop),
        (|rig| rig.plant.ready = false, ControllerState::GuardStop),
        (|rig| rig.plant.enabled = false, ControllerState::MotorOff),
        (|rig| rig.plant.conditions = RobotFlags::ESTOP_RELEASED, {
            ControllerState::EmergencyStopReset
        }),
        (
            |rig| (rig.plant.ready, rig.plant.homing) = (false, JointSet::first(1)),
            ControllerState::MotorOn,
        ),
    ];
    for (row, (set, state)) in table.into_iter().enumerate() {
        let mut rig = Rig::in_mode(Halt);
        set(&mut rig);
        rig.tick();
        assert_eq!(snapshot(&rig).controller_state, state, "row {row}");
    }
}

#[test]
fn a_key_switch_turned_in_halt_is_only_told() {
    let mut rig = Rig::in_mode(Halt);
    let epoch = rig.epoch();
    assert_eq!(switched(&rig), [], "the first mode is no change");
    rig.plant.operational_mode = OperationalMode::Auto;
    rig.tick();
    assert_eq!(switched(&rig), [(OperationalMode::Cobot, OperationalMode::Auto)]);
    assert_eq!((rig.epoch(), rig.mode()), (epoch, Halt));
}

#[test]
fn a_key_switch_turned_on_the_way_ends_the_motion_with_a_ramp_in_a_new_epoch() {
    let mut rig = Rig::in_mode(Trajectory);
    let path = trajectory(&[(0.0, [0.0; 3]), (2.0, [1.0, 0.0, 0.0])]);
    rig.follow(1, &path).expect("granted");
    rig.ticks(150);
    let epoch = rig.epoch();
    rig.plant.operational_mode = OperationalMode::ManualReducedSpeed;
    rig.tick();
    let end = rig.ended(1).expect("ended at once");
    let reason = Some(Refusal::OperationalModeChanged);
    assert_eq!((end.status, end.reason), (ActionStatus::Failed, reason));
    assert_eq!((rig.epoch(), rig.mode()), (epoch + 1, Trajectory));
    assert!(!rig.command_rests(), "a ramp, not a jump to standstill");
    rig.until("standstill", Rig::command_rests);
    assert_eq!(rig.fault_codes(), [], "it is no fault");
}

#[test]
fn silence_turns_no_key_switch() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.silent = true;
    rig.ticks(20);
    rig.plant.silent = false;
    rig.ticks(2);
    assert_eq!(switched(&rig), []);
    rig.plant.silent = true;
    rig.ticks(20);
    (rig.plant.silent, rig.plant.operational_mode) = (false, OperationalMode::Auto);
    rig.tick();
    assert_eq!(switched(&rig), [(OperationalMode::Cobot, OperationalMode::Auto)]);
}

#[test]
fn a_controller_that_reports_no_operational_mode_is_in_that_of_the_robot_file() {
    let operational_mode = OperationalMode::ManualFullSpeed;
    let mut rig = Rig::with(Params { operational_mode, ..params() });
    rig.plant.operational_mode = OperationalMode::Undefined;
    rig.tick();
    assert_eq!(snapshot(&rig).operational_mode, OperationalMode::ManualFullSpeed);
}
