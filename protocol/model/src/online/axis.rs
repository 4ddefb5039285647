//! Motion of one joint as phases of constant jerk.

use arrayvec::ArrayVec;
use serde::{Deserialize, Serialize};

use crate::AxisLimits;

/// Most phases of one motion: 2 that bring a start inside its limits, 7 of the way, 4 of a stop.
const MAX_PHASES: usize = 13;

/// Halvings of the speed at which a stop may turn back, so that it stays inside a position limit.
const TURN_HALVINGS: u32 = 40;

/// Position, velocity and acceleration of one joint at one instant, in its unit \[rad or m\].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxisPoint {
    /// Position \[rad or m\].
    pub position: f64,
    /// Velocity \[1/s\].
    pub velocity: f64,
    /// Acceleration \[1/s²\].
    pub acceleration: f64,
}

/// Motion of one joint: phases of constant jerk without a gap between them, then rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisMotion {
    phases: ArrayVec<Phase, MAX_PHASES>,
    /// Where it is after all phases so far.
    end: AxisPoint,
    end_s: f64,
    arrival_s: f64,
}

/// Constant jerk from a point on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Phase {
    start_s: f64,
    start: AxisPoint,
    jerk: f64,
}

/// Lowest and highest value of one quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Range {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl AxisPoint {
    /// At rest at `position`.
    #[must_use]
    pub const fn at_rest(position: f64) -> Self {
        Self { position, velocity: 0.0, acceleration: 0.0 }
    }

    /// Whether neither velocity nor acceleration is left.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.velocity == 0.0 && self.acceleration == 0.0
    }

    /// The point `t_s` \[s\] later under constant `jerk` \[1/s³\].
    fn after(&self, t_s: f64, jerk: f64) -> Self {
        let Self { position, velocity, acceleration } = *self;
        Self {
            position: position + t_s * (velocity + t_s * (0.5 * acceleration + t_s * jerk / 6.0)),
            velocity: velocity + t_s * (acceleration + 0.5 * t_s * jerk),
            acceleration: acceleration + t_s * jerk,
        }
    }
}

impl AxisMotion {
    /// A motion without phases, at `start`.
    #[must_use]
    pub fn from_point(start: AxisPoint) -> Self {
        Self { phases: ArrayVec::new(), end: start, end_s: 0.0, arrival_s: 0.0 }
    }

    /// Adds a phase of `length_s` \[s\] with constant `jerk` \[1/s³\]; none if the length is not
    /// above zero. Returns whether there was room, which there is for 13 phases.
    pub fn push(&mut self, length_s: f64, jerk: f64) -> bool {
        let is_empty = length_s.is_nan() || length_s <= 0.0;
        if is_empty {
            return true;
        }
        let (start, start_s) = (self.end, self.end_s);
        self.end = start.after(length_s, jerk);
        self.end_s = start_s + length_s;
        self.arrival_s = self.end_s;
        self.phases.try_push(Phase { start_s, start, jerk }).is_ok()
    }

    /// The least-time stop from `start`, under the limits of acceleration and jerk alone.
    pub(crate) fn stop(start: AxisPoint, limits: &AxisLimits) -> Self {
        let mut motion = Self::from_point(start);
        motion.come_to_velocity(0.0, limits);
        motion.rest();
        motion
    }

    /// The least-time way from `start` to `velocity`, under the limits of acceleration and jerk
    /// alone; it stays at that velocity.
    pub(crate) fn to_velocity(start: AxisPoint, velocity: f64, limits: &AxisLimits) -> Self {
        let mut motion = Self::from_point(start);
        motion.come_to_velocity(velocity, limits);
        motion
    }

    /// How long [`to_velocity`](Self::to_velocity) takes \[s\].
    pub(crate) fn time_to_velocity(start: AxisPoint, velocity: f64, limits: &AxisLimits) -> f64 {
        let (a_max, jerk) = (limits.acceleration, limits.jerk);
        let down_s = ((start.acceleration.abs() - a_max) / jerk).max(0.0);
        let AxisPoint { velocity: v, acceleration: a, .. } =
            start.after(down_s, -start.acceleration.signum() * jerk);
        let gain = velocity - v;
        let sign = (gain - a * a.abs() / (2.0 * jerk)).signum();
        let peak = (jerk * sign * gain + 0.5 * a * a).max(0.0).sqrt();
        let flat_s = if peak >= a_max {
            (sign * gain - (2.0 * a_max * a_max - a * a) / (2.0 * jerk)) / a_max
        } else {
            0.0
        };
        let peak = peak.min(a_max);
        down_s + (peak - sign * a).max(0.0) / jerk + flat_s.max(0.0) + peak / jerk
    }

