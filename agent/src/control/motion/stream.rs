//! Following the samples of a stream.
//!
//! **Positions.** Between samples the target goes on at their speed, so a loop of 500 Hz does not
//! stop at each of 100 samples a second, and there is no lag of a sample. The speed is the one
//! given, or the difference of the last two samples over the time between them on the sender's
//! clock. That clock is found from arrival times and numbers ([`Pace`]): the jitter of a network
//! would otherwise be in the speed, and in the target itself. The joints follow the target within
//! the limits in force as [`OnlineState::toward`] says. When no sample has come for twice the
//! usual time the target is not believed any more, and the joints decelerate: so the robot
//! overshoots the last sample by what it goes in that time and the way of a stop, and not at all if
//! the last sample was at rest.
//!
//! **Speeds** are held from sample to sample, times the speed ratio; a twist is turned into joint
//! speeds at each tick, at the position commanded. [`SpeedFollower`] does the rest. They are
//! believed until the stream starves.
//!
//! Joints that the newest sample does not command come to rest and stay. A bad link lowers the limits
//! of speed, see [`LinkQuality`](crate::control::link_quality::LinkQuality).

use std::time::Duration;

use armada_model::{AxisTarget, JointVector, MonoTime, MotionLimits, MotionState, OnlineState};
use serde::{Deserialize, Serialize};

use super::SpeedFollower;
use super::twist::joint_velocity;
use crate::control::equipment::Equipment;
use crate::control::io::{StreamSample, StreamValues, TwistTarget};
use crate::control::link_quality::LEAST_ALLOWED;
use crate::control::state::{LoopState, Tick};
use crate::drivers::JointSet;

/// A sample may come so many times the usual spacing after the one before.
const PATIENCE: f64 = 2.0;

/// A found speed above so many times the limit is a jump, not a motion.
const JUMP: f64 = 2.0;

/// What follows a stream.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct StreamFollower {
    /// The state of the last tick; none before the first.
    state: Option<OnlineState>,
    wanted: Wanted,
    pace: Option<Pace>,
    arrived: MonoTime,
    /// Share of the limits of speed that is used; none before the first tick.
    rate: Option<f64>,
}

/// What the newest sample asks for.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
enum Wanted {
    /// Rest.
    #[default]
    Rest,
    Position(PositionTarget),
    Velocity(JointVector),
    Twist(TwistTarget),
}

/// Positions of some joints at the arrival of a sample, and how they go on.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct PositionTarget {
    joints: JointSet,
    position: JointVector,
    velocity: JointVector,
}

/// The tick in which a stream is followed.
struct Moment<'a> {
    now: MonoTime,
    period: Duration,
    timeout: Duration,
    limits: &'a MotionLimits,
    equipment: &'a Equipment,
    speed_ratio: f64,
    /// Share of the limits of speed that the stream's link allows.
    allowed: f64,
}

impl StreamFollower {
    /// Goes on with `sample`; returns whether the limits allow only a part of it.
    pub(in crate::control) fn take(
        &mut self,
        sample: &StreamSample,
        limits: &MotionLimits,
        now: MonoTime,
    ) -> bool {
        let spacing_s = self.pace.as_mut().map(|pace| pace.take(now, sample.header.seq));
        if spacing_s.is_none() {
            self.pace = Some(Pace::new(now, sample.header.seq));
        }
        self.arrived = now;
        let (wanted, limited) = match sample.values {
            StreamValues::Position { joints, position, velocity } => {
                let velocity = if velocity.is_empty() {
                    self.found_velocity(&position, spacing_s, limits)
                } else {
                    velocity
                };
                let target = PositionTarget { joints, position, velocity };
                (Wanted::Position(target), target.is_limited(limits))
            }
            StreamValues::Velocity { joints, velocity } => {
                let velocity = velocity
                    .map_indexed(|joint, speed| if joints.contains(joint) { speed } else { 0.0 });
                (Wanted::Velocity(velocity), is_too_fast(&velocity, limits))
            }
            StreamValues::Twist(target) => (Wanted::Twist(target), false),
        };
        self.wanted = wanted;
        limited
    }

