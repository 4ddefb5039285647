//! Elements and attributes that URDF does not know, one warning for each kind.

use std::collections::BTreeMap;

use super::Doubts;
use crate::urdf::scan::{Scan, Version};
use crate::urdf::source::Element;
use crate::urdf::warning::UrdfDoubt;

/// An element that URDF knows.
struct Kind {
    name: &'static str,
    attributes: &'static [&'static str],
    children: &'static [&'static str],
}

/// Attributes and children of each element; those of shapes stand alone.
///
/// Source: URDF XML specification, <http://wiki.ros.org/urdf/XML>, with `urdfdom` 4 for what
/// versions 1.1 and 1.2 add.
const KINDS: [Kind; 17] = [
    kind("robot", &["name", "version"], &["link", "joint", "material"]),
    kind("link", &["name"], &["inertial", "visual", "collision"]),
    kind("joint", &["name", "type"], JOINT),
    kind("inertial", &[], &["origin", "mass", "inertia"]),
    kind("visual", &["name"], &["origin", "geometry", "material"]),
    kind("collision", &["name"], &["origin", "geometry"]),
    kind("origin", &["xyz", "rpy"], &[]),
    kind("mass", &["value"], &[]),
    kind("inertia", &crate::urdf::link::MOMENTS, &[]),
    kind("material", &["name"], &["color", "texture"]),
    kind("axis", &["xyz"], &[]),
    kind("limit", &["lower", "upper", "velocity", "effort"], &[]),
    kind("mimic", &["joint", "multiplier", "offset"], &[]),
    kind("dynamics", &["damping", "friction"], &[]),
    kind("calibration", &["rising", "falling", "reference_position"], &[]),
    kind("safety_controller", SAFETY, &[]),
    kind("color", &["rgba"], &[]),
];

const JOINT: &[&str] = &[
    "origin",
    "parent",
    "child",
    "axis",
    "limit",
    "mimic",
    "dynamics",
    "calibration",
    "safety_controller",
];
const SAFETY: &[&str] = &["soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"];

const fn kind(
    name: &'static str,
    attributes: &'static [&'static str],
    children: &'static [&'static str],
) -> Kind {
    Kind { name, attributes, children }
}

/// Kinds of unknown elements or attributes, by what they are in and called: the first, how many.
type Counts<'d> = BTreeMap<(&'d str, &'d str), (Element<'d>, usize)>;

/// Warns once for each kind of element and attribute that is passed over.
pub(super) fn review_elements(scan: &Scan<'_>, doubts: &mut Doubts) {
    let (mut elements, mut attributes) = (Counts::new(), Counts::new());
    let mut open = vec![scan.root.clone()];
    while let Some(parent) = open.pop() {
        let Some(kind) = KINDS.iter().find(|kind| kind.name == parent.name()) else { continue };
        for attribute in parent.attribute_names() {
            if !kind.attributes.contains(&attribute) && !is_newer(scan.version, kind, attribute) {
                count(&mut attributes, (kind.name, attribute), &parent);
            }
        }
        for child in parent.children() {
            if kind.children.contains(&child.name()) {
                open.push(child);
            } else {
                count(&mut elements, (kind.name, child.name()), &child);
            }
        }
    }
    for ((parent, element), (first, count)) in elements {
        let (parent, element) = (parent.to_owned(), element.to_owned());
        doubts.about(&first, UrdfDoubt::UnknownElement { parent, element, count });
    }
    for ((element, attribute), (first, count)) in attributes {
        let (element, attribute) = (element.to_owned(), attribute.to_owned());
        doubts.about(&first, UrdfDoubt::UnknownAttribute { element, attribute, count });
    }
}

/// Whether an attribute came with the version of the file.
fn is_newer(version: Version, kind: &Kind, attribute: &str) -> bool {
    match (kind.name, attribute) {
        // In an older file it is a problem, and told as such.
        ("origin", "quat_xyzw") => true,
        ("limit", "acceleration" | "deceleration" | "jerk") => version >= Version::WITH_OPEN_LIMITS,
        _ => false,
    }
}

fn count<'d>(counts: &mut Counts<'d>, key: (&'d str, &'d str), at: &Element<'d>) {
    let (first, count) = counts.entry(key).or_insert_with(|| (at.clone(), 0));
    *count += 1;
    // The walk does not go through the text from its beginning to its end.
    if at.offset() < first.offset() {
        *first = at.clone();
    }
}
