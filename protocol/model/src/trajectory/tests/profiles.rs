//! One axis: closed forms, and no slower than any other profile of its kind.

use proptest::prelude::*;

use super::*;
use crate::trajectory::{AxisProfile, AxisState, ProfileError};

const LIMITS: AxisLimits =
    AxisLimits { lower: -100.0, upper: 100.0, velocity: 2.0, acceleration: 4.0, jerk: 80.0 };

fn plan(position: f64, velocity: f64, target: f64) -> AxisProfile {
    AxisProfile::plan(AxisState { position, velocity }, target, &LIMITS).expect("finite")
}

fn assert_close(found: f64, exact: f64) {
    assert!((found - exact).abs() < 1e-12, "{found}, exact {exact}");
}

#[test]
fn a_short_way_from_rest_is_a_triangle_and_a_long_one_a_trapezoid() {
    // Up to v²/a = 1 the velocity limit is not reached: 2 √(d/a); beyond: d/v + v/a.
    for (distance, duration) in [(0.25, 0.5), (1.0, 1.0), (3.0, 2.0), (-0.25, 0.5), (-3.0, 2.0)] {
        assert_close(plan(0.5, 0.0, 0.5 + distance).duration_s(), duration);
    }
}

#[test]
fn a_start_above_the_velocity_limit_brakes_to_it_first() {
    // 4 to 2 in 0.5 s over 1.5; cruise 2 over 1 s; 2 to 0 in 0.5 s over 0.5.
    let profile = plan(0.0, 4.0, 4.0);
    assert_close(profile.duration_s(), 2.0);
    assert_eq!(profile.at(0.25), AxisState { position: 0.875, velocity: 3.0 });
    assert_eq!(profile.at(1.0).velocity, 2.0);
}

#[test]
fn what_cannot_brake_in_time_overshoots_and_returns() {
    // From 2 towards 0.25: stops at 0.5 after 0.5 s, returns 0.25 as a triangle in 0.5 s.
    let profile = plan(0.0, 2.0, 0.25);
    assert_close(profile.duration_s(), 1.0);
    assert_eq!(profile.range(), (0.0, 0.5));
    assert_close(profile.at(0.5).position, 0.5);
    assert_close(profile.at(0.5).velocity, 0.0);
}

#[test]
fn what_starts_away_from_the_target_turns_first() {
    let profile = plan(0.0, -2.0, 0.5);
    assert_eq!(profile.range(), (-0.5, 0.5));
    assert_close(profile.duration_s(), 0.5 + 1.0);
}

#[test]
fn exact_braking_is_one_phase_and_standing_at_the_target_none() {
    assert_close(plan(0.0, 2.0, 0.5).duration_s(), 0.5);
    let standing = plan(0.3, 0.0, 0.3);
    assert_eq!(standing.duration_s(), 0.0);
    assert_eq!(standing.at(0.0), AxisState { position: 0.3, velocity: 0.0 });
}

#[test]
fn before_the_start_it_is_the_start() {
    let profile = plan(0.1, 1.0, 0.9);
    for t_s in [-1.0, 0.0, f64::NAN] {
        assert_eq!(profile.at(t_s), AxisState { position: 0.1, velocity: 1.0 });
    }
}

#[test]
fn values_without_sense_are_refused_with_their_name() {
    let refusal = |position, velocity, target, limits: AxisLimits| {
        AxisProfile::plan(AxisState { position, velocity }, target, &limits)
            .expect_err("no such motion")
            .to_string()
    };
    let nan = f64::NAN;
    assert_eq!(refusal(nan, 0.0, 0.0, LIMITS), "start position is NaN, which is not finite");
    assert_eq!(refusal(0.0, nan, 0.0, LIMITS), "start velocity is NaN, which is not finite");
    assert_eq!(refusal(0.0, 0.0, nan, LIMITS), "target position is NaN, which is not finite");
    assert_eq!(
        refusal(0.0, 0.0, 1.0, AxisLimits { velocity: 0.0, ..LIMITS }),
        "velocity limit is 0, expected above 0"
    );
    assert_eq!(
        refusal(0.0, 0.0, 1.0, AxisLimits { acceleration: -1.0, ..LIMITS }),
        "acceleration limit is -1, expected above 0"
    );
    let error = AxisProfile::plan(AxisState::default(), f64::MAX, &LIMITS);
    assert_eq!(error.map(|profile| profile.duration_s() > 0.0), Ok(true));
    let slow = AxisLimits { velocity: 1e-300, ..LIMITS };
    let error = AxisProfile::plan(AxisState::default(), f64::MAX, &slow);
    assert_eq!(error, Err(ProfileError::NotFinite { field: "duration", value: f64::INFINITY }));
}

