//! Shapes that must not touch.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use super::builder::RobotId;
use super::capsule::Capsule;
use super::error::{ClearanceError, length};
use super::fit;
use super::hull::{self, Hull};
use crate::Shape;

/// A body of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BodyId(pub(super) usize);

impl BodyId {
    /// Index in [`CollisionScene::bodies`](super::CollisionScene::bodies).
    #[must_use]
    pub const fn index(self) -> usize {
        self.0
    }
}

/// What a body moves with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Owner {
    /// A link of a robot.
    Link {
        /// The robot.
        robot: RobotId,
        /// Index among the links of its model.
        link: usize,
    },
    /// The world.
    Fixed {
        /// Index among the fixed shapes, in the order they were added.
        fixed: usize,
    },
}

/// A convex shape that moves with a link, or is fixed in the world.
#[derive(Clone, Debug)]
pub struct Body {
    pub(super) owner: Owner,
    pub(super) name: String,
    pub(super) capsule: Capsule,
    /// The shape itself; `None` if the capsule is the shape.
    pub(super) hull: Option<Arc<Hull>>,
}

impl Body {
    /// What it moves with.
    #[must_use]
    pub const fn owner(&self) -> Owner {
        self.owner
    }

    /// Name for people: `robot/link`, with the name of what is attached to it if it is no shape of
    /// the model, or the name of the fixed shape.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Capsule that contains the shape, in the link, or in the world if the shape is fixed.
    #[must_use]
    pub const fn capsule(&self) -> &Capsule {
        &self.capsule
    }

    /// Whether the capsule is the shape itself.
    #[must_use]
    pub const fn is_capsule(&self) -> bool {
        self.hull.is_none()
    }
}

/// A shape in its link: the capsule around it and, if that is not all, the shape.
#[derive(Clone, Debug)]
pub(super) struct Fitted {
    pub(super) capsule: Capsule,
    pub(super) hull: Option<Arc<Hull>>,
}

impl Fitted {
    /// A primitive shape at `X_LS` in its link.
    pub(super) fn primitive(shape: &Shape, X_LS: &Isometry3<f64>) -> Result<Self, ClearanceError> {
        check(shape, X_LS)?;
        let hull = match *shape {
            Shape::Box { size } => Some(Hull::cuboid(size, *X_LS)),
            Shape::Cylinder { radius, length } => Some(Hull::cylinder(radius, length, *X_LS)),
            Shape::Capsule { .. } | Shape::Sphere { .. } => None,
            Shape::Mesh { ref file, .. } => {
                return Err(ClearanceError::MeshFile { file: file.clone() });
            }
        };
        let field = "coordinate";
        let capsule = fit::around_shape(shape, X_LS)
            .ok_or(ClearanceError::Length { field, value: f64::INFINITY })?;
        Ok(Self { capsule, hull: hull.map(Arc::new) })
    }

    /// The convex hull of vertices, each scaled and then moved by `X_LS` into its link.
    pub(super) fn mesh(
        vertices: &[Point3<f64>],
        scale: [f64; 3],
        X_LS: &Isometry3<f64>,
    ) -> Result<Self, ClearanceError> {
        let [x, y, z] = scale;
        let mut points = Vec::with_capacity(vertices.len());
        for vertex in vertices {
            let point = X_LS * Point3::new(x * vertex.x, y * vertex.y, z * vertex.z);
            for value in point.iter() {
                length("vertex", *value)?;
            }
            points.push(point);
        }
        let corners = hull::corners(&points);
        // Around all vertices, so that nothing depends on what is taken for a corner.
        let capsule = fit::around_points(&corners)
            .and_then(|capsule| fit::widened(&capsule, &points))
            .ok_or(ClearanceError::NoVertices)?;
        Ok(Self { capsule, hull: Some(Arc::new(Hull::points(&corners))) })
    }
}

fn check(shape: &Shape, X_LS: &Isometry3<f64>) -> Result<(), ClearanceError> {
    let lengths: &[f64] = match shape {
        Shape::Box { size } => size,
        Shape::Cylinder { radius, length } | Shape::Capsule { radius, length } => {
            &[*radius, *length]
        }
        Shape::Sphere { radius } => &[*radius],
        Shape::Mesh { .. } => &[],
    };
    for &value in lengths {
        if length("length of a shape", value)? < 0.0 {
            return Err(ClearanceError::Length { field: "length of a shape", value });
        }
    }
    for &value in X_LS.translation.vector.iter().chain(X_LS.rotation.coords.iter()) {
        length("pose of a shape", value)?;
    }
    Ok(())
}
