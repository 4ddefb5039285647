//! First pass: names, numbers and types, each checked where its line is known.
//!
//! The pass writes a copy of what it checked. The URDF reader gets the copy, not the file, so it
//! sees the same elements we saw: no foreign namespaces, no entities, no depth beyond URDF's own.
//! It goes on after a problem, and leaves out only what a sound value would have to decide.

use std::collections::BTreeMap;

use super::error::UrdfProblem;
use super::findings::{Fault, Problems};
use super::joint::scan_joint;
use super::link::scan_link;
use super::source::Element;
use super::writer::{Value, Writer};

/// What the first pass found.
pub(super) struct Scan<'d> {
    pub(super) root: Element<'d>,
    pub(super) name: &'d str,
    pub(super) version: Version,
    pub(super) links: Vec<Named<'d>>,
    pub(super) joints: Vec<JointSite<'d>>,
    /// Whether every link can be told by its name, so that links can be looked up.
    pub(super) links_sound: bool,
    /// Whether every joint can be told by its name.
    pub(super) joints_sound: bool,
    /// The checked copy; its links and joints stand in the same order as here. Only to be read
    /// where there are no problems.
    pub(super) copy: String,
}

/// A link or joint and where it stands.
pub(super) struct Named<'d> {
    pub(super) element: Element<'d>,
    /// Empty where the file gives none, which is a problem.
    pub(super) name: &'d str,
}

/// A joint with the names it uses as indices; `None` where a name leads nowhere.
pub(super) struct JointSite<'d> {
    pub(super) element: Element<'d>,
    pub(super) name: &'d str,
    pub(super) parent: Option<usize>,
    pub(super) child: Option<usize>,
    /// Whether it has a degree of freedom.
    pub(super) moves: bool,
    /// How it mimics another.
    pub(super) mimic: Option<MimicRule>,
}

impl JointSite<'_> {
    /// Whether its position is a variable of the robot.
    pub(super) const fn is_driven(&self) -> bool {
        self.moves && self.mimic.is_none()
    }
}

/// `multiplier * position + offset` of another joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MimicRule {
    /// The other joint; `None` where that is not known.
    pub(super) master: Option<usize>,
    pub(super) multiplier: f64,
    pub(super) offset: f64,
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
    pub(super) links: Index<'d>,
    pub(super) joints: Index<'d>,
    pub(super) colours: BTreeMap<&'d str, [f64; 4]>,
}

/// Links or joints by their names.
pub(super) struct Index<'d> {
    positions: BTreeMap<&'d str, usize>,
    /// Whether every one has a name of its own. Where not, a name that is not found is no second
    /// mistake.
    pub(super) is_sound: bool,
}

impl Index<'_> {
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        self.positions.get(name).copied()
    }
}

/// What the first pass makes.
#[derive(Default)]
pub(super) struct Out {
    pub(super) copy: Writer,
    pub(super) problems: Problems,
}

/// Checks the document, which must have the right kind of root.
pub(super) fn scan<'d>(root: Element<'d>, problems: &mut Problems) -> Scan<'d> {
    let mut out = Out { copy: Writer::default(), problems: std::mem::take(problems) };
    let name = out.problems.keep(name_of(&root)).unwrap_or_default();
    // A file of a version that is not known is read with the rules that ask least.
    let version = out.problems.keep(version_of(&root)).unwrap_or(Version::WITH_OPEN_LIMITS);
    let links = named(&root, "link", &mut out.problems);
    let joints = named(&root, "joint", &mut out.problems);
    if links.is_empty() {
        out.problems.report(root.fault(UrdfProblem::NoLinks));
    }
    let names = Names {
        version,
        links: index(&links, &mut out.problems),
        joints: index(&joints, &mut out.problems),
        colours: colours(&root, &links, &mut out.problems),
    };
    let version_text = root.attribute("version").unwrap_or("1.0");
    out.copy.open("robot", &[("name", Value::Text(name)), ("version", Value::Text(version_text))]);
    for link in &links {
        scan_link(link, &names, &mut out);
    }
    let joints = joints.into_iter().map(|joint| scan_joint(joint, &names, &mut out)).collect();
    out.copy.close("robot");
    *problems = out.problems;
    let (links_sound, joints_sound) = (names.links.is_sound, names.joints.is_sound);
    let copy = out.copy.finish();
    Scan { root, name, version, links, joints, links_sound, joints_sound, copy }
}

/// Whether the document can be a robot description at all.
pub(super) fn check_root(root: &Element<'_>) -> Result<(), Fault> {
    if root.name() != "robot" {
        return Err(root.fault(UrdfProblem::NotARobot { element: root.name().to_owned() }));
    }
    match root.first_xacro() {
        Some(template) => {
            let element = template.name().to_owned();
            Err(template.fault(UrdfProblem::Xacro { element }))
        }
        None => Ok(()),
    }
}

fn version_of(root: &Element<'_>) -> Result<Version, Fault> {
    let Some(version) = root.attribute("version") else {
        return Ok(Version { minor: 0 });
    };
    match version.split_once('.').map(|(major, minor)| (major, minor.parse())) {
        Some(("1", Ok(minor @ 0..=2))) => Ok(Version { minor }),
        _ => Err(root.fault(UrdfProblem::Version { version: version.to_owned() })),
    }
}

fn named<'d>(root: &Element<'d>, kind: &'static str, problems: &mut Problems) -> Vec<Named<'d>> {
    root.children_named(kind)
        .map(|element| match problems.keep(name_of(&element)) {
            Some(name) => {
                Named { element: element.with_subject(&format!("{kind} \"{name}\"")), name }
            }
            None => {
                Named { element: element.with_subject(&format!("{kind} without name")), name: "" }
            }
        })
        .collect()
}

fn name_of<'d>(element: &Element<'d>) -> Result<&'d str, Fault> {
    match element.required_attribute("name")? {
        "" => Err(element.fault(UrdfProblem::EmptyName { element: element.name().to_owned() })),
        name => Ok(name),
    }
}

fn index<'d>(named: &[Named<'d>], problems: &mut Problems) -> Index<'d> {
    let mut index = Index { positions: BTreeMap::new(), is_sound: !named.is_empty() };
    for (position, Named { element, name }) in named.iter().enumerate() {
        if name.is_empty() {
            index.is_sound = false;
            continue;
        }
        let first = *index.positions.entry(*name).or_insert(position);
        if first != position {
            index.is_sound = false;
            let first_line = named.get(first).map_or(0, |first| first.element.line());
            let subject = element.subject();
            problems.report(element.fault(UrdfProblem::RepeatedName { subject, first_line }));
        }
    }
    index
}

/// Colours by the name of their material: a visual may use one that another visual defines.
///
/// What is wrong with a visual's own material is found with the visual.
fn colours<'d>(
    root: &Element<'d>,
    links: &[Named<'d>],
    problems: &mut Problems,
) -> BTreeMap<&'d str, [f64; 4]> {
    let mut colours = BTreeMap::new();
    let mut add = |material: &Element<'d>, problems: &mut Problems| {
        let colour = material.child("color", problems);
        let rgba = colour.and_then(|colour| problems.keep(colour.required_numbers::<4>("rgba")));
        if let Some(rgba) = rgba {
            let name = material.attribute("name").unwrap_or_default();
            colours.entry(name).or_insert(rgba);
        }
    };
    for material in root.children_named("material") {
        add(&material, problems);
    }
    let visuals = links.iter().flat_map(|link| link.element.children_named("visual"));
    for material in visuals.flat_map(|visual| visual.children_named("material")) {
        add(&material, &mut Problems::default());
    }
    colours
}
