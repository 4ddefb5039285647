//! Forward kinematics: positions of joints to poses of links.

#![allow(non_snake_case, reason = "X_PL is the pose of frame L in frame P")]

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};

use super::{Joint, Link, PositionSource, RobotModel};
use crate::JointType;

/// Why poses of links cannot be calculated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum KinematicsError {
    /// The position vector does not fit the robot.
    #[error("{given} positions given, but the robot has {expected} driven joints")]
    PositionCount {
        /// Number of driven joints.
        expected: usize,
        /// Length of the position vector.
        given: usize,
    },
    /// The buffer for poses does not fit the robot.
    #[error("room for {given} poses given, but the robot has {expected} links")]
    PoseCount {
        /// Number of links.
        expected: usize,
        /// Length of the buffer.
        given: usize,
    },
    /// A position is infinite or not a number, or a mimic joint's position overflows.
    #[error("joint {joint} has position {value}, which is not finite")]
    NotFinite {
        /// Index of the joint among all joints.
        joint: usize,
        /// Its position.
        value: f64,
    },
    /// No link has that index.
    #[error("there is no link {link}, the robot has {links} links")]
    UnknownLink {
        /// The index given.
        link: usize,
        /// Number of links.
        links: usize,
    },
}

/// A link's pose in its parent, as a function of the position vector.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Index of the parent link; smaller than the link's own but for the root.
    parent: usize,
    /// Index of the joint between the two, for errors.
    joint: usize,
    /// Pose of the link in the parent at position zero.
    origin: Isometry3<f64>,
    motion: NodeMotion,
}

#[derive(Clone, Debug)]
enum NodeMotion {
    Fixed,
    Turn(Unit<Vector3<f64>>, PositionSource),
    Slide(Unit<Vector3<f64>>, PositionSource),
}

/// One node per link, in link order.
pub(super) fn nodes(links: &[Link], joints: &[Joint]) -> Vec<Node> {
    let node = |link: &Link| {
        let index = link.parent_joint?;
        let joint = joints.get(index)?;
        let motion =
            joint.motion.as_ref().map_or(NodeMotion::Fixed, |motion| match motion.joint_type {
                JointType::Revolute | JointType::Continuous => {
                    NodeMotion::Turn(motion.axis, motion.position)
                }
                JointType::Prismatic => NodeMotion::Slide(motion.axis, motion.position),
            });
        Some(Node { parent: joint.parent, joint: index, origin: *joint.origin.isometry(), motion })
    };
    let root =
        || Node { parent: 0, joint: 0, origin: Isometry3::identity(), motion: NodeMotion::Fixed };
    links.iter().map(|link| node(link).unwrap_or_else(root)).collect()
}

impl Node {
    /// The link's pose in its parent.
    #[inline]
    fn pose_in_parent(&self, positions: &[f64]) -> Result<Isometry3<f64>, KinematicsError> {
        match &self.motion {
            NodeMotion::Fixed => Ok(self.origin),
            NodeMotion::Turn(axis, source) => {
                let (sin, cos) = (0.5 * self.position(source, positions)?).sin_cos();
                // Of unit length, because the axis is: no need to normalise.
                let turn = UnitQuaternion::new_unchecked(Quaternion::from_parts(
                    cos,
                    axis.into_inner() * sin,
                ));
                Ok(Isometry3::from_parts(self.origin.translation, self.origin.rotation * turn))
            }
            NodeMotion::Slide(axis, source) => {
                let shift = axis.into_inner() * self.position(source, positions)?;
                Ok(self.origin * Translation3::from(shift))
            }
        }
    }

    #[inline]
    fn position(&self, source: &PositionSource, positions: &[f64]) -> Result<f64, KinematicsError> {
        let value = source.evaluate(positions);
        if value.is_finite() {
            Ok(value)
        } else {
            Err(KinematicsError::NotFinite { joint: self.joint, value })
        }
    }
}

impl RobotModel {
    /// Poses of all links in the root, in link order, for the position vector `positions`.
    ///
    /// Allocates nothing. After an error `poses` holds no useful values.
    ///
    /// # Errors
    /// [`KinematicsError::PositionCount`] and [`KinematicsError::PoseCount`] if a length does not
    /// fit, [`KinematicsError::NotFinite`] if a position is infinite or not a number.
    pub fn link_poses(
        &self,
        positions: &[f64],
        poses: &mut [Isometry3<f64>],
    ) -> Result<(), KinematicsError> {
        self.check_position_count(positions)?;
        if poses.len() != self.nodes.len() {
            let (expected, given) = (self.nodes.len(), poses.len());
            return Err(KinematicsError::PoseCount { expected, given });
        }
        for (link, node) in self.nodes.iter().enumerate() {
            let X_PL = node.pose_in_parent(positions)?;
            // Parents stand before their children; only the root has none.
            let (done, open) = poses.split_at_mut(link);
            if let Some(slot) = open.first_mut() {
                *slot = done.get(node.parent).map_or(X_PL, |X_RP| X_RP * X_PL);
            }
        }
        Ok(())
    }

    /// Pose in the root of the link at index `link`, for the position vector `positions`.
    ///
    /// Allocates nothing; takes time with the number of joints between the link and the root.
    ///
    /// # Errors
    /// [`KinematicsError::PositionCount`] if the length does not fit,
    /// [`KinematicsError::NotFinite`] if a position on the way is infinite or not a number,
    /// [`KinematicsError::UnknownLink`] if there is no such link.
    pub fn link_pose(
        &self,
        positions: &[f64],
        link: usize,
    ) -> Result<Isometry3<f64>, KinematicsError> {
        self.check_position_count(positions)?;
        let unknown = KinematicsError::UnknownLink { link, links: self.nodes.len() };
        let mut current = link;
        let mut X_CL = Isometry3::identity();
        loop {
            let node = self.nodes.get(current).ok_or(unknown)?;
            X_CL = node.pose_in_parent(positions)? * X_CL;
            if current == 0 {
                return Ok(X_CL);
            }
            current = node.parent;
        }
    }

    const fn check_position_count(&self, positions: &[f64]) -> Result<(), KinematicsError> {
        let (expected, given) = (self.variables.len(), positions.len());
        if expected == given {
            Ok(())
        } else {
            Err(KinematicsError::PositionCount { expected, given })
        }
    }
}
