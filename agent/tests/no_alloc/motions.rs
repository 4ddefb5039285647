//! Jogs, homing and trajectories.

use armada_agent::control::{FollowOrder, Order};
use armada_agent::drivers::JointSet;
use armada_protocol::messages::{CommandMode, HomeMethod, JogFrame, Queue};
use uuid::Uuid;

use crate::orders::{follow, home, jog, jog_joint, jog_tool, set_mode};
use crate::rig::{JOINTS, PERIOD, Rig, trajectory};

#[test]
fn jogs_their_change_of_goal_and_their_cancel_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Jog), jog(1, 1.0)]);
    rig.ticks(300);
    rig.tick([jog(2, -1.0), jog(3, 9.0), jog(4, 0.5)]);
    rig.ticks(100);
    let moving = rig.tick([Order::Cancel(Uuid::from_u128(4))]);
    assert!(moving.command.is_some_and(|command| command.joint_velocity[0] != 0.0));
    rig.ticks(2000);
    rig.expect_mode(CommandMode::Jog);
}

#[test]
fn jogs_at_a_speed_into_limits_and_singularities_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Jog), jog_joint(1, 1.0)]);
    for _ in 0..20 {
        rig.tick([jog_joint(1, 1.5), jog_joint(2, 9.0)]);
        rig.ticks(200);
    }
    rig.tick([jog(3, 0.5)]);
    rig.ticks(3000);
    // At 0.5 each and at 0, where the arm is stretched.
    for (id, frame) in [(4, JogFrame::Base), (5, JogFrame::Tool), (6, JogFrame::World)] {
        for speed in [0.1, 2.0, -2.0] {
            rig.tick([jog_tool(id, speed, frame)]);
            rig.ticks(400);
        }
    }
    rig.tick([jog(7, 0.0)]);
    rig.ticks(5000);
    rig.tick([jog_tool(8, 0.5, JogFrame::Base)]);
    rig.ticks(2000);
    rig.expect_mode(CommandMode::Jog);
}

#[test]
fn homing_both_ways_and_its_ends_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Homing), home(1, HomeMethod::Controller)]);
    rig.ticks(100);
    for _ in 0..2 {
        let feedback = rig.feedback.as_mut().expect("heard");
        (feedback.homed, feedback.homing) = (JointSet::first(JOINTS), JointSet::NONE);
        rig.ticks(100);
    }
    rig.tick([home(2, HomeMethod::MoveToHome)]);
    rig.ticks(2000);
    rig.tick([home(3, HomeMethod::Controller)]);
    rig.ticks(10);
    rig.tick([Order::Cancel(Uuid::from_u128(3))]);
    rig.ticks(500);
    rig.tick([home(4, HomeMethod::Controller)]);
    rig.ticks(10);
    rig.tick([Order::Halt]);
    rig.ticks(500);
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn trajectories_allocate_nothing_and_are_not_freed_in_the_loop() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Trajectory)]);
    let orders = [
        follow(1, &trajectory(0.01, 0.5), None),
        follow(2, &trajectory(0.0, 0.5), None),
        follow(3, &trajectory(0.3, 0.5), None),
    ];
    let mut retired = Vec::new();
    retired.extend(rig.tick(orders).retired);
    for _ in 0..2000 {
        retired.extend(rig.tick([]).retired);
    }
    assert_eq!(retired.len(), 3);
    assert_eq!(rig.held(), 0.5);
    let armed = follow(4, &trajectory(0.5, 0.0), Some(rig.now + PERIOD * 100));
    rig.tick([armed]);
    rig.ticks(600);
    // Given back when the robot has come to rest on it.
    let mut given_back = rig.tick([Order::Halt]).retired.len();
    for _ in 0..1000 {
        given_back += rig.tick([]).retired.len();
    }
    assert_eq!(given_back, 1);
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn pauses_speeds_queues_blends_and_replacements_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Trajectory)]);
    let queued = |id, from, to, queue| match follow(id, &trajectory(from, to), None) {
        Order::Follow(order) => Order::Follow(FollowOrder { queue, ..order }),
        other => other,
    };
    let motion = Uuid::from_u128(1);
    let mut retired = Vec::new();
    retired.extend(rig.tick([queued(1, 0.0, 0.4, Queue::Append)]).retired);
    retired.extend(rig.tick([queued(2, 0.4, 0.8, Queue::AppendBlended)]).retired);
    retired.extend(rig.tick([queued(3, 0.8, 0.4, Queue::Append)]).retired);
    for orders in [
        [Order::Pause(motion), Order::SetSpeedRatio(0.5)],
        [Order::Resume(motion), Order::SetSpeedRatio(1.0)],
    ] {
        rig.ticks(200);
        retired.extend(rig.tick(orders).retired);
    }
    for _ in 0..1200 {
        retired.extend(rig.tick([]).retired);
    }
    let here = rig.held();
    retired.extend(rig.tick([queued(4, here, here + 0.3, Queue::Replace)]).retired);
    rig.ticks(300);
    retired.extend(rig.tick([Order::Cancel(Uuid::from_u128(4))]).retired);
    for _ in 0..1200 {
        retired.extend(rig.tick([]).retired);
    }
    assert_eq!(retired.len(), 4);
    rig.expect_mode(CommandMode::Trajectory);
}
