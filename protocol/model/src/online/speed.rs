//! One step towards a wanted velocity.

use super::axis::{AxisMotion, AxisPoint};
use super::request::OnlineState;
use crate::{AxisLimits, JointVector, MotionLimits};

/// Room before a position limit that counts as none \[rad or m\]: rounding, no more.
const NO_ROOM: f64 = 1e-9;

/// Halvings of the speed at which a joint can just still stop before a position limit.
const HALVINGS: u32 = 40;

impl OnlineState {
    /// The state `dt_s` \[s\] later, each joint on its least-time way to the velocity `wanted` of it
    /// \[1/s\]; see [`AxisPoint::toward_velocity`]. No joint waits for another. A value that is
    /// missing in `wanted` counts as zero; joints without limits stay as they are.
    ///
    /// Allocates nothing.
    ///
    /// ```
    /// # use armada_model::{JointLimits, JointVector, MotionLimits, OnlineState};
    /// let joint = JointLimits {
    ///     upper: Some(0.5), velocity: 1.0, acceleration: Some(2.0), jerk: Some(40.0),
    ///     ..JointLimits::default()
    /// };
    /// let limits = MotionLimits::new(&[joint])?;
    /// let mut state = OnlineState::at_rest(JointVector::from_slice(&[0.0])?);
    /// for _ in 0..2000 {
    ///     state = state.toward_velocity(&JointVector::from_slice(&[0.8])?, &limits, 0.001);
    /// }
    /// assert!(state.is_at_rest() && (state.position[0] - 0.5).abs() < 1e-8);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn toward_velocity(&self, wanted: &JointVector, limits: &MotionLimits, dt_s: f64) -> Self {
        Self::from_axes(self.position.len(), |joint| {
            let (point, speed) = (self.axis(joint), wanted.get(joint).copied().unwrap_or(0.0));
            limits.get(joint).map_or(point, |axis| point.toward_velocity(speed, axis, dt_s))
        })
    }
}

