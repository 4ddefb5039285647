//! The curve that is followed: a way in, a trajectory, and where it is left for the next one.
//!
//! ```text
//! phase 0                entry_s                      leave_s                   end
//!   |-- entry: own way -----|-- the trajectory from its `join_s` --|-- leg of the exit --|
//! ```
//!
//! All of it is one curve to whoever runs on it, so pauses, speeds and stops work anywhere on it.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use armada_model::{
    CompiledTrajectory, CurveBounds, CurvePoint, JerkLimitedMove, JointVector, MotionLimits,
    OnlineState, TimedCurve,
};
use armada_protocol::messages::ReducedLimits;

use super::waiting::Waiting;

/// One trajectory and the way into it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Leg {
    #[serde(with = "crate::control::shared")]
    pub(super) trajectory: Arc<CompiledTrajectory>,
    pub(super) entry: Option<Entry>,
}

/// A way onto a trajectory from where the robot was before, in motion.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Entry {
    way: JerkLimitedMove,
    /// Clock of the trajectory where the way joins it \[s\].
    join_s: f64,
}

/// Where a leg is left for the next one.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Exit {
    /// Phase of the leg that is left \[s\].
    pub(super) leave_s: f64,
    /// The motion that is next.
    pub(super) next: Waiting,
    /// The way into it.
    pub(super) entry: Entry,
}

/// What is followed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Course {
    pub(super) leg: Leg,
    pub(super) exit: Option<Exit>,
}

/// A leg by reference, as a curve.
struct LegCurve<'a> {
    trajectory: &'a CompiledTrajectory,
    entry: Option<&'a Entry>,
}

impl Entry {
    /// The way from `state` onto `trajectory` at `join_s` \[s\] of its clock; none if the limits do
    /// not allow one.
    pub(super) fn plan(
        state: &OnlineState,
        trajectory: &CompiledTrajectory,
        join_s: f64,
        limits: &MotionLimits,
    ) -> Option<Self> {
        let target = online_state(&trajectory.point(join_s, &mut 0));
        let way = JerkLimitedMove::plan(state, &target, limits, &Default::default()).ok()?;
        let entry = Self { way, join_s };
        // A state near its limits may make it inevitable to pass them, which a move would take.
        let bounds = entry.all_bounds();
        let legal = limits.iter().enumerate().all(|(joint, axis)| {
            bounds.first[joint].is_within(axis.velocity * (1.0 + ROUNDING))
                && bounds.second[joint].is_within(axis.acceleration * (1.0 + ROUNDING))
        });
        legal.then_some(entry)
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.way.duration_s()
    }

    /// Whether no joint is ever further than `tolerance` from `place`.
    pub(super) fn stays_near(&self, place: &JointVector, tolerance: &JointVector) -> bool {
        let bounds = self.all_bounds();
        let step_s = self.duration_s() / f64::from(LOOKS);
        (0..=LOOKS).all(|look| {
            let position = self.way.at(f64::from(look) * step_s).position;
            position.iter().enumerate().all(|(joint, x)| {
                // Between two looks it cannot go further than that.
                let more = 0.5 * step_s * bounds.first[joint].peak();
                let (place, limit) = (place.get(joint), tolerance.get(joint));
                place.zip(limit).is_some_and(|(place, limit)| (x - place).abs() + more <= *limit)
            })
        })
    }

    fn all_bounds(&self) -> CurveBounds {
        let mut bounds = CurveBounds::EMPTY;
        self.way.bounds(0.0, self.duration_s(), &mut 0, &mut bounds);
        bounds
    }
}

/// By how much a way may pass a limit, of that limit.
const ROUNDING: f64 = 1e-9;
/// At how many places it is looked at where a way goes.
const LOOKS: u32 = 24;

impl Leg {
    pub(super) const fn new(trajectory: Arc<CompiledTrajectory>) -> Self {
        Self { trajectory, entry: None }
    }

    fn curve(&self) -> LegCurve<'_> {
        LegCurve { trajectory: &self.trajectory, entry: self.entry.as_ref() }
    }

    /// How long it takes at its own speed \[s\].
    pub(super) fn duration_s(&self) -> f64 {
        self.curve().duration_s()
    }

    /// The trajectory's clock at `phase_s`; where it joins until then.
    pub(super) fn clock_s(&self, phase_s: f64) -> f64 {
        self.curve().clock_s(phase_s)
    }

    /// The phase at `clock_s` of the trajectory.
    pub(super) fn phase_s(&self, clock_s: f64) -> f64 {
        match &self.entry {
            None => clock_s,
            Some(entry) => entry.duration_s() + clock_s - entry.join_s,
        }
    }

    /// Whether `phase_s` is on the way in.
    pub(super) fn is_entry(&self, phase_s: f64) -> bool {
        self.entry.as_ref().is_some_and(|entry| phase_s < entry.duration_s())
    }

    /// The highest rate at which no joint is faster than at reduced speed.
    pub(super) fn reduced_rate(&self, reduced: &[ReducedLimits]) -> f64 {
        let (velocity, acceleration) =
            (self.trajectory.peak_velocity(), self.trajectory.peak_acceleration());
        let peaks = velocity.iter().copied().zip(acceleration.iter().copied());
        let rate = slowest(reduced, peaks);
        match &self.entry {
            None => rate,
            Some(entry) => rate.min(entry.reduced_rate(reduced)),
        }
    }
}

