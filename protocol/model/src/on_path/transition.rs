//! From any state into the next motion, without a halt where the limits allow.

use super::curve::TimedCurve;
use crate::{
    JerkLimitedMove, JerkLimitedStop, MotionLimits, OnlineError, OnlineGenerator, OnlineOptions,
    OnlineState, RuckigGenerator,
};
use serde::{Deserialize, Serialize};

/// How many places to join a curve are tried, besides its start.
const CANDIDATES: u32 = 8;

/// A jerk-limited motion from any state onto the next curve, to go on there at its own speed.
///
/// It joins the curve where the whole takes the least time, of nine places from its start to the
/// last one allowed; at rest at the start if no other place can be reached legally. If not even that
/// can, straight from the state, the joints stop first. Joining late cuts off the beginning of the
/// curve.
///
/// At every instant a legal stop exists: a way onto the curve is only accepted together with the
/// stop from where it joins. Planning takes nine plans of [`JerkLimitedMove`], some 0.1 ms, and
/// allocates nothing.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Transition {
    stop: Option<JerkLimitedStop>,
    way: JerkLimitedMove,
    join_s: f64,
}

impl Transition {
    /// The way from `state` onto `next`, no later than at its phase `latest_join_s` \[s\].
    ///
    /// # Errors
    /// [`OnlineError`] as of [`JerkLimitedMove::plan`] from rest to the start of `next`, if that too
    /// is impossible; or if the state is not usable.
    pub fn plan(
        state: &OnlineState,
        next: &impl TimedCurve,
        limits: &MotionLimits,
        latest_join_s: f64,
    ) -> Result<Self, OnlineError> {
        let mut generator = RuckigGenerator::default();
        Self::plan_with(&mut generator, state, next, limits, latest_join_s)
    }

    /// As [`plan`](Self::plan), with a generator that is kept.
    ///
    /// # Errors
    /// As [`plan`](Self::plan).
    pub fn plan_with(
        generator: &mut impl OnlineGenerator,
        state: &OnlineState,
        next: &impl TimedCurve,
        limits: &MotionLimits,
        latest_join_s: f64,
    ) -> Result<Self, OnlineError> {
        // No end of the curve: it would be cut off as a whole.
        let latest_s = latest_join_s.clamp(0.0, 0.9 * next.duration_s());
        let (mut best, mut least_s, mut hint) = (None, f64::INFINITY, 0);
        for candidate in 0..=CANDIDATES {
            let join_s = latest_s * f64::from(candidate) / f64::from(CANDIDATES);
            if candidate > 0 && join_s == 0.0 {
                break;
            }
            let target = state_at(next, join_s, &mut hint);
            let options = OnlineOptions::default();
            let planned = JerkLimitedMove::plan_with(generator, state, &target, limits, &options);
            if let Ok(way) = planned {
                let total_s = way.duration_s() + next.duration_s() - join_s;
                if total_s < least_s {
                    (best, least_s) = (Some(Self { stop: None, way, join_s }), total_s);
                }
            }
        }
        match best {
            Some(transition) => Ok(transition),
            None => Self::after_a_stop(generator, state, next, limits),
        }
    }

    /// How long it takes \[s\].
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.stop_s() + self.way.duration_s()
    }

    /// The phase at which it joins the curve \[s\]; go on with [`OnPath::join`](super::OnPath::join).
    #[must_use]
    pub const fn join_s(&self) -> f64 {
        self.join_s
    }

    /// Whether the joints stop before they go to the curve.
    #[must_use]
    pub const fn stops_first(&self) -> bool {
        self.stop.is_some()
    }

    /// The state at `t_s` \[s\]: that of the curve where it joins at the duration, and after it the
    /// stop from there.
    #[must_use]
    pub fn at(&self, t_s: f64) -> OnlineState {
        match &self.stop {
            Some(stop) if t_s < stop.duration_s() => stop.at(t_s),
            // So that rounding cannot make the end a little earlier.
            Some(_) | None if t_s >= self.duration_s() => {
                self.way.at((t_s - self.stop_s()).max(self.way.duration_s()))
            }
            Some(_) | None => self.way.at(t_s - self.stop_s()),
        }
    }

    fn stop_s(&self) -> f64 {
        self.stop.as_ref().map_or(0.0, JerkLimitedStop::duration_s)
    }

    fn after_a_stop(
        generator: &mut impl OnlineGenerator,
        state: &OnlineState,
        next: &impl TimedCurve,
        limits: &MotionLimits,
    ) -> Result<Self, OnlineError> {
        let stop = JerkLimitedStop::plan(state, limits)?;
        let rest = OnlineState::at_rest(stop.stop_position());
        let target = state_at(next, 0.0, &mut 0);
        let options = OnlineOptions::default();
        let way = JerkLimitedMove::plan_with(generator, &rest, &target, limits, &options)?;
        Ok(Self { stop: Some(stop), way, join_s: 0.0 })
    }
}

/// The state on `curve`; at its start at rest, where acceleration may begin with a jump.
fn state_at(curve: &impl TimedCurve, phase_s: f64, hint: &mut usize) -> OnlineState {
    let point = curve.point(phase_s, hint);
    if phase_s <= 0.0 {
        return OnlineState::at_rest(point.position);
    }
    OnlineState { position: point.position, velocity: point.first, acceleration: point.second }
}
