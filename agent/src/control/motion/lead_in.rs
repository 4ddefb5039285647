//! The slow way from where a robot stands to the first waypoint.

use serde::{Deserialize, Serialize};
use std::time::Duration;

use armada_model::{JointMove, JointVector, MotionLimits, MotionState};

use super::jog::move_refusal;
use crate::control::io::Refusal;

/// Distance \[rad or m\] that is no distance.
const SAME: f64 = 1e-9;
/// By what share of a period a clock may be beyond its end by rounding.
const ROUNDING: f64 = 1e-6;

/// The way to the first waypoint, with its time in ticks.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct LeadIn {
    plan: JointMove,
    ticks: u32,
    last: u32,
}

impl LeadIn {
    /// The way from the position held to the first waypoint at `share` of the speed limits; none
    /// if there is no distance.
    pub(super) fn plan(
        held: &JointVector,
        first: &JointVector,
        share: f64,
        limits: &MotionLimits,
        period: Duration,
    ) -> Result<Option<Self>, Refusal> {
        if held.max_abs_difference(first) <= SAME {
            return Ok(None);
        }
        let speed = first
            .map_indexed(|joint, _| limits.get(joint).map_or(0.0, |axis| share * axis.velocity));
        // A share of the limits is within the limits.
        let limits = limits.with_max_velocity(&speed).unwrap_or(*limits);
        let start = MotionState { position: *held, velocity: held.map_indexed(|_, _| 0.0) };
        let plan = JointMove::plan(&start, first, &limits).map_err(move_refusal)?;
        let last = whole_ticks(plan.duration_s(), period.as_secs_f64());
        Ok(Some(Self { plan, ticks: 0, last: u32::try_from(last).unwrap_or(u32::MAX) }))
    }

    pub(super) const fn has_begun(&self) -> bool {
        self.ticks > 0
    }

    /// How long before clock zero its first set-point is sent.
    pub(super) const fn lead(&self, period: Duration) -> Duration {
        period.saturating_mul(self.last.saturating_sub(1))
    }

    /// Its next set-point, but for the last, which is that of clock zero.
    pub(super) fn next(&mut self, period: Duration) -> Option<MotionState> {
        self.ticks = self.ticks.saturating_add(1);
        (self.ticks < self.last).then(|| self.plan.at(f64::from(self.ticks) * period.as_secs_f64()))
    }
}

/// The lowest number of periods, one at least, that is not shorter than `duration_s`.
pub(super) fn whole_ticks(duration_s: f64, period_s: f64) -> u64 {
    // Saturates.
    ((duration_s / period_s - ROUNDING).ceil() as u64).max(1)
}
