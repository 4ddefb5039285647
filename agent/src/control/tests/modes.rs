//! The mode table, and what a change of mode does.

use armada_protocol::messages::{
    ActionStatus, CommandMode, ControllerState, FaultCode, RobotFlags, StopLevel,
};

use super::rig::{Rig, follow, jog, joints, params, trajectory};
use crate::control::{LoopAbilities, LoopEvent, Order, Params, Refusal};
use crate::drivers::JointSet;

use CommandMode::{Halt, Homing, InvalidState, Jog, PositionCommand, Trajectory, VelocityCommand};

const MODES: [CommandMode; 7] =
    [InvalidState, Halt, Jog, Trajectory, PositionCommand, VelocityCommand, Homing];

/// A robot that has every mode.
fn rig_with_all_modes() -> Rig {
    let home = vec![None, Some(0.0), None];
    let mut rig = Rig::with(Params { home, ..params() });
    rig.tick();
    assert_eq!(rig.mode(), Halt);
    rig
}

fn in_fault() -> Rig {
    let mut rig = rig_with_all_modes();
    rig.plant.error_code = 7;
    rig.tick();
    assert_eq!(rig.mode(), InvalidState);
    rig
}

fn rig_in(mode: CommandMode) -> Rig {
    if mode == InvalidState {
        return in_fault();
    }
    let mut rig = rig_with_all_modes();
    rig.ask(Order::SetMode(mode)).expect("halt leads to every mode");
    rig
}

#[test]
fn every_cell_of_the_mode_table_holds() {
    let faulted = Refusal::Faulted(FaultCode::ControllerError);
    for from in MODES {
        for to in MODES {
            let expected = match (from, to) {
                (_, InvalidState) => Err(Refusal::ModeNotSupported(InvalidState)),
                (InvalidState, _) => Err(faulted),
                (_, Halt) | (Halt, _) => Ok(to),
                _ if from == to => Ok(to),
                _ => Err(Refusal::ThroughHalt { mode: from, wanted: to }),
            };
            let mut rig = rig_in(from);
            let answer = rig.ask(Order::SetMode(to));
            assert_eq!(answer.map(|granted| granted.command_mode), expected, "{from:?} to {to:?}");
            assert_eq!(rig.mode(), expected.unwrap_or(from), "{from:?} to {to:?}");
        }
    }
}

#[test]
fn every_mode_is_refused_with_what_is_wrong_with_the_robot() {
    type Harm = fn(&mut Rig);
    let silent: Harm = |rig| {
        rig.plant.silent = true;
        rig.ticks(20);
    };
    let off: Harm = |rig| (rig.plant.enabled, rig.plant.ready) = (false, false);
    let deaf: Harm = |rig| rig.plant.ready = false;
    let guard: Harm = |rig| rig.plant.guard_stop = true;
    let stopped: Harm = |rig| rig.stop = Some(StopLevel::L1);
    let guarded = Refusal::Faulted(FaultCode::GuardStop);
    // What is wrong, the refusal of halt, of homing, and of the other motion modes.
    let table: [(Harm, Option<Refusal>, Option<Refusal>, Refusal); 5] = [
        (silent, Some(Refusal::CommunicationLost), Some(Refusal::CommunicationLost), {
            Refusal::CommunicationLost
        }),
        (off, None, Some(Refusal::NotEnabled), Refusal::NotEnabled),
        (deaf, None, None, Refusal::NotReady),
        (guard, Some(guarded), Some(guarded), guarded),
        (stopped, None, Some(Refusal::Stopped(StopLevel::L1)), Refusal::Stopped(StopLevel::L1)),
    ];
    for (row, (harm, halt, homing, others)) in table.into_iter().enumerate() {
        for wanted in [Halt, Homing, Jog, Trajectory, PositionCommand, VelocityCommand] {
            let mut rig = rig_with_all_modes();
            harm(&mut rig);
            rig.tick();
            let expected = match wanted {
                Halt => halt,
                Homing => homing,
                _ => Some(others),
            };
            let answer = rig.ask(Order::SetMode(wanted));
            assert_eq!(answer.err(), expected, "row {row}, {wanted:?}");
        }
    }
}

