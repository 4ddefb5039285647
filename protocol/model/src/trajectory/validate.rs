//! What can be checked of a trajectory before it is interpolated.

use super::error::TrajectoryError;
use super::waypoints::{JointTrajectory, Waypoint};

/// How far a trajectory may go beyond a limit before it is refused, so that a client's rounding is
/// not taken for a fault: 1e-6 rad or m of position, one millionth of the limit of velocity and of
/// acceleration.
pub const LIMIT_TOLERANCE: f64 = 1e-6;

/// Highest speed \[rad/s or m/s\] that counts as rest at the first and last waypoint; it is then
/// taken as zero.
pub const REST_TOLERANCE: f64 = 1e-9;

/// How far the time of the first waypoint may be from zero \[s\]; it is then taken as zero.
pub const START_TIME_TOLERANCE_S: f64 = 1e-9;

/// Least time between two waypoints \[s\].
pub const MIN_WAYPOINT_SPACING_S: f64 = 1e-4;

/// How large a trajectory may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryOptions {
    /// Longest duration \[s\].
    pub max_duration_s: f64,
    /// Highest number of waypoints.
    pub max_waypoints: usize,
}

impl Default for TrajectoryOptions {
    /// One hour, 100 000 waypoints.
    fn default() -> Self {
        Self { max_duration_s: 3600.0, max_waypoints: 100_000 }
    }
}

/// Finite numbers of the right count, in the robot's joint order, at times that increase.
pub(super) struct Knots {
    /// One per waypoint \[s\], the first is zero.
    pub(super) times: Vec<f64>,
    /// One row per waypoint.
    pub(super) positions: Vec<f64>,
    /// One row per waypoint if velocities were given, zero in the first and the last row.
    pub(super) velocities: Option<Vec<f64>>,
}

/// Takes the rows of `trajectory` into the order of `joints`, if they are what they should be.
pub(super) fn knots(
    trajectory: &JointTrajectory,
    joints: &[impl AsRef<str>],
    options: &TrajectoryOptions,
) -> Result<Knots, TrajectoryError> {
    let columns = columns(&trajectory.joint_names, joints)?;
    let waypoints = &trajectory.waypoints;
    check_count(waypoints.len(), options.max_waypoints)?;
    check_rows(waypoints, joints.len())?;
    let times = times(waypoints, options.max_duration_s)?;
    let reorder = |field, row: fn(&Waypoint) -> &[f64]| {
        gather(waypoints, &columns, row).map_err(|(waypoint, joint, value)| {
            TrajectoryError::NotFinite { waypoint, field, joint: name(joints, joint), value }
        })
    };
    let positions = reorder("joint_position", |waypoint| &waypoint.joint_position)?;
    let has_velocities = waypoints.first().is_some_and(|first| !first.joint_velocity.is_empty());
    let velocities = if has_velocities {
        let mut rows = reorder("joint_velocity", |waypoint| &waypoint.joint_velocity)?;
        rest_at_ends(&mut rows, joints)?;
        Some(rows)
    } else {
        None
    };
    Ok(Knots { times, positions, velocities })
}

/// For each joint of the robot its column in the trajectory.
fn columns(names: &[String], joints: &[impl AsRef<str>]) -> Result<Vec<usize>, TrajectoryError> {
    if let Some(unknown) = names.iter().find(|name| !joints.iter().any(|j| j.as_ref() == **name)) {
        return Err(TrajectoryError::JointUnknown { joint: unknown.clone() });
    }
    let mut columns = Vec::with_capacity(joints.len());
    for joint in joints.iter().map(AsRef::as_ref) {
        let mut matching = names.iter().enumerate().filter(|(_, name)| *name == joint);
        let Some((column, _)) = matching.next() else {
            return Err(TrajectoryError::JointMissing { joint: joint.to_owned() });
        };
        if matching.next().is_some() {
            return Err(TrajectoryError::JointRepeated { joint: joint.to_owned() });
        }
        columns.push(column);
    }
    Ok(columns)
}

fn check_count(count: usize, limit: usize) -> Result<(), TrajectoryError> {
    if count < 2 {
        return Err(TrajectoryError::TooFewWaypoints { count });
    }
    if count > limit {
        return Err(TrajectoryError::TooManyWaypoints { count, limit });
    }
    Ok(())
}

fn check_rows(waypoints: &[Waypoint], joints: usize) -> Result<(), TrajectoryError> {
    let without_velocity = waypoints.first().is_some_and(|first| first.joint_velocity.is_empty());
    for (index, waypoint) in waypoints.iter().enumerate() {
        waypoint.check_lengths(index, joints)?;
        if waypoint.joint_velocity.is_empty() != without_velocity {
            return Err(TrajectoryError::VelocityMixed { waypoint: index });
        }
    }
    Ok(())
}

fn times(waypoints: &[Waypoint], max_duration_s: f64) -> Result<Vec<f64>, TrajectoryError> {
    // Nominally spaced times differ from their spacing by rounding.
    const SPACING_S: f64 = MIN_WAYPOINT_SPACING_S * (1.0 - 1e-6);
    let mut times: Vec<f64> = Vec::with_capacity(waypoints.len());
    for (index, waypoint) in waypoints.iter().enumerate() {
        let time_s = waypoint.time_from_start_s;
        if !time_s.is_finite() {
            return Err(TrajectoryError::TimeNotFinite { waypoint: index, value: time_s });
        }
        match times.last() {
            None if time_s.abs() > START_TIME_TOLERANCE_S => {
                return Err(TrajectoryError::FirstTime { time_s });
            }
            None => times.push(0.0),
            Some(&previous_s) if time_s - previous_s < SPACING_S => {
                return Err(TrajectoryError::Spacing {
                    waypoint: index,
                    time_s,
                    previous_s,
                    spacing_s: MIN_WAYPOINT_SPACING_S,
                });
            }
            Some(_) => times.push(time_s),
        }
    }
    match times.last() {
        Some(&duration_s) if duration_s > max_duration_s => {
            Err(TrajectoryError::TooLong { duration_s, limit_s: max_duration_s })
        }
        _ => Ok(times),
    }
}

/// All rows one after the other, or waypoint, joint and value of what is not finite.
fn gather(
    waypoints: &[Waypoint],
    columns: &[usize],
    row: fn(&Waypoint) -> &[f64],
) -> Result<Vec<f64>, (usize, usize, f64)> {
    let mut rows = Vec::with_capacity(waypoints.len() * columns.len());
    for (index, waypoint) in waypoints.iter().enumerate() {
        let values = columns.iter().filter_map(|&column| row(waypoint).get(column));
        for (joint, &value) in values.enumerate() {
            if !value.is_finite() {
                return Err((index, joint, value));
            }
            rows.push(value);
        }
    }
    Ok(rows)
}

/// Refuses motion in the first and the last row, and makes what counts as rest exactly zero.
fn rest_at_ends(rows: &mut [f64], joints: &[impl AsRef<str>]) -> Result<(), TrajectoryError> {
    let last = (rows.len() / joints.len()).saturating_sub(1);
    for waypoint in [0, last] {
        let row = rows.iter_mut().skip(waypoint * joints.len()).take(joints.len());
        for (joint, value) in row.enumerate() {
            if value.abs() > REST_TOLERANCE {
                let (joint, value) = (name(joints, joint), *value);
                return Err(TrajectoryError::NotAtRest { waypoint, joint, value });
            }
            *value = 0.0;
        }
    }
    Ok(())
}

pub(super) fn name(joints: &[impl AsRef<str>], joint: usize) -> String {
    joints.get(joint).map(|name| name.as_ref().to_owned()).unwrap_or_default()
}
