//! What must hold for every retimed path: closed forms, laws of scaling, limits, refusals.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod path_cases;

use armada_model::{
    AxisLimits, ConstraintScheme, GeometricPath, Grid, JointPath, LimitedQuantity, PathRows,
    RetimeError, RetimeOptions, SplineEnds, retime,
};
use path_cases::{Case, axis};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn uniform(points: usize) -> RetimeOptions {
    RetimeOptions { grid: Grid::Uniform(points), ..RetimeOptions::default() }
}

#[test]
fn a_straight_line_of_one_joint_is_the_trapezoid() {
    // 3 rad at 1 rad/s and 2 rad/s²: half a second up, 2.5 s at full speed, half a second down.
    let path = JointPath::through(&[[0.0], [3.0]], SplineEnds::NotAKnot).expect("a path");
    let timed = retime(&path, &[axis(1.0, 2.0)], &uniform(121)).expect("can be retimed");
    assert!((timed.duration_s() - 3.5).abs() < 1e-9, "{}", timed.duration_s());
    for (t, position, velocity) in [(0.25, 0.0625, 0.5), (1.75, 1.5, 1.0), (3.25, 2.9375, 0.5)] {
        let sample = timed.at(t).expect("one joint");
        assert!((sample.position[0] - position).abs() < 1e-9, "{t}: {sample:?}");
        assert!((sample.velocity[0] - velocity).abs() < 1e-9, "{t}: {sample:?}");
    }
    for part in timed.saturations() {
        assert!((part.share - 1.0).abs() < 1e-9, "{part:?}");
        let middle = 0.5 * (part.from_fraction + part.to_fraction);
        if (middle - 1.0 / 12.0).abs() < 0.01 || (middle - 11.0 / 12.0).abs() < 0.01 {
            continue;
        }
        let cruises = (1.0 / 12.0..11.0 / 12.0).contains(&middle);
        assert_eq!(part.quantity == LimitedQuantity::Velocity, cruises, "{part:?}");
    }
}

#[test]
fn a_short_line_of_one_joint_is_a_triangle() {
    let path = JointPath::through(&[[0.0], [1e-6]], SplineEnds::NotAKnot).expect("a path");
    let timed = retime(&path, &[axis(1.0, 4.0)], &uniform(101)).expect("can be retimed");
    let expected = 2.0 * (1e-6_f64 / 4.0).sqrt();
    assert!((timed.duration_s() / expected - 1.0).abs() < 1e-9, "{}", timed.duration_s());
}

#[test]
fn a_quarter_circle_is_passed_as_fast_as_its_curvature_allows() {
    // Along q = (cos s, sin s) at constant speed the acceleration reaches the limit of one joint
    // where the other is at its fastest, so v² <= A there.
    let rows: Vec<[f64; 2]> =
        (0..=400).map(|i| f64::from(i) * 0.025).map(|s| [s.cos(), s.sin()]).collect();
    let path = JointPath::through(&rows, SplineEnds::NotAKnot).expect("a path");
    let limits = [axis(10.0, 1.0); 2];
    let timed = retime(&path, &limits, &uniform(2001)).expect("can be retimed");
    for knot in timed.knots() {
        assert!(knot.velocity < 1.2, "{knot:?}");
    }
    let middle = timed.state_at(0.5 * timed.duration_s());
    assert!(middle.velocity > 0.99, "{middle:?}");
}

#[test]
fn the_tool_speed_is_kept_where_the_parameter_is_its_way() {
    let path = JointPath::through(&[[0.0], [3.0]], SplineEnds::NotAKnot).expect("a path");
    let options = RetimeOptions { max_velocity: 0.5, ..uniform(301) };
    let timed = retime(&path, &[axis(1.0, 2.0)], &options).expect("can be retimed");
    assert!((timed.duration_s() - 6.25).abs() < 1e-3, "{}", timed.duration_s());
}

