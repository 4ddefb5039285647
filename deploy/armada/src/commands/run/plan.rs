//! A trajectory file, and what each robot has to do in it.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context as _;
use armada_model::{JointTrajectory, JointVector};
use armada_protocol::RobotName;
use armada_protocol::client::Client;
use armada_protocol::messages::{Coupling, RobotInfo};
use uuid::Uuid;

use crate::exit::UsageError;
use crate::motion::Mover;

/// Distance from the first waypoint up to which a robot is there \[rad or m\]; agents refuse more
/// than their own, which is wider.
const THERE: f64 = 1e-3;

/// A trajectory with the robots that follow it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plan {
    name: String,
    trajectory: JointTrajectory,
    mover: Mover,
    parts: Vec<Part>,
    terms: Terms,
}

/// On which terms several robots follow a trajectory together.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Terms {
    /// How closely they are tied together.
    pub(crate) coupling: Coupling,
    /// The lease of each robot that somebody holds one of.
    pub(crate) leases: BTreeMap<RobotName, Uuid>,
}

/// What one robot has to do.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    /// Which robot.
    pub(crate) robot: RobotName,
    /// Its joints with their first positions \[rad or m\], in the order of the file.
    first: Vec<(String, f64)>,
}

impl Plan {
    /// Reads a file; `robot` is whose joints it names, otherwise names are `robot/joint`.
    ///
    /// # Errors
    /// If the file cannot be read, is no trajectory, or names a joint in the wrong form.
    pub(crate) fn load(path: &Path, robot: Option<&RobotName>) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let trajectory: JointTrajectory =
            serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        Ok(Self::new(name, trajectory, robot)
            .map_err(|error| UsageError(format!("{}: {error}", path.display())))?)
    }

    fn new(
        name: String,
        trajectory: JointTrajectory,
        robot: Option<&RobotName>,
    ) -> Result<Self, UsageError> {
        let Some(first) = trajectory.waypoints.first() else {
            return Err(UsageError("it has no waypoints".to_owned()));
        };
        if first.joint_position.len() != trajectory.joint_names.len() {
            return Err(UsageError(format!(
                "{} joints are named, but the first waypoint has {} positions",
                trajectory.joint_names.len(),
                first.joint_position.len()
            )));
        }
        // The way to the first waypoint is a jog, which knows rad and m only.
        let mut units = trajectory.joint_names.iter().zip(&trajectory.joint_units);
        if let Some((name, unit)) = units.find(|(_, unit)| unit.to_si() != 1.0) {
            return Err(UsageError(format!(
                "joint_units has {unit} for {name}, use rad or m here"
            )));
        }
        let mut parts: Vec<Part> = Vec::new();
        for (name, &position) in trajectory.joint_names.iter().zip(&first.joint_position) {
            let (owner, joint) = owner(name, robot)?;
            match parts.iter_mut().find(|part| part.robot == owner) {
                Some(part) => part.first.push((joint, position)),
                None => parts.push(Part { robot: owner, first: vec![(joint, position)] }),
            }
        }
        let mover = robot.map_or(Mover::Cell, |robot| Mover::Robot(robot.clone()));
        Ok(Self { name, trajectory, mover, parts, terms: Terms::default() })
    }

    /// The same with its times divided by `speed`, its velocities multiplied by it, and its
    /// accelerations by its square.
    pub(crate) fn at_speed(mut self, speed: f64) -> Self {
        for waypoint in &mut self.trajectory.waypoints {
            waypoint.time_from_start_s /= speed;
            waypoint.joint_velocity.iter_mut().for_each(|velocity| *velocity *= speed);
            waypoint.joint_acceleration.iter_mut().for_each(|value| *value *= speed * speed);
        }
        self
    }

    /// The same on these terms.
    ///
    /// # Errors
    /// If a lease is that of a robot that takes no part.
    pub(crate) fn on_terms(mut self, terms: Terms) -> Result<Self, UsageError> {
        let takes_part = |robot: &RobotName| self.parts.iter().any(|part| part.robot == *robot);
        if let Some(robot) = terms.leases.keys().find(|robot| !takes_part(robot)) {
            return Err(UsageError(format!("--leases names {robot}, which takes no part")));
        }
        self.terms = terms;
        Ok(self)
    }

    /// The terms.
    pub(crate) const fn terms(&self) -> &Terms {
        &self.terms
    }

    /// The connection as it asks `robot` alone: under its lease, if there is one.
    pub(crate) fn client_of(&self, client: &Client, robot: &RobotName) -> Client {
        match self.terms.leases.get(robot) {
            Some(lease) => client.under(*lease),
            None => client.clone(),
        }
    }

    /// What each robot has to do.
    pub(crate) fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Who carries it out.
    pub(crate) fn mover(&self) -> Mover {
        self.mover.clone()
    }

    /// The trajectory with the names of the file.
    pub(crate) const fn trajectory(&self) -> &JointTrajectory {
        &self.trajectory
    }

    /// Name of the motion, for people.
    pub(crate) fn title(&self) -> String {
        self.name.clone()
    }
}

fn owner(name: &str, robot: Option<&RobotName>) -> Result<(RobotName, String), UsageError> {
    match (name.split_once('/'), robot) {
        (None, Some(robot)) => Ok((robot.clone(), name.to_owned())),
        (Some((owner, joint)), None) => {
            let owner = owner.parse().map_err(|error| UsageError(format!("{name:?}: {error}")))?;
            Ok((owner, joint.to_owned()))
        }
        (Some(_), Some(robot)) => Err(UsageError(format!(
            "joint {name:?} names its robot: run it without --robot {robot}"
        ))),
        (None, None) => Err(UsageError(format!(
            "joint {name:?} does not name its robot: write ROBOT/{name}, or give --robot"
        ))),
    }
}

