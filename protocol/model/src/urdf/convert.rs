//! Third pass: the typed robot as links and joints of the model.

use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};

use super::error::UrdfProblem;
use super::scan::{JointSite, Scan};
use super::tree::Follow;
use crate::robot_model::{
    Collision, Inertial, Joint, Link, Motion, PositionSource, RobotModel, Shape, SoftLimits, Visual,
};
use crate::{JointLimits, JointType, Pose};

/// What the second pass found out.
pub(super) struct Structure {
    /// Joint that leads to each link, `None` for the root.
    pub(super) parents: Vec<Option<usize>>,
    /// Links from the root outwards.
    pub(super) order: Vec<usize>,
    /// What each mimic joint follows.
    pub(super) follows: Vec<Option<Follow>>,
}

/// The model of a document in which no problem was found.
pub(super) fn convert(
    scan: &Scan<'_>,
    structure: &Structure,
    robot: urdf_rs::Robot,
) -> Result<RobotModel, UrdfProblem> {
    let (links, joints) = (robot.links.len(), robot.joints.len());
    if (links, joints) != (scan.links.len(), scan.joints.len()) {
        let reason = format!("the URDF reader found {links} links and {joints} joints");
        return Err(UrdfProblem::Reader { reason });
    }
    let joints = convert_joints(scan, structure, &robot.joints);
    let mut links: Vec<Option<urdf_rs::Link>> = robot.links.into_iter().map(Some).collect();
    let links = structure
        .order
        .iter()
        .filter_map(|&index| {
            let (link, found) = (links.get_mut(index)?.take()?, scan.links.get(index)?);
            let has_mass = found.element.children_named("inertial").next().is_some();
            Some(convert_link(found.name, *structure.parents.get(index)?, has_mass, link))
        })
        .collect();
    Ok(RobotModel::new(scan.name.to_owned(), links, joints))
}

