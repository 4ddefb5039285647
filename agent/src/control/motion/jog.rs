//! Moves of all joints to a position.
//!
//! A jog may be given another goal on the way: the old motion ends as cancelled, and the new one
//! begins in the state of the old one's curve at the last tick, so that velocity is continuous.

use armada_model::{
    JointMove, JointMoveError, JointVector, MotionLimits, MotionLimitsError, MotionState,
};

use super::Next;
use crate::control::io::{JogOrder, Refusal};

/// A move of all joints to a position, on its way.
#[derive(Clone, Debug)]
pub(in crate::control) struct JogMotion {
    plan: JointMove,
    /// Set-points sent.
    ticks: u64,
}

impl JogMotion {
    /// Plans the move from `start`, if the goal and the speeds are within the limits.
    pub(in crate::control) fn plan(
        order: &JogOrder,
        start: &MotionState,
        limits: &MotionLimits,
    ) -> Result<Self, Refusal> {
        check_length(&order.joint_position, limits)?;
        check_length(&order.max_velocity, limits)?;
        for (joint, (&value, axis)) in order.joint_position.iter().zip(limits.iter()).enumerate() {
            if !axis.contains(value) {
                return Err(Refusal::OutOfRange { joint, value, limit: axis.nearer_limit(value) });
            }
        }
        let limits = limits.with_max_velocity(&order.max_velocity).map_err(speed_refusal)?;
        let plan = JointMove::plan(start, &order.joint_position, &limits).map_err(move_refusal)?;
        Ok(Self { plan, ticks: 0 })
    }

    /// The state of the curve at the last set-point.
    pub(in crate::control) fn state(&self, period_s: f64) -> MotionState {
        self.plan.at(self.time_s(period_s))
    }

    pub(super) fn elapsed_s(&self, period_s: f64) -> f64 {
        self.time_s(period_s).min(self.plan.duration_s())
    }

    pub(super) const fn duration_s(&self) -> f64 {
        self.plan.duration_s()
    }

    pub(super) fn next(&mut self, period_s: f64) -> Next {
        self.ticks += 1;
        let state = self.state(period_s);
        if self.time_s(period_s) >= self.plan.duration_s() {
            Next::Last(state)
        } else {
            Next::Moving(state)
        }
    }

    fn time_s(&self, period_s: f64) -> f64 {
        self.ticks as f64 * period_s
    }
}

/// A refused plan in the loop's words.
pub(super) fn move_refusal(error: JointMoveError) -> Refusal {
    match error {
        JointMoveError::JointCount { len, expected, .. } => {
            Refusal::WrongLength { given: len, expected }
        }
        JointMoveError::TargetBeyondLimit { joint, value, limit }
        | JointMoveError::OvershootBeyondLimit { joint, value, limit } => {
            Refusal::OutOfRange { joint, value, limit }
        }
        JointMoveError::Profile { joint, .. } => {
            Refusal::OutOfRange { joint, value: f64::NAN, limit: 0.0 }
        }
    }
}

fn speed_refusal(error: MotionLimitsError) -> Refusal {
    match error {
        MotionLimitsError::VelocityAboveLimit { joint, value, limit } => {
            Refusal::OutOfRange { joint, value, limit }
        }
        MotionLimitsError::NotPositive { joint, value, .. } => {
            Refusal::OutOfRange { joint, value, limit: 0.0 }
        }
        MotionLimitsError::VelocityCount { len, expected } => {
            Refusal::WrongLength { given: len, expected }
        }
        // Of the limits themselves, which were found complete when the loop began.
        MotionLimitsError::JointCount { len } => Refusal::WrongLength { given: len, expected: len },
        MotionLimitsError::AccelerationMissing { joint }
        | MotionLimitsError::PositionRange { joint, .. } => {
            Refusal::OutOfRange { joint, value: f64::NAN, limit: 0.0 }
        }
    }
}

fn check_length(vector: &JointVector, limits: &MotionLimits) -> Result<(), Refusal> {
    let (given, expected) = (vector.len(), limits.len());
    if given == expected { Ok(()) } else { Err(Refusal::WrongLength { given, expected }) }
}
