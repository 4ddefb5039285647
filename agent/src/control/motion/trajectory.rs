//! Timed trajectories.
//!
//! ```text
//! waiting --start is near--> lead-in --at the first waypoint--> clock 0, 1, .. --> last waypoint
//! ```
//!
//! **The clock counts ticks, not time.** It advances by exactly one period per set-point sent. So a
//! late wake, or a whole period missed, delays the motion and cannot make it jump: every
//! difference of set-points is one that the trajectory was validated for. A late wake is legal by
//! construction, and nothing needs to catch up.
//!
//! A start at an instant is at the tick nearest to it. If the position held is not exactly the
//! first waypoint, since it was taken from a measurement, a slow move there comes before. It is
//! planned when the order is taken and begun early enough that clock zero falls on the instant:
//! robots that start together do so, whatever small distance each had to go. If there is no
//! time for it, or the tick comes more than a period late, the start is missed and nothing moves.
//!
//! The last set-point is the last waypoint, bit for bit; then the motion is complete, and the
//! position is held.

use std::sync::Arc;
use std::time::Duration;

use armada_model::{
    CompiledTrajectory, JointMove, JointVector, MonoTime, MotionLimits, MotionState,
};

use super::Next;
use super::jog::move_refusal;
use crate::control::io::{FollowOrder, Params, Refusal};
use crate::control::state::Tick;

/// Speed of the way to the first waypoint, as a share of each joint's limit.
const LEAD_IN_SPEED: f64 = 0.1;
/// Distance \[rad or m\] that is no distance.
const SAME: f64 = 1e-9;
/// By what share of a period a clock may be beyond its end by rounding.
const ROUNDING: f64 = 1e-6;

/// A trajectory being followed, or waiting for its start.
#[derive(Debug)]
pub(in crate::control) struct TrajectoryMotion {
    trajectory: Arc<CompiledTrajectory>,
    start: Option<MonoTime>,
    lead_in: Option<LeadIn>,
    /// Set-points sent after the first; none before that.
    clock: Option<u64>,
    /// The clock at the last set-point.
    last: u64,
    hint: usize,
    waypoint: usize,
}

/// The way to the first waypoint, with its time in ticks.
#[derive(Debug)]
struct LeadIn {
    plan: JointMove,
    ticks: u32,
    last: u32,
}

/// Where a trajectory is begun.
#[derive(Clone, Copy, Debug)]
pub(in crate::control) struct StartPoint<'a> {
    /// The set-point held.
    pub(in crate::control) held: &'a MotionState,
    /// Measured positions.
    pub(in crate::control) measured: &'a JointVector,
}

impl TrajectoryMotion {
    /// Makes ready to follow, if the robot is where the trajectory begins and in time.
    pub(in crate::control) fn plan(
        order: &FollowOrder,
        from: &StartPoint<'_>,
        limits: &MotionLimits,
        tick: &Tick<'_>,
    ) -> Result<Self, Refusal> {
        let (given, expected) = (order.trajectory.joint_count(), limits.len());
        if given != expected {
            return Err(Refusal::WrongLength { given, expected });
        }
        let first = order.trajectory.start();
        check_near(&first, from.measured, tick.params)?;
        check_near(&first, &from.held.position, tick.params)?;
        let period = tick.params.period;
        let lead_in = LeadIn::plan(from.held, &first, limits, period)?;
        if let Some(start) = order.start {
            let earliest = tick.now + lead_in.as_ref().map_or(Duration::ZERO, |l| l.lead(period));
            check_in_time(start, earliest, period)
                .map_err(|late_s| Refusal::StartMissed { late_s })?;
        }
        Ok(Self {
            trajectory: Arc::clone(&order.trajectory),
            start: order.start,
            lead_in,
            clock: None,
            last: whole_ticks(order.trajectory.duration_s(), period.as_secs_f64()),
            hint: 0,
            waypoint: 0,
        })
    }

    pub(super) fn into_trajectory(self) -> Arc<CompiledTrajectory> {
        self.trajectory
    }

    pub(super) const fn is_under_way(&self) -> bool {
        self.clock.is_some() || matches!(&self.lead_in, Some(lead_in) if lead_in.ticks > 0)
    }

    pub(super) fn elapsed_s(&self, period_s: f64) -> f64 {
        (self.clock.unwrap_or(0) as f64 * period_s).min(self.duration_s())
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.trajectory.duration_s()
    }