fn convert_joints(scan: &Scan<'_>, structure: &Structure, joints: &[urdf_rs::Joint]) -> Vec<Joint> {
    let link_positions = positions_in(&structure.order);
    let variables = variables(scan);
    let link = |index: Option<usize>| {
        index.and_then(|index| link_positions.get(index)).copied().unwrap_or_default()
    };
    let convert = |(index, (site, joint)): (usize, (&JointSite<'_>, &urdf_rs::Joint))| {
        let follow = structure.follows.get(index).copied().flatten();
        Joint {
            name: site.name.to_owned(),
            parent: link(site.parent),
            child: link(site.child),
            origin: convert_pose(&joint.origin),
            motion: convert_motion(joint, position_source(index, follow, &variables)),
        }
    };
    scan.joints.iter().zip(joints).enumerate().map(convert).collect()
}

/// For each element of `order`'s range, where it stands in `order`.
fn positions_in(order: &[usize]) -> Vec<usize> {
    let mut positions = vec![0; order.len()];
    for (position, &index) in order.iter().enumerate() {
        if let Some(slot) = positions.get_mut(index) {
            *slot = position;
        }
    }
    positions
}

/// Variable that each driven joint has, zero for the others.
fn variables(scan: &Scan<'_>) -> Vec<usize> {
    let mut next = 0;
    scan.joints
        .iter()
        .map(|joint| {
            let variable = next;
            next += usize::from(joint.is_driven());
            variable
        })
        .collect()
}

fn position_source(index: usize, follow: Option<Follow>, variables: &[usize]) -> PositionSource {
    let variable = |joint: usize| variables.get(joint).copied().unwrap_or_default();
    match follow {
        None => PositionSource::Variable(variable(index)),
        Some(Follow { master, multiplier, offset }) => {
            PositionSource::Mimic { variable: variable(master), multiplier, offset }
        }
    }
}

fn convert_motion(joint: &urdf_rs::Joint, position: PositionSource) -> Option<Motion> {
    let joint_type = match joint.joint_type {
        urdf_rs::JointType::Revolute => JointType::Revolute,
        urdf_rs::JointType::Continuous => JointType::Continuous,
        urdf_rs::JointType::Prismatic => JointType::Prismatic,
        urdf_rs::JointType::Fixed
        | urdf_rs::JointType::Floating
        | urdf_rs::JointType::Planar
        | urdf_rs::JointType::Spherical => return None,
    };
    let soft_limits = joint.safety_controller.as_ref().map(|controller| SoftLimits {
        lower: finite(controller.soft_lower_limit),
        upper: finite(controller.soft_upper_limit),
        k_position: controller.k_position,
        k_velocity: controller.k_velocity,
    });
    Some(Motion {
        joint_type,
        axis: Unit::new_normalize(Vector3::from(*joint.axis.xyz)),
        limits: convert_limits(joint_type, &joint.limit),
        soft_limits,
        position,
    })
}

fn convert_limits(joint_type: JointType, limit: &urdf_rs::JointLimit) -> JointLimits {
    // Without a <limit> element, which only a continuous joint may lack, the reader gives zeros.
    let turns_freely = joint_type == JointType::Continuous;
    let missing = turns_freely && *limit == urdf_rs::JointLimit::default();
    JointLimits {
        lower: finite(limit.lower).filter(|_| !turns_freely),
        upper: finite(limit.upper).filter(|_| !turns_freely),
        velocity: limit.velocity,
        acceleration: finite(limit.acceleration.min(limit.deceleration)).filter(|_| !missing),
        jerk: finite(limit.jerk).filter(|_| !missing),
        effort: finite(limit.effort).filter(|_| !missing),
    }
}

fn convert_link(
    name: &str,
    parent_joint: Option<usize>,
    has_mass: bool,
    link: urdf_rs::Link,
) -> Link {
    let visual = |visual: urdf_rs::Visual| Visual {
        shape: convert_shape(visual.geometry),
        origin: convert_pose(&visual.origin),
        colour: visual.material.and_then(|material| material.color).map(|colour| *colour.rgba),
    };
    let collision = |collision: urdf_rs::Collision| Collision {
        shape: convert_shape(collision.geometry),
        origin: convert_pose(&collision.origin),
    };
    Link {
        name: name.to_owned(),
        parent_joint,
        inertial: has_mass.then(|| convert_inertial(&link.inertial)),
        visuals: link.visual.into_iter().map(visual).collect(),
        collisions: link.collision.into_iter().map(collision).collect(),
    }
}

fn convert_inertial(inertial: &urdf_rs::Inertial) -> Inertial {
    let i = &inertial.inertia;
    Inertial {
        mass: inertial.mass.value,
        origin: convert_pose(&inertial.origin),
        inertia: Matrix3::new(
            i.ixx, i.ixy, i.ixz, //
            i.ixy, i.iyy, i.iyz, //
            i.ixz, i.iyz, i.izz,
        ),
    }
}

fn convert_shape(geometry: urdf_rs::Geometry) -> Shape {
    match geometry {
        urdf_rs::Geometry::Box { size } => Shape::Box { size: *size },
        urdf_rs::Geometry::Cylinder { radius, length } => Shape::Cylinder { radius, length },
        urdf_rs::Geometry::Capsule { radius, length } => Shape::Capsule { radius, length },
        urdf_rs::Geometry::Sphere { radius } => Shape::Sphere { radius },
        urdf_rs::Geometry::Mesh { filename, scale } => {
            Shape::Mesh { file: filename, scale: scale.map_or([1.0; 3], |scale| *scale) }
        }
    }
}

fn convert_pose(pose: &urdf_rs::Pose) -> Pose {
    let ([x, y, z], [roll, pitch, yaw]) = (*pose.xyz, *pose.rpy);
    Pose::from_isometry(Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    ))
}

fn finite(limit: f64) -> Option<f64> {
    limit.is_finite().then_some(limit)
}
