//! Joint velocities for a speed of a tool.

#![allow(non_snake_case, reason = "X_BT is the pose of frame T in B, V_BT its twist")]

use armada_model::{Damping, JointVector, MAX_JOINTS, MotionLimits};
use armada_protocol::messages::JogFrame;

use crate::control::equipment::EquippedChain;
use crate::control::io::TwistTarget;

/// Writes into `wanted` the velocities \[1/s\] with which the joints of `chain` give `target`, at
/// `position` of all joints.
///
/// Near a singularity they are damped; where one would be above its velocity limit all are slowed
/// down, so that the tool keeps its direction. A chain that does not fit the robot, which none from
/// a robot file does, gets zero. A twist in the tool's axes turns with the tool; one in the
/// world's is turned by the pose of the chain's base as it is at the robot's zero position.
pub(in crate::control) fn set_tool_speed(
    wanted: &mut JointVector,
    chain: &EquippedChain,
    target: &TwistTarget,
    position: &JointVector,
    limits: &MotionLimits,
) {
    let EquippedChain { chain, base_in_world: X_WB, joints, .. } = chain;
    let mut own = JointVector::zeros(joints.len()).unwrap_or_default();
    let mut fastest = [0.0; MAX_JOINTS];
    for ((slot, fastest), &joint) in own.iter_mut().zip(&mut fastest).zip(joints) {
        *slot = position.get(joint).copied().unwrap_or(f64::NAN);
        *fastest = limits.get(joint).map_or(0.0, |axis| axis.velocity);
    }
    // Refused if the positions do not fit the chain.
    let Ok((X_BT, jacobian)) = chain.forward_and_jacobian(&own) else { return };
    let V_BT = match target.frame {
        JogFrame::Base => target.twist,
        JogFrame::Tool => target.twist.in_frame(&X_BT.rotation),
        JogFrame::World => target.twist.in_frame(&X_WB.isometry().rotation.inverse()),
    };
    let resolved = jacobian.joint_velocity(
        &V_BT,
        &Damping::ARM,
        fastest.get(..joints.len()).unwrap_or_default(),
    );
    for (&joint, &velocity) in joints.iter().zip(resolved.velocities.iter()) {
        if let Some(slot) = wanted.get_mut(joint) {
            *slot = velocity;
        }
    }
}