    pub(super) fn waypoint(&self) -> u32 {
        u32::try_from(self.waypoint).unwrap_or(u32::MAX)
    }

    /// What the waypoint passed last asks for; nothing on the way to the first one.
    pub(super) fn tolerance(&self) -> JointVector {
        let asked = self.clock.map(|_| self.trajectory.tolerance(self.waypoint).position);
        // Finite and one per joint, since it was compiled.
        asked.and_then(|row| JointVector::from_slice(row).ok()).unwrap_or_default()
    }

    pub(super) fn next(&mut self, now: MonoTime, period: Duration) -> Next {
        let clock = match self.clock {
            Some(clock) => clock + 1,
            None => match self.before_start(now, period) {
                Some(next) => return next,
                None => 0,
            },
        };
        self.clock = Some(clock);
        // Exactly the end, not where rounding of the clock has it.
        let time_s = if clock >= self.last {
            self.duration_s()
        } else {
            clock as f64 * period.as_secs_f64()
        };
        let sample = self.trajectory.sample(time_s, &mut self.hint);
        self.waypoint = sample.waypoint;
        let state = MotionState { position: sample.position, velocity: sample.velocity };
        if clock >= self.last { Next::Last(state) } else { Next::Moving(state) }
    }

    /// What is to be done before clock zero, unless that is now.
    fn before_start(&mut self, now: MonoTime, period: Duration) -> Option<Next> {
        if !self.is_under_way() {
            let lead = self.lead_in.as_ref().map_or(Duration::ZERO, |lead_in| lead_in.lead(period));
            if self.start.is_some_and(|start| now + lead + period / 2 < start) {
                return Some(Next::Waiting);
            }
        }
        if let Some(state) = self.lead_in.as_mut().and_then(|lead_in| lead_in.next(period)) {
            return Some(Next::Approaching(state));
        }
        self.start.and_then(|start| check_in_time(start, now, period).err()).map(Next::Missed)
    }
}

impl LeadIn {
    /// The way from the position held to the first waypoint; none if there is no distance.
    fn plan(
        held: &MotionState,
        first: &JointVector,
        limits: &MotionLimits,
        period: Duration,
    ) -> Result<Option<Self>, Refusal> {
        if held.position.max_abs_difference(first) <= SAME {
            return Ok(None);
        }
        let speed = first.map_indexed(|joint, _| {
            limits.get(joint).map_or(0.0, |axis| LEAD_IN_SPEED * axis.velocity)
        });
        // A share of the limits is within the limits.
        let limits = limits.with_max_velocity(&speed).unwrap_or(*limits);
        let plan = JointMove::plan(held, first, &limits).map_err(move_refusal)?;
        let last = whole_ticks(plan.duration_s(), period.as_secs_f64());
        Ok(Some(Self { plan, ticks: 0, last: u32::try_from(last).unwrap_or(u32::MAX) }))
    }

    /// How long before clock zero its first set-point is sent.
    const fn lead(&self, period: Duration) -> Duration {
        period.saturating_mul(self.last.saturating_sub(1))
    }

    /// Its next set-point, but for the last, which is that of clock zero.
    fn next(&mut self, period: Duration) -> Option<MotionState> {
        self.ticks = self.ticks.saturating_add(1);
        (self.ticks < self.last).then(|| self.plan.at(f64::from(self.ticks) * period.as_secs_f64()))
    }
}

/// The lowest number of periods, one at least, that is not shorter than `duration_s`.
fn whole_ticks(duration_s: f64, period_s: f64) -> u64 {
    // Saturates.
    ((duration_s / period_s - ROUNDING).ceil() as u64).max(1)
}

/// How late \[s\] a start at `now` would be for `start`, if that is too late.
fn check_in_time(start: MonoTime, now: MonoTime, period: Duration) -> Result<(), f64> {
    let late = now.saturating_since(start);
    if late > period { Err(late.as_secs_f64()) } else { Ok(()) }
}

fn check_near(first: &JointVector, actual: &JointVector, params: &Params) -> Result<(), Refusal> {
    let joints = first.iter().zip(actual.iter()).zip(params.start_tolerance.iter());
    for (joint, ((first, actual), &limit)) in joints.enumerate() {
        let value = (first - actual).abs();
        if value > limit {
            return Err(Refusal::StartTolerance { joint, value, limit });
        }
    }
    Ok(())
}
