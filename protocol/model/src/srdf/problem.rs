//! What is wrong with an SRDF, and what to do about it.

use std::fmt;

use crate::Place;

/// One thing that is wrong in an SRDF: where, how bad, and what to do.
///
/// Reads like a compiler's message: `arm.srdf:37: warning: <disable_collisions>: link "base" does
/// not exist; name a link of the URDF or remove the entry`.
#[derive(Clone, Debug, PartialEq)]
pub struct SrdfProblem {
    /// Start of the element that is wrong.
    pub place: Place,
    /// Whether what the file means is lost.
    pub severity: Severity,
    /// Name of the element, such as `disable_collisions`.
    pub element: String,
    /// What is wrong with it.
    pub fault: SrdfFault,
}

impl fmt::Display for SrdfProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { place, severity, element, fault } = self;
        write!(f, "{place}: {severity}: <{element}>: {fault}; {}", fault.remedy())
    }
}

/// How bad a problem of an SRDF is; neither keeps the rest from being used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The entry has no effect or is doubtful; nothing that the file means is lost by that.
    Warning,
    /// The entry, or a part of it, cannot be used: something that the file means is missing.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

/// What is wrong with an entry of an SRDF.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SrdfFault {
    /// SRDF has no such element there.
    #[error("<{parent}> has no such element in SRDF")]
    UnknownElement {
        /// The element around it.
        parent: String,
    },
    /// The robot's name is not that of the URDF.
    #[error("name \"{given}\", but the URDF's robot is \"{expected}\"")]
    RobotName {
        /// Name in the SRDF.
        given: String,
        /// Name in the URDF.
        expected: String,
    },
    /// A required attribute is missing or empty.
    #[error("attribute \"{attribute}\" is missing or empty")]
    MissingAttribute {
        /// Name of the attribute.
        attribute: &'static str,
    },
    /// A value is not the expected count of finite numbers.
    #[error("{attribute} \"{value}\" is not {expected} finite number(s)")]
    NotNumbers {
        /// Name of the attribute.
        attribute: &'static str,
        /// The value as written.
        value: String,
        /// How many numbers it should hold.
        expected: usize,
    },
    /// The robot has no such link.
    #[error("link \"{link}\" does not exist")]
    UnknownLink {
        /// Name of the link.
        link: String,
    },
    /// Neither the URDF nor a virtual joint has that name.
    #[error("joint \"{joint}\" does not exist")]
    UnknownJoint {
        /// Name of the joint.
        joint: String,
    },
    /// The SRDF has no such group.
    #[error("group \"{group}\" does not exist")]
    UnknownGroup {
        /// Name of the group.
        group: String,
    },
    /// The group exists, but was dropped for problems of its own.
    #[error("group \"{group}\" is not usable")]
    UnusableGroup {
        /// Name of the group.
        group: String,
    },
    /// An entry of that kind and name stands already.
    #[error("name \"{name}\" is taken since line {first_line}")]
    RepeatedName {
        /// The name.
        name: String,
        /// Line of the first.
        first_line: u32,
    },
    /// A group has no link and no joint.
    #[error("group \"{group}\" has no link and no joint")]
    EmptyGroup {
        /// Name of the group.
        group: String,
    },
    /// A group holds itself, over others or directly.
    #[error("group \"{group}\" is a part of itself")]
    CyclicGroup {
        /// Name of the group.
        group: String,
    },
    /// A chain begins and ends at one link.
    #[error("the chain begins and ends at link \"{link}\"")]
    EmptyChain {
        /// Name of the link.
        link: String,
    },
    /// A joint of a state is not in the state's group.
    #[error("joint \"{joint}\" is not in group \"{group}\"")]
    NotInGroup {
        /// Name of the joint.
        joint: String,
        /// Name of the group.
        group: String,
    },
    /// A state sets a joint that cannot move.
    #[error("joint \"{joint}\" is fixed")]
    FixedJoint {
        /// Name of the joint.
        joint: String,
    },
    /// A state sets a joint twice.
    #[error("joint \"{joint}\" is set twice")]
    RepeatedValue {
        /// Name of the joint.
        joint: String,
    },
    /// A state's value is outside the joint's limits.
    #[error("joint \"{joint}\" at {value} is outside {lower} to {upper}")]
    OutsideLimits {
        /// Name of the joint.
        joint: String,
        /// The value \[rad or m\].
        value: f64,
        /// Lower limit \[rad or m\], minus infinity if there is none.
        lower: f64,
        /// Upper limit \[rad or m\], infinity if there is none.
        upper: f64,
    },
    /// A state sets a mimic joint to another value than it takes from the joint it follows.
    #[error("joint \"{joint}\" at {value}, but the joint it mimics puts it at {expected}")]
    MimicValue {
        /// Name of the mimic joint.
        joint: String,
        /// The value \[rad or m\].
        value: f64,
        /// The value that follows from the rest of the state \[rad or m\].
        expected: f64,
    },
    /// A state sets a mimic joint, but not the joint that it follows.
    #[error("joint \"{joint}\" mimics \"{master}\", which the state does not set")]
    MimicAlone {
        /// Name of the mimic joint.
        joint: String,
        /// Name of the joint that it follows.
        master: String,
    },
    /// A state sets a virtual joint, which has no place in a position vector.
    #[error("joint \"{joint}\" is virtual, its value is not kept")]
    VirtualValue {
        /// Name of the joint.
        joint: String,
    },
    /// A state leaves driven joints of its group open.
    #[error("{count} driven joint(s) of the group are not set, the first is \"{first}\"")]
    IncompleteState {
        /// Name of the first of them.
        first: String,
        /// How many.
        count: usize,
    },
    /// The parent link of an end effector is a part of it.
    #[error("parent link \"{link}\" is in the end effector's own group \"{group}\"")]
    ParentInGroup {
        /// Name of the link.
        link: String,
        /// Name of the group.
        group: String,
    },
    /// The type of a virtual joint is unknown.
    #[error("type \"{given}\" is none of fixed, planar, floating")]
    VirtualType {
        /// The type as written.
        given: String,
    },
    /// A virtual joint has the name of a joint of the URDF.
    #[error("the URDF has a joint \"{joint}\"")]
    TakenJointName {
        /// The name.
        joint: String,
    },
    /// A virtual joint carries a link that is not the root.
    #[error("child link \"{link}\" is not the root, which is \"{root}\"")]
    NotTheRoot {
        /// Name of the link.
        link: String,
        /// Name of the root link.
        root: String,
    },
    /// A joint is marked passive twice.
    #[error("joint \"{joint}\" is passive already")]
    RepeatedPassive {
        /// Name of the joint.
        joint: String,
    },
    /// Both links of a pair are one.
    #[error("link \"{link}\" is paired with itself")]
    SelfPair {
        /// Name of the link.
        link: String,
    },
    /// The pair, or the link, stands already.
    #[error("the same entry stands in line {first_line}")]
    RepeatedEntry {
        /// Line of the first.
        first_line: u32,
    },
    /// A pair is disabled and enabled.
    #[error("the pair is disabled in line {line} and enabled here; it stays enabled")]
    Contradiction {
        /// Line that disables it.
        line: u32,
    },
    /// A pair is enabled that nothing disables.
    #[error("nothing disables the pair")]
    NothingToEnable,
    /// A sphere's radius is below zero.
    #[error("radius {radius} is below zero")]
    NegativeRadius {
        /// The radius \[m\].
        radius: f64,
    },
}

