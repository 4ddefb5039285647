//! Why a text is not a robot description.

use std::fmt;
use std::sync::Arc;

/// Joint types this crate can move.
pub(super) const SUPPORTED_JOINT_TYPES: &str = "revolute, continuous, prismatic, fixed";
/// Joint types of the URDF specification that this crate cannot move.
pub(super) const OTHER_JOINT_TYPES: &str = "floating, planar, spherical";
/// Shapes that a `<geometry>` may hold.
pub(super) const SHAPES: &str = "box, cylinder, capsule, sphere, mesh";

/// Where in a file something stands.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Place {
    /// The file's label, as the caller gave it.
    pub file: Arc<str>,
    /// Line, counted from one.
    pub line: u32,
    /// Column in characters, counted from one.
    pub column: u32,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file, self.line)
    }
}

/// Why a text is not a robot description, and where it is wrong.
///
/// Reads like a compiler's message: `arm.urdf:12: joint "elbow": limit lower 1.2 is above upper
/// 0.5`.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place}: {problem}")]
pub struct UrdfError {
    /// Start of the element that is wrong.
    pub place: Place,
    /// What is wrong with it.
    pub problem: Box<UrdfProblem>,
}

/// What is wrong with a robot description.
///
/// `subject` names the link or joint as a person reads it, such as `joint "elbow"`.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UrdfProblem {
    /// The text is larger than any robot description.
    #[error("{bytes} bytes, above the limit of {limit} bytes")]
    TooLarge {
        /// Size of the text.
        bytes: usize,
        /// Largest size accepted.
        limit: usize,
    },
    /// The text is not XML, or uses a document type declaration.
    #[error("not valid XML: {0}")]
    Xml(roxmltree::Error),
    /// An element has more attributes than any of a robot description.
    #[error("an element has more than {limit} attributes")]
    TooManyAttributes {
        /// Largest number accepted.
        limit: usize,
    },
    /// The root element is not `<robot>`.
    #[error("root element is <{element}>, expected <robot>")]
    NotARobot {
        /// Name of the root element.
        element: String,
    },
    /// The URDF version is not 1.x.
    #[error("URDF version \"{version}\" is not supported, expected 1.0 to 1.2")]
    Version {
        /// The version given.
        version: String,
    },
    /// The file is a xacro template that was not expanded.
    #[error("<xacro:{element}> is not expanded; run `xacro IN.xacro > OUT.urdf` first")]
    Xacro {
        /// Local name of the first such element.
        element: String,
    },
    /// An attribute is required, and missing.
    #[error("{subject}: <{element}> has no attribute \"{attribute}\"")]
    MissingAttribute {
        /// Link, joint or robot.
        subject: String,
        /// Element that needs it.
        element: String,
        /// Name of the attribute.
        attribute: &'static str,
    },
    /// An element is required, and missing.
    #[error("{subject}: <{parent}> has no <{element}>")]
    MissingElement {
        /// Link, joint or robot.
        subject: String,
        /// Element that needs it.
        parent: String,
        /// Name of the missing element.
        element: &'static str,
    },
    /// An element that may stand once stands twice.
    #[error("{subject}: <{parent}> has more than one <{element}>")]
    RepeatedElement {
        /// Link, joint or robot.
        subject: String,
        /// Element around it.
        parent: String,
        /// Name of the repeated element.
        element: &'static str,
    },
    /// A link or joint is named by the empty string.
    #[error("<{element}> has an empty name")]
    EmptyName {
        /// `link`, `joint` or `robot`.
        element: String,
    },
    /// Two links or two joints have one name.
    #[error("{subject}: the name is taken since line {first_line}")]
    RepeatedName {
        /// The second link or joint of that name.
        subject: String,
        /// Line of the first.
        first_line: u32,
    },
    /// A value is not the expected count of numbers.
    #[error("{subject}: {element} {attribute} \"{value}\" is not {}", numbers(*.expected))]
    NotNumbers {
        /// Link, joint or material.
        subject: String,
        /// Element that holds the attribute.
        element: String,
        /// Name of the attribute.
        attribute: &'static str,
        /// The value as written.
        value: String,
        /// How many numbers it should hold.
        expected: usize,
    },
    /// A number is infinite, not a number, or too large for a 64-bit float.
    #[error("{subject}: {element} {attribute} \"{value}\" is not finite")]
    NotFinite {
        /// Link, joint or material.
        subject: String,
        /// Element that holds the attribute.
        element: String,
        /// Name of the attribute.
        attribute: &'static str,
        /// The value as written.
        value: String,
    },
    /// A quantity that cannot be negative is.
    #[error("{subject}: {element} {attribute} {value} is below zero")]
    Negative {
        /// Link or joint.
        subject: String,
        /// Element that holds the attribute.
        element: String,
        /// Name of the attribute.
        attribute: &'static str,
        /// The value.
        value: f64,
    },
    /// A `quat_xyzw` cannot be used as an orientation.
    #[error("{subject}: origin quat_xyzw {fault}")]
    Quaternion {
        /// Link or joint.
        subject: String,
        /// Why.
        fault: QuaternionFault,
    },
    /// The shape is none of URDF's.
    #[error("{subject}: <{shape}> is not a shape, expected one of {SHAPES}")]
    UnknownShape {
        /// Link.
        subject: String,
        /// Name of the element.
        shape: String,
    },
    /// A `<geometry>` does not hold one shape.
    #[error("{subject}: <geometry> holds {count} shapes, expected one of {SHAPES}")]
    ShapeCount {
        /// Link.
        subject: String,
        /// Number of shapes.
        count: usize,
    },
    /// The joint type is none of URDF's.
    #[error(
        "{subject}: unknown type \"{joint_type}\", \
         expected one of {SUPPORTED_JOINT_TYPES}, {OTHER_JOINT_TYPES}"
    )]
    UnknownJointType {
        /// Joint.
        subject: String,
        /// The type as written.
        joint_type: String,
    },
    /// The joint type is URDF's, but has not exactly one or no degree of freedom.
    #[error(
        "{subject}: type {joint_type} is not supported, expected one of {SUPPORTED_JOINT_TYPES}"
    )]
    UnsupportedJointType {
        /// Joint.
        subject: String,
        /// The type.
        joint_type: String,
    },
    /// A joint with limits by its type has no `<limit>`.
    #[error("{subject}: a {joint_type} joint needs a <limit>")]
    MissingLimit {
        /// Joint.
        subject: String,
        /// `revolute` or `prismatic`.
        joint_type: String,
    },
    /// Lower and upper limit are in the wrong order.
    #[error("{subject}: {kind} lower {lower} is above upper {upper}")]
    LimitOrder {
        /// Joint.
        subject: String,
        /// `limit` or `soft limit`.
        kind: &'static str,
        /// Lower limit \[rad or m\].
        lower: f64,
        /// Upper limit \[rad or m\].
        upper: f64,
    },
    /// The axis has no direction.
    #[error("{subject}: axis xyz has zero length")]
    ZeroAxis {
        /// Joint.
        subject: String,
    },
    /// A joint names a link that does not exist.
    #[error("{subject}: {end} link \"{link}\" does not exist")]
    UnknownLink {
        /// Joint.
        subject: String,
        /// `parent` or `child`.
        end: &'static str,
        /// Name of the missing link.
        link: String,
    },
    /// The robot has no links.
    #[error("the robot has no links")]
    NoLinks,
    /// Two links have no parent; a robot is one tree.
    #[error("link \"{second}\": no joint leads to it, but \"{first}\" is the root already")]
    SeveralRoots {
        /// First link without a parent.
        first: String,
        /// Second link without a parent.
        second: String,
    },
    /// Two joints lead to one link; loops are not supported.
    #[error(
        "joint \"{second}\": its child link \"{link}\" is the child of joint \"{first}\" already"
    )]
    SeveralParents {
        /// The link.
        link: String,
        /// First joint that leads to it.
        first: String,
        /// Second joint that leads to it.
        second: String,
    },
    /// A link is its own ancestor.
    #[error("joint \"{joint}\": link \"{link}\" is its own ancestor")]
    Cycle {
        /// A joint of the loop.
        joint: String,
        /// The joint's child link.
        link: String,
    },
    /// A joint mimics one that does not exist.
    #[error("{subject}: mimics joint \"{master}\", which does not exist")]
    UnknownMaster {
        /// The following joint.
        subject: String,
        /// Name of the joint to follow.
        master: String,
    },
    /// A joint mimics a fixed one.
    #[error("{subject}: mimics joint \"{master}\", which is fixed")]
    FixedMaster {
        /// The following joint.
        subject: String,
        /// Name of the joint to follow.
        master: String,
    },
    /// A joint mimics itself, over others or directly.
    #[error("{subject}: mimics itself")]
    MimicLoop {
        /// A joint of the loop.
        subject: String,
    },
    /// Multipliers of a chain of mimic joints multiply to infinity.
    #[error("{subject}: multiplier and offset towards \"{master}\" are not finite")]
    MimicOverflow {
        /// The following joint.
        subject: String,
        /// The joint at the end of the chain.
        master: String,
    },
    /// The URDF reader refused what passed the checks before it.
    #[error("{reason}")]
    Reader {
        /// The reader's message.
        reason: String,
    },
}

/// Why a `quat_xyzw` cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum QuaternionFault {
    /// URDF has it since version 1.1.
    #[error("needs <robot version=\"1.1\"> or later")]
    Version,
    /// `rpy` is there as well.
    #[error("stands beside rpy; give one of them")]
    WithRpy,
    /// All four numbers are zero, or nearly.
    #[error("has zero length")]
    ZeroLength,
}

fn numbers(count: usize) -> String {
    match count {
        1 => "a number".to_owned(),
        _ => format!("{count} numbers separated by spaces"),
    }
}
