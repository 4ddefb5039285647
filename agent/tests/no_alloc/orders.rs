//! Orders, as short as they can be said.

use std::sync::Arc;
use std::time::Duration;

use armada_agent::control::{
    FollowOrder, HomeOrder, JogCartesianOrder, JogJointOrder, JogOrder, MAX_CHAINS, Order,
    TwistTarget,
};
use armada_agent::drivers::JointSet;
use armada_model::{CompiledTrajectory, MAX_JOINTS, MonoTime, Twist};
use armada_protocol::messages::{CommandMode, HomeMethod, JogFrame};
use uuid::Uuid;

use crate::rig::all;

pub(crate) fn jog(id: u128, goal: f64) -> Order {
    let (joint_position, max_velocity) = (all(goal), all(1.5));
    Order::Jog(JogOrder { id: Uuid::from_u128(id), joint_position, max_velocity })
}

pub(crate) fn jog_joint(id: u128, speed: f64) -> Order {
    Order::JogJoint(JogJointOrder {
        id: Uuid::from_u128(id),
        joint_velocity: all(speed),
        timeout: Duration::from_millis(300),
        renews: false,
    })
}

pub(crate) fn jog_tool(id: u128, speed: f64, frame: JogFrame) -> Order {
    let linear = nalgebra::Vector3::new(speed, 0.5 * speed, -speed);
    let mut twists = [None; MAX_CHAINS];
    twists[0] = Some(TwistTarget { chain: 0, twist: Twist::new(linear, linear), frame });
    let (id, timeout) = (Uuid::from_u128(id), Duration::from_millis(500));
    Order::JogCartesian(JogCartesianOrder { id, twists, timeout, renews: false })
}

pub(crate) fn home(id: u128, method: HomeMethod) -> Order {
    let mut groups = [JointSet::NONE; MAX_JOINTS];
    (groups[0], groups[1]) = (JointSet::first(3), JointSet::NONE.with(5));
    Order::Home(HomeOrder { id: Uuid::from_u128(id), groups, method })
}

pub(crate) fn follow(
    id: u128,
    trajectory: &Arc<CompiledTrajectory>,
    start: Option<MonoTime>,
) -> Order {
    let (id, trajectory) = (Uuid::from_u128(id), Arc::clone(trajectory));
    Order::Follow(FollowOrder { start, ..FollowOrder::at_once(id, trajectory) })
}

pub(crate) const fn set_mode(mode: CommandMode) -> Order {
    Order::SetMode(mode)
}