/// Duration of: reach `peak`, hold it, brake to rest at `distance`; `None` if it does not fit.
fn by_way_of(peak: f64, distance: f64, v0: f64, a: f64) -> Option<f64> {
    let reach_s = (peak - v0).abs() / a;
    let left = distance - 0.5 * (v0 + peak) * reach_s - 0.5 * peak * peak.abs() / a;
    let hold_s = left / peak;
    (hold_s >= 0.0).then_some(reach_s + hold_s + peak.abs() / a)
}

proptest! {
    #![proptest_config(seeded(256))]

    #[test]
    fn from_rest_the_duration_is_the_closed_form(
        distance in -10.0..10.0_f64, v in 0.1..5.0_f64, a in 0.1..20.0_f64,
    ) {
        let limits = AxisLimits { velocity: v, acceleration: a, ..LIMITS };
        let start = AxisState { position: 1.0, velocity: 0.0 };
        let profile = AxisProfile::plan(start, 1.0 + distance, &limits).expect("finite");
        let distance = (1.0 + distance - 1.0_f64).abs();
        let exact = if distance < v * v / a {
            2.0 * (distance / a).sqrt()
        } else {
            distance / v + v / a
        };
        prop_assert!((profile.duration_s() - exact).abs() < 1e-9 * exact.max(1.0));
    }

    #[test]
    fn no_other_peak_velocity_is_faster(
        distance in -5.0..5.0_f64, v0 in -4.0..4.0_f64, v in 0.1..3.0_f64, a in 0.1..20.0_f64,
    ) {
        let limits = AxisLimits { velocity: v, acceleration: a, ..LIMITS };
        let start = AxisState { position: 0.0, velocity: v0 };
        let profile = AxisProfile::plan(start, distance, &limits).expect("finite");
        let peaks = (-2000..=2000).map(|step| f64::from(step) / 2000.0 * v);
        let best = peaks
            .filter_map(|peak| by_way_of(peak, distance, v0, a))
            .fold(f64::INFINITY, f64::min);
        prop_assert!(profile.duration_s() <= best + 1e-9, "{} > {best}", profile.duration_s());
    }

    #[test]
    fn velocity_is_continuous_limited_and_the_slope_of_position(
        distance in -5.0..5.0_f64, v0 in -4.0..4.0_f64, v in 0.1..3.0_f64, a in 0.1..20.0_f64,
    ) {
        let limits = AxisLimits { velocity: v, acceleration: a, ..LIMITS };
        let start = AxisState { position: 0.0, velocity: v0 };
        let profile = AxisProfile::plan(start, distance, &limits).expect("finite");
        let (low, high) = profile.range();
        let step = profile.duration_s() / 1000.0;
        let states: Vec<AxisState> =
            (0..=1000).map(|tick| profile.at(f64::from(tick) * step)).collect();
        prop_assert_eq!(states[0], start);
        for pair in states.windows(2) {
            prop_assert!(pair[1].velocity.abs() <= v.max(v0.abs()) + 1e-12);
            prop_assert!((pair[1].velocity - pair[0].velocity).abs() <= a * step * (1.0 + 1e-9));
            let mean = 0.5 * (pair[0].velocity + pair[1].velocity);
            let slope = (pair[1].position - pair[0].position) / step;
            // A mean of two differs from the mean of all by a step / 4 where acceleration jumps.
            prop_assert!((mean - slope).abs() <= 0.26 * a * step + 1e-9);
            prop_assert!(low - 1e-12 <= pair[1].position && pair[1].position <= high + 1e-12);
        }
        prop_assert_eq!(profile.at(profile.duration_s()).position, distance);
    }
}
