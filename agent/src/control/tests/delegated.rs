//! Moves of the controller's own, under the loop's rules.

use armada_model::JointVector;
use armada_protocol::messages::{
    ActionStatus, CommandMode, Executor, LeaseLoss, MotionKind, Queue, StopLevel, StopStage,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use uuid::Uuid;

use super::rig::{JOINTS, Rig, joints, params};
use crate::control::{DelegateOrder, LoopAbilities, Order, Params, Refusal};
use crate::drivers::{DelegatedGoal, DelegatedMove, DelegatedStatus, DriverRequest};

fn able() -> Params {
    let abilities = LoopAbilities { move_joint: true, pause: true, ..LoopAbilities::default() };
    Params { abilities, ..params() }
}

fn rig() -> Rig {
    let mut rig = Rig::with(able());
    rig.tick();
    assert!(rig.ask(Order::SetMode(CommandMode::Trajectory)).is_ok());
    rig.ticks(3);
    rig
}

fn move_to(id: u128, goal: JointVector) -> Order {
    Order::Delegate(DelegateOrder {
        id: Uuid::from_u128(id),
        kind: MotionKind::MoveJoint,
        order: DelegatedMove {
            number: 0,
            goal: DelegatedGoal::Joint(goal),
            speed: 1.0,
            blend_radius_m: 0.0,
            connect: false,
        },
        queue: Queue::Refuse,
        on_lease_loss: LeaseLoss::StopOnPath,
    })
}

/// A rig whose controller is on its way.
fn moving() -> Rig {
    let mut rig = rig();
    assert!(rig.ask(move_to(1, joints([0.5; JOINTS]))).is_ok());
    rig.until("the move runs", |rig| rig.statuses(1) == [ActionStatus::Running]);
    rig.ticks(20);
    rig
}

fn stops_asked(rig: &Rig) -> usize {
    rig.plant.asked.iter().filter(|asked| **asked == DriverRequest::StopMotion).count()
}

#[test]
fn the_controller_makes_the_move_and_no_set_point_is_sent_until_the_robot_stands() {
    let mut rig = rig();
    let before = rig.commands.len();
    assert!(rig.ask(move_to(1, joints([0.5, -0.2, 0.3]))).is_ok());
    rig.until("the end", |rig| rig.ended(1).is_some());
    let end = rig.ended(1).expect("waited for");
    assert_eq!((end.status, end.kind), (ActionStatus::Complete, MotionKind::MoveJoint));
    assert_eq!(end.executor, Executor::Controller);
    assert_eq!(rig.statuses(1), [ActionStatus::Running, ActionStatus::Complete]);
    assert_eq!(rig.commands.len(), before, "a set-point during the controller's own move");
    assert_eq!(rig.plant.position, joints([0.5, -0.2, 0.3]));
    rig.ticks(2);
    let first = rig.commands.get(before).expect("the stream begins anew");
    assert_eq!(first.joint_position, rig.plant.position);
    assert_eq!(stops_asked(&rig), 0);
    rig.finish();
}

#[test]
fn a_cancelled_move_is_stopped_by_request_and_ends_at_measured_standstill() {
    let mut rig = moving();
    assert!(rig.ask(Order::Cancel(Uuid::from_u128(1))).is_ok());
    assert_eq!(rig.ended(1), None, "not before the robot stands");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.ended(1).map(|end| end.status), Some(ActionStatus::Cancelled));
    assert!(stops_asked(&rig) >= 1);
    let held = rig.plant.position;
    rig.ticks(50);
    assert!(rig.plant.position.max_abs_difference(&held) < 1e-9, "it stays where it stopped");
    rig.finish();
}

#[test]
fn a_halt_ends_the_move_at_once_and_the_controller_is_asked_until_it_obeys() {
    let mut rig = moving();
    rig.plant.own.deaf = true;
    assert!(rig.ask(Order::Halt).is_ok());
    assert_eq!(rig.ended(1).map(|end| end.status), Some(ActionStatus::Cancelled));
    let sent = rig.commands.len();
    rig.ticks(60);
    assert!(stops_asked(&rig) >= 4, "repeated: {}", stops_asked(&rig));
    assert_eq!(rig.commands.len(), sent, "no set-point while the controller moves the robot");
    let refused = rig.ask(Order::SetMode(CommandMode::Trajectory));
    assert_eq!(refused, Err(Refusal::StillMoving));
    rig.plant.own.deaf = false;
    rig.until("the stream", |rig| rig.commands.len() > sent);
    let status = rig.plant.own.report.expect("a report").status;
    assert_eq!(status, DelegatedStatus::Stopped);
    rig.finish();
}

#[test]
fn a_stop_climbs_its_stages_on_what_the_controller_does() {
    let mut rig = moving();
    rig.stop = Some(StopLevel::L2);
    rig.tick();
    assert_eq!(rig.ended(1).map(|end| end.status), Some(ActionStatus::Failed));
    assert_eq!(rig.stages(), [StopStage::Commanded]);
    assert!(rig.plant.own.report.is_some_and(|report| report.status == DelegatedStatus::Running));
    rig.until("standstill", |rig| rig.stages().contains(&StopStage::Standstill));
    assert_eq!(rig.plant.own.report.expect("a report").status, DelegatedStatus::Stopped);
    rig.stop = None;
    rig.finish();
}

