//! Last pass: what can be used, but is doubtful.
//!
//! Values that are not sound are passed over here: they have been reported as problems.

mod elements;
mod joints;
mod links;
mod robot;

use super::findings::Findings;
use super::scan::Scan;
use super::source::Element;
use super::warning::UrdfDoubt;
use crate::robot_model::RobotModel;

/// What is doubtful about a text.
pub(super) type Doubts = Findings<UrdfDoubt>;

impl Doubts {
    fn about(&mut self, element: &Element<'_>, doubt: UrdfDoubt) {
        self.add(element.offset(), doubt);
    }
}

/// Looks over the document, and the robot if there is one.
pub(super) fn review(scan: &Scan<'_>, model: Option<&RobotModel>, doubts: &mut Doubts) {
    let mut is_carried = vec![false; scan.links.len()];
    for child in scan.joints.iter().filter_map(|joint| joint.child) {
        if let Some(slot) = is_carried.get_mut(child) {
            *slot = true;
        }
    }
    for (link, is_carried) in scan.links.iter().zip(is_carried) {
        name(&link.element, link.name, doubts);
        links::review_shapes(link, doubts);
        match link.element.children_named("inertial").next() {
            Some(inertial) => links::review_inertial(&inertial, doubts),
            // Nothing moves the root, whatever its mass.
            None if is_carried => links::review_missing_inertial(link, doubts),
            None => {}
        }
    }
    for joint in &scan.joints {
        name(&joint.element, joint.name, doubts);
        joints::review_joint(scan, joint, doubts);
    }
    name(&scan.root, scan.name, doubts);
    elements::review_elements(scan, doubts);
    links::review_meshes(scan, doubts);
    if let Some(model) = model {
        robot::review_robot(scan, model, doubts);
    }
}

/// Doubts a name that cannot stand in a key of Zenoh, or that is hard to type.
fn name(element: &Element<'_>, name: &str, doubts: &mut Doubts) {
    let is_odd = |character: &char| {
        !character.is_ascii_graphic() || ['/', '*', '$', '?', '#'].contains(character)
    };
    if let Some(character) = name.chars().find(is_odd) {
        doubts.about(element, UrdfDoubt::Name { subject: element.subject(), character });
    }
}
