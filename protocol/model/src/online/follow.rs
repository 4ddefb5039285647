//! One step after a target that moves.

use super::axis::{AxisMotion, AxisPoint};
use super::request::OnlineState;
use crate::{AxisLimits, MotionLimits};

/// Bandwidth of the law where no limit is near \[rad/s\]. With it as `w` the poles are those of
/// `s³ + 3 w s² + 3 w² s + 3/4 w³`, that is at -0.37 w and (-1.31 ± 0.55 i) w.
const BANDWIDTH: f64 = 60.0;

/// Highest product of bandwidth and period that the law is stable with, with a margin of two.
const BANDWIDTH_TIMES_PERIOD: f64 = 0.15;

/// Share of the acceleration limit that the approach to a far target brakes with.
const BRAKE_ACCELERATION: f64 = 0.8;

/// Share of the jerk limit that the approach brakes with, and that velocity errors are made good
/// with; the rest is for corrections on the way.
const BRAKE_JERK: f64 = 0.5;

/// Shares of the jerk asked for that are tried where all of it would break a limit later.
const JERK_SHARES: [f64; 5] = [1.0, 0.5, 0.25, 0.125, 0.0];

/// How near counts as there: the way that this share of the jerk limit makes in a period. The last
/// step then changes jerk by no more than a third of the limit.
const THERE: f64 = 1.0 / 64.0;

/// How far a step may go beyond a limit, of that limit or \[rad or m\]: rounding, no more.
const ROUNDING: f64 = 1e-9;

/// Where a joint is to be at one instant, and how fast it is to go on from there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisTarget {
    /// Position \[rad or m\].
    pub position: f64,
    /// Velocity \[1/s\].
    pub velocity: f64,
}

impl OnlineState {
    /// The state `dt_s` \[s\] later, each joint after the target that `target` has for it, see
    /// [`AxisPoint::toward`], or on its way to rest if there is none; joints without limits stay
    /// as they are. Allocates nothing.
    #[must_use]
    pub fn toward(
        &self,
        target: impl Fn(usize) -> Option<AxisTarget>,
        limits: &MotionLimits,
        dt_s: f64,
    ) -> Self {
        Self::from_axes(self.position.len(), |joint| {
            let point = self.axis(joint);
            match (limits.get(joint), target(joint)) {
                (Some(limits), Some(target)) => point.toward(target, limits, dt_s),
                (Some(limits), None) => point.toward_rest(limits, dt_s),
                (None, _) => point,
            }
        })
    }
}

impl AxisPoint {
    /// The point `dt_s` \[s\] later of a joint that follows `target`, which is where it should be
    /// now; for a control loop that gives it a new target at each tick.
    ///
    /// Near the target it is a linear filter of third order that does not swing: errors fall to a
    /// third in some 45 ms (longer at periods above 2.5 ms), and a target that moves at constant
    /// velocity is followed without lag. Far from it, velocity follows the curve from which the
    /// joint can brake onto the target, so it does not overshoot. A target at rest is reached
    /// exactly.
    ///
    /// From a point that can stop inside the limits it only goes where it still can, so velocity,
    /// acceleration and jerk stay within their limits whatever the targets are. A target beyond a
    /// position limit counts as at the limit and at rest; a position limit that the joint is
    /// beyond counts as moved out to it. From a point that cannot stop inside, it stops. A value
    /// that is not a number stops it too.
    #[must_use]
    pub fn toward(self, target: AxisTarget, limits: &AxisLimits, dt_s: f64) -> Self {
        let Some(target) = target.inside(limits) else {
            return self.toward_rest(limits, dt_s);
        };
        if self.is_there(target, limits, dt_s) {
            return Self::at_rest(target.position);
        }
        let wanted = Law::new(limits, dt_s).jerk(self, target);
        for share in JERK_SHARES {
            let mut step = AxisMotion::from_point(self);
            step.push(dt_s, share * wanted);
            let point = step.end();
            step.append_stop(limits);
            if is_legal(&step, self, limits) {
                return point;
            }
        }
        self.toward_rest(limits, dt_s)
    }

    /// The point `dt_s` \[s\] later on the least-time way to rest inside the position limits, see
    /// [`JerkLimitedStop`](crate::JerkLimitedStop).
    #[must_use]
    pub fn toward_rest(self, limits: &AxisLimits, dt_s: f64) -> Self {
        AxisMotion::stop_inside(self, limits).at(dt_s)
    }

    fn is_there(self, target: AxisTarget, limits: &AxisLimits, dt_s: f64) -> bool {
        let jerk = THERE * limits.jerk;
        target.velocity == 0.0
            && self.acceleration.abs() <= jerk * dt_s
            && self.velocity.abs() <= jerk * dt_s * dt_s
            && (target.position - self.position).abs() <= jerk * dt_s * dt_s * dt_s
    }
}

