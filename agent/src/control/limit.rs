//! The one limiter: what leaves the loop has passed it.
//!
//! It sees what a controller sees: positions `x_k` sent a period `T` apart, their differences
//! `v_k = (x_k - x_(k-1)) / T`, and the differences of those. A set-point passes untouched, bit
//! for bit, if `v_k` and its change are within the joint's limits and the joint can still come to
//! rest before its position limit: losing `a T` of velocity per tick it goes on for
//!
//! ```text
//! B(v) = T (n + 1) v - a T² n (n + 1) / 2,   n = floor(v / a T)
//! ```
//!
//! counted from `x_(k-1)`, so `B(v_k)` is at most the room that is left there. Whoever plans
//! within the limits keeps this without knowing of it: his own set-points are a way to stop in
//! that room, and none is shorter.
//!
//! What does not pass is replaced by a step on the way to rest there that does, and counted. So
//! what leaves can always be braked, and the next tick always has a legal answer: this is the
//! induction that keeps the limiter's own arithmetic legal.
//!
//! A joint found beyond a position limit may stay or come back, but not go further out.
//!
//! Limits are widened by [`LIMIT_TOLERANCE`], since a trajectory is accepted up to there.

use serde::{Deserialize, Serialize};
use std::time::Duration;

use armada_model::{
    AxisLimits, JointVector, LIMIT_TOLERANCE, MAX_JOINTS, MotionLimits, MotionState,
};
use arrayvec::ArrayVec;

use crate::drivers::SetPoint;

/// Knows what was sent last and changes what must not follow it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Limiter {
    axes: ArrayVec<AxisLimits, MAX_JOINTS>,
    period_s: f64,
    /// Position sent last and its difference to the one before; none while nothing is sent.
    last: Option<MotionState>,
    changed: u64,
}

/// A set-point is not finite, or not for this robot: nothing near it can be sent instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Senseless;

impl Limiter {
    pub(super) fn new(limits: &MotionLimits, period: Duration) -> Self {
        let widen = |axis: &AxisLimits| AxisLimits {
            lower: axis.lower - LIMIT_TOLERANCE,
            upper: axis.upper + LIMIT_TOLERANCE,
            velocity: axis.velocity * (1.0 + LIMIT_TOLERANCE),
            acceleration: axis.acceleration * (1.0 + LIMIT_TOLERANCE),
            // Not what this limiter holds: streams from elsewhere promise no jerk.
            jerk: axis.jerk,
        };
        let axes = limits.iter().map(widen).collect();
        Self { axes, period_s: period.as_secs_f64(), last: None, changed: 0 }
    }

    /// Begins a stream at rest at `position`, as if it had been sent for ever.
    pub(super) fn begin(&mut self, position: JointVector) {
        self.last = Some(MotionState { position, velocity: position.map_indexed(|_, _| 0.0) });
    }

    /// Ends the stream.
    pub(super) const fn end(&mut self) {
        self.last = None;
    }

    /// Position sent last and its difference to the one before, divided by the period.
    pub(super) const fn last(&self) -> Option<&MotionState> {
        self.last.as_ref()
    }

    /// Number of set-points that had to be changed so far.
    pub(super) const fn changed(&self) -> u64 {
        self.changed
    }

    /// What is to be sent for `desired`; the velocities only go with it.
    pub(super) fn pass(&mut self, desired: &MotionState) -> Result<SetPoint, Senseless> {
        let last = self.last.as_mut().ok_or(Senseless)?;
        let joints = self.axes.len();
        let lengths = [&last.position, &desired.position, &desired.velocity].map(|v| v.len());
        if lengths != [joints; 3] || !desired.position.is_finite() {
            return Err(Senseless);
        }
        let (mut position, mut velocity) = (desired.position, desired.velocity);
        let mut changed = false;
        for (joint, axis) in self.axes.iter().enumerate() {
            let axis = Axis { limits: axis, period_s: self.period_s };
            let (from, before) = (last.position[joint], last.velocity[joint]);
            let (to, mut speed) = axis.pass(from, before, position[joint]);
            if to != position[joint] || !axis.may_go_with(velocity[joint]) {
                changed = true;
                velocity[joint] = speed;
            }
            if to == from {
                // Exactly, so that rest is known as rest.
                speed = 0.0;
            }
            position[joint] = to;
            (last.position[joint], last.velocity[joint]) = (to, speed);
        }
        self.changed += u64::from(changed);
        Ok(SetPoint { joint_position: position, joint_velocity: velocity })
    }