    /// The least-time stop from `start` that stays inside the position limits, or leaves them
    /// least.
    ///
    /// The least-time stop never turns back, so it may need more room than there is where a harder
    /// one does not: that one brakes longer, crosses standstill while it still decelerates, and
    /// comes to rest from the other side. The further it turns, the less room it needs.
    pub(crate) fn stop_inside(start: AxisPoint, limits: &AxisLimits) -> Self {
        let stop = Self::stop(start, limits);
        let beyond = |motion: &Self| limits.excess(motion.position_range(), start.position);
        if beyond(&stop) <= 0.0 {
            return stop;
        }
        let hardest = limits.acceleration * limits.acceleration / (2.0 * limits.jerk);
        let turning = |speed: f64| Self::turning_stop(start, stop.end.position, speed, limits);
        let mut best = turning(hardest);
        if beyond(&best) > 0.0 {
            return best;
        }
        let (mut low, mut high) = (0.0, hardest);
        for _ in 0..TURN_HALVINGS {
            let middle = 0.5 * (low + high);
            let motion = turning(middle);
            if beyond(&motion) > 0.0 {
                low = middle;
            } else {
                (high, best) = (middle, motion);
            }
        }
        best
    }

    /// A stop that first comes to `speed` in the direction away from `toward`.
    fn turning_stop(start: AxisPoint, toward: f64, speed: f64, limits: &AxisLimits) -> Self {
        let mut motion = Self::from_point(start);
        motion.come_to_velocity(-speed.copysign(toward - start.position), limits);
        motion.come_to_velocity(0.0, limits);
        motion.rest();
        motion
    }

    /// Appends what brings the joint from where it is to rest, in the least time.
    pub(crate) fn append_stop(&mut self, limits: &AxisLimits) {
        let arrival_s = self.arrival_s;
        self.come_to_velocity(0.0, limits);
        self.rest();
        self.arrival_s = arrival_s;
    }

    /// The least-time way to a velocity with acceleration zero, in closed form: acceleration goes
    /// at full jerk to a peak, stays there if the peak is its limit, and goes back.
    ///
    /// With `d` the velocity still to be gained in the direction of the peak, `(2 p² - a²) / 2J =
    /// d` gives the peak `p` from the acceleration `a` now. An acceleration above its limit is
    /// first brought down at full jerk.
    fn come_to_velocity(&mut self, velocity: f64, limits: &AxisLimits) {
        let (a_max, jerk) = (limits.acceleration, limits.jerk);
        let above = self.end.acceleration.abs() - a_max;
        if above > 0.0 {
            let sign = self.end.acceleration.signum();
            self.push(above / jerk, -sign * jerk);
            self.end.acceleration = sign * a_max;
        }
        let a = self.end.acceleration;
        let gain = velocity - self.end.velocity;
        // Which way is left when the acceleration has gone straight back to zero.
        let sign = (gain - a * a.abs() / (2.0 * jerk)).signum();
        let peak = (jerk * sign * gain + 0.5 * a * a).max(0.0).sqrt().min(a_max);
        let ramp = (2.0 * peak * peak - a * a) / (2.0 * jerk);
        self.push((peak - sign * a) / jerk, sign * jerk);
        if peak >= a_max {
            self.end.acceleration = sign * a_max;
            self.push((sign * gain - ramp) / a_max, 0.0);
        }
        self.push(peak / jerk, -sign * jerk);
        self.end.velocity = velocity;
        self.end.acceleration = 0.0;
    }

    /// Ends the motion here, with the rounding of its velocity and acceleration removed.
    pub(crate) fn rest(&mut self) {
        self.end = AxisPoint::at_rest(self.end.position);
    }

    /// Ends the way at exactly `target`, which it has reached but for rounding.
    pub(crate) fn arrive(&mut self, target: AxisPoint) {
        self.end = target;
    }

    /// This motion about `origin`, started from `start`: every distance times `factor`.
    pub(crate) fn scaled(&self, origin: f64, start: f64, factor: f64) -> Self {
        let scale = |point: AxisPoint| AxisPoint {
            position: start + factor * (point.position - origin),
            velocity: factor * point.velocity,
            acceleration: factor * point.acceleration,
        };
        let mut motion = self.clone();
        for phase in &mut motion.phases {
            phase.start = scale(phase.start);
            phase.jerk *= factor;
        }
        motion.end = scale(motion.end);
        motion
    }

    /// When the target is reached \[s\].
    #[must_use]
    pub const fn arrival_s(&self) -> f64 {
        self.arrival_s
    }

    /// When the joint comes to rest \[s\], not before its arrival.
    #[must_use]
    pub const fn rest_s(&self) -> f64 {
        self.end_s
    }

