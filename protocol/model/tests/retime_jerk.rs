//! Retiming within limits of jerk.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod path_cases;

use armada_model::{
    AxisLimits, CompiledTrajectory, Grid, JerkLimit, JointLimits, JointPath, MotionLimits,
    PathTrajectoryError, RetimeOptions, SplineEnds, StackedPath, TimedPath, TrajectoryOptions,
    retime, retime_jerk_limited,
};
use path_cases::{Case, axis};

/// What rounding adds to a difference of accelerations over a millisecond, as a share of limits.
const ROUNDING: f64 = 1e-6;

fn uniform(points: usize) -> RetimeOptions {
    RetimeOptions { grid: Grid::Uniform(points), ..RetimeOptions::default() }
}

/// Checks every millisecond, jerk as difference of the accelerations.
fn assert_legal(timed: &TimedPath<JointPath>, limits: &[AxisLimits], what: &str) {
    let period_s = 1e-3;
    let ticks = (timed.duration_s() / period_s).ceil() as u32 + 1;
    let mut before = timed.at(0.0).expect("one robot").acceleration;
    assert!(before.iter().all(|a| a.abs() < 1e-9), "{what} starts with {before:?}");
    for tick in 1..=ticks {
        let now = timed.at(f64::from(tick) * period_s).expect("one robot");
        for (joint, axis) in limits.iter().enumerate() {
            let velocity = now.velocity[joint].abs() / axis.velocity;
            let acceleration = now.acceleration[joint].abs() / axis.acceleration;
            let jerk = (now.acceleration[joint] - before[joint]).abs() / period_s / axis.jerk;
            let most = velocity.max(acceleration).max(jerk);
            assert!(
                most < 1.0 + ROUNDING,
                "{what}, joint {joint}, tick {tick}: {velocity}, {acceleration}, {jerk}"
            );
        }
        before = now.acceleration;
    }
    assert!(before.iter().all(|&a| a == 0.0));
}

#[test]
fn all_limits_are_kept_every_millisecond_at_little_cost() {
    let mut slower = Vec::new();
    for seed in 0..40 {
        let case = Case::new(seed);
        let sharp = retime(case.path(), &case.limits, &uniform(201)).expect("can be retimed");
        let smooth = retime_jerk_limited(case.path(), &case.limits, &uniform(201));
        let smooth = smooth.expect("can be retimed");
        assert_legal(&smooth, &case.limits, &format!("seed {seed}"));
        slower.push(smooth.duration_s() / sharp.duration_s());
    }
    slower.sort_by(f64::total_cmp);
    assert!(slower[20] < 1.05, "median {}", slower[20]);
    assert!(slower[39] < 1.3, "worst {}", slower[39]);
}

/// The limits as a robot has them.
fn motion_limits(limits: &[AxisLimits]) -> MotionLimits {
    let joint = |axis: &AxisLimits| JointLimits {
        lower: Some(axis.lower).filter(|lower| lower.is_finite()),
        upper: Some(axis.upper).filter(|upper| upper.is_finite()),
        velocity: axis.velocity,
        acceleration: Some(axis.acceleration),
        jerk: Some(axis.jerk),
        effort: None,
    };
    MotionLimits::new(&limits.iter().map(joint).collect::<Vec<_>>()).expect("complete")
}

#[test]
fn waypoints_keep_the_limits_of_jerk_between_them_too() {
    let names = ["a", "b", "c", "d", "e", "f", "g"];
    let options = TrajectoryOptions { jerk: JerkLimit::Enforced, ..TrajectoryOptions::default() };
    let mut stretches = Vec::new();
    for seed in 0..20 {
        let case = Case::new(seed);
        let timed = retime_jerk_limited(case.path(), &case.limits, &uniform(201));
        let timed = timed.expect("can be retimed");
        let made = timed.to_smooth_trajectory(&names, 0.02).expect("smooth");
        let limits = motion_limits(&case.limits);
        let compiled = CompiledTrajectory::compile(&made.trajectory, &names, &limits, &options)
            .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert!((compiled.duration_s() / timed.duration_s() - made.stretch).abs() < 1e-9);
        let middle = 0.5 * timed.duration_s();
        let position = compiled.sample(middle * made.stretch, &mut 0).position;
        let wanted = timed.at(middle).expect("seven joints").position;
        assert!(position.max_abs_difference(&wanted) < 1e-4, "seed {seed}");
        stretches.push(made.stretch);
    }
    stretches.sort_by(f64::total_cmp);
    assert!(stretches[19] < 1.3, "{stretches:?}");
}

