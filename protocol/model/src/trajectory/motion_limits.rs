//! Limits that are complete enough to plan with.

use serde::{Deserialize, Serialize};
use std::ops::Deref;

use crate::{JointLimits, JointVector, MAX_JOINTS};

/// Limits of one driven joint, in its unit \[rad or m\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisLimits {
    /// Lowest position, minus infinity if there is none.
    pub lower: f64,
    /// Highest position, infinity if there is none.
    pub upper: f64,
    /// Highest speed \[1/s\], above zero.
    pub velocity: f64,
    /// Highest acceleration and deceleration \[1/s²\], above zero.
    pub acceleration: f64,
    /// Highest jerk \[1/s³\], above zero, for motions that promise to keep it. Where the robot's
    /// description gives none it is the acceleration divided by [`DEFAULT_JERK_TIME_S`].
    pub jerk: f64,
}

/// How long a joint without a jerk limit takes from rest to its full acceleration \[s\], when its
/// motion is limited in jerk. Short against a move of an arm, long against a control period.
pub const DEFAULT_JERK_TIME_S: f64 = 0.05;

/// Limits of all driven joints of a robot, in its joint order; one at least.
///
/// Unlike [`JointLimits`], which say what a robot's description happens to give, these are
/// complete: a joint without a limit of speed or of acceleration cannot be planned for.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MotionLimits {
    len: usize,
    axes: [AxisLimits; MAX_JOINTS],
}

