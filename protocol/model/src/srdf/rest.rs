//! Virtual and passive joints, end effectors, spheres, and what SRDF does not know.

use std::collections::BTreeMap;

use super::{
    EndEffector, LinkSpheres, Reader, Severity, SrdfFault, VirtualJoint, VirtualJointType,
};

/// Every element that may stand in `<robot>`; the last has properties for planners.
const KNOWN: [&str; 10] = [
    "group",
    "group_state",
    "end_effector",
    "virtual_joint",
    "passive_joint",
    "disable_collisions",
    "disable_default_collisions",
    "enable_collisions",
    "link_sphere_approximation",
    "joint_property",
];

impl Reader<'_, '_> {
    pub(super) fn check_robot(&mut self) {
        let root = self.root;
        if let Some(given) = self.problems.required(&root, "name")
            && given != self.model.name()
        {
            let (given, expected) = (given.to_owned(), self.model.name().to_owned());
            self.problems.warning(&root, SrdfFault::RobotName { given, expected });
        }
        for child in root.children().filter(|child| !KNOWN.contains(&child.name())) {
            let parent = "robot".to_owned();
            self.problems.warning(&child, SrdfFault::UnknownElement { parent });
        }
    }

    pub(super) fn read_virtual_joints(&mut self) {
        let mut lines: BTreeMap<&str, u32> = BTreeMap::new();
        for element in self.entries("virtual_joint") {
            let name = self.problems.required(&element, "name");
            let given = self.problems.required(&element, "type");
            let frame = self.problems.required(&element, "parent_frame");
            let child = self.link(&element, "child_link", Severity::Error);
            let kind = given.and_then(|given| {
                let kind = virtual_type(given);
                if kind.is_none() {
                    let given = given.to_owned();
                    self.problems.error(&element, SrdfFault::VirtualType { given });
                }
                kind
            });
            let (Some(name), Some(kind), Some(frame), Some(child)) = (name, kind, frame, child)
            else {
                continue;
            };
            if let Some(&first_line) = lines.get(name) {
                let name = name.to_owned();
                self.problems.error(&element, SrdfFault::RepeatedName { name, first_line });
            } else if self.model.joint_index(name).is_some() {
                let joint = name.to_owned();
                self.problems.error(&element, SrdfFault::TakenJointName { joint });
            } else if child != 0 {
                let (link, root) = (self.link_name(child), self.link_name(0));
                self.problems.error(&element, SrdfFault::NotTheRoot { link, root });
            } else {
                lines.insert(name, element.line());
                let (name, parent_frame) = (name.to_owned(), frame.to_owned());
                self.srdf.virtual_joints.push(VirtualJoint { name, kind, parent_frame });
            }
        }
    }

    pub(super) fn read_passive_joints(&mut self) {
        for element in self.entries("passive_joint") {
            let Some(name) = self.problems.required(&element, "name") else { continue };
            let joint = name.to_owned();
            match self.model.joint_index(name) {
                Some(index) => match self.srdf.passive_joints.binary_search(&index) {
                    Ok(_) => self.problems.warning(&element, SrdfFault::RepeatedPassive { joint }),
                    Err(place) => self.srdf.passive_joints.insert(place, index),
                },
                // Virtual joints are never driven: the mark adds nothing.
                None if self.srdf.virtual_joints.iter().any(|known| known.name == name) => {}
                None => self.problems.warning(&element, SrdfFault::UnknownJoint { joint }),
            }
        }
    }

    pub(super) fn read_end_effectors(&mut self) {
        let mut lines: BTreeMap<&str, u32> = BTreeMap::new();
        for element in self.entries("end_effector") {
            let name = self.problems.required(&element, "name");
            let group = self.group(&element, "group");
            let parent_link = self.link(&element, "parent_link", Severity::Error);
            let parent_group = element
                .attribute("parent_group")
                .and_then(|_| self.group(&element, "parent_group"));
            let (Some(name), Some(group), Some(parent_link)) = (name, group, parent_link) else {
                continue;
            };
            if let Some(&first_line) = lines.get(name) {
                let name = name.to_owned();
                self.problems.error(&element, SrdfFault::RepeatedName { name, first_line });
                continue;
            }
            lines.insert(name, element.line());
            let own = self.srdf.groups.get(group);
            if let Some(own) = own.filter(|own| own.links.binary_search(&parent_link).is_ok()) {
                let (group, link) = (own.name.clone(), self.link_name(parent_link));
                self.problems.warning(&element, SrdfFault::ParentInGroup { link, group });
            }
            let name = name.to_owned();
            let end_effector = EndEffector { name, group, parent_link, parent_group };
            self.srdf.end_effectors.push(end_effector);
        }
    }

    pub(super) fn read_spheres(&mut self) {
        let mut lines: BTreeMap<usize, u32> = BTreeMap::new();
        for element in self.entries("link_sphere_approximation") {
            let Some(link) = self.link(&element, "link", Severity::Error) else { continue };
            if let Some(&first_line) = lines.get(&link) {
                self.problems.warning(&element, SrdfFault::RepeatedEntry { first_line });
                continue;
            }
            lines.insert(link, element.line());
            let mut spheres = Vec::new();
            for child in element.children() {
                if child.name() != "sphere" {
                    let parent = "link_sphere_approximation".to_owned();
                    self.problems.warning(&child, SrdfFault::UnknownElement { parent });
                    continue;
                }
                let centre = self.problems.numbers::<3>(&child, "center");
                let radius = self.problems.number(&child, "radius");
                match (centre, radius) {
                    (_, Some(radius)) if radius < 0.0 => {
                        self.problems.error(&child, SrdfFault::NegativeRadius { radius });
                    }
                    (Some(centre), Some(radius)) => spheres.push((centre, radius)),
                    _ => {}
                }
            }
            self.srdf.link_spheres.push(LinkSpheres { link, spheres });
        }
    }
}

fn virtual_type(name: &str) -> Option<VirtualJointType> {
    match name {
        "fixed" => Some(VirtualJointType::Fixed),
        "planar" => Some(VirtualJointType::Planar),
        "floating" => Some(VirtualJointType::Floating),
        _ => None,
    }
}
