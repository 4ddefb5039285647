//! Moving at a wanted joint velocity: what jogs and streams of velocities have in common.

use armada_model::{JointVector, MotionLimits, OnlineState};

/// Joints on their way to wanted velocities, with limited jerk; the one way to move like that.
///
/// It begins in any state and is told at each tick what is wanted now. Every joint goes there by
/// itself in the least time and slows down before its position limits, where it rests for as long
/// as it is told to go on; see [`OnlineState::toward_velocity`].
#[derive(Clone, Debug, PartialEq)]
pub(in crate::control) struct SpeedFollower {
    state: OnlineState,
}

impl SpeedFollower {
    /// Goes on from `state`.
    pub(in crate::control) const fn new(state: &OnlineState) -> Self {
        Self { state: *state }
    }

    /// One period of `period_s` \[s\] towards the velocities `target` \[1/s\]; one above its limit
    /// counts as the limit, one that is missing as zero.
    pub(in crate::control) fn tick(
        &mut self,
        target: &JointVector,
        limits: &MotionLimits,
        period_s: f64,
    ) -> OnlineState {
        self.state = self.state.toward_velocity(target, limits, period_s);
        self.state
    }

    /// The state of the last tick.
    pub(in crate::control) const fn state(&self) -> &OnlineState {
        &self.state
    }

    /// Whether no joint has a velocity or an acceleration.
    pub(in crate::control) fn is_at_rest(&self) -> bool {
        self.state.is_at_rest()
    }
}