impl AxisTarget {
    /// The nearest target that the limits allow; none if it is not a number.
    fn inside(self, limits: &AxisLimits) -> Option<Self> {
        let Self { position, velocity } = self;
        if position.is_nan() || velocity.is_nan() {
            return None;
        }
        if !limits.contains(position) {
            return Some(Self {
                position: position.clamp(limits.lower, limits.upper),
                velocity: 0.0,
            });
        }
        Some(Self { position, velocity: velocity.clamp(-limits.velocity, limits.velocity) })
    }
}

/// The gains, with limits and period.
struct Law<'a> {
    limits: &'a AxisLimits,
    position_gain: f64,
    velocity_gain: f64,
    acceleration_gain: f64,
}

impl<'a> Law<'a> {
    fn new(limits: &'a AxisLimits, dt_s: f64) -> Self {
        let bandwidth = BANDWIDTH.min(BANDWIDTH_TIMES_PERIOD / dt_s);
        let half = 0.5 * bandwidth;
        Self {
            limits,
            position_gain: half,
            velocity_gain: half,
            acceleration_gain: 3.0 * bandwidth,
        }
    }

    /// The jerk at `point`: velocity goes after the curve of [`approach`](Self::approach), with
    /// the acceleration along that curve as feed-forward.
    fn jerk(&self, point: AxisPoint, target: AxisTarget) -> f64 {
        let AxisLimits { velocity: v_max, acceleration: a_max, jerk: j_max, .. } = *self.limits;
        let distance = target.position - point.position;
        let (speed, slope) = self.approach(distance.abs());
        let mut velocity = target.velocity + speed.copysign(distance);
        let mut along = slope * (target.velocity - point.velocity);
        if velocity.abs() > v_max {
            (velocity, along) = (v_max.copysign(velocity), 0.0);
        }
        let error = velocity - point.velocity;
        let back = (self.velocity_gain * error.abs())
            .min((2.0 * BRAKE_JERK * j_max * error.abs()).sqrt())
            .copysign(error);
        let acceleration = (along.clamp(-a_max, a_max) + back).clamp(-a_max, a_max);
        (self.acceleration_gain * (acceleration - point.acceleration)).clamp(-j_max, j_max)
    }

    /// Speed towards a target at rest so far away, and its derivative by the distance: proportional
    /// near it; further out the speed from which a joint comes to rest there, with a share of
    /// its limits. With acceleration `a` and jerk `j` that is `v √(v / j)` of way up to `v = a² / j`,
    /// and `v (v / a + a / j) / 2` above.
    fn approach(&self, distance: f64) -> (f64, f64) {
        let a = BRAKE_ACCELERATION * self.limits.acceleration;
        let j = BRAKE_JERK * self.limits.jerk;
        let (speed, slope) = if distance <= a * a * a / (j * j) {
            let speed = (distance * distance * j).cbrt();
            (speed, 2.0 / 3.0 * speed / distance)
        } else {
            let lead = 0.5 * a / j;
            let speed = a * ((lead * lead + 2.0 * distance / a).sqrt() - lead);
            (speed, a / (speed + a * lead))
        };
        let near = self.position_gain * distance;
        if near <= speed { (near, self.position_gain) } else { (speed, slope) }
    }
}