    /// Samples stay away: what they said does not count any more.
    pub(in crate::control) const fn starve(&mut self) {
        (self.wanted, self.pace) = (Wanted::Rest, None);
    }

    /// Speeds at `position`, found from the sample before, `spacing_s` ago on the sender's clock.
    fn found_velocity(
        &self,
        position: &JointVector,
        spacing_s: Option<f64>,
        limits: &MotionLimits,
    ) -> JointVector {
        let before = match (&self.wanted, spacing_s) {
            (Wanted::Position(before), Some(spacing_s)) => Some((before, spacing_s)),
            _ => None,
        };
        position.map_indexed(|joint, position| {
            let found = before.and_then(|(before, spacing_s)| {
                let from = before.joints.contains(joint).then(|| before.position.get(joint))??;
                Some((position - from) / spacing_s)
            });
            let highest = limits.get(joint).map_or(0.0, |axis| JUMP * axis.velocity);
            found.filter(|speed| speed.abs() <= highest).unwrap_or(0.0)
        })
    }

    /// The state one period on, and whether a sample is followed in it.
    fn next(&mut self, held: &MotionState, moment: &Moment<'_>) -> (OnlineState, bool) {
        let going_on = self.state.filter(|state| state.position == held.position);
        let state = going_on.unwrap_or_else(|| OnlineState {
            position: held.position,
            velocity: held.velocity,
            acceleration: held.velocity.map_indexed(|_, _| 0.0),
        });
        let rate = self.eased_rate(moment);
        let slowed;
        let limits = if rate < 1.0 {
            slowed = moment.limits.slowed(rate);
            &slowed
        } else {
            moment.limits
        };
        let period_s = moment.period.as_secs_f64();
        let speed = |wanted: &JointVector| {
            let wanted = wanted.map_indexed(|_, speed| moment.speed_ratio * speed);
            SpeedFollower::new(&state).tick(&wanted, limits, period_s)
        };
        let (next, followed) = match &self.wanted {
            Wanted::Rest => (state.toward(|_| None, limits, period_s), false),
            Wanted::Position(target) => {
                let age_s = moment.now.saturating_since(self.arrived).as_secs_f64();
                let believed = age_s <= self.patience_s(moment);
                let ahead_s = age_s + self.pace.as_ref().map_or(0.0, |pace| pace.late_s);
                let target = |joint| target.ahead(joint, ahead_s).filter(|_| believed);
                (state.toward(target, limits, period_s), believed)
            }
            Wanted::Velocity(velocity) => (speed(velocity), true),
            Wanted::Twist(target) => {
                let velocity = joint_velocity(target, moment.equipment, &state.position, limits);
                (speed(&velocity), true)
            }
        };
        self.state = Some(next);
        (next, followed)
    }

    /// Share of the limits of speed in this tick. It changes so slowly that a joint at its limit
    /// keeps it with half of its acceleration.
    fn eased_rate(&mut self, moment: &Moment<'_>) -> f64 {
        // What is refused comes to rest for want of samples.
        let allowed = moment.allowed.clamp(LEAST_ALLOWED, 1.0);
        let before = self.rate.unwrap_or(allowed);
        let slope = moment.limits.iter().map(|axis| 0.5 * axis.acceleration / axis.velocity);
        let step = slope.fold(f64::INFINITY, f64::min) * moment.period.as_secs_f64();
        *self.rate.insert(allowed.clamp(before - step, before + step))
    }

    /// How long the newest sample is believed.
    fn patience_s(&self, moment: &Moment<'_>) -> f64 {
        let timeout_s = moment.timeout.as_secs_f64();
        let spacing_s = self.pace.as_ref().and_then(Pace::spacing_s);
        spacing_s.map_or(timeout_s, |spacing_s| {
            (PATIENCE * (spacing_s + moment.period.as_secs_f64())).min(timeout_s)
        })
    }
}

impl PositionTarget {
    /// The target of a joint `ahead_s` after the sample; none if the joint is not commanded.
    fn ahead(&self, joint: usize, ahead_s: f64) -> Option<AxisTarget> {
        let (position, velocity) = (*self.position.get(joint)?, *self.velocity.get(joint)?);
        let position = position + ahead_s * velocity;
        self.joints.contains(joint).then_some(AxisTarget { position, velocity })
    }