#[test]
fn homing_exists_where_the_controller_searches_references_or_a_home_is_given() {
    let refused = Err(Refusal::ModeNotSupported(Homing));
    assert_eq!(Rig::in_mode(Halt).ask(Order::SetMode(Homing)), refused);
    assert!(rig_with_all_modes().ask(Order::SetMode(Homing)).is_ok());
    let abilities = LoopAbilities { homing: true, ..LoopAbilities::default() };
    let mut rig = Rig::with(Params { abilities, ..params() });
    rig.tick();
    assert!(rig.ask(Order::SetMode(Homing)).is_ok());
}

#[test]
fn a_search_of_references_needs_drives_but_no_controller_that_takes_commands() {
    let mut rig = rig_in(Homing);
    rig.plant.ready = false;
    rig.plant.homing = JointSet::first(1);
    rig.plant.position = joints([0.5, 0.0, 0.0]);
    rig.ticks(5);
    assert_eq!((rig.mode(), rig.fault_codes()), (Homing, vec![]));
    rig.plant.enabled = false;
    rig.tick();
    assert_eq!((rig.mode(), rig.fault_codes()), (InvalidState, vec![FaultCode::NotReady]));
}

#[test]
fn selecting_the_mode_in_force_changes_nothing() {
    for mode in [Halt, Jog, Trajectory] {
        let mut rig = Rig::in_mode(mode);
        let (epoch, events) = (rig.epoch(), rig.events.len());
        let granted = rig.ask(Order::SetMode(mode)).expect("granted");
        assert_eq!((granted.epoch, granted.command_mode), (epoch, mode));
        assert_eq!(rig.events.len(), events + 1, "only the answer");
    }
}

#[test]
fn selecting_jog_again_leaves_a_jog_in_progress() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [0.3, 0.0, 0.0]).expect("granted");
    rig.ticks(20);
    assert!(rig.ask(Order::SetMode(Jog)).is_ok());
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.ended(1).map(|report| report.status), Some(ActionStatus::Complete));
}

#[test]
fn a_halt_raises_the_epoch_in_halt_too() {
    let mut rig = Rig::in_mode(Halt);
    let epoch = rig.epoch();
    assert_eq!(rig.ask(Order::Halt).map(|granted| granted.epoch), Ok(epoch + 1));
}

#[test]
fn every_change_of_mode_raises_the_epoch_and_is_told_once() {
    let mut rig = Rig::in_mode(Halt);
    let epoch = rig.epoch();
    rig.ask(Order::SetMode(Jog)).expect("granted");
    rig.ask(Order::SetMode(Halt)).expect("granted");
    rig.ask(Order::SetMode(Trajectory)).expect("granted");
    assert_eq!(rig.epoch(), epoch + 3);
    let modes: Vec<_> =
        rig.events.iter().filter(|event| matches!(event, LoopEvent::Mode { .. })).collect();
    assert_eq!(
        modes,
        [
            &LoopEvent::Mode { from: InvalidState, to: Halt },
            &LoopEvent::Mode { from: Halt, to: Jog },
            &LoopEvent::Mode { from: Jog, to: Halt },
            &LoopEvent::Mode { from: Halt, to: Trajectory },
        ]
    );
}

#[test]
fn halt_is_refused_in_invalid_state_with_the_fault() {
    let faulted = Refusal::Faulted(FaultCode::ControllerError);
    assert_eq!(in_fault().ask(Order::Halt), Err(faulted));
}