/// Whether a step and the stop after it keep the limits, or what the start is beyond already.
fn is_legal(motion: &AxisMotion, start: AxisPoint, limits: &AxisLimits) -> bool {
    let within = |peak: f64, limit: f64| peak <= limit * (1.0 + ROUNDING);
    within(motion.acceleration_range().peak(), limits.acceleration.max(start.acceleration.abs()))
        && within(motion.velocity_range().peak(), limits.velocity.max(start.velocity.abs()))
        && limits.excess(motion.position_range(), start.position) <= 0.0
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;

    const LIMITS: AxisLimits =
        AxisLimits { lower: -1.0, upper: 2.0, velocity: 1.5, acceleration: 4.0, jerk: 80.0 };
    const PERIODS: [f64; 5] = [0.0005, 0.001, 0.002, 0.004, 0.01];

    fn at_rest(position: f64) -> AxisTarget {
        AxisTarget { position, velocity: 0.0 }
    }

    /// The points of a joint that is given these targets, from rest at `start`.
    fn follow(
        start: f64,
        period_s: f64,
        targets: impl IntoIterator<Item = AxisTarget>,
    ) -> Vec<AxisPoint> {
        let mut points = vec![AxisPoint::at_rest(start)];
        for target in targets {
            let last = points[points.len() - 1];
            points.push(last.toward(target, &LIMITS, period_s));
        }
        points
    }

    fn differences(values: &[f64], period_s: f64) -> Vec<f64> {
        values.windows(2).map(|pair| (pair[1] - pair[0]) / period_s).collect()
    }

    fn peak(values: &[f64]) -> f64 {
        values.iter().fold(0.0, |peak: f64, value| peak.max(value.abs()))
    }

    #[test]
    fn a_target_at_rest_is_reached_exactly_and_never_overshot() {
        for period_s in PERIODS {
            for goal in [1e-6, 1e-3, 0.01, 0.1, 1.0, 2.0] {
                let ticks = (4.0 / period_s) as usize;
                let points = follow(0.0, period_s, vec![at_rest(goal); ticks]);
                let highest = points.iter().map(|point| point.position).fold(0.0, f64::max);
                assert!(highest <= goal + 1e-9, "{goal} overshot to {highest} at {period_s} s");
                assert_eq!(points[ticks], AxisPoint::at_rest(goal), "at {period_s} s");
            }
        }
    }

    #[test]
    fn a_far_target_is_reached_nearly_as_fast_as_the_limits_allow() {
        let points = follow(-1.0, 0.002, vec![at_rest(2.0); 2000]);
        let arrived = points.iter().position(|point| point.position > 2.0 - 1e-3);
        // 3 rad / 1.5 rad/s + 1.5 / 4 s + 4 / 80 s
        let least_s = 2.425;
        assert!((arrived.expect("arrives") as f64) * 0.002 < least_s + 0.25);
    }

    #[test]
    fn a_target_at_constant_velocity_is_followed_without_lag() {
        for period_s in PERIODS {
            let ticks = (2.5 / period_s) as usize;
            let target = |tick: usize| {
                let time_s = tick as f64 * period_s;
                AxisTarget { position: -0.5 + 0.8 * time_s, velocity: 0.8 }
            };
            let points = follow(-0.5, period_s, (0..ticks).map(target));
            let (last, wanted) = (points[ticks], target(ticks));
            assert!((last.velocity - 0.8).abs() < 1e-4, "{last:?} at {period_s} s");
            // The new point lies a period after the target it was made for.
            assert!((last.position - wanted.position).abs() < 1e-5, "{last:?} at {period_s} s");
        }
    }

    #[test]
    fn a_target_beyond_a_limit_counts_as_at_rest_at_the_limit() {
        let out = AxisTarget { position: 20.0, velocity: 9.0 };
        let points = follow(0.0, 0.002, vec![out; 2500]);
        assert_eq!(points[2500], AxisPoint::at_rest(LIMITS.upper));
    }

    #[test]
    fn a_joint_beyond_a_limit_comes_back_and_goes_no_further() {
        let inside = follow(2.3, 0.002, vec![at_rest(1.9); 2500]);
        assert!(inside.iter().all(|point| point.position <= 2.3));
        assert_eq!(inside[2500], AxisPoint::at_rest(1.9));
    }

    #[test]
    fn a_target_that_is_no_number_stops_the_joint() {
        let moving = AxisPoint { velocity: 1.0, ..AxisPoint::default() };
        let stopped = moving.toward_rest(&LIMITS, 0.002);
        for wrong in [
            AxisTarget { position: f64::NAN, velocity: 0.0 },
            AxisTarget { position: 0.0, velocity: f64::NAN },
        ] {
            assert_eq!(moving.toward(wrong, &LIMITS, 0.002), stopped);
        }
    }

    fn config() -> ProptestConfig {
        ProptestConfig {
            rng_seed: RngSeed::Fixed(37),
            failure_persistence: None,
            ..ProptestConfig::with_cases(400)
        }
    }

    proptest! {
        #![proptest_config(config())]

        #[test]
        fn whatever_the_targets_are_all_limits_hold_in_differences(
            start in -1.0..2.0f64,
            period_s in prop::sample::select(PERIODS.to_vec()),
            targets in prop::collection::vec(
                (prop_oneof![-1.2..2.2f64, -30.0..30.0f64], -3.0..3.0f64, 1..200usize),
                1..12,
            ),
        ) {
            let targets = targets.into_iter().flat_map(|(position, velocity, ticks)| {
                (0..ticks).map(move |tick| AxisTarget {
                    position: position + velocity * tick as f64 * period_s,
                    velocity,
                })
            });
            let points = follow(start, period_s, targets);
            let positions: Vec<f64> = points.iter().map(|point| point.position).collect();
            for position in &positions {
                prop_assert!((LIMITS.lower - 1e-8..=LIMITS.upper + 1e-8).contains(position));
            }
            let velocity = differences(&positions, period_s);
            prop_assert!(peak(&velocity) <= LIMITS.velocity * (1.0 + 1e-6));
            let acceleration = differences(&velocity, period_s);
            prop_assert!(peak(&acceleration) <= LIMITS.acceleration * (1.0 + 1e-6));
            let jerk = differences(&acceleration, period_s);
            prop_assert!(peak(&jerk) <= LIMITS.jerk * (1.0 + 1e-3), "{}", peak(&jerk));
        }
    }
}