#[test]
fn motion_at_the_ends_is_kept() {
    let case = Case::new(5);
    let options = RetimeOptions { start_velocity: 0.05, end_velocity: 0.08, ..uniform(201) };
    let timed = retime(case.path(), &case.limits, &options).expect("can be retimed");
    assert!((timed.state_at(0.0).velocity - 0.05).abs() < 1e-12);
    assert!((timed.state_at(timed.duration_s()).velocity - 0.08).abs() < 1e-12);
}

/// Largest share of a limit of velocity and of acceleration, looked at densely.
fn densest_shares(case: &Case, options: &RetimeOptions) -> (f64, f64) {
    let timed = retime(case.path(), &case.limits, options).expect("can be retimed");
    let mut shares = (0.0_f64, 0.0_f64);
    for tick in 0..=4000 {
        let sample = timed.at(timed.duration_s() * f64::from(tick) / 4000.0).expect("7 joints");
        for (joint, axis) in case.limits.iter().enumerate() {
            shares.0 = shares.0.max(sample.velocity[joint].abs() / axis.velocity);
            shares.1 = shares.1.max(sample.acceleration[joint].abs() / axis.acceleration);
        }
    }
    shares
}

#[test]
fn between_grid_points_limits_are_exceeded_with_the_square_of_the_step_only() {
    let mut worst = [0.0_f64; 3];
    for seed in 0..60 {
        let case = Case::new(seed);
        for (worst, grid) in
            worst.iter_mut().zip([Grid::Uniform(201), Grid::Uniform(801), Grid::Adaptive])
        {
            let options = RetimeOptions { grid, ..RetimeOptions::default() };
            let (velocity, acceleration) = densest_shares(&case, &options);
            *worst = worst.max(velocity - 1.0).max(acceleration - 1.0);
        }
    }
    println!("worst excess: {worst:?}");
    assert!(worst[0] < 0.05 && worst[1] < 0.01 && worst[2] < 0.005, "{worst:?}");
}

#[test]
fn nearly_everywhere_a_limit_is_reached() {
    for seed in 0..60 {
        let case = Case::new(seed);
        let timed = retime(case.path(), &case.limits, &uniform(401)).expect("can be retimed");
        let parts = timed.saturations();
        let reached = parts.iter().filter(|part| part.share > 0.98).count();
        assert!(10 * reached >= 9 * parts.len(), "seed {seed}: {reached} of {}", parts.len());
        assert!(parts.iter().all(|part| part.joint < 7));
    }
}

#[test]
fn a_motion_is_its_path_by_the_chain_rule() {
    let case = Case::new(3);
    let timed = retime(case.path(), &case.limits, &uniform(201)).expect("can be retimed");
    let step = 1e-5;
    let mut rising = 0.0;
    for tick in 1..200 {
        let t = timed.duration_s() * f64::from(tick) / 200.3;
        let (before, here, after) = (timed.at(t - step), timed.at(t), timed.at(t + step));
        let (before, here, after) =
            (before.expect("7"), here.expect("7 joints"), after.expect("7"));
        let mut rows = vec![0.0; 21];
        timed.path().evaluate(timed.state_at(t).s, &mut PathRows::split(&mut rows));
        assert_eq!(here.position[..], rows[..7]);
        for joint in 0..7 {
            let velocity = (after.position[joint] - before.position[joint]) / (2.0 * step);
            assert!((velocity - here.velocity[joint]).abs() < 1e-3, "{t}");
        }
        assert!(timed.fraction_at(t) > rising);
        rising = timed.fraction_at(t);
    }
    assert_eq!((timed.fraction_at(-1.0), timed.fraction_at(f64::NAN)), (0.0, 0.0));
    assert_eq!(timed.fraction_at(1e9), 1.0);
    let end = timed.at(timed.duration_s()).expect("7 joints");
    assert!(end.velocity.iter().chain(end.acceleration.iter()).all(|&value| value == 0.0));
}

