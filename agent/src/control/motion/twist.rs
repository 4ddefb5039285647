//! From the speed wanted of a tool to speeds of joints.

use armada_model::{Damping, JointVector, MotionLimits, Twist};
use armada_protocol::messages::JogFrame;

use crate::control::equipment::{Equipment, EquippedChain};
use crate::control::io::TwistTarget;

/// Speed of each joint of the robot \[1/s\] that moves a tool as wanted from `position` on, damped
/// near singularities, and slowed down as a whole until each joint is within its limit. Joints
/// that are not of the chain get zero, as does every joint if there is no such chain.
pub(in crate::control) fn joint_velocity(
    target: &TwistTarget,
    equipment: &Equipment,
    position: &JointVector,
    limits: &MotionLimits,
) -> JointVector {
    let none = position.map_indexed(|_, _| 0.0);
    let chain = equipment.chains.get(usize::from(target.chain));
    chain.and_then(|chain| resolve(target, chain, position, limits)).unwrap_or(none)
}

#[expect(non_snake_case, reason = "monogram notation of poses")]
fn resolve(
    target: &TwistTarget,
    equipped: &EquippedChain,
    position: &JointVector,
    limits: &MotionLimits,
) -> Option<JointVector> {
    let EquippedChain { chain, tcp, base_in_world, joints, .. } = equipped;
    let mut own = JointVector::zeros(joints.len()).ok()?;
    let mut highest = own;
    for ((x, v), &joint) in own.iter_mut().zip(highest.iter_mut()).zip(joints) {
        (*x, *v) = (*position.get(joint)?, limits.get(joint)?.velocity);
    }
    let (X_BF, jacobian) = chain.forward_and_jacobian(&own).ok()?;
    let X_BT = X_BF * tcp.isometry();
    let V_BT = match target.frame {
        JogFrame::Base => target.twist,
        JogFrame::Tool => target.twist.in_frame(&X_BT.rotation),
        JogFrame::World => target.twist.in_frame(&base_in_world.isometry().rotation.inverse()),
    };
    // The Jacobian is that of the flange.
    let V_BF: Twist = V_BT.shifted(&(X_BF.translation.vector - X_BT.translation.vector));
    let resolved = jacobian.joint_velocity(&V_BF, &Damping::ARM, &highest);
    let mut all = position.map_indexed(|_, _| 0.0);
    for (&joint, &velocity) in joints.iter().zip(resolved.velocities.iter()) {
        *all.get_mut(joint)? = velocity;
    }
    Some(all)
}
