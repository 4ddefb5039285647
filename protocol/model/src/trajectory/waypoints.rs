//! A trajectory as it is asked for: the payload.

use serde::{Deserialize, Serialize};

use super::error::TrajectoryError;
use super::units::JointUnit;
use crate::JointType;

/// Positions to pass at given times; `joint_names` gives the order of every row.
///
/// It may name the joints of several robots. Nothing is checked before
/// [`CompiledTrajectory::compile`](super::CompiledTrajectory::compile) but what the types say.
/// Nothing in it is ever ignored: what its interpolation cannot honour is refused by name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointTrajectory {
    /// Names of the joints, one per column of the waypoints.
    pub joint_names: Vec<String>,
    /// Unit of each column, in the order of `joint_names`; empty if all are implicit.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint_units: Vec<JointUnit>,
    /// What to pass, in the order of time.
    pub waypoints: Vec<Waypoint>,
    /// How to move between the waypoints.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// Where all joints are at one time. Every row is in the order of `joint_names`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waypoint {
    /// Time since the start of the trajectory \[s\]; zero at the first waypoint.
    pub time_from_start_s: f64,
    /// Positions \[rad or m, if `joint_units` does not say otherwise\].
    pub joint_position: Vec<f64>,
    /// Velocities \[1/s\]; either every waypoint has them or none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint_velocity: Vec<f64>,
    /// Accelerations \[1/s²\], only for [`Interpolation::QuinticHermite`]; either every waypoint
    /// has them or none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint_acceleration: Vec<f64>,
    /// How far the robot may be from the set-point, above zero; empty if the waypoint asks for
    /// nothing. It holds from this waypoint's time until the next one's, at the last waypoint from
    /// the end on. [`Interpolation::JointLinear`] itself passes the waypoint within it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub position_tolerance: Vec<f64>,
    /// How far the robot's velocity may be from the set-point's \[1/s\], above zero; empty if the
    /// waypoint asks for nothing. It holds as long as `position_tolerance`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub velocity_tolerance: Vec<f64>,
}

/// How to move between waypoints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// A cubic polynomial per joint between two waypoints. With velocities given: the one that
    /// has them at both ends (Hermite), so acceleration may jump at a waypoint. Without: the
    /// spline with continuous acceleration that starts and ends at rest (clamped), where
    /// acceleration jumps only at the ends.
    #[default]
    CubicSpline,
    /// The cubic spline with continuous acceleration that is zero at both ends (natural). Its
    /// velocity at the ends follows from the waypoints and is zero only by chance, so it is for
    /// motions that something else begins and ends: see [`Ends`](super::Ends). Takes no velocities.
    CubicSplineNatural,
    /// Straight lines in joint space at constant velocity, timed so that each line, continued,
    /// passes its waypoints at their times; at each waypoint a blend at constant acceleration. A
    /// blend is one parabola for all joints, as short as the acceleration limit of one of them
    /// allows, but [`MIN_BLEND_S`](super::MIN_BLEND_S) long at least. Inner waypoints are therefore
    /// passed at a distance, a share of 1/8 of change of velocity times length of the blend; the
    /// outer ones exactly. Takes no velocities; starts and ends at rest.
    JointLinear,
    /// A polynomial of fifth degree per joint between two waypoints, with continuous acceleration.
    /// Velocities that are not given are those of the clamped cubic spline. Accelerations that are
    /// not given are zero at both ends, and at an inner waypoint the mean of what the cubics with
    /// these velocities have on either side (for the spline: its acceleration).
    QuinticHermite,
}

