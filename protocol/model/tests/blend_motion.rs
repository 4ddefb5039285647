//! Blended joint-space moves, retimed as one motion that agents accept.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod counting_allocator;

use armada_model::{
    BlendedPath, CompiledTrajectory, GeometricPath, JointCorner, JointLimits, MotionLimits,
    PathRows, RetimeOptions, TrajectoryOptions, blended_legs, retime, retime_jerk_limited,
};
use counting_allocator::allocations_of;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const NAMES: [&str; 3] = ["a", "b", "c"];

fn limits() -> MotionLimits {
    let joint = |velocity, acceleration| JointLimits {
        velocity,
        acceleration: Some(acceleration),
        ..JointLimits::default()
    };
    MotionLimits::new(&[joint(1.0, 3.0), joint(1.5, 5.0), joint(2.0, 4.0)]).expect("complete")
}

fn compiled(path: &BlendedPath) -> CompiledTrajectory {
    let timed = retime(path, &limits(), &RetimeOptions::default()).expect("a motion");
    let part = timed.to_trajectory(&NAMES, 0.01).expect("waypoints");
    assert!(part.stretch < 1.02, "slowed down by {}", part.stretch);
    let options = TrajectoryOptions::default();
    CompiledTrajectory::compile(&part.trajectory, &NAMES, &limits(), &options)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Position and speed of all joints every millisecond.
fn samples(motion: &CompiledTrajectory) -> Vec<(Vec<f64>, f64)> {
    let mut hint = 0;
    let mut samples = Vec::new();
    while (samples.len() as f64) * 1e-3 < motion.duration_s() {
        let sample = motion.sample(samples.len() as f64 * 1e-3, &mut hint);
        let speed = sample.velocity.iter().map(|v| v * v).sum::<f64>().sqrt();
        samples.push((sample.position.to_vec(), speed));
    }
    samples
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Distance of a point to the straight line between two others.
fn distance_to_line(point: &[f64], from: &[f64], to: &[f64]) -> f64 {
    let along: f64 = (0..point.len()).map(|i| (point[i] - from[i]) * (to[i] - from[i])).sum();
    let fraction = (along / distance(from, to).powi(2)).clamp(0.0, 1.0);
    let foot: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + fraction * (b - a)).collect();
    distance(point, &foot)
}

const WAYPOINTS: [[f64; 3]; 4] =
    [[0.0, 0.0, 0.0], [0.8, 0.2, -0.3], [0.6, 1.0, 0.4], [-0.3, 0.9, 1.0]];

#[test]
fn blended_corners_are_passed_without_a_stop_and_save_time() {
    let corners = [JointCorner::Radius(0.2), JointCorner::Radius(0.2)];
    let round = blended_legs(&WAYPOINTS, &corners).expect("legs");
    let sharp = blended_legs(&WAYPOINTS, &[JointCorner::Stop, JointCorner::Stop]).expect("legs");
    assert_eq!((round.len(), sharp.len()), (1, 3));
    let motion = compiled(&round[0]);
    let stopping: f64 = sharp.iter().map(|leg| compiled(leg).duration_s()).sum();
    assert!(motion.duration_s() < 0.9 * stopping, "{} {stopping}", motion.duration_s());
    let samples = samples(&motion);
    let inner = samples.len() / 10..samples.len() * 9 / 10;
    let slowest = samples[inner].iter().map(|(_, speed)| *speed).fold(f64::INFINITY, f64::min);
    assert!(slowest > 0.2, "{slowest}");
}

#[test]
fn a_move_there_and_back_turns_short_of_the_corner() {
    let waypoints = [[0.0; 3], [0.9, 0.3, 0.6], [0.0; 3]];
    let legs = blended_legs(&waypoints, &[JointCorner::Radius(0.3)]).expect("legs");
    let motion = compiled(&legs[0]);
    let reached = samples(&motion).iter().map(|(row, _)| row[0]).fold(0.0, f64::max);
    let length = distance(&waypoints[0], &waypoints[1]);
    let expected = 0.9 * (1.0 - 0.375 * 0.3 / length);
    assert!((reached - expected).abs() < 1e-4, "{reached} {expected}");
}

#[test]
fn blended_moves_can_be_run_along_within_limits_of_jerk() {
    let corners = [JointCorner::Radius(0.2), JointCorner::Tolerance(vec![0.03; 3])];
    let legs = blended_legs(&WAYPOINTS, &corners).expect("legs");
    let limits = limits();
    let quick = retime(&legs[0], &limits, &RetimeOptions::default()).expect("a motion");
    let gentle =
        retime_jerk_limited(&legs[0], &limits, &RetimeOptions::default()).expect("a motion");
    assert!(gentle.duration_s() > quick.duration_s());
    assert!(gentle.duration_s() < 1.3 * quick.duration_s(), "{}", gentle.duration_s());
    let at = |tick: u32| gentle.at(f64::from(tick) * 1e-3).expect("three joints").acceleration;
    let mut tick = 0;
    while f64::from(tick) * 1e-3 < gentle.duration_s() {
        let (before, after) = (at(tick), at(tick + 1));
        for (joint, axis) in limits.iter().enumerate() {
            let jerk = (after[joint] - before[joint]) / 1e-3;
            assert!(jerk.abs() < 1.001 * axis.jerk, "{joint} at {tick} ms: {jerk}");
            assert!(after[joint].abs() < 1.0001 * axis.acceleration);
        }
        tick += 1;
    }
}

#[test]
fn evaluating_a_blended_path_allocates_nothing() {
    let corners = [JointCorner::Radius(0.2), JointCorner::Tolerance(vec![0.05; 3])];
    let legs = blended_legs(&WAYPOINTS, &corners).expect("legs");
    let (mut scratch, mut third, mut sum) = ([0.0; 9], [0.0; 3], 0.0);
    let allocations = allocations_of(|| {
        for step in 0..=1000 {
            let s = legs[0].length() * f64::from(step) / 1000.0;
            legs[0].evaluate(s, &mut PathRows::split(&mut scratch));
            legs[0].third_derivative(s, &mut third);
            sum += scratch[0] + third[0].abs();
        }
    });
    assert_eq!(allocations, 0);
    assert!(sum > 100.0, "nothing was calculated: {sum}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 48,
        rng_seed: RngSeed::Fixed(15),
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_blended_moves_are_accepted_and_stay_within_their_deviation(
        waypoints in prop::collection::vec(prop::collection::vec(-2.0..2.0, 3), 3..6),
        radius in 0.05..1.0,
    ) {
        let apart = waypoints.windows(2).all(|pair| distance(&pair[0], &pair[1]) > 0.2);
        prop_assume!(apart);
        let corners = vec![JointCorner::Radius(radius); waypoints.len() - 2];
        let legs = blended_legs(&waypoints, &corners).expect("legs");
        prop_assert_eq!(legs.len(), 1);
        let allowed = legs[0].corners().iter().map(|corner| corner.deviation).fold(0.0, f64::max);
        for (row, _) in samples(&compiled(&legs[0])) {
            let lines = waypoints.windows(2);
            let off = lines
                .map(|ends| distance_to_line(&row, &ends[0], &ends[1]))
                .fold(f64::INFINITY, f64::min);
            prop_assert!(off < allowed + 1e-4, "{} {}", off, allowed);
        }
    }
}
