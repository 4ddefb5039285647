//! What retiming gives is accepted as a trajectory, for one robot and for several in phase.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod path_cases;

use armada_model::{
    AxisLimits, CompiledTrajectory, ConstraintScheme, GeometricPath, Grid, JointLimits, JointPath,
    JointTrajectory, MotionLimits, PathTrajectoryError, RetimeOptions, SplineEnds, StackedPath,
    TrajectoryOptions, retime,
};
use path_cases::{Case, axis};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn names(prefix: &str, count: usize) -> Vec<String> {
    (0..count).map(|joint| format!("{prefix}{joint}")).collect()
}

fn motion_limits(limits: &[AxisLimits]) -> MotionLimits {
    let joints: Vec<JointLimits> = limits
        .iter()
        .map(|axis| JointLimits {
            lower: Some(axis.lower).filter(|limit| limit.is_finite()),
            upper: Some(axis.upper).filter(|limit| limit.is_finite()),
            velocity: axis.velocity,
            acceleration: Some(axis.acceleration),
            ..JointLimits::default()
        })
        .collect();
    MotionLimits::new(&joints).expect("complete limits")
}

fn compile(trajectory: &JointTrajectory, limits: &[AxisLimits]) -> CompiledTrajectory {
    let options = TrajectoryOptions::default();
    CompiledTrajectory::compile(
        trajectory,
        &trajectory.joint_names,
        &motion_limits(limits),
        &options,
    )
    .unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_trapezoid_needs_four_waypoints_and_no_stretch() {
    let path = JointPath::through(&[[0.0], [3.0]], SplineEnds::NotAKnot).expect("a path");
    let options = RetimeOptions { grid: Grid::Uniform(121), ..RetimeOptions::default() };
    let timed = retime(&path, &[axis(1.0, 2.0)], &options).expect("can be retimed");
    let found = timed.to_trajectory(&["a"], 10.0).expect("waypoints");
    assert!(found.stretch < 1.0 + 1e-6, "{}", found.stretch);
    let times: Vec<f64> =
        found.trajectory.waypoints.iter().map(|waypoint| waypoint.time_from_start_s).collect();
    assert_eq!(times.len(), 4, "{times:?}");
    for (found, expected) in times.iter().zip([0.0, 0.5, 3.0, 3.5]) {
        assert!((found - expected).abs() < 1e-6, "{times:?}");
    }
    compile(&found.trajectory, &[axis(1.0, 2.0)]);
}

fn config(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(20180613);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config(96))]

    #[test]
    fn every_motion_is_accepted_and_hardly_stretched(
        seed in 0_u64..100_000,
        spacing_s in prop::sample::select(vec![0.004, 0.02, 0.1, 1.0]),
    ) {
        let case = Case::new(seed);
        let timed = retime(case.path(), &case.limits, &RetimeOptions::default()).expect("retimed");
        let found = timed.to_trajectory(&names("j", 7), spacing_s).expect("waypoints");
        let compiled = compile(&found.trajectory, &case.limits);
        prop_assert!(found.stretch < 1.01, "{}", found.stretch);
        let expected = timed.duration_s() * found.stretch;
        prop_assert!((compiled.duration_s() - expected).abs() < 1e-9);
        let mut hint = 0;
        for tick in 0..200 {
            let t = timed.duration_s() * f64::from(tick) / 200.0;
            let position = compiled.sample(t * found.stretch, &mut hint).position;
            let off = position.max_abs_difference(&timed.at(t).expect("7 joints").position);
            prop_assert!(off < 2e-4, "{off} at {t}");
        }
    }

    #[test]
    fn coarse_and_tiny_motions_are_accepted_too(seed in 0_u64..100_000, points in 3_usize..60) {
        let case = Case::new(seed);
        let k = 10.0_f64.powi(-i32::from((seed % 9) as u8));
        let rows: Vec<Vec<f64>> =
            case.waypoints.iter().map(|row| row.iter().map(|q| q * k).collect()).collect();
        let path = JointPath::through(&rows, SplineEnds::Clamped).expect("a path");
        for scheme in [ConstraintScheme::Collocation, ConstraintScheme::Interpolation] {
            let grid = Grid::Uniform(points);
            let options = RetimeOptions { scheme, grid, ..RetimeOptions::default() };
            let timed = retime(&path, &case.limits, &options).expect("retimed");
            let found = timed.to_trajectory(&names("j", 7), 0.01).expect("waypoints");
            compile(&found.trajectory, &case.limits);
        }
    }
}