#[test]
fn a_motion_whose_acceleration_jumps_is_refused_as_not_smooth() {
    let case = Case::new(1);
    let sharp = retime(case.path(), &case.limits, &uniform(201)).expect("can be retimed");
    let names = ["a", "b", "c", "d", "e", "f", "g"];
    let error = sharp.to_smooth_trajectory(&names, 0.02).expect_err("bang-bang");
    assert!(
        matches!(error, PathTrajectoryError::NotSmooth { stretch } if stretch > 2.0),
        "{error}"
    );
}

#[test]
fn low_limits_of_jerk_are_kept_too() {
    for (seed, factor) in (0..12).flat_map(|seed| [0.3, 0.03].map(|factor| (seed, factor))) {
        let case = Case::new(seed);
        let limits: Vec<AxisLimits> = case
            .limits
            .iter()
            .map(|axis| AxisLimits { jerk: factor * axis.jerk, ..*axis })
            .collect();
        let smooth = retime_jerk_limited(case.path(), &limits, &uniform(201));
        let smooth = smooth.expect("can be retimed");
        assert_legal(&smooth, &limits, &format!("seed {seed}, jerk {factor}"));
    }
}

#[test]
fn a_straight_line_of_one_joint_is_near_the_optimum() {
    // 3 rad at 1 rad/s, 2 rad/s², 40 rad/s³: the optimum is d/V + V/A + A/J = 3.55 s.
    let path = JointPath::through(&[[0.0], [3.0]], SplineEnds::NotAKnot).expect("a path");
    let smooth = retime_jerk_limited(path, &[axis(1.0, 2.0)], &uniform(121)).expect("retimed");
    assert!((smooth.duration_s() - 3.55).abs() < 1e-3, "{}", smooth.duration_s());
}

#[test]
fn tiny_paths_and_zero_inertia_points_are_legal() {
    for exponent in 1..8 {
        let case = Case::new(exponent);
        let k = 10.0_f64.powi(-(exponent as i32));
        let rows: Vec<Vec<f64>> =
            case.waypoints.iter().map(|row| row.iter().map(|q| q * k).collect()).collect();
        for ends in [SplineEnds::NotAKnot, SplineEnds::Natural] {
            let path = JointPath::through(&rows, ends).expect("a path");
            let smooth = retime_jerk_limited(path, &case.limits, &uniform(201)).expect("retimed");
            assert_legal(&smooth, &case.limits, &format!("scale {k}"));
        }
    }
}

#[test]
fn two_arms_move_in_phase_and_their_waypoints_are_accepted() {
    let (left, right) = (Case::new(21), Case::new(34));
    let stack = StackedPath::new(vec![left.path(), right.path()]).expect("two paths");
    let limits = [left.limits.as_slice(), &right.limits].concat();
    let timed = retime_jerk_limited(&stack, &limits, &uniform(201)).expect("can be retimed");
    let names: Vec<String> = (0..14).map(|joint| format!("j{joint}")).collect();
    let whole = timed.to_trajectory(&names, 0.01).expect("waypoints");
    assert!(whole.stretch < 1.005, "{}", whole.stretch);
    for (part, limits) in
        stack.split(&whole.trajectory).expect("two").iter().zip([&left.limits, &right.limits])
    {
        let joints: Vec<JointLimits> = limits
            .iter()
            .map(|axis| JointLimits {
                velocity: axis.velocity,
                acceleration: Some(axis.acceleration),
                ..JointLimits::default()
            })
            .collect();
        let limits = MotionLimits::new(&joints).expect("complete limits");
        let options = TrajectoryOptions::default();
        CompiledTrajectory::compile(part, &part.joint_names, &limits, &options).expect("legal");
    }
}

#[test]
fn motion_at_the_ends_is_refused() {
    let case = Case::new(2);
    let options = RetimeOptions { end_velocity: 0.1, ..RetimeOptions::default() };
    let error = retime_jerk_limited(case.path(), &case.limits, &options).expect_err("moves");
    assert_eq!(
        error.to_string(),
        "end_velocity is 0.1, but a jerk-limited motion starts and ends at rest"
    );
}
