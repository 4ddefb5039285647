//! First pass: names, numbers and types, each checked where its line is known.
//!
//! The pass writes a copy of what it checked. The URDF reader gets the copy, not the file, so it
//! sees the same elements we saw: no foreign namespaces, no entities, no depth beyond URDF's own.

use std::collections::BTreeMap;

use super::error::{UrdfError, UrdfProblem};
use super::joint::scan_joint;
use super::link::scan_link;
use super::source::Element;
use super::writer::{Value, Writer};

/// What the first pass found.
pub(super) struct Scan<'d> {
    pub(super) root: Element<'d>,
    pub(super) name: &'d str,
    pub(super) links: Vec<Named<'d>>,
    pub(super) joints: Vec<JointSite<'d>>,
    /// The checked copy; its links and joints stand in the same order as here.
    pub(super) copy: String,
}

/// A link or joint and where it stands.
pub(super) struct Named<'d> {
    pub(super) element: Element<'d>,
    pub(super) name: &'d str,
}

/// A joint with the names it uses as indices.
pub(super) struct JointSite<'d> {
    pub(super) element: Element<'d>,
    pub(super) name: &'d str,
    pub(super) parent: usize,
    pub(super) child: usize,
    /// Whether it has a degree of freedom.
    pub(super) moves: bool,
    /// Joint that it mimics.
    pub(super) master: Option<usize>,
}

/// Version of URDF, 1.0 if the file names none.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Version {
    minor: u32,
}

impl Version {
    /// Since when `<origin>` may have `quat_xyzw`.
    pub(super) const WITH_QUATERNIONS: Self = Self { minor: 1 };
    /// Since when a missing position limit means none, not zero, and `<limit>` may have
    /// `acceleration` and `deceleration`.
    pub(super) const WITH_OPEN_LIMITS: Self = Self { minor: 2 };
}

/// Tables that the parts of the file refer to.
pub(super) struct Names<'d> {
    pub(super) version: Version,
    pub(super) links: BTreeMap<&'d str, usize>,
    pub(super) joints: BTreeMap<&'d str, usize>,
    pub(super) colours: BTreeMap<&'d str, [f64; 4]>,
}

/// Checks the document.
pub(super) fn scan(root: Element<'_>) -> Result<Scan<'_>, UrdfError> {
    if root.name() != "robot" {
        return Err(root.error(UrdfProblem::NotARobot { element: root.name().to_owned() }));
    }
    if let Some(template) = root.first_xacro() {
        let element = template.name().to_owned();
        return Err(template.error(UrdfProblem::Xacro { element }));
    }
    let name = name_of(&root)?;
    let version = version_of(&root)?;
    let links = named(&root, "link")?;
    let joints = named(&root, "joint")?;
    let names = Names {
        version,
        links: index(&links)?,
        joints: index(&joints)?,
        colours: colours(&root, &links)?,
    };
    let mut writer = Writer::default();
    let version_text = root.attribute("version").unwrap_or("1.0");
    writer.open("robot", &[("name", Value::Text(name)), ("version", Value::Text(version_text))]);
    for link in &links {
        scan_link(link, &names, &mut writer)?;
    }
    let joints = joints
        .into_iter()
        .map(|joint| scan_joint(joint, &names, &mut writer))
        .collect::<Result<_, _>>()?;
    writer.close("robot");
    Ok(Scan { root, name, links, joints, copy: writer.finish() })
}

fn version_of(root: &Element<'_>) -> Result<Version, UrdfError> {
    let Some(version) = root.attribute("version") else {
        return Ok(Version { minor: 0 });
    };
    match version.split_once('.').map(|(major, minor)| (major, minor.parse())) {
        Some(("1", Ok(minor @ 0..=2))) => Ok(Version { minor }),
        _ => Err(root.error(UrdfProblem::Version { version: version.to_owned() })),
    }
}

fn named<'d>(root: &Element<'d>, kind: &'static str) -> Result<Vec<Named<'d>>, UrdfError> {
    root.children_named(kind)
        .map(|element| {
            let name = name_of(&element)?;
            Ok(Named { element: element.with_subject(&format!("{kind} \"{name}\"")), name })
        })
        .collect()
}

fn name_of<'d>(element: &Element<'d>) -> Result<&'d str, UrdfError> {
    match element.required_attribute("name")? {
        "" => Err(element.error(UrdfProblem::EmptyName { element: element.name().to_owned() })),
        name => Ok(name),
    }
}

fn index<'d>(named: &[Named<'d>]) -> Result<BTreeMap<&'d str, usize>, UrdfError> {
    let mut index = BTreeMap::new();
    for (position, Named { element, name }) in named.iter().enumerate() {
        if let Some(first) = index.insert(*name, position) {
            let first_line = named.get(first).map_or(0, |first| first.element.place().line);
            let subject = element.subject();
            return Err(element.error(UrdfProblem::RepeatedName { subject, first_line }));
        }
    }
    Ok(index)
}

/// Colours by the name of their material: a visual may use one that another visual defines.
fn colours<'d>(
    root: &Element<'d>,
    links: &[Named<'d>],
) -> Result<BTreeMap<&'d str, [f64; 4]>, UrdfError> {
    let visuals = links.iter().flat_map(|link| link.element.children_named("visual"));
    let materials = root
        .children_named("material")
        .chain(visuals.flat_map(|visual| visual.children_named("material")));
    let mut colours = BTreeMap::new();
    for material in materials {
        let name = material.attribute("name").unwrap_or_default();
        if let Some(colour) = material.child("color")? {
            let rgba = colour.required_numbers::<4>("rgba")?;
            colours.entry(name).or_insert(rgba);
        }
    }
    Ok(colours)
}
