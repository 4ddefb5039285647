//! Units a trajectory's numbers may be in.

use std::f64::consts::PI;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::error::TrajectoryError;
use crate::JointType;

/// Ticks per metre and per revolution.
const TICKS: f64 = 1_048_576.0;
/// Nanoticks per tick.
const NANO: f64 = 1e9;

/// Unit of one joint's numbers in a [`JointTrajectory`](super::JointTrajectory): of its positions
/// and position tolerances, per second of velocities, per second squared of accelerations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointUnit {
    /// The joint's own: \[rad\] if it turns, \[m\] if it slides.
    #[default]
    Implicit,
    /// Radians, of a joint that turns.
    Radian,
    /// Degrees, of a joint that turns.
    Degree,
    /// Metres, of a joint that slides.
    Meter,
    /// Revolutions / 2²⁰, of a joint that turns.
    TicksRot,
    /// Revolutions / 2²⁰ / 10⁹, of a joint that turns.
    NanoticksRot,
    /// Metres / 2²⁰, of a joint that slides.
    TicksLin,
    /// Metres / 2²⁰ / 10⁹, of a joint that slides.
    NanoticksLin,
}

impl JointUnit {
    /// What one of this unit is in the joint's own \[rad or m\].
    #[must_use]
    pub const fn to_si(self) -> f64 {
        match self {
            Self::Implicit | Self::Radian | Self::Meter => 1.0,
            Self::Degree => PI / 180.0,
            Self::TicksRot => 2.0 * PI / TICKS,
            Self::NanoticksRot => 2.0 * PI / TICKS / NANO,
            Self::TicksLin => 1.0 / TICKS,
            Self::NanoticksLin => 1.0 / TICKS / NANO,
        }
    }

    /// Whether a joint of this type can have this unit.
    #[must_use]
    pub const fn fits(self, joint_type: JointType) -> bool {
        let slides = matches!(joint_type, JointType::Prismatic);
        match self {
            Self::Implicit => true,
            Self::Radian | Self::Degree | Self::TicksRot | Self::NanoticksRot => !slides,
            Self::Meter | Self::TicksLin | Self::NanoticksLin => slides,
        }
    }

    /// [`to_si`](Self::to_si) if the unit fits `joint`. Of a joint whose type is not known only
    /// what needs no conversion is taken.
    pub(super) fn factor(
        self,
        joint: &str,
        joint_type: Option<JointType>,
    ) -> Result<f64, TrajectoryError> {
        match joint_type {
            Some(joint_type) if !self.fits(joint_type) => {
                let joint = joint.to_owned();
                Err(TrajectoryError::UnitMismatch { joint, unit: self, joint_type })
            }
            None if !matches!(self, Self::Implicit | Self::Radian | Self::Meter) => {
                Err(TrajectoryError::UnitUnknownType { joint: joint.to_owned(), unit: self })
            }
            _ => Ok(self.to_si()),
        }
    }
}

impl fmt::Display for JointUnit {
    /// The name it has on the wire.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Implicit => "implicit",
            Self::Radian => "radian",
            Self::Degree => "degree",
            Self::Meter => "meter",
            Self::TicksRot => "ticks_rot",
            Self::NanoticksRot => "nanoticks_rot",
            Self::TicksLin => "ticks_lin",
            Self::NanoticksLin => "nanoticks_lin",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [JointUnit; 8] = [
        JointUnit::Implicit,
        JointUnit::Radian,
        JointUnit::Degree,
        JointUnit::Meter,
        JointUnit::TicksRot,
        JointUnit::NanoticksRot,
        JointUnit::TicksLin,
        JointUnit::NanoticksLin,
    ];

    #[test]
    fn a_half_turn_is_pi_in_every_unit_that_turns() {
        for (half_turn, unit) in [
            (PI, JointUnit::Radian),
            (180.0, JointUnit::Degree),
            (524_288.0, JointUnit::TicksRot),
            (524_288e9, JointUnit::NanoticksRot),
        ] {
            assert!((half_turn * unit.to_si() - PI).abs() < 1e-15, "{unit}");
        }
    }

    #[test]
    fn a_metre_is_one_in_every_unit_that_slides() {
        for (metre, unit) in [
            (1.0, JointUnit::Meter),
            (1_048_576.0, JointUnit::TicksLin),
            (1_048_576e9, JointUnit::NanoticksLin),
        ] {
            assert!((metre * unit.to_si() - 1.0).abs() < 1e-15, "{unit}");
        }
    }

    #[test]
    fn a_unit_fits_joints_that_turn_or_joints_that_slide() {
        let fitting = |joint_type| ALL.map(|unit| unit.fits(joint_type));
        let turns = [true, true, true, false, true, true, false, false];
        assert_eq!(fitting(JointType::Revolute), turns);
        assert_eq!(fitting(JointType::Continuous), turns);
        assert_eq!(
            fitting(JointType::Prismatic),
            [true, false, false, true, false, false, true, true]
        );
    }

    #[test]
    fn a_unit_is_shown_as_it_is_written() {
        for unit in ALL {
            let text = serde_json::to_string(&unit).expect("a name");
            assert_eq!(text, format!("\"{unit}\""));
            assert_eq!(serde_json::from_str::<JointUnit>(&text).expect("decodes"), unit);
        }
    }
}
