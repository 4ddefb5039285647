//! Moves of the controller's own, under the loop's rules.

use std::time::Duration;

use armada_model::JointVector;
use armada_protocol::messages::{
    ActionStatus, CommandMode, Executor, FaultCode, LeaseLoss, MotionKind, Queue, StopLevel,
    StopStage,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use uuid::Uuid;

use super::rig::{JOINTS, Rig, joints, params, queued, trajectory};
use crate::control::{DelegateOrder, LoopAbilities, LoopEvent, Order, Params, Refusal};
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
    queued_to(id, goal, Queue::Refuse)
}

fn queued_to(id: u128, goal: JointVector, queue: Queue) -> Order {
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
        queue,
        on_lease_loss: LeaseLoss::StopOnPath,
    })
}

/// A rig whose controller is on its way.
fn moving() -> Rig {
    moving_to([0.5; JOINTS])
}

fn moving_to(goal: [f64; JOINTS]) -> Rig {
    let mut rig = rig();
    assert!(rig.ask(move_to(1, joints(goal))).is_ok());
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
    rig.params.request_timeout = Duration::from_secs(1);
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
fn a_controller_that_does_not_end_its_move_is_a_fault_and_its_drives_go_off() {
    let mut rig = moving_to([1.9; JOINTS]);
    rig.plant.own.deaf = true;
    rig.plant.asked.clear();
    assert!(rig.ask(Order::Halt).is_ok());
    rig.plant.obeys_after = None;
    rig.ticks(49);
    assert_eq!(rig.fault_codes(), [], "it has its time");
    assert!(!rig.plant.asked.contains(&DriverRequest::Disable));
    rig.until("the fault", |rig| !rig.fault_codes().is_empty());
    let fault = rig.events.iter().find_map(|event| match event {
        LoopEvent::FaultLatched(fault) => Some(*fault),
        _ => None,
    });
    let fault = fault.expect("waited for");
    assert_eq!((fault.code, fault.limit), (FaultCode::StopIgnored, 0.2));
    assert!(fault.value > 0.2 && fault.value < 0.21, "{fault:?}");
    assert_eq!(rig.mode(), CommandMode::InvalidState);
    // The brakes end what the controller does not, and it is asked for until they have.
    rig.ticks(60);
    let asked = rig.plant.asked.iter().filter(|asked| **asked == DriverRequest::Disable).count();
    assert!(asked >= 4, "asked {asked} times");
    let early = rig.ask_and_wait(Order::ResetErrors);
    assert_eq!(early, Err(Refusal::CauseRemains(FaultCode::StopIgnored)));
    rig.plant.obeys_after = Some(5);
    rig.until("drives off", |rig| !rig.plant.enabled);
    assert!(rig.ask_and_wait(Order::ResetErrors).is_ok(), "its motion is over");
    assert_eq!(rig.mode(), CommandMode::Halt);
    rig.plant.own.deaf = false;
    assert!(rig.ask_and_wait(Order::Enable).is_ok());
    rig.finish();
}

#[test]
fn a_controller_that_is_not_heard_is_not_blamed_for_going_on() {
    let mut rig = moving_to([1.9; JOINTS]);
    rig.plant.own.deaf = true;
    assert!(rig.ask(Order::Halt).is_ok());
    rig.ticks(10);
    rig.plant.silent = true;
    rig.ticks(200);
    rig.plant.silent = false;
    rig.ticks(40);
    assert_eq!(rig.fault_codes(), [FaultCode::CommunicationLost], "its time begins anew");
    rig.until("the fault", |rig| rig.fault_codes().contains(&FaultCode::StopIgnored));
    rig.plant.own.deaf = false;
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
    let rests = |rig: &Rig| {
        rig.last.as_ref().is_some_and(|out| out.snapshot.motion.is_some_and(|m| m.rate == 0.0))
    };
    rig.until("the rest", rests);
    let held = rig.plant.position;
    rig.ticks(30);
    assert_eq!(rig.plant.position, held);
    assert!(rig.ask(Order::Resume(id)).is_ok());
    rig.until("the end", |rig| rig.ended(1).is_some());
    use ActionStatus::{Complete, Paused, Running};
    assert_eq!(rig.statuses(1), [Running, Paused, Running, Complete], "as of the loop's own");
    rig.finish();
}

fn ends_at(rig: &mut Rig, ids: &[u128]) {
    for &id in ids {
        rig.until("the end", |rig| rig.ended(id).is_some());
        assert_eq!(rig.ended(id).map(|end| end.status), Some(ActionStatus::Complete), "{id}");
    }
}

#[test]
fn moves_and_trajectories_wait_for_each_other_in_any_order() {
    let mut rig = moving();
    let back = trajectory(&[(0.0, [0.5; JOINTS]), (1.0, [0.2; JOINTS])]);
    let away = trajectory(&[(0.0, [0.2; JOINTS]), (1.0, [0.3; JOINTS])]);
    assert!(rig.ask(queued(2, &back, Queue::Append)).is_ok());
    assert!(rig.ask(queued(3, &away, Queue::AppendBlended)).is_ok());
    assert!(rig.ask(queued_to(4, joints([0.1; JOINTS]), Queue::Append)).is_ok());
    assert!(rig.ask(queued_to(5, joints([-0.1; JOINTS]), Queue::Append)).is_ok());
    let queued = rig.last.as_ref().and_then(|out| out.snapshot.motion).map(|m| m.queued);
    assert_eq!(queued, Some(4));
    ends_at(&mut rig, &[1, 2, 3]);
    assert_eq!(rig.plant.own.report.map(|report| report.number), Some(1), "not before rest");
    ends_at(&mut rig, &[4, 5]);
    use ActionStatus::{Complete, Queued, Running};
    for id in 2..=5 {
        assert_eq!(rig.statuses(id), [Queued, Running, Complete], "{id}");
    }
    let executors = [1, 2, 3, 4, 5].map(|id| rig.ended(id).map(|end| end.executor));
    let (own, theirs) = (Some(Executor::Agent), Some(Executor::Controller));
    assert_eq!(executors, [theirs, own, own, theirs, theirs]);
    assert_eq!(rig.plant.position, joints([-0.1; JOINTS]));
    assert_eq!(rig.fault_codes(), []);
    rig.finish();
}

#[test]
fn a_move_that_waits_for_rest_is_handed_over_when_the_robot_is_seen_to_stand() {
    let mut rig = rig();
    let path = trajectory(&[(0.0, [0.0; JOINTS]), (1.0, [0.4; JOINTS])]);
    assert!(rig.follow(1, &path).is_ok());
    assert!(rig.ask(queued_to(2, joints([0.5; JOINTS]), Queue::Append)).is_ok());
    ends_at(&mut rig, &[1]);
    let sent = rig.commands.len();
    let mut waited = 0;
    while rig.plant.own.report.is_none() {
        rig.tick();
        waited += 1;
        assert!(waited < 100, "it is never handed over");
    }
    // The standstill has to hold for 25 ticks; set-points keep the robot there meanwhile.
    assert!(waited > 25, "after {waited} ticks");
    assert!(rig.commands.len() - sent > 20);
    ends_at(&mut rig, &[2]);
    rig.finish();
}

#[test]
fn a_move_that_waits_is_cancelled_paused_and_broken_off_like_any_motion() {
    use ActionStatus::{Cancelled, Complete, Queued};
    let id = Uuid::from_u128;
    let path = trajectory(&[(0.0, [0.0; JOINTS]), (1.0, [0.4; JOINTS])]);
    let mut rig = rig();
    assert!(rig.follow(1, &path).is_ok());
    for waiting in 2..=4 {
        let order = queued_to(waiting, joints([0.1 * waiting as f64; JOINTS]), Queue::Append);
        assert!(rig.ask(order).is_ok());
    }
    assert!(rig.ask(Order::Cancel(id(3))).is_ok(), "and with it what is behind it");
    assert_eq!(
        (rig.statuses(3), rig.statuses(4)),
        (vec![Queued, Cancelled], vec![Queued, Cancelled])
    );
    assert_eq!(rig.ended(4).and_then(|end| end.reason), Some(Refusal::QueueBroken));
    ends_at(&mut rig, &[1]);
    // In front of the queue now, and waiting for the robot to stand.
    assert!(rig.ask(Order::Pause(id(2))).is_ok());
    rig.ticks(100);
    assert_eq!(rig.plant.own.report, None, "a paused move is not handed over");
    assert!(rig.ask(Order::Cancel(id(2))).is_ok());
    assert_eq!(rig.ended(2).map(|end| end.status), Some(Cancelled), "at once: it has not begun");
    assert_eq!(stops_asked(&rig), 0);
    rig.ticks(3);
    assert!(rig.follow(5, &trajectory(&[(0.0, [0.4; JOINTS]), (1.0, [0.0; JOINTS])])).is_ok());
    assert!(rig.ask(queued_to(6, joints([0.2; JOINTS]), Queue::Append)).is_ok());
    rig.until("the end", |rig| rig.ended(5).is_some());
    assert_eq!(rig.ended(5).map(|end| end.status), Some(Complete));
    assert!(rig.ask(Order::Halt).is_ok());
    assert_eq!(rig.statuses(6), [Queued, Cancelled]);
    assert_eq!(stops_asked(&rig), 0, "the controller never had it");
    rig.finish();
}

#[test]
fn what_cannot_wait_is_refused_by_name() {
    let mut rig = moving();
    let elsewhere = trajectory(&[(0.0, [0.0; JOINTS]), (1.0, [0.2; JOINTS])]);
    let refused = rig.ask(queued(2, &elsewhere, Queue::Append));
    assert_eq!(refused, Err(Refusal::StartTolerance { joint: 0, value: 0.5, limit: 0.05 }));
    for queue in [Queue::AppendBlended, Queue::Replace] {
        let refused = rig.ask(queued_to(3, joints([0.1; JOINTS]), queue));
        assert!(matches!(refused, Err(Refusal::NotSupported(_))), "{queue:?}: {refused:?}");
    }
    let again = rig.ask(queued_to(1, joints([0.1; JOINTS]), Queue::Append));
    assert_eq!(again, Err(Refusal::Busy(Uuid::from_u128(1))));
    assert!(rig.ask(Order::Cancel(Uuid::from_u128(1))).is_ok());
    let late = rig.ask(queued_to(4, joints([0.1; JOINTS]), Queue::Append));
    assert_eq!(late, Err(Refusal::Busy(Uuid::from_u128(1))), "it is being cancelled");
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
    Move(f64, Queue),
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
        4 => ((-0.8..0.8), any::<bool>()).prop_map(|(goal, waits)| {
            Happening::Move(goal, if waits { Queue::Append } else { Queue::Refuse })
        }),
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
                Happening::Move(goal, queue) => {
                    newest += 1;
                    rig.order(queued_to(newest, joints([goal; JOINTS]), queue));
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
