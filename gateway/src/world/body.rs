//! One robot in the world.

#![allow(non_snake_case, reason = "X_WL is the pose of link L in the world W")]

use std::collections::BTreeMap;
use std::sync::Arc;

use armada_model::{
    CompiledTrajectory, JointLimits, JointTrajectory, JointType, JointVector, MotionLimits, Pose,
    RobotModel, Shape, TrajectoryContext, TrajectoryOptions,
};
use armada_protocol::messages::{JointInfo, RobotInfo};
use nalgebra::Isometry3;

use super::WorldError;

/// Least motion that is told: of the origin \[m\], and of the orientation \[rad\].
const LEAST_MOTION: f64 = 1e-6;

/// A robot's links.
#[derive(Debug)]
pub(in crate::world) struct Body {
    pub(in crate::world) model: Arc<RobotModel>,
    pub(in crate::world) joints: Joints,
    /// Variable of the model for each joint of the robot.
    pub(in crate::world) variables: Vec<usize>,
    /// Names of the links in the world.
    names: Vec<String>,
    /// Names of what the chains carry.
    equipment: Vec<String>,
    /// Position of each variable; `None` before any are known.
    pub(in crate::world) positions: Option<Vec<f64>>,
    /// Poses in the root, for calculation.
    X_RL: Vec<Isometry3<f64>>,
    /// Poses in the world, empty while the robot is not placed.
    X_WL: Vec<Pose>,
    /// Poses that were told last.
    told: Vec<Option<Pose>>,
}

/// The joints of a robot, shared with whoever interpolates its trajectories.
#[derive(Clone, Debug)]
pub(in crate::world) struct Joints(Arc<[JointInfo]>);

impl Joints {
    /// The trajectory as the agent interpolates it, within its limits or those at reduced speed.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(in crate::world) fn compile(
        &self,
        trajectory: &JointTrajectory,
        reduced: bool,
    ) -> Result<CompiledTrajectory, String> {
        let limits = |joint: &JointInfo| {
            if !reduced {
                return joint.limits;
            }
            JointLimits {
                velocity: joint.limits.velocity.min(joint.reduced.velocity),
                acceleration: joint.limits.acceleration.map(|a| a.min(joint.reduced.acceleration)),
                ..joint.limits
            }
        };
        let limits: Vec<_> = self.0.iter().map(limits).collect();
        let limits = MotionLimits::new(&limits).map_err(|error| error.to_string())?;
        let names: Vec<_> = self.0.iter().map(|joint| joint.name.as_str()).collect();
        let types: Vec<JointType> = self.0.iter().map(|joint| joint.joint_type).collect();
        let context =
            TrajectoryContext { joint_order: &names, joint_types: Some(&types), limits: &limits };
        CompiledTrajectory::compile_for(trajectory, &context, &TrajectoryOptions::default())
            .map_err(|error| error.to_string())
    }
}

impl Body {
    pub(super) fn new(info: &RobotInfo) -> Result<Self, WorldError> {
        let label = format!("URDF of {}", info.robot);
        let model = RobotModel::from_urdf(&info.urdf, &label).map_err(|cause| {
            WorldError::Urdf { robot: info.robot.clone(), cause: Box::new(cause) }
        })?;
        let variable = |name: &String| {
            model
                .variable_index(name)
                .ok_or_else(|| WorldError::Joint { robot: info.robot.clone(), joint: name.clone() })
        };
        let variables =
            info.joints.iter().map(|joint| variable(&joint.name)).collect::<Result<Vec<_>, _>>()?;
        if variables.len() != model.variable_count() {
            return Err(WorldError::JointCount {
                robot: info.robot.clone(),
                expected: model.variable_count(),
                given: variables.len(),
            });
        }
        let links = model.links();
        let (X_RL, told) = (vec![Isometry3::identity(); links.len()], vec![None; links.len()]);
        let names = links.iter().map(|link| format!("{}/{}", info.robot, link.name)).collect();
        Ok(Self {
            joints: Joints(info.joints.clone().into()),
            equipment: equipment(info),
            model: Arc::new(model),
            variables,
            names,
            positions: None,
            X_RL,
            X_WL: Vec::new(),
            told,
        })
    }

    /// What of the robot has no shape that could be checked, named `robot/link`: links of which
    /// there is a picture only, or a file, all links if none has a shape, and what is attached.
    pub(in crate::world) fn without_shape(&self) -> Vec<String> {
        let links = || self.model.links().iter().zip(&self.names);
        let is_blind = links().all(|(link, _)| link.collisions.is_empty());
        let lacks = |link: &armada_model::Link| {
            let is_file = |shape: &Shape| matches!(shape, Shape::Mesh { .. });
            is_blind
                || (link.collisions.is_empty() && !link.visuals.is_empty())
                || link.collisions.iter().any(|collision| is_file(&collision.shape))
        };
        let bare = links().filter(|(link, _)| lacks(link)).map(|(_, name)| name.clone());
        bare.chain(self.equipment.iter().cloned()).collect()
    }

    pub(super) fn has_link(&self, link: &str) -> bool {
        self.model.link_index(link).is_some()
    }

    pub(super) fn set_positions(&mut self, positions: &JointVector) {
        if positions.len() != self.variables.len() {
            return;
        }
        let mut ordered = vec![0.0; self.variables.len()];
        for (&variable, &position) in self.variables.iter().zip(positions.iter()) {
            if let Some(slot) = ordered.get_mut(variable) {
                *slot = position;
            }
        }
        self.positions = Some(ordered);
    }

    pub(super) fn pose_in_world(&self, link: &str) -> Option<Pose> {
        self.X_WL.get(self.model.link_index(link)?).copied()
    }

    /// Places the robot with its root at `X_WR`, and tells the links that moved, or all.
    pub(super) fn place(&mut self, X_WR: &Pose, all: bool, frames: &mut BTreeMap<String, Pose>) {
        let Some(positions) = &self.positions else { return };
        if self.model.link_poses(positions, &mut self.X_RL).is_err() {
            return;
        }
        let in_world = |X_RL: &Isometry3<f64>| Pose::from_isometry(X_WR.isometry() * X_RL);
        self.X_WL.clear();
        self.X_WL.extend(self.X_RL.iter().map(in_world));
        for ((pose, told), name) in self.X_WL.iter().zip(&mut self.told).zip(&self.names) {
            if all || told.is_none_or(|told| has_moved(&told, pose)) {
                *told = Some(*pose);
                frames.insert(name.clone(), *pose);
            }
        }
    }
}

fn equipment(info: &RobotInfo) -> Vec<String> {
    let named = |name: &str| format!("{}/{name}", info.robot);
    let carried = info.equipment.iter().flat_map(|chain| {
        let tool = chain.tool.as_ref().map(|tool| named(&tool.name));
        let payload = chain.payload.as_ref().map(|held| named(&held.payload.name));
        [tool, payload]
    });
    carried.flatten().collect()
}

fn has_moved(from: &Pose, to: &Pose) -> bool {
    let (distance, angle) = from.distance(to);
    distance > LEAST_MOTION || angle > LEAST_MOTION
}