impl Entry {
    pub(super) fn reduced_rate(&self, reduced: &[ReducedLimits]) -> f64 {
        let bounds = self.all_bounds();
        let peaks = bounds.first.iter().map(|v| v.peak());
        slowest(reduced, peaks.zip(bounds.second.iter().map(|a| a.peak())))
    }
}

/// The lowest of the rates of all joints at which velocity and acceleration are at most `reduced`:
/// acceleration goes with the square of the rate.
fn slowest(reduced: &[ReducedLimits], peaks: impl Iterator<Item = (f64, f64)>) -> f64 {
    reduced.iter().zip(peaks).fold(1.0, |rate: f64, (limit, (velocity, acceleration))| {
        let mut rate = rate;
        if velocity > limit.velocity {
            rate = rate.min(limit.velocity / velocity);
        }
        if acceleration > limit.acceleration {
            rate = rate.min((limit.acceleration / acceleration).sqrt());
        }
        rate
    })
}

impl LegCurve<'_> {
    fn entry_s(&self) -> f64 {
        self.entry.map_or(0.0, Entry::duration_s)
    }

    fn clock_s(&self, phase_s: f64) -> f64 {
        match self.entry {
            _ if phase_s >= self.duration_s() => self.trajectory.duration_s(),
            None => phase_s,
            Some(entry) => entry.join_s + (phase_s - entry.duration_s()).max(0.0),
        }
    }
}

impl TimedCurve for LegCurve<'_> {
    fn joint_count(&self) -> usize {
        TimedCurve::joint_count(self.trajectory)
    }

    fn duration_s(&self) -> f64 {
        let whole_s = self.trajectory.duration_s();
        self.entry.map_or(whole_s, |entry| entry.duration_s() + whole_s - entry.join_s)
    }

    fn limits_jerk(&self) -> bool {
        TimedCurve::limits_jerk(self.trajectory)
    }

    fn point(&self, phase_s: f64, hint: &mut usize) -> CurvePoint {
        match self.entry {
            Some(entry) if phase_s < entry.duration_s() => entry.way.point(phase_s, &mut 0),
            _ => self.trajectory.point(self.clock_s(phase_s), hint),
        }
    }

    fn bounds(&self, from_s: f64, to_s: f64, hint: &mut usize, bounds: &mut CurveBounds) {
        let entry_s = self.entry_s();
        let entry = self.entry.filter(|_| from_s < entry_s);
        let mut on_entry = CurveBounds::EMPTY;
        if let Some(entry) = entry {
            entry.way.bounds(from_s, to_s.min(entry_s), &mut 0, &mut on_entry);
            if to_s < entry_s {
                *bounds = on_entry;
                return;
            }
        }
        self.trajectory.bounds(self.clock_s(from_s), self.clock_s(to_s), hint, bounds);
        if entry.is_some() {
            widen(bounds, &on_entry, TimedCurve::joint_count(self));
        }
    }
}

impl Course {
    pub(super) const fn new(leg: Leg) -> Self {
        Self { leg, exit: None }
    }

    /// The leg after this one.
    fn next(&self) -> Option<(f64, LegCurve<'_>)> {
        let exit = self.exit.as_ref()?;
        let curve = LegCurve { trajectory: &exit.next.trajectory, entry: Some(&exit.entry) };
        Some((exit.leave_s, curve))
    }

    /// Everything that a state on it needs to go over to something else.
    pub(super) fn state(&self, phase_s: f64, hint: &mut usize) -> OnlineState {
        online_state(&self.point(phase_s, hint))
    }
}

impl TimedCurve for Course {
    fn joint_count(&self) -> usize {
        TimedCurve::joint_count(self.leg.trajectory.as_ref())
    }

    fn duration_s(&self) -> f64 {
        self.next().map_or_else(|| self.leg.duration_s(), |(at_s, next)| at_s + next.duration_s())
    }

    fn limits_jerk(&self) -> bool {
        self.leg.curve().limits_jerk() && self.next().is_none_or(|(_, next)| next.limits_jerk())
    }

    fn point(&self, phase_s: f64, hint: &mut usize) -> CurvePoint {
        match self.next() {
            Some((leave_s, next)) if phase_s >= leave_s => next.point(phase_s - leave_s, &mut 0),
            _ => self.leg.curve().point(phase_s, hint),
        }
    }

    fn bounds(&self, from_s: f64, to_s: f64, hint: &mut usize, bounds: &mut CurveBounds) {
        let next = self.next().filter(|(leave_s, _)| to_s >= *leave_s);
        let Some((leave_s, next)) = next else {
            return self.leg.curve().bounds(from_s, to_s, hint, bounds);
        };
        next.bounds((from_s - leave_s).max(0.0), to_s - leave_s, &mut 0, bounds);
        if from_s < leave_s {
            let mut before = CurveBounds::EMPTY;
            self.leg.curve().bounds(from_s, leave_s, hint, &mut before);
            widen(bounds, &before, TimedCurve::joint_count(self));
        }
    }
}

/// Position and its derivatives by the phase, as a state at full speed.
fn online_state(point: &CurvePoint) -> OnlineState {
    OnlineState { position: point.position, velocity: point.first, acceleration: point.second }
}

fn widen(bounds: &mut CurveBounds, other: &CurveBounds, joints: usize) {
    let rows = [
        (&mut bounds.first, &other.first),
        (&mut bounds.second, &other.second),
        (&mut bounds.third, &other.third),
    ];
    for (spans, others) in rows {
        for (span, other) in spans.iter_mut().zip(others).take(joints) {
            span.include(other.low);
            span.include(other.high);
        }
    }
}
