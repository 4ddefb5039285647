//! SRDF text to [`Srdf`]: groups, states, and pairs of links that may touch.
//!
//! ```text
//! text --source--> XML with positions --groups, states, pairs--> Srdf + all problems
//! ```
//!
//! SRDF says what URDF does not: which joints form an arm, named states, where an end effector
//! sits, which pairs of links need no collision check. Names are resolved against a
//! [`RobotModel`]; what fits is used, and everything that does not is listed, with its line.
//!
//! Source: `srdfdom` of MoveIt 2 and its description of the format.

mod groups;
mod pairs;
mod problem;
mod rest;
mod source;
mod states;

use crate::xml::Source;
use crate::{Place, RobotModel};
pub use problem::{Severity, SrdfFault, SrdfProblem};
use source::{Element, Problems};

/// What an SRDF says about a robot, as indices into its [`RobotModel`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Srdf {
    /// Groups of joints and links, in the order of the file.
    pub groups: Vec<JointGroup>,
    /// Named states of groups, in the order of the file.
    pub states: Vec<GroupState>,
    /// End effectors, in the order of the file.
    pub end_effectors: Vec<EndEffector>,
    /// How the root is connected to the world.
    pub virtual_joints: Vec<VirtualJoint>,
    /// Joints that no motor drives, as indices among the model's joints, ascending.
    pub passive_joints: Vec<usize>,
    /// Pairs of links that need no collision check, none twice, in the order of the file.
    pub disabled_pairs: Vec<DisabledPair>,
    /// Links that are checked against no other but for [`enabled_pairs`](Self::enabled_pairs).
    pub unchecked_links: Vec<usize>,
    /// Pairs of links that are checked whatever else says, each with the lower index first.
    pub enabled_pairs: Vec<[usize; 2]>,
    /// Spheres that stand for a link's shape.
    pub link_spheres: Vec<LinkSpheres>,
}

/// A named set of joints and links.
#[derive(Clone, Debug, PartialEq)]
pub struct JointGroup {
    /// Name, unique among the robot's groups.
    pub name: String,
    /// Joints, fixed and mimic ones as well, as indices among the model's joints, ascending.
    pub joints: Vec<usize>,
    /// Links, as indices among the model's links, ascending: those named, and what the joints carry.
    pub links: Vec<usize>,
    /// Driven joints, as indices in a position vector, ascending.
    pub variables: Vec<usize>,
    /// Base and tip link of each chain that the group itself is given by.
    pub chains: Vec<[usize; 2]>,
    /// Groups it is made of, as indices in [`Srdf::groups`].
    pub subgroups: Vec<usize>,
    /// Virtual joints, as indices in [`Srdf::virtual_joints`].
    pub virtual_joints: Vec<usize>,
}

/// A named state of a group.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupState {
    /// Name, unique among the group's states.
    pub name: String,
    /// The group, as index in [`Srdf::groups`].
    pub group: usize,
    /// Index in a position vector and position \[rad or m\], ascending by index; not all of the
    /// group's joints need a value.
    pub positions: Vec<(usize, f64)>,
}

/// A tool or hand.
#[derive(Clone, Debug, PartialEq)]
pub struct EndEffector {
    /// Name, unique among the end effectors.
    pub name: String,
    /// Its joints and links, as index in [`Srdf::groups`].
    pub group: usize,
    /// Link that carries it, as index among the model's links.
    pub parent_link: usize,
    /// Group of the arm that carries it, as index in [`Srdf::groups`]; `None` if not given.
    pub parent_group: Option<usize>,
}

/// How a robot's root is connected to the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VirtualJoint {
    /// Name, unlike any joint of the URDF.
    pub name: String,
    /// How the root moves.
    pub kind: VirtualJointType,
    /// Name of the outer frame.
    pub parent_frame: String,
}

/// How a virtual joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VirtualJointType {
    /// Not at all.
    Fixed,
    /// In a plane: x, y and turn.
    Planar,
    /// Freely.
    Floating,
}

/// A pair of links that needs no collision check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DisabledPair {
    /// The two links, as indices among the model's links, the lower first.
    pub links: [usize; 2],
    /// Why, as the file says, such as `Adjacent`, `Never`, `Always`; `None` if it does not.
    pub reason: Option<String>,
}

/// Spheres that stand for a link's shape.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkSpheres {
    /// The link, as index among the model's links.
    pub link: usize,
    /// Centre in the link and radius \[m\].
    pub spheres: Vec<([f64; 3], f64)>,
}

/// Why a text is not an SRDF at all.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place}: {kind}")]
pub struct SrdfError {
    /// Where.
    pub place: Place,
    /// Why.
    pub kind: SrdfErrorKind,
}

/// Why a text is not an SRDF at all.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SrdfErrorKind {
    /// The text is larger than any SRDF.
    #[error("{bytes} bytes, above the limit of {limit} bytes")]
    TooLarge {
        /// Size of the text.
        bytes: usize,
        /// Largest size accepted.
        limit: usize,
    },
    /// An element has more attributes than any of an SRDF.
    #[error("an element has more than {limit} attributes")]
    TooManyAttributes {
        /// Largest number accepted.
        limit: usize,
    },
    /// The text is not XML, or uses a document type declaration.
    #[error("not valid XML: {0}")]
    Xml(roxmltree::Error),
    /// The root element is not `<robot>`.
    #[error("root element is <{element}>, expected <robot>")]
    NotARobot {
        /// Name of the root element.
        element: String,
    },
    /// The file is a URDF: it defines links or joints.
    #[error("<robot> has a <{element}>: this is a URDF, expected an SRDF")]
    Urdf {
        /// `link` or `joint`.
        element: String,
    },
    /// The file is a xacro template that was not expanded.
    #[error("<xacro:{element}> is not expanded; run `xacro IN.srdf.xacro > OUT.srdf` first")]
    Xacro {
        /// Local name of the first such element.
        element: String,
    },
}