#[test]
fn a_halt_between_two_ticks_ends_the_motion_though_the_mode_is_back() {
    let mut rig = Rig::in_mode(Jog);
    // It has not moved yet, so there is no ramp, and the way back is free at once.
    rig.order(jog(1, [0.0, 0.0, 1.0]));
    let halted = rig.order(Order::Halt);
    let back = rig.order(Order::SetMode(Jog));
    rig.tick();
    assert!(rig.answer(halted).is_some_and(|answer| answer.is_ok()));
    assert!(rig.answer(back).is_some_and(|answer| answer.is_ok()));
    let end = rig.ended(1).expect("ended in the tick of the halt");
    assert_eq!((end.status, end.reason), (ActionStatus::Cancelled, Some(Refusal::ModeLeft)));
    assert_eq!(rig.mode(), Jog);
    rig.ticks(50);
    assert!(rig.commands.iter().all(|command| command.joint_position[2] == 0.0));
}

#[test]
fn a_halt_between_two_ticks_stops_a_trajectory_in_full_motion() {
    let mut rig = Rig::in_mode(Trajectory);
    let path = trajectory(&[(0.0, [0.0; 3]), (2.0, [1.0; 3])]);
    rig.follow(1, &path).expect("granted");
    rig.ticks(200);
    assert!(!rig.command_rests());
    rig.order(Order::Halt);
    let back = rig.order(Order::SetMode(Trajectory));
    let again = rig.order(follow(2, &path));
    rig.tick();
    assert_eq!(rig.ended(1).map(|end| end.status), Some(ActionStatus::Cancelled));
    assert_eq!(rig.answer(back), Some(Err(Refusal::StillMoving)));
    let wrong_mode = Refusal::WrongMode { mode: Halt, needed: Trajectory };
    assert_eq!(rig.answer(again), Some(Err(wrong_mode)));
    rig.until("standstill", Rig::command_rests);
    assert_eq!(rig.mode(), Halt);
}

#[test]
fn motion_modes_need_drives_and_a_controller_that_takes_commands() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.ready = false;
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::NotReady));
    rig.plant.enabled = false;
    assert_eq!(rig.ask(Order::SetMode(Trajectory)), Err(Refusal::NotEnabled));
    assert_eq!(rig.mode(), Halt, "in halt this is no fault");
    assert_eq!(rig.fault_codes(), []);
    let snapshot = rig.last.expect("a tick").snapshot;
    assert_eq!(snapshot.controller_state, ControllerState::MotorOff);
    assert!(!snapshot.flags.contains(RobotFlags::ENABLED));
}

#[test]
fn motions_need_their_mode() {
    let path = trajectory(&[(0.0, [0.0; 3]), (1.0, [0.1; 3])]);
    for (mode, order, needed) in [
        (Halt, jog(1, [0.1; 3]), Jog),
        (Trajectory, jog(1, [0.1; 3]), Jog),
        (Halt, follow(1, &path), Trajectory),
        (Jog, follow(1, &path), Trajectory),
    ] {
        let answer = Rig::in_mode(mode).ask(order);
        assert_eq!(answer, Err(Refusal::WrongMode { mode, needed }));
    }
}

#[test]
fn a_latched_stop_refuses_every_mode_but_halt() {
    let mut rig = Rig::in_mode(Jog);
    rig.stop = Some(StopLevel::L2);
    rig.tick();
    assert_eq!(rig.mode(), Halt);
    let stopped = Err(Refusal::Stopped(StopLevel::L2));
    assert_eq!(rig.ask(Order::SetMode(Jog)), stopped);
    assert_eq!(rig.ask(Order::SetMode(Trajectory)), stopped);
    assert!(rig.ask(Order::SetMode(Halt)).is_ok());
    assert!(rig.ask(Order::Halt).is_ok());
}

#[test]
fn a_mode_is_not_entered_while_the_robot_decelerates() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.0, 0.0, 0.0]).expect("granted");
    rig.ticks(100);
    rig.ask(Order::Halt).expect("granted");
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::StillMoving));
    rig.until("standstill", Rig::command_rests);
    assert!(rig.ask(Order::SetMode(Jog)).is_ok());
}
