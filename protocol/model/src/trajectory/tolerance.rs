//! How far a robot may be from its set-points.

use super::error::TrajectoryError;
use super::validate::{Column, name};
use super::waypoints::Waypoint;
use serde::{Deserialize, Serialize};

/// How far the robot may be from the set-points of a trajectory. A slice holds one value per joint,
/// in the robot's joint order, or nothing if the trajectory does not ask for anything.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tolerance<'a> {
    /// Largest distance of positions \[rad or m\].
    pub position: &'a [f64],
    /// Largest difference of velocities \[rad/s or m/s\].
    pub velocity: &'a [f64],
}

/// Tolerances of all waypoints.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Tolerances {
    joints: usize,
    /// A row per waypoint, of zeros if it has none; empty if no waypoint has any.
    position: Vec<f64>,
    velocity: Vec<f64>,
}

impl Tolerances {
    pub(super) fn new(
        waypoints: &[Waypoint],
        columns: &[Column],
        names: &[&str],
    ) -> Result<Self, TrajectoryError> {
        let rows = |field, row: fn(&Waypoint) -> &[f64]| {
            gather(waypoints, columns, row).map_err(|(waypoint, joint, value)| {
                TrajectoryError::NotPositive { waypoint, field, joint: name(names, joint), value }
            })
        };
        let position = rows("position_tolerance", |waypoint| &waypoint.position_tolerance)?;
        let velocity = rows("velocity_tolerance", |waypoint| &waypoint.velocity_tolerance)?;
        Ok(Self { joints: columns.len(), position, velocity })
    }

    pub(super) const fn has_velocity(&self) -> bool {
        !self.velocity.is_empty()
    }

    pub(super) fn at(&self, waypoint: usize) -> Tolerance<'_> {
        Tolerance {
            position: row(&self.position, self.joints, waypoint),
            velocity: row(&self.velocity, self.joints, waypoint),
        }
    }
}

/// The row of a waypoint; nothing if it has none.
fn row(rows: &[f64], joints: usize, waypoint: usize) -> &[f64] {
    let start = waypoint.saturating_mul(joints);
    let row = rows.get(start..start.saturating_add(joints)).unwrap_or_default();
    if row.first().is_some_and(|&first| first > 0.0) { row } else { &[] }
}

/// All rows one after the other, of zeros where there is none, and nothing if there is none at all;
/// or waypoint, joint and value of what is not a finite number above zero.
fn gather(
    waypoints: &[Waypoint],
    columns: &[Column],
    row: fn(&Waypoint) -> &[f64],
) -> Result<Vec<f64>, (usize, usize, f64)> {
    if waypoints.iter().all(|waypoint| row(waypoint).is_empty()) {
        return Ok(Vec::new());
    }
    let mut rows = Vec::with_capacity(waypoints.len() * columns.len());
    for (waypoint, values) in waypoints.iter().map(row).enumerate() {
        for (joint, column) in columns.iter().enumerate() {
            let Some(&value) = values.get(column.index) else {
                rows.push(0.0);
                continue;
            };
            // In nanoticks even the smallest number becomes zero, so the product is looked at.
            let own = value * column.factor;
            if !(own.is_finite() && own > 0.0) {
                return Err((waypoint, joint, value));
            }
            rows.push(own);
        }
    }
    Ok(rows)
}