#[test]
fn two_arms_and_a_torso_move_in_phase_and_each_part_is_legal() {
    let (left, right) = (Case::new(4), Case::new(13));
    let torso = JointPath::through(&[[0.0, 0.1, 0.0], [0.3, 0.0, 0.2]], SplineEnds::NotAKnot);
    let torso = torso.expect("a path");
    let torso_limits = [axis(0.4, 1.0); 3];
    let paths = vec![left.path(), right.path(), torso.clone()];
    let stack = StackedPath::new(paths).expect("three paths");
    assert_eq!(stack.coordinates(), 17);
    assert_eq!(stack.columns().collect::<Vec<_>>(), [0..7, 7..14, 14..17]);
    let limits = [left.limits.as_slice(), &right.limits, &torso_limits].concat();
    let options = RetimeOptions::default();
    let timed = retime(&stack, &limits, &options).expect("can be retimed");
    assert!(timed.at(0.1).is_none(), "17 joints are more than one sample holds");
    let alone = [
        retime(left.path(), &left.limits, &options).expect("alone").duration_s(),
        retime(right.path(), &right.limits, &options).expect("alone").duration_s(),
        retime(&torso, &torso_limits, &options).expect("alone").duration_s(),
    ];
    let longest = alone.into_iter().fold(0.0, f64::max);
    assert!(timed.duration_s() > longest * (1.0 - 1e-3), "{} < {alone:?}", timed.duration_s());
    assert!(timed.duration_s() < alone.iter().sum(), "{} > {alone:?}", timed.duration_s());
    let all = [names("left/", 7), names("right/", 7), names("torso/", 3)].concat();
    let whole = timed.to_trajectory(&all, 0.02).expect("waypoints");
    let parts = stack.split(&whole.trajectory).expect("three parts");
    let owned: [(&JointPath, &[AxisLimits]); 3] = [
        (&stack.paths()[0], &left.limits),
        (&stack.paths()[1], &right.limits),
        (&stack.paths()[2], &torso_limits),
    ];
    for (part, (path, limits)) in parts.iter().zip(owned) {
        let compiled = compile(part, limits);
        assert_eq!(compiled.duration_s(), timed.duration_s() * whole.stretch);
        for waypoint in &part.waypoints {
            // In phase: each is where its own path is at the common fraction.
            let fraction = timed.fraction_at(waypoint.time_from_start_s / whole.stretch);
            let (start, end) = path.range();
            let mut rows = vec![0.0; 3 * path.coordinates()];
            let mut rows = armada_model::PathRows::split(&mut rows);
            path.evaluate(start + fraction * (end - start), &mut rows);
            for (found, expected) in waypoint.joint_position.iter().zip(&*rows.position) {
                assert!((found - expected).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn a_robot_of_a_stack_may_stand_still() {
    let case = Case::new(9);
    let still = JointPath::with_parameters(&[0.0, 1.0], &[[0.5; 2]; 2], SplineEnds::NotAKnot);
    let (path, still) = (case.path(), still.expect("a path"));
    let stack = StackedPath::new(vec![&path as &dyn GeometricPath, &still]).expect("two paths");
    let limits = [case.limits.as_slice(), &[axis(1.0, 1.0); 2]].concat();
    let options = RetimeOptions { grid: Grid::Uniform(201), ..RetimeOptions::default() };
    let timed = retime(&stack, &limits, &options).expect("can be retimed");
    let alone = retime(&path, &case.limits, &options).expect("can be retimed");
    assert!((timed.duration_s() / alone.duration_s() - 1.0).abs() < 1e-9);
    let none = StackedPath::<JointPath>::new(Vec::new()).expect_err("no path");
    assert_eq!(none.to_string(), "there is no coordinate to move");
}

#[test]
fn what_cannot_be_waypoints_is_refused_with_the_reason() {
    let rows = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]];
    let path = JointPath::through(&rows, SplineEnds::NotAKnot).expect("a path");
    let options = RetimeOptions::default();
    let timed = retime(&path, &[axis(1.0, 2.0); 2], &options).expect("can be retimed");
    let refusal = |names: &[&str], spacing_s: f64| -> PathTrajectoryError {
        timed.to_trajectory(names, spacing_s).expect_err("is wrong")
    };
    assert_eq!(refusal(&["a"], 0.1).to_string(), "1 joint names, but the path has 2 coordinates");
    for (spacing_s, message) in [
        (0.0, "spacing is 0 s, expected at least 0.0001 s"),
        (f64::NAN, "spacing is NaN s, expected at least 0.0001 s"),
    ] {
        assert_eq!(refusal(&["a", "b"], spacing_s).to_string(), message);
    }
    let slow = retime(&path, &[axis(0.01, 2.0); 2], &options).expect("can be retimed");
    assert_eq!(
        slow.to_trajectory(&["a", "b"], 1e-4).expect_err("too many").to_string(),
        "spacing 0.0001 s makes more than the 100000 waypoints a trajectory may have"
    );
    let moving = RetimeOptions { end_velocity: 0.1, ..options };
    let moving = retime(&path, &[axis(1.0, 2.0); 2], &moving).expect("can be retimed");
    let error = moving.to_trajectory(&["a", "b"], 0.1).expect_err("moves at the end");
    assert!(matches!(error, PathTrajectoryError::NotAtRest { time_s, .. } if time_s > 1.0));
}

#[test]
fn a_position_limit_that_is_touched_between_grid_points_is_not_exceeded() {
    // The parabola (s, 1 - (s - 1)²) touches 1 in the middle, where no point of this grid is.
    let rows = [[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]];
    let path = JointPath::with_parameters(&[0.0, 1.0, 2.0], &rows, SplineEnds::NotAKnot);
    let path = path.expect("a path");
    let limits = [axis(1.0, 2.0), AxisLimits { upper: 1.0, ..axis(1.0, 2.0) }];
    let options = RetimeOptions { grid: Grid::Uniform(40), ..RetimeOptions::default() };
    let timed = retime(&path, &limits, &options).expect("can be retimed");
    compile(&timed.to_trajectory(&["a", "b"], 0.05).expect("waypoints").trajectory, &limits);
    let tight = [limits[0], AxisLimits { upper: 0.99999, ..limits[1] }];
    let coarse = RetimeOptions { grid: Grid::Uniform(4), ..RetimeOptions::default() };
    let timed = retime(&path, &tight, &coarse).expect("no grid point is beyond");
    let error = timed.to_trajectory(&["a", "b"], 0.05).expect_err("is beyond");
    assert!(
        matches!(error, PathTrajectoryError::PositionBeyondLimit { joint: 1, limit, .. }
            if limit == 0.99999),
        "{error}"
    );
}