impl SrdfFault {
    /// What a person can do about it.
    #[must_use]
    pub const fn remedy(&self) -> &'static str {
        match self {
            Self::UnknownElement { .. } => {
                "it is passed over: mend its name or place, or remove it"
            }
            Self::RobotName { .. } => "check that the two files belong together",
            Self::MissingAttribute { .. } => "add it; the entry is passed over",
            Self::NotNumbers { .. } => {
                "write numbers separated by spaces; the entry is passed over"
            }
            Self::UnknownLink { .. } => "name a link of the URDF or remove the entry",
            Self::UnknownJoint { .. } => "name a joint of the URDF or remove the entry",
            Self::UnknownGroup { .. } => "define the group or mend its name",
            Self::UnusableGroup { .. } => "mend that group first",
            Self::RepeatedName { .. } => "rename or remove one; the first is used",
            Self::EmptyGroup { .. } => "add a link, joint, chain or group; the group is not used",
            Self::CyclicGroup { .. } => "break the circle of groups; the group is not used",
            Self::EmptyChain { .. } => "name two links; the chain is passed over",
            Self::NotInGroup { .. } => {
                "add it to the group or remove the value; the state is not used"
            }
            Self::FixedJoint { .. } => "remove the value",
            Self::RepeatedValue { .. } => "remove one of the values; the state is not used",
            Self::OutsideLimits { .. } => "give a value inside the limits; the state is not used",
            Self::MimicValue { .. } | Self::MimicAlone { .. } => {
                "set the joint that it mimics; this value is passed over"
            }
            Self::VirtualValue { .. } => "remove the value; a robot's place comes from its mount",
            Self::IncompleteState { .. } => "set every joint, or say in a comment what is meant",
            Self::ParentInGroup { .. } => {
                "take the link out of the group or name the one before it"
            }
            Self::VirtualType { .. } => "write one of the three; the joint is passed over",
            Self::TakenJointName { .. } => "rename the virtual joint; it is passed over",
            Self::NotTheRoot { .. } => "name the root link; the joint is passed over",
            Self::RepeatedPassive { .. } | Self::RepeatedEntry { .. } => "remove one of them",
            Self::SelfPair { .. } => "name two links or remove the entry",
            Self::Contradiction { .. } => "remove one of the two entries",
            Self::NothingToEnable => "remove the entry",
            Self::NegativeRadius { .. } => {
                "give a radius of zero or more; the sphere is passed over"
            }
        }
    }
}
