//! How fast a body can move, joint by joint.

use super::body::{Body, Owner};
use super::builder::{Mount, Robot, RobotId};
use crate::{Joint, JointType, PositionSource};

/// A joint on the way from the world to a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lever {
    /// Robot and index of the joint in its model.
    pub(super) joint: (usize, usize),
    /// Index in the position vector of the scene.
    pub(super) variable: usize,
    /// Highest speed of any point of the body for each unit of speed of the variable \[m/rad or
    /// 1\], in every configuration; infinite if a slide without limits lies between.
    pub(super) reach: f64,
}

/// The joints from the world to the body, the outermost first.
///
/// A joint that turns moves a point by at most its distance from the axis, which is at most the sum
/// of the distances from each joint's origin to the next, and of the strokes of the slides.
pub(super) fn levers(robots: &[Robot], offsets: &[usize], body: &Body) -> Vec<Lever> {
    let Owner::Link { robot, link } = body.owner else { return Vec::new() };
    let mut levers = Vec::new();
    let (mut at, mut link) = (robot.0, link);
    let [a, b] = body.capsule.ends();
    let mut extent = a.coords.norm().max(b.coords.norm()) + body.capsule.radius();
    while let Some(robot) = robots.get(at) {
        let parent = robot.model.links().get(link).and_then(|link| link.parent_joint);
        match parent.and_then(|index| Some((index, robot.model.joints().get(index)?))) {
            Some((index, joint)) => {
                let offset = offsets.get(at).copied().unwrap_or_default();
                let is_own = Owner::Link { robot: RobotId(at), link } == body.owner;
                let arm = own_axis(joint, body).filter(|_| is_own).unwrap_or(extent);
                levers.extend(lever(joint, (at, index), offset, arm));
                extent += joint.origin.position().norm() + stroke(joint, &robot.model);
                link = joint.parent;
            }
            None => match robot.mount {
                Mount::World(_) => break,
                Mount::Link { robot, link: carrier, pose } => {
                    extent += pose.position().norm();
                    (at, link) = (robot.0, carrier);
                }
            },
        }
    }
    levers.reverse();
    levers
}

/// Largest distance of the body from the axis of the joint that carries its link.
fn own_axis(joint: &Joint, body: &Body) -> Option<f64> {
    let axis = joint.motion.as_ref()?.axis;
    let across = body.capsule.ends().map(|end| end.coords.cross(&axis).norm());
    Some(across[0].max(across[1]) + body.capsule.radius())
}

fn lever(joint: &Joint, id: (usize, usize), offset: usize, extent: f64) -> Option<Lever> {
    let motion = joint.motion.as_ref()?;
    let reach = match motion.joint_type {
        JointType::Revolute | JointType::Continuous => extent,
        JointType::Prismatic => 1.0,
    };
    let (variable, gain) = match motion.position {
        PositionSource::Variable(variable) => (variable, 1.0),
        PositionSource::Mimic { variable, multiplier, .. } => (variable, multiplier.abs()),
    };
    // A multiplier of zero holds the body still, whatever its reach.
    let reach = if gain > 0.0 { gain * reach } else { 0.0 };
    Some(Lever { joint: id, variable: offset + variable, reach })
}

/// Farthest that a slide carries its link from its origin \[m\]; zero for other joints.
pub(super) fn stroke(joint: &Joint, model: &crate::RobotModel) -> f64 {
    let Some(motion) = joint.motion.as_ref() else { return 0.0 };
    if motion.joint_type != JointType::Prismatic {
        return 0.0;
    }
    let farthest = |motion: &crate::Motion| match (motion.limits.lower, motion.limits.upper) {
        (Some(lower), Some(upper)) => lower.abs().max(upper.abs()),
        _ => f64::INFINITY,
    };
    match motion.position {
        PositionSource::Variable(_) => farthest(motion),
        // What a mimic joint does follows from its master's limits; its own bind nobody.
        PositionSource::Mimic { variable, multiplier, offset } => {
            let master = model.variables().nth(variable);
            match master.map(|master| farthest(master.motion)) {
                Some(travel) if multiplier != 0.0 => multiplier.abs() * travel + offset.abs(),
                _ => offset.abs(),
            }
        }
    }
}

/// What of two ways from the world does not lie on both: only that changes their distance.
pub(super) fn unshared<'l>(a: &'l [Lever], b: &'l [Lever]) -> impl Iterator<Item = &'l Lever> {
    let shared = a.iter().zip(b).take_while(|(a, b)| a.joint == b.joint).count();
    a.iter().skip(shared).chain(b.iter().skip(shared))
}
