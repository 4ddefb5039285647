//! Where every link of every robot is.
//!
//! ```text
//! mounts of the cell file --+
//! URDF of each robot -------+--> world pose of each link --> those that moved
//! positions of its joints --+
//! ```
//! The same mounts and descriptions tell how near robots come to each other on a motion: `clearance`.
//!
//! Pure. A robot without a usable description, or without known positions, is left out, and so is
//! what stands on it; everybody else is there.

mod body;
mod clearance;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::time::Duration;

use armada_model::{JointVector, MonoTime, Pose, UrdfError};
use armada_protocol::RobotName;
use armada_protocol::messages::{CellRobot, Mount, RobotInfo};

use body::Body;
pub use clearance::{ClearanceProblem, ClearanceReport, ClearanceRequest};

/// How often every link is told.
const FULL_PERIOD: Duration = Duration::from_secs(1);

/// The robots of a cell in one frame.
#[derive(Debug)]
pub struct World {
    /// In an order in which every robot comes after the one it stands on.
    robots: Vec<(RobotName, Placed)>,
    last_full: Option<MonoTime>,
}

#[derive(Debug)]
struct Placed {
    mount: Mount,
    body: Option<Body>,
}

/// Poses of links in the world, named `robot/link`.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// Whether every link is in it, not only those that moved.
    pub full: bool,
    /// Pose in the world of each link.
    pub frames: BTreeMap<String, Pose>,
}

/// Why a robot is not in the world.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// The cell has no such robot.
    #[error("the cell has no robot {0}")]
    UnknownRobot(RobotName),
    /// Its description cannot be read.
    #[error("{robot}: {cause}")]
    Urdf {
        /// The robot.
        robot: RobotName,
        /// What is wrong.
        cause: Box<UrdfError>,
    },
    /// It says that it has a joint that its description does not drive.
    #[error("{robot}: joint {joint} is no driven joint of its URDF")]
    Joint {
        /// The robot.
        robot: RobotName,
        /// The joint.
        joint: String,
    },
    /// Its description drives a joint that it does not have.
    #[error("{robot}: its URDF has {expected} driven joints, but it tells {given}")]
    JointCount {
        /// The robot.
        robot: RobotName,
        /// Driven joints of the URDF.
        expected: usize,
        /// Joints told.
        given: usize,
    },
    /// It stands on a link that does not exist.
    #[error("{robot}: its mount parent {parent:?} is no link of that robot")]
    MountLink {
        /// The robot.
        robot: RobotName,
        /// Where it should stand.
        parent: String,
    },
}

impl World {
    /// A world of robots that have not been described yet. Mounts must reach the world, as a
    /// [`CellConfig`](crate::config::CellConfig) guarantees; a robot whose mount does not is never
    /// placed.
    #[must_use]
    pub fn new(robots: impl IntoIterator<Item = CellRobot>) -> Self {
        let mut waiting: Vec<_> =
            robots.into_iter().map(|robot| (robot.robot, Placed::new(robot.mount))).collect();
        let mut sorted: Vec<(RobotName, Placed)> = Vec::with_capacity(waiting.len());
        loop {
            let (ready, rest): (Vec<_>, Vec<_>) = waiting.into_iter().partition(|(_, placed)| {
                let parent = placed.parent().map(|(parent, _)| parent);
                parent.is_none_or(|parent| sorted.iter().any(|(name, _)| name.as_str() == parent))
            });
            if ready.is_empty() {
                return Self { robots: sorted, last_full: None };
            }
            sorted.extend(ready);
            waiting = rest;
        }
    }

    /// Takes the description of a robot in place of an earlier one.
    ///
    /// Returns why it, or a robot that stands on it, cannot be placed.
    pub fn set_model(&mut self, info: &RobotInfo) -> Vec<WorldError> {
        let Some((_, placed)) = self.robots.iter_mut().find(|(name, _)| *name == info.robot) else {
            return vec![WorldError::UnknownRobot(info.robot.clone())];
        };
        match Body::new(info) {
            Ok(body) => {
                placed.body = Some(body);
                self.misplaced_on(&info.robot)
            }
            Err(error) => {
                placed.body = None;
                vec![error]
            }
        }
    }

    fn misplaced_on(&self, parent: &RobotName) -> Vec<WorldError> {
        let body = self.body(parent.as_str());
        let is_misplaced = |placed: &Placed| match placed.parent() {
            Some((robot, link)) if robot == parent.as_str() => {
                body.is_some_and(|body| !body.has_link(link))
            }
            _ => false,
        };
        let misplaced = self.robots.iter().filter(|(_, placed)| is_misplaced(placed));
        misplaced
            .map(|(robot, placed)| WorldError::MountLink {
                robot: robot.clone(),
                parent: placed.mount.parent.clone(),
            })
            .collect()
    }

    /// Takes the positions of a robot's joints, in the order of its description. What does not fit
    /// the description is passed over.
    pub fn set_positions(&mut self, robot: &RobotName, positions: &JointVector) {
        let found = self.robots.iter_mut().find(|(name, _)| name == robot);
        if let Some(body) = found.and_then(|(_, placed)| placed.body.as_mut()) {
            body.set_positions(positions);
        }
    }

    /// The links that moved since they were told last, or all of them once a second; `None` if
    /// there is nothing to tell.
    pub fn frames(&mut self, now: MonoTime) -> Option<Frames> {
        let is_due = |last: MonoTime| now.saturating_since(last) >= FULL_PERIOD;
        let full = self.last_full.is_none_or(is_due);
        let mut frames = BTreeMap::new();
        for index in 0..self.robots.len() {
            let Some(base) = self.base_of(index) else { continue };
            if let Some((_, Placed { body: Some(body), .. })) = self.robots.get_mut(index) {
                body.place(&base, full, &mut frames);
            }
        }
        if frames.is_empty() {
            return None;
        }
        if full {
            self.last_full = Some(now);
        }
        Some(Frames { full, frames })
    }

    /// Pose in the world of a link, as of the last [`Self::frames`].
    #[must_use]
    pub fn link_pose(&self, robot: &RobotName, link: &str) -> Option<Pose> {
        self.body(robot.as_str())?.pose_in_world(link)
    }

    /// Pose in the world of the root link of the robot at `index`.
    fn base_of(&self, index: usize) -> Option<Pose> {
        let (_, placed) = self.robots.get(index)?;
        match placed.parent() {
            None => Some(placed.mount.pose),
            Some((robot, link)) => Some(self.body(robot)?.pose_in_world(link)? * placed.mount.pose),
        }
    }

    fn body(&self, robot: &str) -> Option<&Body> {
        let found = self.robots.iter().find(|(name, _)| name.as_str() == robot);
        found.and_then(|(_, placed)| placed.body.as_ref())
    }
}

impl Placed {
    const fn new(mount: Mount) -> Self {
        Self { mount, body: None }
    }

    /// Robot and link it stands on; `None` if that is the world.
    fn parent(&self) -> Option<(&str, &str)> {
        self.mount.parent.split_once('/')
    }
}