impl JointTrajectory {
    /// The trajectory of some of the joints: column `columns[i]` here becomes column `i` there,
    /// under the name `names[i]`. This splits a trajectory of several robots.
    ///
    /// # Errors
    /// [`TrajectoryError::ColumnNames`] if there is not one name per column,
    /// [`TrajectoryError::ColumnUnknown`] if a column does not exist,
    /// [`TrajectoryError::UnitCount`] if there are units, but not one per joint,
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
        self.check_unit_count()?;
        let mut waypoints = Vec::with_capacity(self.waypoints.len());
        for (index, waypoint) in self.waypoints.iter().enumerate() {
            waypoint.check_lengths(index, joints)?;
            waypoints.push(waypoint.map_rows(|row| pick(row, columns)));
        }
        let joint_units = pick(&self.joint_units, columns);
        Ok(Self { joint_names: names, joint_units, waypoints, interpolation: self.interpolation })
    }

    /// The same motion in each joint's own unit \[rad or m\], without `joint_units`. `joint_types`
    /// says how each joint of `joint_names` moves, in its order.
    ///
    /// # Errors
    /// [`TrajectoryError::TypeCount`] if there is not one type per joint,
    /// [`TrajectoryError::UnitCount`] if there are units, but not one per joint,
    /// [`TrajectoryError::UnitMismatch`] if a unit does not fit its joint,
    /// [`TrajectoryError::RowLength`] if a row does not have one value per joint.
    pub fn to_si(&self, joint_types: &[JointType]) -> Result<Self, TrajectoryError> {
        let (joints, types) = (self.joint_names.len(), joint_types.len());
        if joints != types {
            return Err(TrajectoryError::TypeCount { joints, types });
        }
        self.check_unit_count()?;
        let mut factors = Vec::with_capacity(joints);
        for (column, (name, &joint_type)) in self.joint_names.iter().zip(joint_types).enumerate() {
            factors.push(self.unit(column).factor(name, Some(joint_type))?);
        }
        let mut waypoints = Vec::with_capacity(self.waypoints.len());
        for (index, waypoint) in self.waypoints.iter().enumerate() {
            waypoint.check_lengths(index, joints)?;
            waypoints.push(waypoint.map_rows(|row| {
                row.iter().zip(&factors).map(|(value, factor)| value * factor).collect()
            }));
        }
        Ok(Self {
            joint_names: self.joint_names.clone(),
            joint_units: Vec::new(),
            waypoints,
            interpolation: self.interpolation,
        })
    }

    /// Unit of a column.
    pub(super) fn unit(&self, column: usize) -> JointUnit {
        self.joint_units.get(column).copied().unwrap_or_default()
    }

    pub(super) const fn check_unit_count(&self) -> Result<(), TrajectoryError> {
        let (len, joints) = (self.joint_units.len(), self.joint_names.len());
        if len != 0 && len != joints {
            return Err(TrajectoryError::UnitCount { len, joints });
        }
        Ok(())
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
        for (field, row) in [
            ("joint_velocity", &self.joint_velocity),
            ("joint_acceleration", &self.joint_acceleration),
            ("position_tolerance", &self.position_tolerance),
            ("velocity_tolerance", &self.velocity_tolerance),
        ] {
            if !row.is_empty() && row.len() != expected {
                return refuse(field, row.len());
            }
        }
        Ok(())
    }

    fn map_rows(&self, f: impl Fn(&[f64]) -> Vec<f64>) -> Self {
        Self {
            time_from_start_s: self.time_from_start_s,
            joint_position: f(&self.joint_position),
            joint_velocity: f(&self.joint_velocity),
            joint_acceleration: f(&self.joint_acceleration),
            position_tolerance: f(&self.position_tolerance),
            velocity_tolerance: f(&self.velocity_tolerance),
        }
    }
}

impl Interpolation {
    /// Whether waypoints may have `joint_velocity`.
    pub(super) const fn takes_velocity(self) -> bool {
        matches!(self, Self::CubicSpline | Self::QuinticHermite)
    }

    /// Whether waypoints may have `joint_acceleration`.
    pub(super) const fn takes_acceleration(self) -> bool {
        matches!(self, Self::QuinticHermite)
    }
}

impl std::fmt::Display for Interpolation {
    /// The name it has on the wire.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::CubicSpline => "cubic_spline",
            Self::CubicSplineNatural => "cubic_spline_natural",
            Self::JointLinear => "joint_linear",
            Self::QuinticHermite => "quintic_hermite",
        })
    }
}

/// The elements at `columns`; nothing of an empty row.
fn pick<T: Copy>(row: &[T], columns: &[usize]) -> Vec<T> {
    columns.iter().filter_map(|&column| row.get(column).copied()).collect()
}
