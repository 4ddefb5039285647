//! Waypoints of all joints in time, group after group.

use armada_model::{Interpolation, JointTrajectory, JointVector, Waypoint};

/// Duration of a trajectory that goes nowhere \[s\].
const REST_S: f64 = 0.01;

/// What was planned so far.
pub(super) struct Timeline {
    waypoints: Vec<Waypoint>,
    end: JointVector,
    /// When each move has passed its goal or corner \[s\].
    pub(super) passed_s: Vec<f64>,
}

impl Timeline {
    pub(super) fn new(start: &JointVector) -> Self {
        Self { waypoints: vec![at_rest(0.0, start)], end: *start, passed_s: Vec::new() }
    }

    /// Where all joints are at its end.
    pub(super) const fn end(&self) -> &JointVector {
        &self.end
    }

    pub(super) fn end_s(&self) -> f64 {
        self.waypoints.last().map_or(0.0, |last| last.time_from_start_s)
    }

    /// Adds a motion from rest to rest of `joints`, which begins where this one ends; the other
    /// joints stay.
    pub(super) fn append(&mut self, motion: &JointTrajectory, joints: &[usize]) {
        let start_s = self.end_s();
        let from = self.end;
        let all = |row: &[f64], others: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let joint = |joint: usize| {
                let place = joints.iter().position(|&own| own == joint);
                place.and_then(|place| row.get(place)).copied().unwrap_or_else(|| others(joint))
            };
            (0..from.len()).map(joint).collect()
        };
        for waypoint in motion.waypoints.iter().skip(1) {
            let stay = |joint: usize| from.get(joint).copied().unwrap_or_default();
            self.waypoints.push(Waypoint {
                time_from_start_s: start_s + waypoint.time_from_start_s,
                joint_position: all(&waypoint.joint_position, &stay),
                joint_velocity: all(&waypoint.joint_velocity, &|_| 0.0),
                ..Waypoint::default()
            });
        }
        if let Some(last) = self.waypoints.last() {
            self.end = JointVector::from_slice(&last.joint_position).unwrap_or(from);
        }
    }

    /// The whole for joints of these names; one that goes nowhere rests for a moment.
    pub(super) fn trajectory(&self, names: &[String]) -> JointTrajectory {
        let mut waypoints = self.waypoints.clone();
        if waypoints.len() == 1 {
            waypoints.push(at_rest(REST_S, &self.end));
        }
        JointTrajectory {
            joint_names: names.to_vec(),
            waypoints,
            interpolation: Interpolation::CubicSpline,
            ..JointTrajectory::default()
        }
    }
}

fn at_rest(time_from_start_s: f64, position: &JointVector) -> Waypoint {
    Waypoint {
        time_from_start_s,
        joint_position: position.to_vec(),
        joint_velocity: vec![0.0; position.len()],
        ..Waypoint::default()
    }
}
