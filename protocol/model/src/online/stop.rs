//! The jerk-limited stop of all joints.

use super::axis::AxisMotion;
use super::jerk_limited::JerkLimitedMove;
use super::request::{OnlineError, OnlineState};
use crate::{JointVector, MotionLimits};
use serde::{Deserialize, Serialize};

/// The least-time stop of all joints from any state, each by itself, with limited acceleration and
/// jerk. It is a closed form and never fails for a state of finite numbers.
///
/// It keeps the position limits where that is possible: a joint whose least-time stop would leave
/// them brakes longer, turns back and comes to rest from the other side, with the smallest turn
/// that keeps it inside; one that cannot stay inside leaves them as little as possible. A state
/// outside the limits of velocity and acceleration is taken, as
/// [`JerkLimitedMove`] says. It does not stay on the path that the joints were on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JerkLimitedStop {
    motion: JerkLimitedMove,
}

impl JerkLimitedStop {
    /// The stop from `state`.
    ///
    /// # Errors
    /// [`OnlineError::JointCount`] if a vector does not have one value per joint,
    /// [`OnlineError::NotUsable`] if a value is not a number or above
    /// [`MAX_ONLINE_VALUE`](super::MAX_ONLINE_VALUE).
    pub fn plan(state: &OnlineState, limits: &MotionLimits) -> Result<Self, OnlineError> {
        state.check(["start position", "start velocity", "start acceleration"], limits.len())?;
        Ok(Self { motion: JerkLimitedMove::stop(state, limits) })
    }

    /// When all joints are at rest \[s\].
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.motion.duration_s()
    }

    /// Where the joints come to rest \[rad or m\].
    #[must_use]
    pub fn stop_position(&self) -> JointVector {
        self.motion.rest_position()
    }

    /// The state at `t_s` \[s\]: at rest at exactly the stop position from the duration on.
    #[must_use]
    pub fn at(&self, t_s: f64) -> OnlineState {
        self.motion.at(t_s)
    }

    /// Lowest and highest position of each joint on the way \[rad or m\], exactly.
    #[must_use]
    pub fn position_extrema(&self) -> (JointVector, JointVector) {
        self.motion.position_extrema()
    }

    /// The joint that leaves its position limits furthest, or goes further out than it is already,
    /// and by how much \[rad or m\]; `None` if all stay inside.
    #[must_use]
    pub fn overshoot(&self, limits: &MotionLimits) -> Option<(usize, f64)> {
        let beyond = |axis: &AxisMotion, joint: usize| {
            limits[joint].excess(axis.position_range(), axis.at(0.0).position)
        };
        let axes = self.motion.axes().iter().take(limits.len()).enumerate();
        axes.map(|(joint, axis)| (joint, beyond(axis, joint)))
            .filter(|&(_, excess)| excess > 0.0)
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }
}
