//! The decelerating stop.

use serde::{Deserialize, Serialize};
use std::time::Duration;

use super::joint_move::MotionState;
use super::motion_limits::{AxisLimits, MotionLimits};
use crate::JointVector;

/// Deceleration of all joints to standstill, tick by tick, from what was commanded last.
///
/// It starts from the last commanded position `x_0` and the last backward difference
/// `w_0 = (x_0 - x_-1) / T`, so it needs to know nothing of what moved before. At each tick a joint
/// loses `d T` of its velocity: `w_j = max(0, w_0 - d T j)`, `x_j = x_(j-1) + w_j T` (written for
/// motion towards positive). So the differences of what is sent are legal by construction.
///
/// All joints take the same time, that of the joint which needs longest at its full deceleration,
/// and so go on straight in joint space. A joint that would then pass its position limit brakes at
/// its full deceleration instead.
///
/// **It stays inside the position limits** if the motion before it would have: a legal motion's own
/// further set-points come to rest inside the limits, and lose at most `a T` of velocity per tick. A
/// joint at full deceleration loses exactly that, so it is at no tick faster than the motion would
/// have been, and ends no further out. (In numbers: it goes on for at most `(w_0 - a T / 2)² / 2a`,
/// and the velocity of the curve at `x_0` is at least `w_0 - a T / 2`.) If the motion before it was
/// not legal, [`stop_position`](Self::stop_position) tells where it ends; deceleration is never
/// exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StopRamp {
    start: MotionState,
    /// Share of its start velocity that each joint loses per tick.
    loss: JointVector,
    period_s: f64,
    tick: u32,
    ticks: u32,
}

impl StopRamp {
    /// The stop from `last`: the position commanded last, and as velocity its difference to the
    /// position commanded one `period` before, divided by `period`.
    ///
    /// A stop cannot be refused: a joint that has no velocity or no limits in the arguments is held
    /// where it is, and so are all if `period` is zero.
    #[must_use]
    pub fn plan(last: &MotionState, limits: &MotionLimits, period: Duration) -> Self {
        let period_s = period.as_secs_f64();
        let velocity = last.position.map_indexed(|joint, _| match limits.get(joint) {
            Some(_) if period_s > 0.0 => last.velocity.get(joint).copied().unwrap_or(0.0),
            _ => 0.0,
        });
        let start = MotionState { position: last.position, velocity };
        let common_s = velocity
            .iter()
            .zip(limits.iter())
            .map(|(w, axis)| w.abs() / axis.acceleration)
            .fold(0.0, f64::max);
        let mut ticks = 0;
        let loss = velocity.map_indexed(|joint, w| {
            let Some(axis) = limits.get(joint).filter(|_| w != 0.0) else {
                return 1.0;
            };
            let together = (period_s / common_s).min(1.0);
            let alone = (axis.acceleration * period_s / w.abs()).min(1.0);
            let step = w * period_s;
            let passes = passes_limit(last.position[joint] + travel(step, together), w, axis);
            let loss = if passes { alone } else { together };
            // Until the first tick at which the difference is zero.
            ticks = ticks.max((1.0 / loss).ceil() as u32);
            loss
        });
        Self { start, loss, period_s, tick: 0, ticks }
    }

    /// Goes on by one tick. The position is what to send; the velocity is its difference to the
    /// position one tick before, divided by the period.
    pub fn step(&mut self) -> MotionState {
        self.tick = self.tick.saturating_add(1).min(self.ticks);
        self.current()
    }

    /// The state at the current tick.
    #[must_use]
    pub fn current(&self) -> MotionState {
        let MotionState { position, velocity } = self.start;
        let position = position.map_indexed(|joint, x| {
            x + travel_until(self.tick, velocity[joint] * self.period_s, self.loss[joint])
        });
        let velocity = velocity.map_indexed(|joint, w| {
            // Exactly zero at the end, whatever the rounding.
            let left = 1.0 - f64::from(self.tick) * self.loss[joint];
            if self.is_standstill() { 0.0 } else { w * left.max(0.0) }
        });
        MotionState { position, velocity }
    }

    /// Whether the last two positions are equal: a motion may start from rest now.
    #[must_use]
    pub const fn is_standstill(&self) -> bool {
        self.tick >= self.ticks
    }

    /// How long the whole ramp takes.
    #[must_use]
    pub fn duration(&self) -> Duration {
        Duration::from_secs_f64(self.period_s).saturating_mul(self.ticks)
    }

    /// Where the ramp ends.
    #[must_use]
    pub fn stop_position(&self) -> JointVector {
        Self { tick: self.ticks, ..*self }.current().position
    }
}

/// Number of ticks at which a joint still moves, if it loses `loss` of its start velocity at each.
fn moving_ticks(loss: f64) -> u32 {
    // Saturates; never negative, since loss lies above zero and at most at one.
    (1.0 / loss) as u32
}

/// Distance covered after `tick` ticks: the sum of `step (1 - loss j)` over `j` from 1 on, while
/// the joint moves.
fn travel_until(tick: u32, step: f64, loss: f64) -> f64 {
    let ticks = f64::from(tick.min(moving_ticks(loss)));
    step * ticks * (1.0 - 0.5 * loss * (ticks + 1.0))
}

fn travel(step: f64, loss: f64) -> f64 {
    travel_until(u32::MAX, step, loss)
}

fn passes_limit(stop: f64, velocity: f64, limits: &AxisLimits) -> bool {
    if velocity > 0.0 { stop > limits.upper } else { stop < limits.lower }
}
