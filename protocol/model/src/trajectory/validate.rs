//! What can be checked of a trajectory before it is interpolated.

use super::error::TrajectoryError;
use super::options::{Ends, TrajectoryContext, TrajectoryOptions};
use super::tolerance::Tolerances;
use super::waypoints::{JointTrajectory, Waypoint};
use crate::JointType;

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

/// Finite numbers of the right count, in the robot's joint order and the joints' own units, at
/// times that increase.
pub(super) struct Knots {
    /// One per waypoint \[s\], the first is zero.
    pub(super) times: Vec<f64>,
    /// One row per waypoint.
    pub(super) positions: Vec<f64>,
    /// One row per waypoint if velocities were given; if the ends must be at rest, zero in the
    /// first and the last row.
    pub(super) velocities: Option<Vec<f64>>,
    /// One row per waypoint if accelerations were given.
    pub(super) accelerations: Option<Vec<f64>>,
    pub(super) tolerances: Tolerances,
}

/// Takes the rows of `trajectory` into the order of the robot's joints, if they are what they
/// should be. `names` are those of `context`.
pub(super) fn knots<S>(
    trajectory: &JointTrajectory,
    names: &[&str],
    context: &TrajectoryContext<'_, S>,
    options: &TrajectoryOptions,
) -> Result<Knots, TrajectoryError> {
    let columns = columns(trajectory, names, context.joint_types)?;
    let waypoints = &trajectory.waypoints;
    check_count(waypoints.len(), options.max_waypoints)?;
    check_rows(trajectory, names.len())?;
    let times = times(waypoints, options.max_duration_s)?;
    let reorder = |field, row: fn(&Waypoint) -> &[f64]| {
        gather(waypoints, &columns, row).map_err(|(waypoint, joint, value)| {
            TrajectoryError::NotFinite { waypoint, field, joint: name(names, joint), value }
        })
    };
    let given =
        |row: fn(&Waypoint) -> &[f64]| waypoints.first().is_some_and(|w| !row(w).is_empty());
    let positions = reorder("joint_position", |waypoint| &waypoint.joint_position)?;
    let velocities = given(|waypoint| &waypoint.joint_velocity)
        .then(|| reorder("joint_velocity", |waypoint| &waypoint.joint_velocity))
        .transpose()?;
    let velocities = match (velocities, options.ends) {
        (Some(rows), Ends::AtRest) => Some(at_rest(rows, names)?),
        (rows, _) => rows,
    };
    let accelerations = given(|waypoint| &waypoint.joint_acceleration)
        .then(|| reorder("joint_acceleration", |waypoint| &waypoint.joint_acceleration))
        .transpose()?;
    let tolerances = Tolerances::new(waypoints, &columns, names)?;
    Ok(Knots { times, positions, velocities, accelerations, tolerances })
}

/// Where a joint of the robot is in a trajectory.
#[derive(Clone, Copy)]
pub(super) struct Column {
    pub(super) index: usize,
    /// What one of its unit is in the joint's own.
    pub(super) factor: f64,
}

/// For each joint of the robot its column in the trajectory.
fn columns(
    trajectory: &JointTrajectory,
    joints: &[&str],
    joint_types: Option<&[JointType]>,
) -> Result<Vec<Column>, TrajectoryError> {
    let names = &trajectory.joint_names;
    if let Some(unknown) = names.iter().find(|name| !joints.contains(&name.as_str())) {
        return Err(TrajectoryError::JointUnknown { joint: unknown.clone() });
    }
    trajectory.check_unit_count()?;
    let mut columns = Vec::with_capacity(joints.len());
    for (place, &joint) in joints.iter().enumerate() {
        let mut matching = names.iter().enumerate().filter(|(_, name)| *name == joint);
        let Some((index, _)) = matching.next() else {
            return Err(TrajectoryError::JointMissing { joint: joint.to_owned() });
        };
        if matching.next().is_some() {
            return Err(TrajectoryError::JointRepeated { joint: joint.to_owned() });
        }
        let joint_type = joint_types.and_then(|types| types.get(place).copied());
        let factor = trajectory.unit(index).factor(joint, joint_type)?;
        columns.push(Column { index, factor });
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

fn check_rows(trajectory: &JointTrajectory, joints: usize) -> Result<(), TrajectoryError> {
    let interpolation = trajectory.interpolation;
    let (takes_velocity, takes_acceleration) =
        (interpolation.takes_velocity(), interpolation.takes_acceleration());
    let first = trajectory.waypoints.first();
    for (waypoint, rows) in trajectory.waypoints.iter().enumerate() {
        rows.check_lengths(waypoint, joints)?;
        let velocity: fn(&Waypoint) -> &[f64] = |rows| &rows.joint_velocity;
        let acceleration: fn(&Waypoint) -> &[f64] = |rows| &rows.joint_acceleration;
        for (field, row, is_taken) in [
            ("joint_velocity", velocity, takes_velocity),
            ("joint_acceleration", acceleration, takes_acceleration),
        ] {
            let is_empty = row(rows).is_empty();
            if !is_empty && !is_taken {
                return Err(TrajectoryError::RowNotTaken { waypoint, field, interpolation });
            }
            if first.is_some_and(|first| row(first).is_empty() != is_empty) {
                return Err(TrajectoryError::RowMixed { waypoint, field });
            }
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
    columns: &[Column],
    row: fn(&Waypoint) -> &[f64],
) -> Result<Vec<f64>, (usize, usize, f64)> {
    let mut rows = Vec::with_capacity(waypoints.len() * columns.len());
    for (waypoint, values) in waypoints.iter().map(row).enumerate() {
        for (joint, column) in columns.iter().enumerate() {
            let value = values.get(column.index).copied().unwrap_or(f64::NAN);
            if !value.is_finite() {
                return Err((waypoint, joint, value));
            }
            rows.push(value * column.factor);
        }
    }
    Ok(rows)
}

/// Refuses motion in the first and the last row, and makes what counts as rest exactly zero.
fn at_rest(mut rows: Vec<f64>, names: &[&str]) -> Result<Vec<f64>, TrajectoryError> {
    moving_end(&mut rows, names.len()).map_or(Ok(rows), |(waypoint, joint, value)| {
        Err(TrajectoryError::NotAtRest { waypoint, joint: name(names, joint), value })
    })
}

/// Makes what counts as rest in the first and the last row exactly zero; waypoint, joint and
/// velocity of what does not.
pub(super) fn moving_end(rows: &mut [f64], joints: usize) -> Option<(usize, usize, f64)> {
    let last = (rows.len() / joints).saturating_sub(1);
    for waypoint in [0, last] {
        let row = rows.iter_mut().skip(waypoint * joints).take(joints);
        for (joint, value) in row.enumerate() {
            if value.abs() > REST_TOLERANCE {
                return Some((waypoint, joint, *value));
            }
            *value = 0.0;
        }
    }
    None
}

pub(super) fn name(names: &[&str], joint: usize) -> String {
    names.get(joint).map(|&name| name.to_owned()).unwrap_or_default()
}