    fn is_limited(&self, limits: &MotionLimits) -> bool {
        let commanded = |joint: &usize| self.joints.contains(*joint);
        let is_beyond = |joint: usize| {
            let (Some(axis), Some(position)) = (limits.get(joint), self.position.get(joint)) else {
                return false;
            };
            let speed = self.velocity.get(joint).map_or(0.0, |speed| speed.abs());
            !axis.contains(*position) || speed > axis.velocity
        };
        (0..limits.len()).filter(commanded).any(is_beyond)
    }
}

fn is_too_fast(velocity: &JointVector, limits: &MotionLimits) -> bool {
    velocity.iter().zip(limits.iter()).any(|(speed, axis)| speed.abs() > axis.velocity)
}

/// When samples were sent, on the receiver's clock: an alpha-beta filter of arrival times over
/// sample numbers, so that jitter is smoothed.
///
/// Source of the gains of the first samples, which average them all: E. Brookner, "Tracking and
/// Kalman Filtering Made Easy", 1998, section 1.2.10; of the last, critical damping with fading
/// memory, section 1.2.6.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Pace {
    seq: u64,
    arrived: MonoTime,
    /// How much later than smoothed the newest sample came \[s\].
    late_s: f64,
    /// Time from one number to the next \[s\].
    interval_s: f64,
    /// Numbers between the last two samples that came.
    steps: f64,
    /// Samples averaged over.
    count: u32,
}

impl Pace {
    /// Lowest share of an error of time that is taken over.
    const ALPHA: f64 = 0.1;
    /// The same of an error of the interval.
    const BETA: f64 = Self::ALPHA * Self::ALPHA / (2.0 - Self::ALPHA);
    /// An error of so many spacings is no jitter: the sender has paused, or numbers anew.
    const RESTART: f64 = 8.0;

    const fn new(arrived: MonoTime, seq: u64) -> Self {
        Self { seq, arrived, late_s: 0.0, interval_s: 0.0, steps: 1.0, count: 1 }
    }

    /// Takes a later sample, in a later tick; returns the time from the one before on the
    /// sender's clock \[s\].
    fn take(&mut self, now: MonoTime, seq: u64) -> f64 {
        let steps = seq.saturating_sub(self.seq).max(1) as f64;
        let passed_s = now.saturating_since(self.arrived).as_secs_f64();
        let expected_s = self.interval_s * steps;
        let error_s = passed_s + self.late_s - expected_s;
        (self.seq, self.arrived, self.steps) = (seq, now, steps);
        if self.count < 2 || error_s.abs() > Self::RESTART * expected_s {
            (self.late_s, self.interval_s, self.count) = (0.0, passed_s / steps, 2);
            return passed_s;
        }
        self.count = self.count.saturating_add(1);
        let k = f64::from(self.count);
        let alpha = (2.0 * (2.0 * k - 1.0) / (k * (k + 1.0))).max(Self::ALPHA);
        let beta = (6.0 / (k * (k + 1.0))).max(Self::BETA);
        self.late_s = (1.0 - alpha) * error_s;
        self.interval_s = (self.interval_s + beta * error_s / steps).max(0.1 * self.interval_s);
        (expected_s + alpha * error_s).max(0.1 * expected_s)
    }

    /// The usual time between samples \[s\]; none after the first.
    fn spacing_s(&self) -> Option<f64> {
        (self.count > 1).then_some(self.interval_s * self.steps)
    }
}

impl LoopState {
    /// What the stream in progress asks for, if there is one.
    pub(super) fn stream_step(&mut self, tick: &Tick<'_>) -> Option<MotionState> {
        let held = *self.limiter.last()?;
        let limits = self.limits_in_force(tick.params);
        let moment = Moment {
            now: tick.now,
            period: tick.params.period,
            timeout: tick.params.stream_timeout,
            limits: &limits,
            equipment: &self.equipment,
            speed_ratio: self.speed_ratio,
            allowed: self.stream.allowed(),
        };
        let (state, followed) = self.stream.follower_mut()?.next(&held, &moment);
        self.stream.note_followed(followed);
        self.hold = state.position;
        Some(state.motion_state())
    }
}
