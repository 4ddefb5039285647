//! Moves of the controller's own.

use armada_agent::control::{DelegateOrder, LoopEvent, Order, Output};
use armada_agent::drivers::{DelegatedGoal, DelegatedMove};
use armada_model::Pose;
use armada_protocol::messages::{
    ActionStatus, CommandMode, LeaseLoss, MotionKind, Queue, StopLevel,
};
use uuid::Uuid;

use crate::orders::set_mode;
use crate::rig::{Rig, all};

fn delegate(id: u128, kind: MotionKind, goal: DelegatedGoal) -> Order {
    let (speed, blend_radius_m, connect) = (0.5, 0.02, false);
    let order = DelegatedMove { number: 0, goal, speed, blend_radius_m, connect };
    let (queue, on_lease_loss) = (Queue::Refuse, LeaseLoss::StopOnPath);
    Order::Delegate(DelegateOrder { id: Uuid::from_u128(id), kind, order, queue, on_lease_loss })
}

fn to_joints(id: u128) -> Order {
    delegate(id, MotionKind::MoveJoint, DelegatedGoal::Joint(all(0.5)))
}

/// Ready to follow orders to move, and seen to stand.
fn ready() -> Rig {
    let mut rig = Rig::new();
    rig.ticks(100);
    rig.tick([set_mode(CommandMode::Trajectory)]);
    rig.ticks(100);
    rig
}

fn status_of(output: &Output, id: u128) -> Option<ActionStatus> {
    output.events.iter().rev().find_map(|event| match event {
        LoopEvent::Motion(report) if report.id == Uuid::from_u128(id) => Some(report.status),
        _ => None,
    })
}

/// Ticks until the motion has ended.
#[track_caller]
fn ended(rig: &mut Rig, id: u128) -> ActionStatus {
    let mut ticks = (0..2000).map(|_| rig.tick([]));
    let end = ticks.find_map(|output| status_of(&output, id).filter(|end| end.is_terminal()));
    end.expect("it ends")
}

#[test]
fn moves_of_the_controller_that_are_paused_slowed_and_completed_allocate_nothing() {
    let mut rig = ready();
    let motion = Uuid::from_u128(1);
    rig.tick([to_joints(1), to_joints(2)]);
    rig.ticks(60);
    rig.tick([Order::Pause(motion), Order::SetSpeedRatio(0.5)]);
    let paused = rig.ticks(100).snapshot.motion.expect("in progress");
    assert!(paused.paused && paused.id == motion);
    rig.tick([Order::Resume(motion), Order::SetSpeedRatio(1.0)]);
    assert_eq!(ended(&mut rig, 1), ActionStatus::Complete);
    rig.expect_mode(CommandMode::Trajectory);
}

#[test]
fn moves_of_the_controller_to_poses_and_their_cancel_allocate_nothing() {
    let mut rig = ready();
    let (chain, pose) = (0, Pose::from_translation(0.3, 0.0, 0.5));
    rig.tick([delegate(1, MotionKind::MovePose, DelegatedGoal::Pose { chain, pose })]);
    assert_eq!(ended(&mut rig, 1), ActionStatus::Complete);
    rig.ticks(100);
    rig.tick([delegate(2, MotionKind::MoveLinear, DelegatedGoal::Linear { chain, pose })]);
    rig.ticks(60);
    rig.tick([Order::Cancel(Uuid::from_u128(2))]);
    assert_eq!(ended(&mut rig, 2), ActionStatus::Cancelled);
    let unknown = DelegatedGoal::Linear { chain: 3, pose };
    rig.tick([delegate(3, MotionKind::MoveLinear, unknown)]);
    rig.ticks(100);
    rig.expect_mode(CommandMode::Trajectory);
}

#[test]
fn moves_of_the_controller_that_are_halted_stopped_lost_or_not_taken_allocate_nothing() {
    let mut rig = ready();
    rig.tick([to_joints(1)]);
    rig.ticks(60);
    let halted = rig.tick([Order::Halt]);
    assert_eq!(status_of(&halted, 1), Some(ActionStatus::Cancelled));
    rig.ticks(300);
    rig.tick([set_mode(CommandMode::Trajectory), to_joints(2)]);
    rig.ticks(60);
    rig.stop = Some(StopLevel::L1);
    assert_eq!(ended(&mut rig, 2), ActionStatus::Failed);
    rig.ticks(500);
    rig.stop = None;
    rig.tick([Order::ResetErrors, Order::Enable]);
    rig.ticks(300);
    rig.tick([set_mode(CommandMode::Trajectory), to_joints(3)]);
    rig.ticks(60);
    let feedback = rig.feedback.take();
    assert_eq!(ended(&mut rig, 3), ActionStatus::Failed);
    rig.feedback = feedback;
    rig.ticks(300);
    rig.tick([Order::ResetErrors, Order::Halt]);
    rig.ticks(300);
    rig.deaf = true;
    rig.tick([set_mode(CommandMode::Trajectory), to_joints(4)]);
    assert_eq!(ended(&mut rig, 4), ActionStatus::Failed);
    rig.deaf = false;
    rig.ticks(300);
    rig.expect_mode(CommandMode::Trajectory);
}
