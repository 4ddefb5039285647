//! The joints between two links.

#![allow(non_snake_case, reason = "X_PC is the pose of frame C in frame P")]

use arrayvec::ArrayVec;
use nalgebra::{Isometry3, Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::reduce::{Element, Moving, Reduced, reduce};
use crate::{
    JointLimits, JointType, JointVector, KinematicsError, MAX_JOINTS, Motion, Pose, PositionSource,
    RobotModel,
};

/// The joints between two links of a robot, with a tool at the end.
///
/// The *variables* of a chain are the robot's variables that move the tip link relative to the base
/// link, in the order in which they are met on the way from base to tip; a mimic joint on the way
/// makes the joint that it follows one of them, even if that stands elsewhere. A position vector of
/// the chain holds one value for each, \[rad\] if the joint turns, \[m\] if it slides.
///
/// The tool centre point, TCP, is the tip link's frame until [`Chain::with_tool`] moves it. The base
/// need not be an ancestor of the tip: the way then leads up to the link that carries both, as from
/// one hand of a robot to the other.
///
/// Building a chain allocates, evaluating it does not.
///
/// ```
/// use armada_model::{Chain, Pose, RobotModel};
///
/// let urdf = r#"<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/>
///   <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>
///     <axis xyz="0 0 1"/></joint>
///   <joint name="elbow" type="continuous"><origin xyz="0.4 0 0"/>
///     <parent link="upper"/><child link="fore"/><axis xyz="0 0 1"/></joint></robot>"#;
/// let model = RobotModel::from_urdf(urdf, "arm.urdf")?;
/// let tool = Pose::from_translation(0.3, 0.0, 0.0);
/// let chain = Chain::new(&model, "base", "fore")?.with_tool(&tool);
///
/// let (X_BT, jacobian) = chain.forward_and_jacobian(&[0.0, std::f64::consts::FRAC_PI_2])?;
/// assert!((X_BT.translation.y - 0.3).abs() < 1e-12);
/// let twist = jacobian.twist(&[1.0, 0.0]);
/// assert!((twist.linear.y - 0.4).abs() < 1e-12);
/// assert_eq!(twist.angular.z, 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Chain {
    base: String,
    tip: String,
    variables: ArrayVec<ChainVariable, MAX_JOINTS>,
    pub(super) reduced: Reduced,
    /// Pose of the TCP in the last joint's frame, after its motion.
    pub(super) last: (Matrix3<f64>, Vector3<f64>),
    tool: Pose,
}

/// One variable of a [`Chain`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainVariable {
    /// Name of the driven joint.
    pub name: String,
    /// Index in a position vector of the whole robot.
    pub index: usize,
    /// How the joint moves.
    pub joint_type: JointType,
    /// Its hard limits; a velocity of zero means that the file gives none.
    pub limits: JointLimits,
    /// Whether a whole turn of the variable leaves the tip where it was: a joint that turns, whose
    /// followers on the way, if any, turn whole turns as well.
    pub periodic: bool,
}

/// Why two links make no [`Chain`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChainError {
    /// No link has that name.
    #[error("there is no link {link:?}")]
    UnknownLink {
        /// The name given.
        link: String,
    },
    /// No driven joint moves the tip relative to the base.
    #[error("no driven joint moves {tip:?} relative to {base:?}")]
    Rigid {
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
    },
    /// More driven joints than a position vector holds.
    #[error("more than {MAX_JOINTS} driven joints move {tip:?} relative to {base:?}")]
    TooManyVariables {
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
    },
}