#[test]
fn a_controller_that_does_not_take_the_move_in_time_fails_it() {
    let mut rig = rig();
    rig.plant.own.lazy = true;
    assert!(rig.ask(move_to(1, joints([0.5; JOINTS]))).is_ok());
    rig.until("the end", |rig| rig.ended(1).is_some());
    let end = rig.ended(1).expect("waited for");
    assert_eq!(end.reason, Some(Refusal::ControllerTimeout));
    let asked = |asked: &&DriverRequest| matches!(asked, DriverRequest::Move(_));
    assert!(rig.plant.asked.iter().filter(asked).count() > 1, "it is asked again");
    rig.finish();
}

#[test]
fn a_move_that_the_controller_gives_up_fails_with_its_error() {
    let mut rig = rig();
    rig.plant.own.fails = Some(4098);
    assert!(rig.ask(move_to(1, joints([0.5; JOINTS]))).is_ok());
    rig.until("the end", |rig| rig.ended(1).is_some());
    let end = rig.ended(1).expect("waited for");
    assert_eq!(end.reason, Some(Refusal::ControllerRefused { code: 4098 }));
    rig.finish();
}

#[test]
fn a_pause_brings_the_move_to_rest_and_a_resume_to_its_goal() {
    let mut rig = moving();
    let id = Uuid::from_u128(1);
    assert!(rig.ask(Order::Pause(id)).is_ok());
    let paused = |rig: &Rig| {
        rig.last.as_ref().is_some_and(|out| out.snapshot.motion.is_some_and(|m| m.paused))
    };
    rig.until("the pause", paused);
    let held = rig.plant.position;
    rig.ticks(30);
    assert_eq!(rig.plant.position, held);
    assert!(rig.ask(Order::Resume(id)).is_ok());
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.ended(1).map(|end| end.status), Some(ActionStatus::Complete));
    rig.finish();
}

#[test]
fn what_the_controller_cannot_do_is_refused_by_name() {
    let mut rig = Rig::in_mode(CommandMode::Trajectory);
    let refused = rig.ask(move_to(1, joints([0.5; JOINTS])));
    let what = "a controller that makes moves of the joints";
    assert_eq!(refused, Err(Refusal::NotSupported(what)));
    let mut rig = self::rig();
    let beyond = rig.ask(move_to(2, joints([2.5, 0.0, 0.0])));
    assert_eq!(beyond, Err(Refusal::OutOfRange { joint: 0, value: 2.5, limit: 2.0 }));
    assert!(rig.ask(move_to(3, joints([0.5; JOINTS]))).is_ok());
    let busy = rig.ask(move_to(4, joints([0.0; JOINTS])));
    assert_eq!(busy, Err(Refusal::Busy(Uuid::from_u128(3))));
    rig.finish();
}

/// What happens next in a random story.
#[derive(Clone, Copy, Debug)]
enum Happening {
    Ticks(usize),
    Move(f64),
    Cancel,
    Pause(bool),
    Halt,
    Mode,
    Stop(bool),
    Deaf(bool),
    Fails,
    Silence(bool),
    Reset,
}

fn happenings() -> impl Strategy<Value = Happening> {
    prop_oneof![
        6 => (1..80_usize).prop_map(Happening::Ticks),
        4 => (-0.8..0.8).prop_map(Happening::Move),
        1 => Just(Happening::Cancel),
        1 => any::<bool>().prop_map(Happening::Pause),
        1 => Just(Happening::Halt),
        3 => Just(Happening::Mode),
        1 => any::<bool>().prop_map(Happening::Stop),
        1 => any::<bool>().prop_map(Happening::Deaf),
        1 => Just(Happening::Fails),
        1 => any::<bool>().prop_map(Happening::Silence),
        2 => Just(Happening::Reset),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 96, rng_seed: RngSeed::Fixed(41), ..ProptestConfig::default()
    })]

    // The rig itself watches limits, epochs, answers, and one terminal status for each motion.
    #[test]
    fn no_set_point_is_sent_while_the_controller_moves_the_robot(
        story in prop::collection::vec(happenings(), 1..40),
    ) {
        let mut rig = rig();
        let mut newest = 0;
        for happening in story {
            match happening {
                Happening::Ticks(count) => {
                    for _ in 0..count {
                        let moved = rig.plant.own.report.is_some_and(|report| {
                            matches!(
                                report.status,
                                DelegatedStatus::Running | DelegatedStatus::Paused
                            )
                        });
                        let output = rig.tick();
                        prop_assert!(!(moved && output.command.is_some()), "two masters");
                    }
                }
                Happening::Move(goal) => {
                    newest += 1;
                    rig.order(move_to(newest, joints([goal; JOINTS])));
                }
                Happening::Cancel => {
                    rig.order(Order::Cancel(Uuid::from_u128(newest)));
                }
                Happening::Pause(true) => {
                    rig.order(Order::Pause(Uuid::from_u128(newest)));
                }
                Happening::Pause(false) => {
                    rig.order(Order::Resume(Uuid::from_u128(newest)));
                }
                Happening::Halt => {
                    rig.order(Order::Halt);
                }
                Happening::Mode => {
                    rig.order(Order::SetMode(CommandMode::Trajectory));
                }
                Happening::Stop(on) => rig.stop = on.then_some(StopLevel::L2),
                Happening::Deaf(on) => rig.plant.own.deaf = on,
                Happening::Fails => rig.plant.own.fails = Some(7),
                Happening::Silence(on) => rig.plant.silent = on,
                Happening::Reset => {
                    rig.order(Order::ResetErrors);
                }
            }
        }
        (rig.plant.own.deaf, rig.plant.silent, rig.stop) = (false, false, None);
        rig.finish();
    }
}