    /// Where it is after all phases.
    #[must_use]
    pub const fn end(&self) -> AxisPoint {
        self.end
    }

    /// The point at `t_s` \[s\]; the end from [`rest_s`](Self::rest_s) on, the start before zero.
    #[must_use]
    pub fn at(&self, t_s: f64) -> AxisPoint {
        if t_s >= self.end_s {
            return self.end;
        }
        let begun = self.phases.iter().take_while(|phase| phase.start_s <= t_s).last();
        match begun.or_else(|| self.phases.first()) {
            Some(phase) => phase.start.after((t_s - phase.start_s).max(0.0), phase.jerk),
            None => self.end,
        }
    }

    /// The point at `t_s` \[s\] of a motion that goes on from its end at the velocity it has there.
    pub(crate) fn after(&self, t_s: f64) -> AxisPoint {
        if t_s > self.end_s { self.end.after(t_s - self.end_s, 0.0) } else { self.at(t_s) }
    }

    /// Each phase with the point and the time at which it ends.
    fn phases(&self) -> impl Iterator<Item = (&Phase, AxisPoint, f64)> {
        let next = self.phases.iter().skip(1).map(|phase| (phase.start, phase.start_s));
        let ends = next.chain(std::iter::once((self.end, self.end_s)));
        self.phases.iter().zip(ends).map(|(phase, (end, end_s))| (phase, end, end_s))
    }

    /// Calls `piece` with velocity, acceleration, jerk and length \[s\] of each part of a phase that
    /// lies between two times \[s\]; both phases at a border between them, and rest after the end.
    pub(crate) fn pieces(&self, from_s: f64, to_s: f64, mut piece: impl FnMut([f64; 3], f64)) {
        for (phase, _, end_s) in self.phases() {
            if phase.start_s <= to_s && end_s >= from_s {
                let begin_s = from_s.max(phase.start_s);
                let at = phase.start.after(begin_s - phase.start_s, phase.jerk);
                piece([at.velocity, at.acceleration, phase.jerk], to_s.min(end_s) - begin_s);
            }
        }
        if to_s >= self.end_s {
            piece([0.0; 3], 0.0);
        }
    }

    /// Highest absolute jerk, and the ranges of acceleration, velocity and position: exact.
    pub(crate) fn jerk_peak(&self) -> f64 {
        self.phases.iter().map(|phase| phase.jerk.abs()).fold(0.0, f64::max)
    }

    pub(crate) fn acceleration_range(&self) -> Range {
        let mut range = Range::of(self.end.acceleration);
        for phase in &self.phases {
            range.include(phase.start.acceleration);
        }
        range
    }

    pub(crate) fn velocity_range(&self) -> Range {
        let mut range = Range::of(self.end.velocity);
        for (Phase { start, jerk, .. }, end, _) in self.phases() {
            range.include(start.velocity);
            if start.acceleration * end.acceleration < 0.0 {
                range.include(start.after(-start.acceleration / jerk, *jerk).velocity);
            }
        }
        range
    }

    pub(crate) fn position_range(&self) -> Range {
        let mut range = Range::of(self.end.position);
        for (phase, end, end_s) in self.phases() {
            range.include(phase.start.position);
            if !phase.may_stand_still(end) {
                continue;
            }
            for t_s in phase.standstills() {
                if t_s > 0.0 && t_s < end_s - phase.start_s {
                    range.include(phase.start.after(t_s, phase.jerk).position);
                }
            }
        }
        range
    }
}

impl Phase {
    /// Whether the velocity may have a root before `end`: it changes its sign, or it has an extreme.
    fn may_stand_still(&self, end: AxisPoint) -> bool {
        self.start.velocity * end.velocity < 0.0 || self.start.acceleration * end.acceleration < 0.0
    }

    /// Roots of the velocity `v + a t + j t² / 2`, without cancellation; any that do not exist are
    /// not numbers or infinite.
    fn standstills(&self) -> [f64; 2] {
        let AxisPoint { velocity, acceleration, .. } = self.start;
        let root = (acceleration * acceleration - 2.0 * self.jerk * velocity).sqrt();
        let q = -(acceleration + root.copysign(acceleration));
        [q / self.jerk, 2.0 * velocity / q]
    }
}

impl Range {
    const fn of(value: f64) -> Self {
        Self { low: value, high: value }
    }

    const fn include(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }

    pub(crate) const fn peak(self) -> f64 {
        self.high.max(-self.low)
    }
}

impl AxisLimits {
    /// How far `range` goes beyond the position limits, of which one that the start is already
    /// beyond moves out to the start; not above zero if it stays inside.
    pub(crate) const fn excess(&self, range: Range, start: f64) -> f64 {
        (self.lower.min(start) - range.low).max(range.high - self.upper.max(start))
    }
}