impl AxisPoint {
    /// The point `dt_s` \[s\] later, on the least-time way to the velocity `wanted` \[1/s\] under the
    /// limits of acceleration and jerk.
    ///
    /// From a point that can stop inside the position limits it only goes where it still can: it
    /// slows down in time, and rests at the limit, to within 1e-9, for as long as the velocity
    /// points there. For that, the way to rest is tried from where the step would end, and the
    /// velocity lowered until it fits. A point that cannot stop inside takes the way to rest that
    /// goes out least, as [`JerkLimitedStop`](crate::JerkLimitedStop) does. A limit that the point
    /// is beyond counts as moved out to it.
    ///
    /// Above the limit of velocity or not a number, `wanted` is brought to the limit or to zero.
    /// With limits that never change, velocities stay within them in every step and between.
    #[must_use]
    pub fn toward_velocity(self, wanted: f64, limits: &AxisLimits, dt_s: f64) -> Self {
        let wanted = if wanted.is_finite() { wanted } else { 0.0 };
        let wanted = wanted.clamp(-limits.velocity, limits.velocity);
        let beyond = |motion: &AxisMotion| limits.excess(motion.position_range(), self.position);
        let is_safe = |point| beyond(&AxisMotion::stop(point, limits)) <= 0.0;
        let step = |speed| AxisMotion::to_velocity(self, speed, limits).after(dt_s);
        let full = step(wanted);
        if is_safe(full) {
            return full;
        }
        let stop = AxisMotion::stop_inside(self, limits);
        let mut best = stop.at(dt_s);
        if beyond(&stop) > -NO_ROOM {
            return best;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let point = step(middle * wanted);
            if is_safe(point) {
                (low, best) = (middle, point);
            } else {
                high = middle;
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;

    const LIMITS: AxisLimits =
        AxisLimits { lower: -1.0, upper: 2.0, velocity: 1.5, acceleration: 4.0, jerk: 80.0 };

    /// Positions of a joint that is told these speeds, each for some periods, from rest at `start`.
    fn follow(start: f64, period_s: f64, orders: &[(f64, usize)]) -> Vec<AxisPoint> {
        let mut points = vec![AxisPoint::at_rest(start)];
        for &(speed, ticks) in orders {
            for _ in 0..ticks {
                let last = points[points.len() - 1];
                points.push(last.toward_velocity(speed, &LIMITS, period_s));
            }
        }
        points
    }

    fn differences(values: &[f64], period_s: f64) -> Vec<f64> {
        values.windows(2).map(|pair| (pair[1] - pair[0]) / period_s).collect()
    }

    fn peak(values: &[f64]) -> f64 {
        values.iter().fold(0.0, |peak: f64, value| peak.max(value.abs()))
    }

    /// Time to change the velocity by `change` from a constant one to another \[s\].
    fn ramp_s(change: f64) -> f64 {
        let AxisLimits { acceleration, jerk, .. } = LIMITS;
        let least = acceleration * acceleration / jerk;
        if change < least {
            2.0 * (change / jerk).sqrt()
        } else {
            change / acceleration + acceleration / jerk
        }
    }

    #[test]
    fn a_velocity_is_reached_in_the_least_time_and_exactly() {
        for (from, to) in [(0.0, 1.5), (0.05, 0.0), (-1.5, 0.8), (0.8, 0.8)] {
            let start = AxisPoint { velocity: from, ..AxisPoint::default() };
            let (wide, time_s) = (f64::INFINITY, ramp_s((to - from).abs()));
            let limits = AxisLimits { lower: -wide, upper: wide, ..LIMITS };
            let reached = start.toward_velocity(to, &limits, time_s + 1e-12);
            assert_eq!((reached.velocity, reached.acceleration), (to, 0.0), "{from} to {to}");
            let before = start.toward_velocity(to, &limits, 0.9 * time_s);
            assert!(time_s == 0.0 || before.acceleration != 0.0, "{from} to {to}");
        }
    }

    #[test]
    fn a_joint_told_to_go_on_rests_at_its_limit_and_comes_back() {
        for period_s in [0.001, 0.004, 0.02] {
            let ticks = (3.0 / period_s) as usize;
            let points = follow(0.0, period_s, &[(1.5, ticks), (-0.5, ticks / 10)]);
            let there = points[ticks];
            assert!(there.is_at_rest(), "{there:?}");
            assert!((there.position - LIMITS.upper).abs() < 2e-9, "{there:?}");
            assert!(points[points.len() - 1].position < LIMITS.upper - 0.05);
        }
    }

    #[test]
    fn a_joint_beyond_a_limit_goes_no_further_and_comes_back() {
        let outside = AxisPoint::at_rest(2.3);
        assert_eq!(outside.toward_velocity(1.0, &LIMITS, 0.01), outside);
        assert!(outside.toward_velocity(-1.0, &LIMITS, 0.01).position < 2.3);
    }

    #[test]
    fn what_is_not_a_velocity_brakes_and_what_is_too_high_is_brought_to_the_limit() {
        let moving = AxisPoint { velocity: 1.0, ..AxisPoint::default() };
        let braked = moving.toward_velocity(0.0, &LIMITS, 0.01);
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(moving.toward_velocity(wrong, &LIMITS, 0.01), braked);
        }
        let fastest = moving.toward_velocity(1.5, &LIMITS, 0.01);
        assert_eq!(moving.toward_velocity(9.0, &LIMITS, 0.01), fastest);
    }

    #[test]
    fn a_point_that_cannot_stop_inside_goes_out_least() {
        let late = AxisPoint { position: 1.9, velocity: 1.4, acceleration: 0.0 };
        let stop = AxisMotion::stop_inside(late, &LIMITS);
        assert_eq!(late.toward_velocity(1.5, &LIMITS, 0.01), stop.at(0.01));
    }

    fn config() -> ProptestConfig {
        ProptestConfig {
            rng_seed: RngSeed::Fixed(31),
            failure_persistence: None,
            ..ProptestConfig::with_cases(400)
        }
    }

    proptest! {
        #![proptest_config(config())]

        #[test]
        fn whatever_is_wanted_all_limits_hold_in_differences(
            start in -1.0..2.0f64,
            period_s in prop::sample::select(vec![0.001, 0.002, 0.004, 0.01]),
            orders in prop::collection::vec((-2.0..2.0f64, 1..200usize), 1..12),
        ) {
            let points = follow(start, period_s, &orders);
            let positions: Vec<f64> = points.iter().map(|point| point.position).collect();
            for position in &positions {
                prop_assert!((LIMITS.lower - 1e-8..=LIMITS.upper + 1e-8).contains(position));
            }
            let velocity = differences(&positions, period_s);
            prop_assert!(peak(&velocity) <= LIMITS.velocity * (1.0 + 1e-9));
            let acceleration = differences(&velocity, period_s);
            prop_assert!(peak(&acceleration) <= LIMITS.acceleration * (1.0 + 1e-6));
            let jerk = differences(&acceleration, period_s);
            prop_assert!(peak(&jerk) <= LIMITS.jerk * (1.0 + 1e-3));
        }

        #[test]
        fn from_whatever_was_wanted_it_rests_within_the_time_that_the_limits_allow(
            start in -1.0..2.0f64,
            orders in prop::collection::vec((-2.0..2.0f64, 1..200usize), 1..6),
        ) {
            let mut orders = orders;
            let period_s = 0.004;
            let used: usize = orders.iter().map(|order| order.1).sum();
            // From any acceleration to none, and then from any velocity to none.
            let longest = ramp_s(LIMITS.velocity) + LIMITS.acceleration / LIMITS.jerk;
            orders.push((0.0, (longest / period_s).ceil() as usize + 1));
            let points = follow(start, period_s, &orders);
            prop_assert!(points.len() > used && points[points.len() - 1].is_at_rest());
        }
    }
}
