//! Forward kinematics: positions of joints to poses of links.

#![allow(non_snake_case, reason = "X_PL is the pose of frame L in frame P")]

use nalgebra::{Isometry3, Quaternion, Unit, UnitQuaternion, Vector3};

use super::{Joint, Link, Motion, PositionSource, RobotModel};
use crate::kinematics::sin_cos;
use crate::{JointType, Twist};

/// Why poses of links cannot be calculated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum KinematicsError {
    /// The position vector does not fit the robot or chain.
    #[error("{given} positions given for {expected} driven joints")]
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
    /// A joint that neither moves nor shifts nor turns.
    Same,
    /// A fixed joint without rotation.
    Shifted,
    Fixed,
    Turn {
        axis: Unit<Vector3<f64>>,
        /// Rotation of the origin times a half turn about the axis: the rotation by an angle is
        /// `cos(angle / 2)` times the origin's plus `sin(angle / 2)` times this.
        half_turn: Quaternion<f64>,
        source: PositionSource,
    },
    Slide {
        axis: Unit<Vector3<f64>>,
        /// The axis in the parent.
        direction: Vector3<f64>,
        source: PositionSource,
    },
}

/// One node per link, in link order.
pub(super) fn nodes(links: &[Link], joints: &[Joint]) -> Vec<Node> {
    let node = |link: &Link| {
        let index = link.parent_joint?;
        let joint = joints.get(index)?;
        let origin = *joint.origin.isometry();
        let motion = node_motion(&origin, joint.motion.as_ref());
        Some(Node { parent: joint.parent, joint: index, origin, motion })
    };
    let root =
        || Node { parent: 0, joint: 0, origin: Isometry3::identity(), motion: NodeMotion::Same };
    links.iter().map(|link| node(link).unwrap_or_else(root)).collect()
}

fn node_motion(origin: &Isometry3<f64>, motion: Option<&Motion>) -> NodeMotion {
    let Some(motion) = motion else {
        let turned = origin.rotation != UnitQuaternion::identity();
        let shifted = origin.translation.vector != Vector3::zeros();
        return match (turned, shifted) {
            (true, _) => NodeMotion::Fixed,
            (false, true) => NodeMotion::Shifted,
            (false, false) => NodeMotion::Same,
        };
    };
    let (axis, source) = (motion.axis, motion.position);
    match motion.joint_type {
        JointType::Revolute | JointType::Continuous => {
            let half_turn = origin.rotation.into_inner() * Quaternion::from_imag(axis.into_inner());
            NodeMotion::Turn { axis, half_turn, source }
        }
        JointType::Prismatic => {
            NodeMotion::Slide { axis, direction: origin.rotation * axis.into_inner(), source }
        }
    }
}

impl Node {
    /// The link's pose in the frame in which its parent stands at `X_RP`.
    #[inline]
    fn pose_after(
        &self,
        X_RP: &Isometry3<f64>,
        positions: &[f64],
    ) -> Result<Isometry3<f64>, KinematicsError> {
        Ok(match self.motion {
            NodeMotion::Same => *X_RP,
            NodeMotion::Shifted => self.shifted(X_RP, X_RP.rotation),
            NodeMotion::Fixed => self.shifted(X_RP, X_RP.rotation * self.origin.rotation),
            NodeMotion::Turn { half_turn, source, .. } => {
                let rotation = self.turned(&half_turn, self.position(&source, positions)?);
                self.shifted(X_RP, X_RP.rotation * rotation)
            }
            NodeMotion::Slide { direction, source, .. } => {
                let shift = direction * self.position(&source, positions)?;
                let rotation = X_RP.rotation * self.origin.rotation;
                let p = X_RP.rotation * (self.origin.translation.vector + shift);
                Isometry3::from_parts((X_RP.translation.vector + p).into(), rotation)
            }
        })
    }

    /// The pose with `rotation` whose origin stands where the parent at `X_RP` carries this one's.
    #[inline]
    fn shifted(&self, X_RP: &Isometry3<f64>, rotation: UnitQuaternion<f64>) -> Isometry3<f64> {
        let p = X_RP.rotation * self.origin.translation.vector;
        Isometry3::from_parts((X_RP.translation.vector + p).into(), rotation)
    }

    /// Rotation in the parent of a joint that turns, at `angle`.
    #[inline]
    fn turned(&self, half_turn: &Quaternion<f64>, angle: f64) -> UnitQuaternion<f64> {
        let (sin, cos) = sin_cos(0.5 * angle);
        // Of unit length, because both are and they are orthogonal: no need to normalise.
        UnitQuaternion::new_unchecked(self.origin.rotation.into_inner() * cos + half_turn * sin)
    }

    /// Twist of the point of the link that stands at `point`, relative to the parent and in the
    /// link's axes.
    #[inline]
    fn twist_at(&self, point: &Vector3<f64>, velocities: &[f64]) -> Twist {
        let rate = |source: &PositionSource| match *source {
            PositionSource::Variable(index) => velocities.get(index).copied().unwrap_or_default(),
            PositionSource::Mimic { variable, multiplier, .. } => {
                multiplier * velocities.get(variable).copied().unwrap_or_default()
            }
        };
        match &self.motion {
            NodeMotion::Same | NodeMotion::Shifted | NodeMotion::Fixed => Twist::ZERO,
            NodeMotion::Turn { axis, source, .. } => {
                let angular = axis.into_inner() * rate(source);
                Twist::new(angular.cross(point), angular)
            }
            NodeMotion::Slide { axis, source, .. } => {
                Twist::new(axis.into_inner() * rate(source), Vector3::zeros())
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
            // Parents stand before their children; only the root has none.
            let X_RP = if link == 0 { Isometry3::identity() } else { poses[node.parent] };
            poses[link] = node.pose_after(&X_RP, positions)?;
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
            X_CL = node.pose_after(&Isometry3::identity(), positions)? * X_CL;
            if current == 0 {
                return Ok(X_CL);
            }
            current = node.parent;
        }
    }

    /// Pose in the root of the link at index `link`, and its twist relative to the root: of its
    /// origin, in the axes of the root.
    ///
    /// `velocities` holds one velocity \[rad/s or m/s\] per variable. Allocates nothing; takes time
    /// with the number of joints between the link and the root.
    ///
    /// # Errors
    /// Those of [`RobotModel::link_pose`], for the length of `velocities` as well.
    pub fn link_twist(
        &self,
        positions: &[f64],
        velocities: &[f64],
        link: usize,
    ) -> Result<(Isometry3<f64>, Twist), KinematicsError> {
        self.check_position_count(positions)?;
        self.check_position_count(velocities)?;
        let unknown = KinematicsError::UnknownLink { link, links: self.nodes.len() };
        let mut current = link;
        let mut X_CL = Isometry3::identity();
        // Relative to C and in its axes, C going up from the link to the root.
        let mut V_CL = Twist::ZERO;
        loop {
            let node = self.nodes.get(current).ok_or(unknown)?;
            let X_PC = node.pose_after(&Isometry3::identity(), positions)?;
            let own = node.twist_at(&X_CL.translation.vector, velocities);
            let sum = Twist::new(V_CL.linear + own.linear, V_CL.angular + own.angular);
            V_CL = sum.in_frame(&X_PC.rotation);
            X_CL = X_PC * X_CL;
            if current == 0 {
                return Ok((X_CL, V_CL));
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
