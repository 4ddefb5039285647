//! A robot as a tree of links, and where its links are.

mod joint;
mod kinematics;
mod link;

use std::collections::BTreeMap;

pub use joint::{Joint, Motion, PositionSource, SoftLimits, Variable};
pub use kinematics::KinematicsError;
pub use link::{Collision, Inertial, Link, Shape, Visual};

use kinematics::Node;

/// A robot: one tree of links, connected by joints.
///
/// Links stand in topological order: the root first, every other link after its parent. Joints
/// stand in the order of the file. The positions of the driven joints, those that move and mimic
/// no other, are the *variables*; a position vector holds one value per variable, in joint order,
/// \[rad\] if the joint turns, \[m\] if it slides. Made by [`RobotModel::from_urdf`].
#[derive(Clone, Debug)]
pub struct RobotModel {
    name: String,
    links: Vec<Link>,
    joints: Vec<Joint>,
    /// Joint of each variable.
    variables: Vec<usize>,
    link_indices: BTreeMap<String, usize>,
    joint_indices: BTreeMap<String, usize>,
    /// What forward kinematics needs of each link, in link order.
    nodes: Vec<Node>,
}

impl RobotModel {
    /// The model of links in topological order and joints whose indices fit them.
    pub(crate) fn new(name: String, links: Vec<Link>, joints: Vec<Joint>) -> Self {
        let named = |(index, name): (usize, &String)| (name.clone(), index);
        let driven = |(index, joint): (usize, &Joint)| joint.variable().map(|_| index);
        Self {
            variables: joints.iter().enumerate().filter_map(driven).collect(),
            link_indices: links.iter().map(|link| &link.name).enumerate().map(named).collect(),
            joint_indices: joints.iter().map(|joint| &joint.name).enumerate().map(named).collect(),
            nodes: kinematics::nodes(&links, &joints),
            name,
            links,
            joints,
        }
    }

    /// The robot's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// All links in topological order; the first is the root.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// All joints, fixed ones as well, in the order of the file.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Index in [`links`](Self::links) of the link of that name.
    #[must_use]
    pub fn link_index(&self, name: &str) -> Option<usize> {
        self.link_indices.get(name).copied()
    }

    /// Index in [`joints`](Self::joints) of the joint of that name.
    #[must_use]
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joint_indices.get(name).copied()
    }

    /// Length of a position vector.
    #[must_use]
    pub fn variable_count(&self) -> usize {
        self.variables.len()
    }

    /// The driven joints in the order of a position vector.
    pub fn variables(&self) -> impl Iterator<Item = Variable<'_>> + Clone {
        self.variables.iter().filter_map(|&index| {
            let joint = self.joints.get(index)?;
            Some(Variable { name: &joint.name, joint: index, motion: joint.motion.as_ref()? })
        })
    }

    /// Index in a position vector of the driven joint of that name; `None` as well for joints that
    /// are fixed or mimic another.
    #[must_use]
    pub fn variable_index(&self, name: &str) -> Option<usize> {
        self.joints.get(self.joint_index(name)?)?.variable()
    }
}