impl Chain {
    /// The joints of `model` from the link `base` to the link `tip`.
    ///
    /// # Errors
    /// [`ChainError::UnknownLink`] if a link is not there, [`ChainError::Rigid`] if no driven joint
    /// lies between, [`ChainError::TooManyVariables`] if more than [`MAX_JOINTS`] do.
    pub fn new(model: &RobotModel, base: &str, tip: &str) -> Result<Self, ChainError> {
        let find = |link: &str| {
            let unknown = || ChainError::UnknownLink { link: link.to_owned() };
            model.link_index(link).ok_or_else(unknown)
        };
        let (base_link, tip_link) = (find(base)?, find(tip)?);
        let names = || (base.to_owned(), tip.to_owned());
        let mut way = Way::default();
        if !way.walk(model, base_link, tip_link) {
            let (base, tip) = names();
            return Err(ChainError::TooManyVariables { base, tip });
        }
        if way.variables.is_empty() {
            let (base, tip) = names();
            return Err(ChainError::Rigid { base, tip });
        }
        let reduced = reduce(&way.elements);
        let variables = way.variables.iter().filter_map(|&index| way.variable(model, index));
        Ok(Self {
            base: base.to_owned(),
            tip: tip.to_owned(),
            variables: variables.collect(),
            last: reduced.last,
            reduced,
            tool: Pose::default(),
        })
    }

    /// The joints of `model` from its root to the link `tip`.
    ///
    /// # Errors
    /// Those of [`Chain::new`].
    pub fn from_root(model: &RobotModel, tip: &str) -> Result<Self, ChainError> {
        let root = model.links().first().map(|link| link.name.as_str()).unwrap_or_default();
        Self::new(model, root, tip)
    }

    /// The same chain with the TCP at `tool`, its pose in the tip link; it replaces an earlier tool.
    #[must_use]
    pub fn with_tool(mut self, tool: &Pose) -> Self {
        let (R, p) = self.reduced.last;
        let X_LT = tool.isometry();
        let R_LT = X_LT.rotation.to_rotation_matrix();
        self.last = (R * R_LT.matrix(), p + R * X_LT.translation.vector);
        self.tool = *tool;
        self
    }

    /// The same chain with these limits of its variables, in their order, as where a robot file
    /// narrows those of the description; variables beyond the end of `limits` keep theirs.
    #[must_use]
    pub fn with_limits(mut self, limits: &[JointLimits]) -> Self {
        for (variable, limits) in self.variables.iter_mut().zip(limits) {
            variable.limits = *limits;
        }
        self
    }

    /// Name of the base link.
    #[must_use]
    pub fn base(&self) -> &str {
        &self.base
    }

    /// Name of the tip link.
    #[must_use]
    pub fn tip(&self) -> &str {
        &self.tip
    }

    /// Pose of the TCP in the tip link.
    #[must_use]
    pub const fn tool(&self) -> &Pose {
        &self.tool
    }

    /// Number of variables, from 1 to [`MAX_JOINTS`].
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a chain has at least one variable")]
    pub fn len(&self) -> usize {
        self.variables.len()
    }

    /// The variables in the order of the chain's position vector.
    #[must_use]
    pub fn variables(&self) -> &[ChainVariable] {
        &self.variables
    }

    /// The chain's part of `positions`, a position vector of the whole robot; of velocities as well.
    ///
    /// # Errors
    /// [`KinematicsError::PositionCount`] if `positions` is too short for the robot.
    pub fn gather(&self, positions: &[f64]) -> Result<JointVector, KinematicsError> {
        let mut own = JointVector::zeros(self.len()).unwrap_or_default();
        for (slot, variable) in own.iter_mut().zip(&self.variables) {
            *slot = *positions.get(variable.index).ok_or_else(|| self.too_short(positions))?;
        }
        Ok(own)
    }

    /// Puts `own`, one value per variable of the chain, into a vector of the whole robot; the other
    /// elements stay.
    ///
    /// # Errors
    /// [`KinematicsError::PositionCount`] if `own` does not fit the chain or `positions` is too
    /// short for the robot.
    pub fn scatter(&self, own: &[f64], positions: &mut [f64]) -> Result<(), KinematicsError> {
        self.check_count(own)?;
        if self.variables.iter().any(|variable| variable.index >= positions.len()) {
            return Err(self.too_short(positions));
        }
        for (&value, variable) in own.iter().zip(&self.variables) {
            if let Some(slot) = positions.get_mut(variable.index) {
                *slot = value;
            }
        }
        Ok(())
    }

