//! What a person does about a problem or a doubt.

use super::error::{QuaternionFault, SHAPES, SUPPORTED_JOINT_TYPES, UrdfError, UrdfProblem};

impl UrdfError {
    /// What a person does about it, as an instruction: `swap lower and upper, …`.
    #[must_use]
    pub fn remedy(&self) -> String {
        self.problem.remedy()
    }
}

impl UrdfProblem {
    /// What a person does about it, as an instruction: `swap lower and upper, …`.
    #[must_use]
    pub fn remedy(&self) -> String {
        self.remedy_of_values()
            .or_else(|| self.remedy_of_names())
            .unwrap_or_else(|| self.remedy_of_text().to_owned())
    }

    /// For what is wrong with one element and its values.
    fn remedy_of_values(&self) -> Option<String> {
        Some(match self {
            Self::MissingAttribute { element, attribute: "velocity", .. } => {
                format!("give <{element}> a velocity above 0, or make the joint fixed")
            }
            Self::MissingAttribute { element, attribute, .. } => {
                format!("give <{element}> the attribute {attribute}=\"…\"")
            }
            Self::MissingElement { parent, element, .. } => {
                format!("put a <{element}> into the <{parent}>")
            }
            Self::RepeatedElement { element, .. } => format!("remove all but one <{element}>"),
            Self::NotNumbers { attribute, expected: 1, .. } => {
                format!("write {attribute} as one number with a point: 0.5")
            }
            Self::NotNumbers { attribute, expected, .. } => {
                format!("write {attribute} as {expected} numbers with points, spaces between them")
            }
            Self::NotFinite { attribute, .. } => format!(
                "write {attribute} as a finite number; a limit that does not exist is left out"
            ),
            Self::Negative { attribute, .. } => format!("write {attribute} as 0 or above"),
            Self::Quaternion { fault: QuaternionFault::Version, .. } => {
                "write <robot version=\"1.1\">, or give the orientation as rpy".to_owned()
            }
            Self::Quaternion { fault: QuaternionFault::WithRpy, .. } => {
                "remove either rpy or quat_xyzw".to_owned()
            }
            Self::Quaternion { fault: QuaternionFault::ZeroLength, .. } => {
                "write no rotation as quat_xyzw=\"0 0 0 1\"".to_owned()
            }
            Self::UnknownShape { .. } | Self::ShapeCount { .. } => {
                format!("give <geometry> exactly one of {SHAPES}")
            }
            Self::MissingLimit { joint_type, .. } => limit_remedy(joint_type),
            Self::LimitOrder { .. } => "swap lower and upper, or correct one of them".to_owned(),
            Self::ZeroAxis { .. } => {
                "give <axis> a direction, such as xyz=\"0 0 1\", or make the joint fixed".to_owned()
            }
            _ => return None,
        })
    }

    /// For what is wrong with names, types and how links and joints are connected.
    fn remedy_of_names(&self) -> Option<String> {
        Some(match self {
            Self::EmptyName { element } => format!("give the <{element}> a name"),
            Self::RepeatedName { .. } => {
                "give it another name, and correct what means it".to_owned()
            }
            Self::UnknownJointType { .. } => format!("write one of {SUPPORTED_JOINT_TYPES}"),
            Self::UnsupportedJointType { joint_type, .. } => unsupported_remedy(joint_type),
            Self::UnknownLink { end, link, .. } => {
                format!("correct the name in <{end}>, or add <link name=\"{link}\"/>")
            }
            Self::SeveralRoots { second, .. } => format!(
                "add a joint with <child link=\"{second}\"/>, a fixed one if it does not move, or \
                 remove the link"
            ),
            Self::SeveralParents { link, .. } => format!(
                "remove one of the two joints, or give one another child than \"{link}\"; for a \
                 loop of links leave one joint out and let the others mimic"
            ),
            Self::Cycle { joint, .. } => {
                format!("give joint \"{joint}\", or another of the loop, another parent or child")
            }
            Self::UnknownMaster { master, .. } => {
                format!("correct the name in <mimic>, or add a joint \"{master}\"")
            }
            Self::FixedMaster { .. } => {
                "mimic a joint that moves, or make this one fixed as well".to_owned()
            }
            Self::MimicLoop { .. } => {
                "remove <mimic> from the joint of the loop that has the drive".to_owned()
            }
            Self::MimicOverflow { .. } => {
                "correct the multipliers on the way to that joint".to_owned()
            }
            _ => return None,
        })
    }

    /// For what is wrong with the text as a whole.
    const fn remedy_of_text(&self) -> &'static str {
        match self {
            Self::TooLarge { .. } => {
                "keep meshes in files of their own, and name them in the description"
            }
            Self::Xml(roxmltree::Error::DtdDetected) => {
                "remove <!DOCTYPE …>; entities are not expanded"
            }
            Self::Xml(_) => "correct the text at that place; xmllint shows more",
            Self::TooManyAttributes { .. } => "remove attributes that are not URDF's",
            Self::NotARobot { .. } => "give a URDF file, whose root element is <robot>",
            Self::Version { .. } => "write version=\"1.0\", or leave the attribute out",
            Self::Xacro { .. } => "run `xacro IN.xacro > OUT.urdf`, and give OUT.urdf",
            Self::NoLinks => "add at least one <link name=\"…\"/>",
            _ => "correct the element; the message is of the URDF reader",
        }
    }
}

fn limit_remedy(joint_type: &str) -> String {
    let free = if joint_type == "revolute" { ", or make it continuous" } else { "" };
    format!("add <limit lower=\"…\" upper=\"…\" velocity=\"…\" effort=\"…\"/>{free}")
}

fn unsupported_remedy(joint_type: &str) -> String {
    match joint_type {
        "floating" => "remove the joint: where a robot stands in the cell is in the cell's file, \
                       and a robot file has one root"
            .to_owned(),
        _ => format!(
            "replace the {joint_type} joint by a chain of revolute and prismatic joints with \
             links of no mass between them"
        ),
    }
}
