//! Doubts about the robot as a whole.

use super::Doubts;
use crate::MAX_JOINTS;
use crate::robot_model::RobotModel;
use crate::urdf::scan::Scan;
use crate::urdf::warning::UrdfDoubt;

pub(super) fn review_robot(scan: &Scan<'_>, model: &RobotModel, doubts: &mut Doubts) {
    let slow: Vec<_> = model
        .variables()
        .filter(|variable| variable.motion.limits.acceleration.is_none_or(|limit| limit == 0.0))
        .collect();
    if let Some(first) = slow.first() {
        let (joints, name) = (slow.len(), first.name.to_owned());
        let element = scan.joints.get(first.joint).map_or(&scan.root, |site| &site.element);
        doubts.about(element, UrdfDoubt::NoAcceleration { joints, first: name });
    }
    long_chains(scan, model, doubts);
}

/// Doubts each leaf with too many driven joints on the way to it.
fn long_chains(scan: &Scan<'_>, model: &RobotModel, doubts: &mut Doubts) {
    // Parents stand before their children, so the count of the parent is always known.
    let mut driven: Vec<usize> = Vec::with_capacity(model.links().len());
    let mut is_leaf = vec![true; model.links().len()];
    for link in model.links() {
        let joint = link.parent_joint.and_then(|joint| model.joints().get(joint));
        let count = joint.map_or(0, |joint| {
            if let Some(leaf) = is_leaf.get_mut(joint.parent) {
                *leaf = false;
            }
            let above = driven.get(joint.parent).copied().unwrap_or_default();
            above + usize::from(joint.variable().is_some())
        });
        driven.push(count);
    }
    for ((link, driven), is_leaf) in model.links().iter().zip(driven).zip(is_leaf) {
        if is_leaf && driven > MAX_JOINTS {
            let tip = link.name.clone();
            let site = link.parent_joint.and_then(|joint| scan.joints.get(joint));
            let element = site.map_or(&scan.root, |site| &site.element);
            doubts.about(element, UrdfDoubt::LongChain { tip, driven, limit: MAX_JOINTS });
        }
    }
}
