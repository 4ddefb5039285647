//! Motion of all joints of a robot to rest at a target.

use super::motion_limits::{AxisLimits, MotionLimits};
use super::profile::{AxisProfile, AxisState, ProfileError};
use super::validate::LIMIT_TOLERANCE;
use crate::{JointVector, MAX_JOINTS};
use serde::{Deserialize, Serialize};

/// Position and velocity of all joints at one instant, in the robot's joint order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionState {
    /// Position of each joint \[rad or m\].
    pub position: JointVector,
    /// Velocity of each joint \[rad/s or m/s\].
    pub velocity: JointVector,
}

/// A motion of all joints from a state to rest at a target, inside all limits.
///
/// From rest it goes straight in joint space, as fast as the joint allows that is slowest on this
/// line. From motion each joint goes its fastest way by itself.
///
/// To change the target on the way, plan again from [`at`](Self::at) the time of the last
/// set-point: the curve then has continuous velocity, and the set-points stay legal as the
/// module's head says. The difference of the last two set-points will not do, it is the velocity
/// half a period earlier.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointMove {
    len: usize,
    axes: [AxisProfile; MAX_JOINTS],
    duration_s: f64,
}

/// Why a move is refused. Joints are counted from zero.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum JointMoveError {
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
    /// The target lies outside the position limits.
    #[error("joint {joint}: target {value} is beyond the limit {limit}")]
    TargetBeyondLimit {
        /// Index of the joint.
        joint: usize,
        /// The target.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// The joint is too fast to stay inside the position limits.
    #[error("joint {joint}: turns back only at {value}, beyond the limit {limit}")]
    OvershootBeyondLimit {
        /// Index of the joint.
        joint: usize,
        /// Where it would turn back.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// A joint has no profile.
    #[error("joint {joint}: {source}")]
    Profile {
        /// Index of the joint.
        joint: usize,
        /// Why.
        source: ProfileError,
    },
}

impl JointMove {
    /// The motion from `start` to rest at `target`. A start outside the position limits is taken,
    /// so that an arm that was pushed there can be driven back, but it never goes further out.
    ///
    /// # Errors
    /// [`JointMoveError::JointCount`] if a vector does not have one value per joint,
    /// [`JointMoveError::TargetBeyondLimit`] if the target breaks a position limit,
    /// [`JointMoveError::OvershootBeyondLimit`] if a joint cannot brake before a position limit,
    /// [`JointMoveError::Profile`] if a value is not finite.
    pub fn plan(
        start: &MotionState,
        target: &JointVector,
        limits: &MotionLimits,
    ) -> Result<Self, JointMoveError> {
        let expected = limits.len();
        let vectors = [
            ("start position", &start.position),
            ("start velocity", &start.velocity),
            ("target", target),
        ];
        for (field, vector) in vectors {
            check_vector(field, vector, expected)?;
        }
        let at_rest = start.velocity.iter().all(|&v| v == 0.0);
        let line = straight_line(&start.position, target, limits);
        let mut axes = [AxisProfile::resting(0.0); MAX_JOINTS];
        let mut duration_s = 0.0_f64;
        for (joint, (profile, axis)) in axes.iter_mut().zip(limits.iter()).enumerate() {
            let from =
                AxisState { position: start.position[joint], velocity: start.velocity[joint] };
            let planned = if at_rest {
                line.map(|line| line.stretched(from.position, target[joint]))
            } else {
                AxisProfile::plan(from, target[joint], axis)
            };
            *profile = planned.map_err(|source| JointMoveError::Profile { joint, source })?;
            check_range(joint, profile, axis)?;
            duration_s = duration_s.max(profile.duration_s());
        }
        Ok(Self { len: expected, axes, duration_s })
    }

    /// How long the slowest joint takes \[s\].
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Where the motion ends.
    #[must_use]
    pub fn target(&self) -> JointVector {
        self.each(AxisProfile::target)
    }

    /// The state at `t_s` \[s since the start\]: the start before zero, at rest at exactly the
    /// target from the duration on.
    #[must_use]
    pub fn at(&self, t_s: f64) -> MotionState {
        let mut velocity = self.each(|_| 0.0);
        let mut position = velocity;
        let values = position.iter_mut().zip(velocity.iter_mut());
        for ((x, v), axis) in values.zip(&self.axes) {
            let state = axis.at(t_s);
            (*x, *v) = (state.position, state.velocity);
        }
        MotionState { position, velocity }
    }

    /// The profile of each joint.
    pub(crate) fn axes(&self) -> &[AxisProfile] {
        &self.axes[..self.len]
    }

    fn each(&self, value: impl Fn(&AxisProfile) -> f64) -> JointVector {
        let zeros = JointVector::zeros(self.len).unwrap_or_default();
        zeros.map_indexed(|joint, _| value(&self.axes[joint]))
    }
}

/// The fastest motion along the line from `from` to `to`, as a profile of the covered share, from
/// 0 to 1. Each joint covers it at its own distance, so the limits of the share are the lowest of
/// the joints' limits divided by their distances.
fn straight_line(
    from: &JointVector,
    to: &JointVector,
    limits: &MotionLimits,
) -> Result<AxisProfile, ProfileError> {
    // Finite, so that a line without length has a duration: some 1e-150 s.
    const UNLIMITED: f64 = 1e300;
    let mut share = AxisLimits {
        lower: 0.0,
        upper: 1.0,
        velocity: UNLIMITED,
        acceleration: UNLIMITED,
        jerk: UNLIMITED,
    };
    for ((from, to), axis) in from.iter().zip(to.iter()).zip(limits.iter()) {
        let distance = (to - from).abs();
        share.velocity = share.velocity.min(axis.velocity / distance);
        share.acceleration = share.acceleration.min(axis.acceleration / distance);
    }
    AxisProfile::plan(AxisState::default(), 1.0, &share)
}

fn check_vector(
    field: &'static str,
    vector: &JointVector,
    expected: usize,
) -> Result<(), JointMoveError> {
    if vector.len() != expected {
        return Err(JointMoveError::JointCount { field, len: vector.len(), expected });
    }
    match vector.iter().enumerate().find(|(_, value)| !value.is_finite()) {
        Some((joint, &value)) => {
            let source = ProfileError::NotFinite { field, value };
            Err(JointMoveError::Profile { joint, source })
        }
        None => Ok(()),
    }
}

fn check_range(
    joint: usize,
    profile: &AxisProfile,
    limits: &AxisLimits,
) -> Result<(), JointMoveError> {
    let target = profile.target();
    if !limits.contains(target) {
        let limit = limits.nearer_limit(target);
        return Err(JointMoveError::TargetBeyondLimit { joint, value: target, limit });
    }
    let start = profile.at(0.0).position;
    let (low, high) = profile.range();
    for (value, limit, beyond) in [
        (low, limits.lower, limits.lower.min(start) - low),
        (high, limits.upper, high - limits.upper.max(start)),
    ] {
        if beyond > LIMIT_TOLERANCE {
            return Err(JointMoveError::OvershootBeyondLimit { joint, value, limit });
        }
    }
    Ok(())
}
