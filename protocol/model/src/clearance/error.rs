//! Why clearances cannot be calculated.

use crate::KinematicsError;

/// Why a scene cannot be built or a distance not be calculated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ClearanceError {
    /// A length or coordinate of a shape or pose is not usable.
    #[error("{field} is {value}, expected a finite number within {MAX_LENGTH_M} m")]
    Length {
        /// What it belongs to, such as `radius`.
        field: &'static str,
        /// The value \[m\].
        value: f64,
    },
    /// A fixed shape or attachment is a mesh, which cannot be placed without its vertices.
    #[error("a mesh is given by its vertices here, not by its file \"{file}\"")]
    MeshFile {
        /// The file.
        file: String,
    },
    /// A mesh has no vertices.
    #[error("a mesh needs at least one vertex")]
    NoVertices,
    /// The robot is not one of the scene's.
    #[error("there is no robot {robot}, the scene has {robots}")]
    UnknownRobot {
        /// Index of the robot.
        robot: usize,
        /// Number of robots.
        robots: usize,
    },
    /// The robot has no such link.
    #[error("robot \"{robot}\" has no link {link}, it has {links} links")]
    UnknownLink {
        /// The robot.
        robot: String,
        /// Index of the link.
        link: usize,
        /// Number of links.
        links: usize,
    },
    /// The fixed shape is not one of the scene's.
    #[error("there is no fixed shape {fixed}, the scene has {count}")]
    UnknownFixed {
        /// Index of the shape.
        fixed: usize,
        /// Number of fixed shapes.
        count: usize,
    },
    /// Two robots or fixed shapes have one name.
    #[error("name \"{name}\" is taken")]
    RepeatedName {
        /// The name.
        name: String,
    },
    /// The position vector does not fit the scene.
    #[error("{given} positions given, but the robots of the scene have {expected} driven joints")]
    PositionCount {
        /// Number of driven joints of all robots.
        expected: usize,
        /// Length of the vector.
        given: usize,
    },
    /// The workspace was made by another scene.
    #[error("the workspace was made by another scene")]
    Workspace,
    /// Poses of links cannot be calculated.
    #[error("robot {robot}: {source}")]
    Kinematics {
        /// Index of the robot.
        robot: usize,
        /// Why.
        source: KinematicsError,
    },
    /// A body is so far away that distances lose their meaning.
    #[error("body {body} is more than {MAX_LENGTH_M} m from the origin")]
    TooFar {
        /// Index of the body.
        body: usize,
    },
    /// An option of a motion check is not usable.
    #[error("{field} is {value}, expected {expected}")]
    Option {
        /// Name of the option.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What is expected.
        expected: &'static str,
    },
    /// The speeds do not fit the scene.
    #[error("{given} speeds given, but the robots of the scene have {expected} driven joints")]
    SpeedCount {
        /// Number of driven joints of all robots.
        expected: usize,
        /// Length of the vector.
        given: usize,
    },
    /// The motion is faster than the speeds that the check was given, so that its bound is void.
    #[error(
        "variable {variable} moves by {distance} from {from_s} s to {to_s} s, above its speed \
         {speed}"
    )]
    SpeedExceeded {
        /// Index in the position vector of the scene.
        variable: usize,
        /// Start of the step \[s\].
        from_s: f64,
        /// End of the step \[s\].
        to_s: f64,
        /// Distance in the step \[rad or m\].
        distance: f64,
        /// Speed given \[rad/s or m/s\].
        speed: f64,
    },
    /// A slide without position limits carries a turning body: its speed has no bound.
    #[error("variable {variable} moves a body with no bound on its distance from a turning axis")]
    UnboundedReach {
        /// Index in the position vector of the scene.
        variable: usize,
    },
    /// A slide is outside the limits that the bound on speeds was made with.
    #[error("robot {robot}: joint {joint} is at {position}, outside its limits")]
    OutsideTravel {
        /// Index of the robot.
        robot: usize,
        /// Index of the joint among the robot's.
        joint: usize,
        /// Position \[m\].
        position: f64,
    },
}

/// Largest length and distance from the origin that is accepted \[m\].
pub(super) const MAX_LENGTH_M: f64 = 1e6;

/// The value, if it is finite and not too large.
pub(super) fn length(field: &'static str, value: f64) -> Result<f64, ClearanceError> {
    if value.abs() <= MAX_LENGTH_M {
        Ok(value)
    } else {
        Err(ClearanceError::Length { field, value })
    }
}
