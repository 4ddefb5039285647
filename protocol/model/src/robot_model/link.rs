//! Rigid bodies and their shapes.

use nalgebra::Matrix3;

use crate::Pose;

/// A rigid body of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name, unique among the robot's links.
    pub name: String,
    /// Index of the joint that leads to the link, `None` for the root.
    pub parent_joint: Option<usize>,
    /// Mass, where the file gives it.
    pub inertial: Option<Inertial>,
    /// What a picture shows.
    pub visuals: Vec<Visual>,
    /// What must not touch anything.
    pub collisions: Vec<Collision>,
}

/// Mass of a link and how it is spread.
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Mass \[kg\], not negative.
    pub mass: f64,
    /// Pose of the inertia frame in the link; its position is the centre of mass.
    pub origin: Pose,
    /// Inertia about the centre of mass, in the inertia frame \[kg m²\].
    pub inertia: Matrix3<f64>,
}

/// A shape to show.
#[derive(Clone, Debug, PartialEq)]
pub struct Visual {
    /// The shape.
    pub shape: Shape,
    /// Pose of the shape in the link.
    pub origin: Pose,
    /// Red, green, blue and opacity, each from 0 to 1 in a well-made file; `None` if not given.
    pub colour: Option<[f64; 4]>,
}

/// A shape for collision checks.
#[derive(Clone, Debug, PartialEq)]
pub struct Collision {
    /// The shape.
    pub shape: Shape,
    /// Pose of the shape in the link.
    pub origin: Pose,
}

/// A body around the origin of its own frame; lengths in \[m\], none negative.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A cuboid centred in the origin.
    Box {
        /// Full edge lengths along x, y and z.
        size: [f64; 3],
    },
    /// A cylinder along z, centred in the origin.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full length.
        length: f64,
    },
    /// A cylinder along z with half a sphere on both ends, centred in the origin.
    Capsule {
        /// Radius of cylinder and spheres.
        radius: f64,
        /// Length of the cylinder between the spheres.
        length: f64,
    },
    /// A sphere around the origin.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A mesh in a file that this crate never opens.
    Mesh {
        /// File as the description names it, such as `package://robot/meshes/arm.stl`.
        file: String,
        /// Factors along x, y and z; negative ones mirror.
        scale: [f64; 3],
    },
}