impl Part {
    /// Names of its joints, in the order of the file.
    pub(crate) fn joints(&self) -> impl Iterator<Item = &str> {
        self.first.iter().map(|(name, _)| name.as_str())
    }

    /// Where the joints are at the first waypoint, in the robot's order \[rad or m\].
    ///
    /// # Errors
    /// If the file does not name exactly the robot's joints.
    pub(crate) fn first_waypoint(&self, info: &RobotInfo) -> Result<JointVector, UsageError> {
        let unknown = |name: &String| !info.joints.iter().any(|joint| &joint.name == name);
        if let Some((name, _)) = self.first.iter().find(|(name, _)| unknown(name)) {
            return Err(UsageError(format!("{} has no joint {name:?}", self.robot)));
        }
        let position = |joint: &str| {
            self.first
                .iter()
                .find(|(name, _)| name == joint)
                .map(|(_, position)| *position)
                .ok_or_else(|| {
                    UsageError(format!("joint {joint} of {} is not in the file", self.robot))
                })
        };
        let positions: Vec<f64> =
            info.joints.iter().map(|joint| position(&joint.name)).collect::<Result<_, _>>()?;
        JointVector::from_slice(&positions).map_err(|error| UsageError(error.to_string()))
    }

    /// Whether joints at `position` need no move to `goal`.
    pub(crate) fn is_there(&self, goal: &JointVector, position: &JointVector) -> bool {
        goal.len() == position.len() && goal.max_abs_difference(position) <= THERE
    }
}

#[cfg(test)]
mod tests {
    use armada_model::{JointUnit, Waypoint};

    use super::*;

    fn trajectory(names: &[&str]) -> JointTrajectory {
        let row = |time_from_start_s, base: f64| Waypoint {
            time_from_start_s,
            joint_position: (0..names.len()).map(|index| base + index as f64).collect(),
            joint_velocity: vec![0.5; names.len()],
            joint_acceleration: vec![1.0; names.len()],
            ..Waypoint::default()
        };
        JointTrajectory {
            joint_names: names.iter().map(|name| (*name).to_owned()).collect(),
            waypoints: vec![row(0.0, 0.0), row(2.0, 1.0)],
            ..JointTrajectory::default()
        }
    }

    fn plan(names: &[&str], robot: Option<&str>) -> Result<Plan, String> {
        let robot = robot.map(|name| name.parse().expect("a name"));
        Plan::new("demo".to_owned(), trajectory(names), robot.as_ref())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn joints_are_grouped_by_robot_in_the_order_of_the_file() {
        let plan = plan(&["left/a", "torso/lift", "left/b"], None).expect("a plan");
        let parts: Vec<_> =
            plan.parts().iter().map(|part| (part.robot.as_str(), part.first.clone())).collect();
        let joint = |name: &str, position| (name.to_owned(), position);
        assert_eq!(parts[0], ("left", vec![joint("a", 0.0), joint("b", 2.0)]));
        assert_eq!(parts[1], ("torso", vec![joint("lift", 1.0)]));
        assert_eq!(plan.mover(), Mover::Cell);
    }

    #[test]
    fn half_speed_takes_twice_the_time_at_half_the_velocity() {
        let plan = plan(&["a"], Some("left")).expect("a plan").at_speed(0.5);
        let last = plan.trajectory().waypoints.last().expect("two");
        assert_eq!(last.time_from_start_s, 4.0);
        assert_eq!(last.joint_velocity, [0.25]);
        assert_eq!(last.joint_acceleration, [0.25]);
        assert_eq!(last.joint_position, [1.0]);
    }

    #[test]
    fn names_in_the_wrong_form_are_told_with_the_way_out() {
        let error = plan(&["a"], None).expect_err("whose a?");
        assert_eq!(error, "joint \"a\" does not name its robot: write ROBOT/a, or give --robot");
        let error = plan(&["left/a"], Some("left")).expect_err("twice");
        assert!(error.contains("run it without --robot left"), "{error}");
        assert!(plan(&["Left/a"], None).expect_err("no name").contains("not a robot name"));
    }

    #[test]
    fn a_file_without_waypoints_or_with_a_short_row_is_refused() {
        let empty = JointTrajectory { joint_names: vec!["l/a".to_owned()], ..Default::default() };
        assert!(Plan::new(String::new(), empty, None).is_err());
        let mut short = trajectory(&["l/a", "l/b"]);
        short.waypoints[0].joint_position.pop();
        let error = Plan::new(String::new(), short, None).expect_err("one position");
        assert_eq!(error.to_string(), "2 joints are named, but the first waypoint has 1 positions");
    }

    #[test]
    fn a_file_in_degrees_is_refused_since_the_way_to_its_start_is_in_radians() {
        let mut degrees = trajectory(&["l/a"]);
        degrees.joint_units = vec![JointUnit::Degree];
        let error = Plan::new(String::new(), degrees, None).expect_err("degrees");
        assert_eq!(error.to_string(), "joint_units has degree for l/a, use rad or m here");
    }

    #[test]
    fn a_robot_is_there_only_with_every_joint() {
        let plan = plan(&["l/a", "l/b"], None).expect("a plan");
        let vector = |values: &[f64]| JointVector::from_slice(values).expect("finite");
        let part = &plan.parts()[0];
        assert!(part.is_there(&vector(&[0.0, 1.0]), &vector(&[0.0005, 1.0])));
        assert!(!part.is_there(&vector(&[0.0, 1.0]), &vector(&[0.0, 1.01])));
        assert!(!part.is_there(&vector(&[0.0, 1.0]), &JointVector::EMPTY));
    }
}