impl Srdf {
    /// What the SRDF `text` says about the robot `model`, and all problems in the order of the
    /// file; `file` labels the text in them.
    ///
    /// ```
    /// # use armada_model::{RobotModel, Srdf};
    /// let urdf = r#"<robot name="r"><link name="a"/><link name="b"/>
    ///   <joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>"#;
    /// let model = RobotModel::from_urdf(urdf, "r.urdf")?;
    /// let text = r#"<robot name="r">
    ///   <disable_collisions link1="a" link2="b" reason="Adjacent"/>
    ///   <disable_collisions link1="a" link2="c" reason="Never"/></robot>"#;
    /// let (srdf, problems) = Srdf::read(text, "r.srdf", &model)?;
    /// assert!(srdf.is_disabled(0, 1));
    /// assert!(problems[0].to_string().starts_with("r.srdf:3: warning: <disable_collisions>: link"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`SrdfErrorKind`] lists why a text is not an SRDF at all; entries that are wrong are
    /// problems, not errors.
    pub fn read(
        text: &str,
        file: &str,
        model: &RobotModel,
    ) -> Result<(Self, Vec<SrdfProblem>), SrdfError> {
        let source = Source::new(text, file);
        let document = source::parse(&source)?;
        let root = Element::root(&document, &source);
        check_root(&root)?;
        let mut reader =
            Reader { model, root, srdf: Self::default(), problems: Problems::default() };
        reader.check_robot();
        reader.read_virtual_joints();
        reader.read_passive_joints();
        reader.read_groups();
        reader.read_states();
        reader.read_end_effectors();
        reader.read_pairs();
        reader.read_spheres();
        let mut problems = reader.problems.0;
        problems.sort_by_key(|problem| (problem.place.line, problem.place.column));
        Ok((reader.srdf, problems))
    }

    /// The group of that name.
    #[must_use]
    pub fn group(&self, name: &str) -> Option<&JointGroup> {
        self.groups.iter().find(|group| group.name == name)
    }

    /// The state `name` of the group of that name.
    #[must_use]
    pub fn state(&self, group: &str, name: &str) -> Option<&GroupState> {
        let group = self.groups.iter().position(|known| known.name == group)?;
        self.states.iter().find(|state| state.group == group && state.name == name)
    }

    /// Whether the file says that the two links, by index, need no check against each other.
    #[must_use]
    pub fn is_disabled(&self, a: usize, b: usize) -> bool {
        let pair = [a.min(b), a.max(b)];
        if self.enabled_pairs.contains(&pair) {
            return false;
        }
        let unchecked = |link| self.unchecked_links.contains(link);
        self.disabled_pairs.iter().any(|disabled| disabled.links == pair)
            || pair.iter().any(unchecked)
    }
}

fn check_root(root: &Element<'_>) -> Result<(), SrdfError> {
    if root.name() != "robot" {
        return Err(root.fatal(SrdfErrorKind::NotARobot { element: root.name().to_owned() }));
    }
    if let Some(template) = root.first_xacro() {
        let element = template.name().to_owned();
        return Err(template.fatal(SrdfErrorKind::Xacro { element }));
    }
    match root.children().find(|child| matches!(child.name(), "link" | "joint")) {
        Some(child) => Err(child.fatal(SrdfErrorKind::Urdf { element: child.name().to_owned() })),
        None => Ok(()),
    }
}

/// What is being read.
struct Reader<'d, 'm> {
    model: &'m RobotModel,
    root: Element<'d>,
    srdf: Srdf,
    problems: Problems,
}

impl<'d> Reader<'d, '_> {
    fn entries(&self, name: &'static str) -> impl Iterator<Item = Element<'d>> + use<'d> {
        self.root.children().filter(move |child| child.name() == name)
    }

    /// The link that the attribute names; a problem of that severity if there is none.
    fn link(
        &mut self,
        at: &Element<'_>,
        attribute: &'static str,
        severity: Severity,
    ) -> Option<usize> {
        let name = self.problems.required(at, attribute)?;
        let link = self.model.link_index(name);
        if link.is_none() {
            self.problems.add(at, severity, SrdfFault::UnknownLink { link: name.to_owned() });
        }
        link
    }

    /// Name of a link of the model.
    fn link_name(&self, link: usize) -> String {
        self.model.links().get(link).map(|link| link.name.clone()).unwrap_or_default()
    }

    /// The group that the attribute names.
    fn group(&mut self, at: &Element<'_>, attribute: &'static str) -> Option<usize> {
        let name = self.problems.required(at, attribute)?;
        let group = self.srdf.groups.iter().position(|group| group.name == name);
        if group.is_none() {
            let defined = self.entries("group").any(|group| group.attribute("name") == Some(name));
            let group = name.to_owned();
            let fault = if defined {
                SrdfFault::UnusableGroup { group }
            } else {
                SrdfFault::UnknownGroup { group }
            };
            self.problems.error(at, fault);
        }
        group
    }
}
