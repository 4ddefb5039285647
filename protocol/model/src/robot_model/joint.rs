//! Connections of links.

use nalgebra::{Unit, Vector3};

use crate::{JointLimits, JointType, Pose};

/// Connection of two links.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, unique among the robot's joints.
    pub name: String,
    /// Index of the link that carries.
    pub parent: usize,
    /// Index of the link that is carried.
    pub child: usize,
    /// Pose of the child link in the parent link at position zero.
    pub origin: Pose,
    /// How the child moves, `None` for a fixed joint.
    pub motion: Option<Motion>,
}

impl Joint {
    /// Index in a position vector, `None` if the joint is fixed or mimics another.
    #[must_use]
    pub fn variable(&self) -> Option<usize> {
        match self.motion.as_ref()?.position {
            PositionSource::Variable(variable) => Some(variable),
            PositionSource::Mimic { .. } => None,
        }
    }
}

/// How a joint moves its child link.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Whether the joint turns or slides, and whether it has position limits.
    pub joint_type: JointType,
    /// Direction in the child link about which it turns or along which it slides.
    pub axis: Unit<Vector3<f64>>,
    /// Hard limits; a velocity of zero means that the file gives none.
    pub limits: JointLimits,
    /// Soft limits, if the file has a `<safety_controller>`.
    pub soft_limits: Option<SoftLimits>,
    /// Where the joint's position comes from.
    pub position: PositionSource,
}

/// Where a joint's position comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PositionSource {
    /// It is a variable: the element of a position vector at this index.
    Variable(usize),
    /// It follows a variable: `multiplier * position[variable] + offset`.
    Mimic {
        /// Index in a position vector. A chain of mimic joints is followed to its end.
        variable: usize,
        /// Factor.
        multiplier: f64,
        /// Offset \[rad or m\].
        offset: f64,
    },
}

impl PositionSource {
    /// The joint's position \[rad or m\] if the robot's is `positions`; zero if that is too short.
    #[must_use]
    pub fn evaluate(&self, positions: &[f64]) -> f64 {
        let of = |variable: usize| positions.get(variable).copied().unwrap_or_default();
        match *self {
            Self::Variable(variable) => of(variable),
            Self::Mimic { variable, multiplier, offset } => multiplier * of(variable) + offset,
        }
    }
}

/// Limits that a safety controller keeps inside the hard ones.
///
/// Near a soft limit the velocity is held within `-k_position * (position - limit)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftLimits {
    /// Lowest position \[rad or m\], `None` if there is none.
    pub lower: Option<f64>,
    /// Highest position \[rad or m\], `None` if there is none.
    pub upper: Option<f64>,
    /// Velocity per distance from a position limit \[1/s\].
    pub k_position: f64,
    /// Effort per velocity beyond its limit \[Nms/rad or Ns/m\].
    pub k_velocity: f64,
}

/// A driven joint: one that moves and mimics no other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variable<'m> {
    /// The joint's name.
    pub name: &'m str,
    /// The joint's index among all joints.
    pub joint: usize,
    /// How it moves: type, axis, limits, soft limits.
    pub motion: &'m Motion,
}
