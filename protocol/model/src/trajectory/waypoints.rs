//! A trajectory as it is asked for: the payload.

use serde::{Deserialize, Serialize};

use super::error::TrajectoryError;

/// Positions to pass at given times; `joint_names` gives the order of every row.
///
/// It may name the joints of several robots. Nothing is checked before
/// [`CompiledTrajectory::compile`](super::CompiledTrajectory::compile) but what the types say.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointTrajectory {
    /// Names of the joints, one per column of the waypoints.
    pub joint_names: Vec<String>,
    /// What to pass, in the order of time.
    pub waypoints: Vec<Waypoint>,
    /// How to move between the waypoints.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// Where all joints are at one time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waypoint {
    /// Time since the start of the trajectory \[s\]; zero at the first waypoint.
    pub time_from_start_s: f64,
    /// Positions in the order of `joint_names` \[rad or m\].
    pub joint_position: Vec<f64>,
    /// Velocities in the order of `joint_names` \[rad/s or m/s\]; either every waypoint has them
    /// or none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint_velocity: Vec<f64>,
}

/// How to move between waypoints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// A cubic polynomial per joint between two waypoints. With velocities given: the one that
    /// has them at both ends (Hermite), so acceleration may jump at a waypoint. Without: the
    /// spline with continuous acceleration that starts and ends at rest.
    #[default]
    CubicSpline,
}

impl JointTrajectory {
    /// The trajectory of some of the joints: column `columns[i]` here becomes column `i` there,
    /// under the name `names[i]`. This splits a trajectory of several robots.
    ///
    /// # Errors
    /// [`TrajectoryError::ColumnNames`] if there is not one name per column,
    /// [`TrajectoryError::ColumnUnknown`] if a column does not exist,
    /// [`TrajectoryError::RowLength`] if a row does not have one value per joint.
    pub fn select(&self, columns: &[usize], names: Vec<String>) -> Result<Self, TrajectoryError> {
        let joints = self.joint_names.len();
        if columns.len() != names.len() {
            return Err(TrajectoryError::ColumnNames {
                columns: columns.len(),
                names: names.len(),
            });
        }
        if let Some(&column) = columns.iter().find(|&&column| column >= joints) {
            return Err(TrajectoryError::ColumnUnknown { column, joints });
        }
        let pick = |row: &[f64]| -> Vec<f64> {
            columns.iter().filter_map(|&column| row.get(column).copied()).collect()
        };
        let mut waypoints = Vec::with_capacity(self.waypoints.len());
        for (index, waypoint) in self.waypoints.iter().enumerate() {
            waypoint.check_lengths(index, joints)?;
            waypoints.push(Waypoint {
                time_from_start_s: waypoint.time_from_start_s,
                joint_position: pick(&waypoint.joint_position),
                joint_velocity: pick(&waypoint.joint_velocity),
            });
        }
        Ok(Self { joint_names: names, waypoints, interpolation: self.interpolation })
    }
}

impl Waypoint {
    /// Refuses rows that do not have one value for each of `expected` joints; `index` is only told.
    pub(super) fn check_lengths(
        &self,
        index: usize,
        expected: usize,
    ) -> Result<(), TrajectoryError> {
        let refuse =
            |field, len| Err(TrajectoryError::RowLength { waypoint: index, field, len, expected });
        if self.joint_position.len() != expected {
            return refuse("joint_position", self.joint_position.len());
        }
        if !self.joint_velocity.is_empty() && self.joint_velocity.len() != expected {
            return refuse("joint_velocity", self.joint_velocity.len());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_robots() -> JointTrajectory {
        let row = |time_from_start_s, base: f64| Waypoint {
            time_from_start_s,
            joint_position: vec![base, base + 1.0, base + 2.0],
            joint_velocity: vec![0.0; 3],
        };
        JointTrajectory {
            joint_names: ["left/a", "left/b", "right/a"].map(str::to_owned).to_vec(),
            waypoints: vec![row(0.0, 0.0), row(1.0, 10.0)],
            interpolation: Interpolation::CubicSpline,
        }
    }

    #[test]
    fn optional_fields_may_be_left_out() {
        let text = r#"{"joint_names":["a"],"waypoints":[
            {"time_from_start_s":0.0,"joint_position":[0.5]}]}"#;
        let trajectory: JointTrajectory = serde_json::from_str(text).expect("decodes");
        assert_eq!(trajectory.interpolation, Interpolation::CubicSpline);
        assert_eq!(
            serde_json::to_string(&trajectory).expect("encodes"),
            r#"{"joint_names":["a"],"waypoints":[{"time_from_start_s":0.0,"joint_position":[0.5]}],"interpolation":"cubic_spline"}"#
        );
    }

    #[test]
    fn a_field_that_is_not_honoured_is_refused_by_name() {
        let text = r#"{"joint_names":[],"waypoints":[
            {"time_from_start_s":0.0,"joint_position":[],"position_tolerance":[]}]}"#;
        let error = serde_json::from_str::<JointTrajectory>(text).expect_err("unknown field");
        assert!(error.to_string().contains("position_tolerance"), "{error}");
        let text = r#"{"joint_names":[],"waypoints":[],"interpolation":"linear"}"#;
        let error = serde_json::from_str::<JointTrajectory>(text).expect_err("unknown variant");
        assert!(error.to_string().contains("linear"), "{error}");
    }

    #[test]
    fn selection_reorders_columns_and_renames_joints() {
        let part = two_robots()
            .select(&[2, 0], vec!["x".to_owned(), "y".to_owned()])
            .expect("both columns exist");
        assert_eq!(part.joint_names, ["x", "y"]);
        assert_eq!(part.waypoints[1].joint_position, [12.0, 10.0]);
        assert_eq!(part.waypoints[1].joint_velocity, [0.0, 0.0]);
        assert_eq!(part.waypoints[1].time_from_start_s, 1.0);
    }

    #[test]
    fn selection_never_hides_a_row_of_wrong_length() {
        let mut trajectory = two_robots();
        trajectory.waypoints[1].joint_velocity.pop();
        let error = trajectory.select(&[0], vec!["x".to_owned()]).expect_err("row is short");
        assert_eq!(
            error.to_string(),
            "waypoint 1: joint_velocity has 2 values, expected one for each of 3 joints"
        );
    }

    #[test]
    fn selection_refuses_columns_that_do_not_exist_or_have_no_name() {
        let error = two_robots().select(&[3], vec!["x".to_owned()]).expect_err("no column 3");
        assert_eq!(error.to_string(), "column 3 does not exist, the trajectory has 3 joints");
        let error = two_robots().select(&[0], Vec::new()).expect_err("no name");
        assert_eq!(error.to_string(), "1 columns, but 0 names");
    }
}