/// Why limits are not complete or make no sense. Joints are counted from zero.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MotionLimitsError {
    /// There is no joint, or more than [`MAX_JOINTS`].
    #[error("{len} joints, expected 1 to {MAX_JOINTS}")]
    JointCount {
        /// Number of joints given.
        len: usize,
    },
    /// A driven joint has no acceleration limit.
    #[error("joint {joint}: acceleration limit is missing")]
    AccelerationMissing {
        /// Index of the joint.
        joint: usize,
    },
    /// A limit of speed or acceleration is not a finite number above zero.
    #[error("joint {joint}: {field} is {value}, expected a finite number above 0")]
    NotPositive {
        /// Index of the joint.
        joint: usize,
        /// Which limit.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// No position lies within the position limits.
    #[error("joint {joint}: lower limit {lower} is not below upper limit {upper}")]
    PositionRange {
        /// Index of the joint.
        joint: usize,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// A lower speed was asked for, for another number of joints.
    #[error("max_velocity has {len} values, expected one for each of {expected} joints")]
    VelocityCount {
        /// Number of values given.
        len: usize,
        /// Number of joints.
        expected: usize,
    },
    /// A speed was asked for that is above the limit.
    #[error("joint {joint}: max_velocity {value} is above the limit {limit}")]
    VelocityAboveLimit {
        /// Index of the joint.
        joint: usize,
        /// The speed asked for.
        value: f64,
        /// The joint's limit.
        limit: f64,
    },
}

impl AxisLimits {
    const UNUSED: Self =
        Self { lower: 0.0, upper: 0.0, velocity: 1.0, acceleration: 1.0, jerk: 1.0 };

    /// Whether `position` lies inside the position limits; not a number never does.
    #[must_use]
    pub fn contains(&self, position: f64) -> bool {
        self.lower <= position && position <= self.upper
    }

    /// The position limit that is nearer to `position`, which is the one it is beyond if any.
    #[must_use]
    pub fn nearer_limit(&self, position: f64) -> f64 {
        if position - self.lower < self.upper - position { self.lower } else { self.upper }
    }
}

impl MotionLimits {
    /// The limits of driven joints, from what the robot's description gives.
    ///
    /// # Errors
    /// [`MotionLimitsError::JointCount`] for no joint or more than [`MAX_JOINTS`],
    /// [`MotionLimitsError::AccelerationMissing`] if a joint has no acceleration limit,
    /// [`MotionLimitsError::NotPositive`] if a velocity or acceleration limit is not above zero,
    /// [`MotionLimitsError::PositionRange`] if lower and upper limit are not in this order.
    pub fn new(limits: &[JointLimits]) -> Result<Self, MotionLimitsError> {
        let len = limits.len();
        if len == 0 || len > MAX_JOINTS {
            return Err(MotionLimitsError::JointCount { len });
        }
        let mut axes = [AxisLimits::UNUSED; MAX_JOINTS];
        for (joint, (axis, limits)) in axes.iter_mut().zip(limits).enumerate() {
            *axis = complete(joint, limits)?;
        }
        Ok(Self { len, axes })
    }

    /// These limits with lower speeds, as asked for by a person for one motion.
    ///
    /// # Errors
    /// [`MotionLimitsError::VelocityCount`] if there is not one value per joint,
    /// [`MotionLimitsError::NotPositive`] if a value is not above zero,
    /// [`MotionLimitsError::VelocityAboveLimit`] if a value is above the joint's limit.
    pub fn with_max_velocity(&self, max_velocity: &JointVector) -> Result<Self, MotionLimitsError> {
        let (len, expected) = (max_velocity.len(), self.len);
        if len != expected {
            return Err(MotionLimitsError::VelocityCount { len, expected });
        }
        let mut slower = *self;
        for (joint, (axis, &value)) in slower.axes.iter_mut().zip(max_velocity.iter()).enumerate() {
            let limit = axis.velocity;
            if value > limit {
                return Err(MotionLimitsError::VelocityAboveLimit { joint, value, limit });
            }
            axis.velocity = positive(joint, "max_velocity", value)?;
        }
        Ok(slower)
    }

    /// These limits with the `share` of each speed, above 0 and up to 1; what is above counts as 1.
    #[must_use]
    pub fn slowed(&self, share: f64) -> Self {
        debug_assert!(share > 0.0, "{share} of a speed is none");
        let mut slower = *self;
        for axis in &mut slower.axes {
            axis.velocity *= share.min(1.0);
        }
        slower
    }
}

impl Deref for MotionLimits {
    type Target = [AxisLimits];

    fn deref(&self) -> &[AxisLimits] {
        &self.axes[..self.len]
    }
}

impl std::fmt::Debug for MotionLimits {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

fn complete(joint: usize, limits: &JointLimits) -> Result<AxisLimits, MotionLimitsError> {
    let lower = limits.lower.unwrap_or(f64::NEG_INFINITY);
    let upper = limits.upper.unwrap_or(f64::INFINITY);
    // Written so that not a number is refused as well.
    let ordered = lower < upper;
    if !ordered {
        return Err(MotionLimitsError::PositionRange { joint, lower, upper });
    }
    let acceleration =
        limits.acceleration.ok_or(MotionLimitsError::AccelerationMissing { joint })?;
    let acceleration = positive(joint, "acceleration limit", acceleration)?;
    let jerk = limits.jerk.unwrap_or(acceleration / DEFAULT_JERK_TIME_S);
    Ok(AxisLimits {
        lower,
        upper,
        velocity: positive(joint, "velocity limit", limits.velocity)?,
        acceleration,
        jerk: positive(joint, "jerk limit", jerk)?,
    })
}

fn positive(joint: usize, field: &'static str, value: f64) -> Result<f64, MotionLimitsError> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(MotionLimitsError::NotPositive { joint, field, value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint() -> JointLimits {
        JointLimits {
            lower: Some(-1.0),
            upper: Some(1.0),
            velocity: 2.0,
            acceleration: Some(4.0),
            jerk: None,
            effort: None,
        }
    }

    fn refusal(limits: JointLimits) -> String {
        MotionLimits::new(&[joint(), limits]).expect_err("limits are wrong").to_string()
    }

    #[test]
    fn a_continuous_joint_has_infinite_position_limits() {
        let limits = JointLimits { lower: None, upper: None, ..joint() };
        let limits = MotionLimits::new(&[limits]).expect("complete");
        assert_eq!((limits[0].lower, limits[0].upper), (f64::NEG_INFINITY, f64::INFINITY));
        assert!(limits[0].contains(1e9) && !limits[0].contains(f64::NAN));
    }

    #[test]
    fn each_incomplete_or_senseless_limit_is_refused() {
        assert_eq!(
            refusal(JointLimits { acceleration: None, ..joint() }),
            "joint 1: acceleration limit is missing"
        );
        assert_eq!(
            refusal(JointLimits { acceleration: Some(f64::INFINITY), ..joint() }),
            "joint 1: acceleration limit is inf, expected a finite number above 0"
        );
        assert_eq!(
            refusal(JointLimits { velocity: 0.0, ..joint() }),
            "joint 1: velocity limit is 0, expected a finite number above 0"
        );
        assert_eq!(
            refusal(JointLimits { lower: Some(1.0), ..joint() }),
            "joint 1: lower limit 1 is not below upper limit 1"
        );
        assert_eq!(
            refusal(JointLimits { upper: Some(f64::NAN), ..joint() }),
            "joint 1: lower limit -1 is not below upper limit NaN"
        );
    }

    #[test]
    fn a_jerk_limit_is_taken_and_otherwise_follows_from_the_acceleration() {
        let given = JointLimits { jerk: Some(100.0), ..joint() };
        let limits = MotionLimits::new(&[joint(), given]).expect("complete");
        assert_eq!([limits[0].jerk, limits[1].jerk], [4.0 / 0.05, 100.0]);
        assert_eq!(
            refusal(JointLimits { jerk: Some(0.0), ..joint() }),
            "joint 1: jerk limit is 0, expected a finite number above 0"
        );
    }

    #[test]
    fn no_joint_and_seventeen_joints_are_refused() {
        let error = MotionLimits::new(&[]).expect_err("no joint");
        assert_eq!(error.to_string(), "0 joints, expected 1 to 16");
        assert_eq!(
            MotionLimits::new(&[joint(); 17]),
            Err(MotionLimitsError::JointCount { len: 17 })
        );
    }

    #[test]
    fn a_lower_speed_is_taken_and_a_higher_refused() {
        let limits = MotionLimits::new(&[joint(), joint()]).expect("complete");
        let ask = |values: &[f64]| {
            limits.with_max_velocity(&JointVector::from_slice(values).expect("short and finite"))
        };
        let slower = ask(&[2.0, 0.5]).expect("within the limits");
        assert_eq!([slower[0].velocity, slower[1].velocity], [2.0, 0.5]);
        let text = |values: &[f64]| ask(values).expect_err("refused").to_string();
        assert_eq!(text(&[2.0, 2.1]), "joint 1: max_velocity 2.1 is above the limit 2");
        assert_eq!(
            text(&[-50.0, 2.0]),
            "joint 0: max_velocity is -50, expected a finite number above 0"
        );
        assert_eq!(text(&[1.0]), "max_velocity has 1 values, expected one for each of 2 joints");
    }
}
