//! Doubts about one joint.

use std::f64::consts::TAU;

use super::Doubts;
use crate::urdf::scan::{JointSite, Scan, Version};
use crate::urdf::source::Element;
use crate::urdf::warning::UrdfDoubt;

/// How far the length of an axis may be from one: axes are often written with four digits.
const AXIS_LENGTH_TOLERANCE: f64 = 1e-3;

pub(super) fn review_joint(scan: &Scan<'_>, joint: &JointSite<'_>, doubts: &mut Doubts) {
    let joint_type = joint.element.attribute("type").unwrap_or_default();
    if !matches!(joint_type, "revolute" | "continuous" | "prismatic") {
        return;
    }
    review_axis(&joint.element, doubts);
    review_limits(scan.version, joint, joint_type, doubts);
    let master = joint.mimic.and_then(|rule| scan.joints.get(rule.master?));
    if let Some(master) = master.filter(|master| master.mimic.is_some()) {
        let (subject, master) = (joint.element.subject(), master.name.to_owned());
        doubts.about(&joint.element, UrdfDoubt::MimicChain { subject, master });
    }
}

fn review_axis(joint: &Element<'_>, doubts: &mut Doubts) {
    let Some(axis) = joint.children_named("axis").next() else { return };
    let Ok(Some([x, y, z])) = axis.numbers::<3>("xyz") else { return };
    let norm = x.hypot(y).hypot(z);
    // One without direction is a problem already.
    if norm > 0.0 && (norm - 1.0).abs() > AXIS_LENGTH_TOLERANCE {
        doubts.about(&axis, UrdfDoubt::AxisLength { subject: axis.subject(), norm });
    }
}

fn review_limits(version: Version, joint: &JointSite<'_>, joint_type: &str, doubts: &mut Doubts) {
    let subject = || joint.element.subject();
    let Some(limit) = joint.element.children_named("limit").next() else {
        if joint_type == "continuous" && joint.is_driven() {
            doubts.about(&joint.element, UrdfDoubt::NoVelocity { subject: subject() });
        }
        return;
    };
    let number = |name| limit.number(name).ok().flatten();
    // A revolute joint without any is a problem already.
    let missing = if joint_type == "continuous" { 0.0 } else { 1.0 };
    if joint.is_driven() && limit.number("velocity").is_ok_and(|v| v.unwrap_or(missing) == 0.0) {
        doubts.about(&limit, UrdfDoubt::NoVelocity { subject: subject() });
    }
    if joint_type == "continuous"
        || limit.number("lower").is_err()
        || limit.number("upper").is_err()
    {
        return;
    }
    let missing = (version < Version::WITH_OPEN_LIMITS).then_some(0.0);
    let (Some(lower), Some(upper)) = (number("lower").or(missing), number("upper").or(missing))
    else {
        return;
    };
    let range = upper - lower;
    if range == 0.0 {
        doubts.about(&limit, UrdfDoubt::NoRange { subject: subject(), position: lower });
    } else if joint_type == "revolute" && range > 2.0 * TAU * (1.0 + f64::EPSILON) {
        doubts.about(&limit, UrdfDoubt::WideRange { subject: subject(), range });
    }
}
