//! What is doubtful about a robot description that can be used.

use super::error::Place;

/// Something doubtful about a robot description, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place}: {doubt}")]
pub struct UrdfWarning {
    /// Start of the element that it is about; of several, the first.
    pub place: Place,
    /// What is doubtful.
    pub doubt: UrdfDoubt,
}

/// What is doubtful about a robot description.
///
/// `subject` names the link or joint as a person reads it, such as `joint "elbow"`.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UrdfDoubt {
    /// A driven joint has no velocity limit, or one of zero.
    #[error("{subject}: no velocity limit above 0, so nothing may move it")]
    NoVelocity {
        /// Joint.
        subject: String,
    },
    /// Driven joints have no acceleration limit, which URDF can give since version 1.2.
    #[error("{joints} driven joints have no acceleration limit, joint \"{first}\" is the first")]
    NoAcceleration {
        /// Number of joints.
        joints: usize,
        /// Name of the first.
        first: String,
    },
    /// A joint that should move has one position.
    #[error("{subject}: limit lower and upper are both {position}, so it cannot move")]
    NoRange {
        /// Joint.
        subject: String,
        /// The position \[rad or m\].
        position: f64,
    },
    /// A revolute joint turns more than twice around.
    #[error("{subject}: limits are {range} rad apart, more than two turns")]
    WideRange {
        /// Joint.
        subject: String,
        /// Upper less lower limit \[rad\].
        range: f64,
    },
    /// The axis is not of unit length; its direction is used.
    #[error("{subject}: axis xyz has length {norm}, expected 1")]
    AxisLength {
        /// Joint.
        subject: String,
        /// Its length.
        norm: f64,
    },
    /// A joint mimics one that mimics another itself.
    #[error("{subject}: mimics joint \"{master}\", which mimics another itself")]
    MimicChain {
        /// Joint.
        subject: String,
        /// Joint that it names.
        master: String,
    },
    /// A link with a shape has no mass.
    #[error("{subject}: has a shape, but no <inertial>")]
    NoInertial {
        /// Link.
        subject: String,
    },
    /// A link has inertia and no mass.
    #[error("{subject}: mass is 0, but the inertia is not")]
    NoMass {
        /// Link.
        subject: String,
    },
    /// No body has such an inertia: a principal moment is zero or below.
    #[error("{subject}: inertia has the principal moment {moment} kg m², expected above 0")]
    InertiaNotPositive {
        /// Link.
        subject: String,
        /// Smallest principal moment \[kg m²\].
        moment: f64,
    },
    /// No body has such an inertia: a principal moment is above the sum of the other two.
    #[error(
        "{subject}: inertia has the principal moment {largest} kg m², above the sum {others} of \
         the other two"
    )]
    InertiaTriangle {
        /// Link.
        subject: String,
        /// Largest principal moment \[kg m²\].
        largest: f64,
        /// Sum of the other two \[kg m²\].
        others: f64,
    },
    /// A link can be seen, but not collide.
    #[error("{subject}: has a <visual>, but no <collision>")]
    NoCollision {
        /// Link.
        subject: String,
    },
    /// Shapes are in files of their own.
    #[error("{files} mesh files have to be found, \"{first}\" is the first")]
    Meshes {
        /// Number of different files.
        files: usize,
        /// The first, as the text names it.
        first: String,
    },
    /// A chain has more driven joints than a controller may drive.
    #[error("{driven} driven joints lead to link \"{tip}\", above the limit of {limit}")]
    LongChain {
        /// Link at the end of the chain.
        tip: String,
        /// Driven joints between root and tip.
        driven: usize,
        /// Most that one controller may drive.
        limit: usize,
    },
    /// A name has characters that cannot stand in a key, or are easily mistaken.
    #[error("{subject}: the name holds {character:?}")]
    Name {
        /// Link, joint or robot.
        subject: String,
        /// First such character.
        character: char,
    },
    /// Elements that URDF does not know are passed over.
    #[error("<{element}> in <{parent}> is passed over, {count} of them")]
    UnknownElement {
        /// Element around it.
        parent: String,
        /// Name of the element.
        element: String,
        /// How many there are.
        count: usize,
    },
    /// Attributes that URDF does not know are passed over.
    #[error("attribute \"{attribute}\" of <{element}> is passed over, {count} of them")]
    UnknownAttribute {
        /// Element that has it.
        element: String,
        /// Name of the attribute.
        attribute: String,
        /// How many there are.
        count: usize,
    },
}

impl UrdfWarning {
    /// What a person does about it, as an instruction.
    #[must_use]
    pub fn remedy(&self) -> String {
        self.doubt.remedy().to_owned()
    }
}

impl UrdfDoubt {
    /// What a person does about it, as an instruction.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::NoVelocity { .. } => "give <limit> a velocity above 0, or make the joint fixed",
            Self::NoAcceleration { .. } => {
                "give them in the robot file, joints.NAME.acceleration_rad_s2 or _m_s2, or in \
                 <limit> of a file with <robot version=\"1.2\">"
            }
            Self::NoRange { .. } => "correct lower or upper, or make the joint fixed",
            Self::WideRange { .. } => {
                "check that the limits are in radians, not degrees; a joint without limits is \
                 continuous"
            }
            Self::AxisLength { .. } => "scale xyz to length 1; the direction is used as it is",
            Self::MimicChain { .. } => {
                "name the joint that has the drive; other programs may not follow a chain"
            }
            Self::NoInertial { .. } => "add <inertial> if dynamics are ever to be calculated",
            Self::NoMass { .. } => "give <mass> its value, or remove <inertial>",
            Self::InertiaNotPositive { .. } | Self::InertiaTriangle { .. } => {
                "calculate the inertia anew, about the centre of mass, from the link's shape and \
                 mass"
            }
            Self::NoCollision { .. } => {
                "add <collision> with a simple shape; what has none touches nothing"
            }
            Self::Meshes { .. } => "see that they lie where the tools that draw them look",
            Self::LongChain { .. } => "divide the robot between several controllers",
            Self::Name { .. } => "use letters, digits, _ and - of ASCII",
            Self::UnknownElement { element, .. } if is_of_others(element) => {
                "nothing, if it is meant for another program"
            }
            Self::UnknownElement { .. } | Self::UnknownAttribute { .. } => {
                "check its spelling and where it stands; nothing, if it is meant for another \
                 program"
            }
        }
    }
}

/// Whether an element is known to be other programs' business.
fn is_of_others(element: &str) -> bool {
    ["gazebo", "transmission", "ros2_control", "sensor", "mujoco", "drake"].contains(&element)
}
