//! What is asked of a jerk-limited motion, and why it is refused.

use super::axis::AxisPoint;
use crate::{JointVector, LimitedQuantity, MAX_JOINTS, MotionLimits, MotionState};
use serde::{Deserialize, Serialize};

/// Largest absolute value of any position, velocity and acceleration that is planned for. Beyond it
/// the solvers lose the digits that they need.
pub const MAX_ONLINE_VALUE: f64 = 1e6;

/// Position, velocity and acceleration of all joints at one instant, in the robot's joint order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OnlineState {
    /// Position of each joint \[rad or m\].
    pub position: JointVector,
    /// Velocity of each joint \[rad/s or m/s\].
    pub velocity: JointVector,
    /// Acceleration of each joint \[rad/s² or m/s²\].
    pub acceleration: JointVector,
}

/// How a jerk-limited motion shall be made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OnlineOptions {
    /// What the joints have to do with each other.
    pub synchronisation: Synchronisation,
    /// Time that the motion takes at least \[s\], zero for as fast as it can be.
    pub minimum_duration_s: f64,
}

/// What the joints of a motion have to do with each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Synchronisation {
    /// All joints arrive at the same time.
    #[default]
    Time,
    /// All joints move in proportion, on a straight line in joint space, wherever position
    /// differences, velocities and accelerations of start and target are in proportion (rest to
    /// rest always); elsewhere as [`Time`](Self::Time).
    Phase,
    /// Each joint arrives as early as it can, and stops there.
    None,
}

/// Why a jerk-limited motion is refused. Joints are counted from zero.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OnlineError {
    /// A vector does not have one value per joint.
    #[error("{field} has {len} values, expected one for each of {expected} joints")]
    JointCount {
        /// Which vector.
        field: &'static str,
        /// Number of its values.
        len: usize,
        /// Number of joints that have limits.
        expected: usize,
    },
    /// A value is not a number or too large to plan with.
    #[error("joint {joint}: {field} is {value}, expected a number within {MAX_ONLINE_VALUE}")]
    NotUsable {
        /// Which vector.
        field: &'static str,
        /// Index of the joint.
        joint: usize,
        /// The value.
        value: f64,
    },
    /// The least duration asked for is negative, too large or not a number.
    #[error("minimum duration is {value} s, expected 0 to {MAX_ONLINE_VALUE}")]
    MinimumDuration {
        /// The duration \[s\].
        value: f64,
    },
    /// The target breaks a limit, or cannot be reached or left without breaking it.
    #[error("joint {joint}: target {quantity} {value} is beyond the limit {limit}")]
    TargetBeyondLimit {
        /// Which limit.
        quantity: LimitedQuantity,
        /// Index of the joint.
        joint: usize,
        /// The target; or the velocity that its acceleration makes inevitable.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// The motion would leave the position limits on its way, or in the stop after it.
    #[error("joint {joint}: turns back only at {value}, beyond the limit {limit}")]
    OvershootBeyondLimit {
        /// Index of the joint.
        joint: usize,
        /// Where it would turn back.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// The generator found no profile, or one that was wrong. It is an error of rounding in rare
    /// states; the same target can be reached from a state a little later.
    #[error("joint {joint}: no profile found")]
    NoProfile {
        /// Index of the joint; zero if it is the joints' common duration that was not found.
        joint: usize,
    },
}

impl OnlineState {
    /// At rest at `position`.
    #[must_use]
    pub fn at_rest(position: JointVector) -> Self {
        let zero = position.map_indexed(|_, _| 0.0);
        Self { position, velocity: zero, acceleration: zero }
    }

    /// Whether no joint has a velocity or an acceleration.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.velocity.iter().chain(self.acceleration.iter()).all(|&value| value == 0.0)
    }

    /// Position and velocity.
    #[must_use]
    pub const fn motion_state(&self) -> MotionState {
        MotionState { position: self.position, velocity: self.velocity }
    }

    /// One joint of it; zero where a vector is too short, which a checked state is not.
    pub(super) fn axis(&self, joint: usize) -> AxisPoint {
        let value = |vector: &JointVector| vector.get(joint).copied().unwrap_or_default();
        AxisPoint {
            position: value(&self.position),
            velocity: value(&self.velocity),
            acceleration: value(&self.acceleration),
        }
    }

    /// The state whose joint `i` is `axis(i)`, for `len` joints.
    pub(super) fn from_axes(len: usize, axis: impl Fn(usize) -> AxisPoint) -> Self {
        let mut state = Self::at_rest(JointVector::zeros(len).unwrap_or_default());
        for joint in 0..len.min(MAX_JOINTS) {
            let point = axis(joint);
            state.position[joint] = point.position;
            state.velocity[joint] = point.velocity;
            state.acceleration[joint] = point.acceleration;
        }
        state
    }

    /// Refuses a state that cannot be planned with; `names` are told in this order.
    pub(super) fn check(
        &self,
        names: [&'static str; 3],
        expected: usize,
    ) -> Result<(), OnlineError> {
        let vectors = [&self.position, &self.velocity, &self.acceleration];
        for (field, vector) in names.into_iter().zip(vectors) {
            if vector.len() != expected {
                return Err(OnlineError::JointCount { field, len: vector.len(), expected });
            }
            let usable = |value: f64| value.abs() <= MAX_ONLINE_VALUE;
            if let Some((joint, &value)) = vector.iter().enumerate().find(|(_, v)| !usable(**v)) {
                return Err(OnlineError::NotUsable { field, joint, value });
            }
        }
        Ok(())
    }

    /// Refuses a target that breaks a limit, or that cannot be reached without breaking one: with
    /// an acceleration there must have been, or will be, a velocity beyond its own.
    pub(super) fn check_target(&self, limits: &MotionLimits) -> Result<(), OnlineError> {
        self.check(["target position", "target velocity", "target acceleration"], limits.len())?;
        for (joint, axis) in limits.iter().enumerate() {
            let AxisPoint { position, velocity, acceleration } = self.axis(joint);
            let refuse = |quantity, value, limit| {
                Err(OnlineError::TargetBeyondLimit { quantity, joint, value, limit })
            };
            if !axis.contains(position) {
                let limit = axis.nearer_limit(position);
                return refuse(LimitedQuantity::Position, position, limit);
            }
            if acceleration.abs() > axis.acceleration {
                return refuse(LimitedQuantity::Acceleration, acceleration, axis.acceleration);
            }
            let more = acceleration * acceleration / (2.0 * axis.jerk);
            let peak = velocity.abs() + more;
            if peak > axis.velocity {
                return refuse(LimitedQuantity::Velocity, peak.copysign(velocity), axis.velocity);
            }
        }
        Ok(())
    }
}