    /// A legal step from what was sent last towards rest at `target`; none while nothing is sent.
    pub(super) fn toward(&self, target: &JointVector) -> Option<MotionState> {
        let last = self.last?;
        let (mut position, mut velocity) = (last.position, last.velocity);
        let joints = position.iter_mut().zip(velocity.iter_mut()).zip(target.iter());
        for (((x, v), &goal), axis) in joints.zip(&self.axes) {
            let axis = Axis { limits: axis, period_s: self.period_s };
            (*x, *v) = axis.approach(*x, *v, goal);
        }
        Some(MotionState { position, velocity })
    }
}

/// The arithmetic of one joint.
#[derive(Clone, Copy)]
struct Axis<'a> {
    limits: &'a AxisLimits,
    period_s: f64,
}

impl Axis<'_> {
    /// Position to send for `to`, and its difference to `from`.
    fn pass(self, from: f64, before: f64, to: f64) -> (f64, f64) {
        let asked = (to - from) / self.period_s;
        let legal = self.legal(from, before, asked);
        if (legal - asked).abs() <= self.rounding(from) {
            return (to, asked);
        }
        self.approach(from, before, to)
    }

    /// Position to send on the way to rest at `goal`, and its difference to `from`.
    fn approach(self, from: f64, before: f64, goal: f64) -> (f64, f64) {
        let distance = goal - from;
        let wanted = self.brakeable(distance.abs()).min(distance.abs() / self.period_s);
        let legal = self.legal(from, before, wanted.copysign(distance));
        if (legal - distance / self.period_s).abs() <= self.rounding(from) {
            return (goal, distance / self.period_s);
        }
        let (lower, upper) = self.range(from);
        let to = (from + legal * self.period_s).clamp(lower, upper);
        (to, (to - from) / self.period_s)
    }

    /// The legal velocity nearest to `asked`. Of limits that contradict each other, which only an
    /// illegal past can bring about, acceleration is kept.
    fn legal(self, from: f64, before: f64, asked: f64) -> f64 {
        let (lower, upper) = self.range(from);
        let change = self.limits.acceleration * self.period_s;
        asked
            .clamp(-self.limits.velocity, self.limits.velocity)
            .clamp(-self.brakeable(from - lower), self.brakeable(upper - from))
            .clamp(before - change, before + change)
    }

    /// Whether a velocity may be sent along with a position; not a number may not.
    fn may_go_with(self, velocity: f64) -> bool {
        velocity.abs() <= self.limits.velocity * (1.0 + 1e-9)
    }

    /// The position limits, as far out as the joint is.
    fn range(self, from: f64) -> (f64, f64) {
        (self.limits.lower.min(from), self.limits.upper.max(from))
    }

    /// Highest velocity `v` with `B(v) <= room`. `B` is linear between multiples of `a T`, where
    /// it is `a T² n (n + 1) / 2`.
    fn brakeable(self, room: f64) -> f64 {
        if !room.is_finite() {
            return f64::INFINITY;
        }
        let change = self.limits.acceleration * self.period_s;
        let steps = room / (change * self.period_s);
        let n = (0.5 * (1.0 + 8.0 * steps).sqrt() - 0.5).floor().max(0.0);
        (room / self.period_s + 0.5 * change * n * (n + 1.0)) / (n + 1.0)
    }

    /// By how much a difference of positions near `position` may be wrong by rounding.
    fn rounding(self, position: f64) -> f64 {
        16.0 * f64::EPSILON * position.abs().max(1.0) / self.period_s
    }
}