fn config(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(20180613);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config(64))]

    #[test]
    fn faster_limits_shorten_the_time_in_proportion(seed in 0_u64..10_000, k in 0.01_f64..100.0) {
        let case = Case::new(seed);
        let faster: Vec<AxisLimits> = case
            .limits
            .iter()
            .map(|limits| axis(limits.velocity * k, limits.acceleration * k * k))
            .collect();
        for grid in [Grid::Uniform(101), Grid::Adaptive] {
            let options = RetimeOptions { grid, ..RetimeOptions::default() };
            let slow = retime(case.path(), &case.limits, &options).expect("can be retimed");
            let fast = retime(case.path(), &faster, &options).expect("can be retimed");
            prop_assert!((fast.duration_s() * k / slow.duration_s() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn the_way_back_takes_as_long(seed in 0_u64..10_000) {
        let case = Case::new(seed);
        let mut back = case.waypoints.clone();
        back.reverse();
        let back = JointPath::through(&back, SplineEnds::NotAKnot).expect("a path");
        let there = retime(case.path(), &case.limits, &uniform(401)).expect("can be retimed");
        let back = retime(back, &case.limits, &uniform(401)).expect("can be retimed");
        let ratio = back.duration_s() / there.duration_s();
        prop_assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
    }

    #[test]
    fn a_scaled_path_under_scaled_limits_takes_as_long(
        seed in 0_u64..10_000,
        exponent in -9_i32..6,
    ) {
        let case = Case::new(seed);
        let k = 10.0_f64.powi(exponent);
        let rows: Vec<Vec<f64>> =
            case.waypoints.iter().map(|row| row.iter().map(|q| q * k).collect()).collect();
        let scaled: Vec<AxisLimits> =
            case.limits.iter().map(|l| axis(l.velocity * k, l.acceleration * k)).collect();
        let path = JointPath::through(&rows, SplineEnds::NotAKnot).expect("a path");
        let scaled = retime(path, &scaled, &uniform(101)).expect("can be retimed");
        let plain = retime(case.path(), &case.limits, &uniform(101)).expect("can be retimed");
        prop_assert!((scaled.duration_s() / plain.duration_s() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn every_kind_of_path_can_be_retimed(seed in 0_u64..100_000, points in 3_usize..400) {
        let case = Case::new(seed);
        for ends in [SplineEnds::NotAKnot, SplineEnds::Natural, SplineEnds::Clamped] {
            for scheme in [ConstraintScheme::Collocation, ConstraintScheme::Interpolation] {
                let path = JointPath::through(&case.waypoints, ends).expect("a path");
                let options = RetimeOptions { scheme, ..uniform(points) };
                let timed = retime(&path, &case.limits, &options).expect("can be retimed");
                prop_assert!(timed.duration_s() > 0.01 && timed.duration_s() < 1e3);
            }
        }
    }
}

fn refusal(rows: &[[f64; 1]], axis: AxisLimits, options: &RetimeOptions) -> String {
    let path = JointPath::with_parameters(&[0.0, 0.5, 2.0], rows, SplineEnds::NotAKnot);
    retime(path.expect("a path"), &[axis], options).expect_err("is wrong").to_string()
}

#[test]
fn what_cannot_be_retimed_is_refused_with_the_reason() {
    let rows = [[0.0], [0.25], [4.0]];
    let plain = axis(1.0, 2.0);
    let options = uniform(101);
    for (axis, message) in [
        (AxisLimits { velocity: 0.0, ..plain }, "joint 0: velocity limit is 0, expected"),
        (AxisLimits { acceleration: f64::NAN, ..plain }, "joint 0: acceleration limit is NaN"),
        (AxisLimits { jerk: -1.0, ..plain }, "joint 0: jerk limit is -1, expected"),
        (
            AxisLimits { upper: 1.0, ..plain },
            "joint 0: position 1.0404 at fraction 0.51 is beyond the limit 1",
        ),
    ] {
        let found = refusal(&rows, axis, &options);
        assert!(found.starts_with(message), "{found}");
    }
    for (options, message) in [
        (uniform(2), "2 grid points, expected 3 to 100000"),
        (uniform(usize::MAX), "18446744073709551615 grid points, expected 3 to 100000"),
        (
            RetimeOptions { start_velocity: -1.0, ..options },
            "start_velocity is -1, expected a number above 0, or 0 for rest at an end",
        ),
        (
            RetimeOptions { end_velocity: 0.5, ..options },
            "path velocity 0.5 at fraction 1 is above 0.25, the highest that the velocity limit \
             of joint 0 allows",
        ),
    ] {
        assert_eq!(refusal(&rows, plain, &options), message);
    }
    assert_eq!(refusal(&[[1.0]; 3], plain, &options), "the path has no length: no joint moves");
}

#[test]
fn a_start_that_is_too_fast_or_too_slow_names_joint_and_limit() {
    let path = JointPath::through(&[[0.0, 0.0], [0.1, 0.0]], SplineEnds::NotAKnot).expect("path");
    let limits = [axis(10.0, 1.0), axis(1.0, 1.0)];
    let fast = RetimeOptions { start_velocity: 1.0, ..uniform(101) };
    let Err(RetimeError::TooFast { fraction, highest, joint, quantity, .. }) =
        retime(&path, &limits, &fast)
    else {
        panic!("0.1 rad do not suffice to brake")
    };
    assert_eq!((fraction, joint, quantity), (0.0, 0, LimitedQuantity::Acceleration));
    assert!((highest - 0.2_f64.sqrt()).abs() < 1e-9, "{highest}");
    let slow = RetimeOptions { end_velocity: 1.0, ..uniform(101) };
    let Err(RetimeError::TooSlow { lowest, joint, quantity, .. }) = retime(&path, &limits, &slow)
    else {
        panic!("0.1 rad do not suffice to speed up")
    };
    assert_eq!((joint, quantity), (0, LimitedQuantity::Acceleration));
    assert!((lowest - 0.8_f64.sqrt()).abs() < 1e-9, "{lowest}");
}

#[test]
fn a_bend_before_a_fast_end_is_infeasible_there() {
    // The first joint turns back before the end, which shall be passed at full speed.
    let rows = [[0.0, 0.0], [1.0, 1.0], [1.05, 2.0], [1.0, 2.1]];
    let path = JointPath::with_parameters(&[0.0, 1.0, 2.0, 2.1], &rows, SplineEnds::NotAKnot);
    let limits = [axis(1.0, 0.02), axis(1.0, 0.02)];
    let options = RetimeOptions { end_velocity: 0.9, ..uniform(201) };
    let error = retime(path.expect("a path"), &limits, &options).expect_err("too fast");
    let RetimeError::Infeasible { fraction, joint, .. } = error else { panic!("{error}") };
    assert!(fraction > 0.5 && fraction < 1.0 && joint < 2, "{error}");
}

#[test]
fn limits_must_fit_the_path_and_the_path_be_finite() {
    #[derive(Debug)]
    struct Broken;
    impl GeometricPath for Broken {
        fn coordinates(&self) -> usize {
            1
        }
        fn range(&self) -> (f64, f64) {
            (0.0, 1.0)
        }
        fn evaluate(&self, s: f64, out: &mut PathRows<'_>) {
            (out.position[0], out.first[0], out.second[0]) = (s, 1.0, 1.0 / (s - 0.5));
        }
    }
    let error = retime(Broken, &[axis(1.0, 1.0)], &uniform(101)).expect_err("infinite");
    assert_eq!(
        error.to_string(),
        "joint 0: second derivative of the path is inf at fraction 0.5, not finite"
    );
    let error = retime(Broken, &[], &uniform(101)).expect_err("no limits");
    assert_eq!(error.to_string(), "limits of 0 joints, but the path has 1 coordinates");
}
