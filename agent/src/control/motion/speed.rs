//! Moving at a wanted joint velocity: what jogs and streams of velocities have in common.

use armada_model::{JointVector, MotionLimits, OnlineState};
use serde::{Deserialize, Serialize};

/// Joints on their way to wanted velocities, with limited jerk; the one way to move like that.
///
/// It begins in any state and is told at each tick what is wanted now. Every joint goes there by
/// itself in the least time and slows down before its position limits, where it rests for as long
/// as it is told to go on; see [`OnlineState::toward_velocity`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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

    /// As [`tick`](Self::tick), but the joints of each group as one body: they change their
    /// velocities in proportion, and what limits one holds up its group; see
    /// [`OnlineState::toward_velocity_together`]. Joints of no group are by themselves.
    pub(in crate::control) fn tick_together<'a>(
        &mut self,
        target: &JointVector,
        groups: impl Iterator<Item = &'a [usize]>,
        limits: &MotionLimits,
        period_s: f64,
    ) -> OnlineState {
        let before = self.state;
        self.state = before.toward_velocity(target, limits, period_s);
        for group in groups {
            let next = before.toward_velocity_together(target, group, limits, period_s);
            for &joint in group {
                copy_joint(&mut self.state, &next, joint);
            }
        }
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

fn copy_joint(to: &mut OnlineState, from: &OnlineState, joint: usize) {
    let vectors = [
        (&mut to.position, &from.position),
        (&mut to.velocity, &from.velocity),
        (&mut to.acceleration, &from.acceleration),
    ];
    for (to, from) in vectors {
        if let (Some(to), Some(from)) = (to.get_mut(joint), from.get(joint)) {
            *to = *from;
        }
    }
}