    pub(super) fn check_count(&self, positions: &[f64]) -> Result<(), KinematicsError> {
        let (expected, given) = (self.len(), positions.len());
        if expected == given {
            return Ok(());
        }
        Err(KinematicsError::PositionCount { expected, given })
    }

    fn too_short(&self, positions: &[f64]) -> KinematicsError {
        let highest = self.variables.iter().map(|variable| variable.index).max();
        let expected = highest.map_or(0, |highest| highest + 1);
        KinematicsError::PositionCount { expected, given: positions.len() }
    }
}

/// What lies between two links.
#[derive(Default)]
struct Way {
    elements: Vec<Element>,
    /// Indices in a position vector of the robot.
    variables: ArrayVec<usize, MAX_JOINTS>,
}

impl Way {
    /// Goes from `base` up to the link that carries both, and down to `tip`; false if there are too
    /// many variables.
    fn walk(&mut self, model: &RobotModel, base: usize, tip: usize) -> bool {
        let (mut up, mut down) = (base, tip);
        let mut descent = Vec::new();
        // Parents stand before their children: the later of two different links is no ancestor.
        while up != down {
            let later = up.max(down);
            let Some(index) = model.links().get(later).and_then(|link| link.parent_joint) else {
                break;
            };
            let Some(joint) = model.joints().get(index) else { break };
            if later == down {
                descent.push(index);
                down = joint.parent;
                continue;
            }
            up = joint.parent;
            let X_CP = joint.origin.isometry().inverse();
            if !self.push_motion(joint.motion.as_ref(), index, -1.0) {
                return false;
            }
            self.elements.push(Element::Fixed(X_CP));
        }
        descent.iter().rev().all(|&index| {
            let Some(joint) = model.joints().get(index) else { return false };
            self.elements.push(Element::Fixed(*joint.origin.isometry()));
            self.push_motion(joint.motion.as_ref(), index, 1.0)
        })
    }

    /// Adds a joint's motion, taken backwards if `direction` is -1; false if there is no room.
    fn push_motion(&mut self, motion: Option<&Motion>, joint: usize, direction: f64) -> bool {
        let Some(motion) = motion else { return true };
        let (index, multiplier, offset) = match motion.position {
            PositionSource::Variable(index) => (index, 1.0, 0.0),
            PositionSource::Mimic { variable, multiplier, offset } => {
                (variable, multiplier, offset)
            }
        };
        let known = self.variables.iter().position(|&other| other == index);
        let variable = known.unwrap_or(self.variables.len());
        if known.is_none() && self.variables.try_push(index).is_err() {
            return false;
        }
        self.elements.push(Element::Moving(Moving {
            joint,
            variable,
            multiplier: direction * multiplier,
            offset: direction * offset,
            turns: motion.joint_type != JointType::Prismatic,
            axis: motion.axis,
        }));
        true
    }

    fn variable(&self, model: &RobotModel, index: usize) -> Option<ChainVariable> {
        let driven = model.variables().nth(index)?;
        let own = self.variables.iter().position(|&other| other == index)?;
        let whole_turns = |element: &Element| match element {
            Element::Fixed(_) => true,
            Element::Moving(moving) => {
                moving.variable != own || (moving.turns && moving.multiplier.fract() == 0.0)
            }
        };
        Some(ChainVariable {
            name: driven.name.to_owned(),
            index,
            joint_type: driven.motion.joint_type,
            limits: driven.motion.limits,
            periodic: driven.motion.joint_type != JointType::Prismatic
                && self.elements.iter().all(whole_turns),
        })
    }
}

/// The pose of a rotation matrix and a position.
pub(super) fn isometry(R: &Matrix3<f64>, p: &Vector3<f64>) -> Isometry3<f64> {
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(*R);
    Isometry3::from_parts((*p).into(), nalgebra::UnitQuaternion::from_rotation_matrix(&rotation))
}
