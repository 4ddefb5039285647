//! Whole motions: every refusal, closed forms, brute force, and random ones at random periods.

mod interpolation;
mod legality;
mod moves;
mod polynomials;
mod profiles;
mod ramps;
mod refusals;

use proptest::test_runner::{Config as ProptestConfig, RngSeed};

use super::{
    AxisLimits, CompiledTrajectory, Interpolation, JointTrajectory, LIMIT_TOLERANCE,
    LimitedQuantity, MotionLimits, TrajectoryError, TrajectoryOptions, Waypoint,
};
use crate::{JointLimits, JointVector};

/// The same random cases at every run, so that a failure is the fault of a change.
fn seeded(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(0x0a4d_ada0),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn joint_limits(position: f64, velocity: f64, acceleration: f64) -> JointLimits {
    JointLimits {
        lower: Some(-position),
        upper: Some(position),
        velocity,
        acceleration: Some(acceleration),
        jerk: None,
        effort: None,
    }
}

fn limits_of(axes: &[AxisLimits]) -> MotionLimits {
    let limits: Vec<_> = axes
        .iter()
        .map(|axis| JointLimits {
            lower: Some(axis.lower),
            upper: Some(axis.upper),
            velocity: axis.velocity,
            acceleration: Some(axis.acceleration),
            jerk: None,
            effort: None,
        })
        .collect();
    MotionLimits::new(&limits).expect("complete limits")
}

fn vector(values: &[f64]) -> JointVector {
    JointVector::from_slice(values).expect("short and finite")
}

/// Waypoints of the joints `a`, `b`, … at `times`; a row of `velocities` may be empty.
fn trajectory(times: &[f64], positions: &[&[f64]], velocities: &[&[f64]]) -> JointTrajectory {
    let joints = positions.first().map_or(0, |row| row.len());
    let rows = times.iter().zip(positions).enumerate();
    JointTrajectory {
        joint_names: names(joints),
        waypoints: rows
            .map(|(index, (&time_from_start_s, row))| Waypoint {
                time_from_start_s,
                joint_position: row.to_vec(),
                joint_velocity: velocities.get(index).map_or(Vec::new(), |row| row.to_vec()),
            })
            .collect(),
        interpolation: Interpolation::CubicSpline,
    }
}

fn names(count: usize) -> Vec<String> {
    ('a'..='z').take(count).map(String::from).collect()
}

fn compile(
    trajectory: &JointTrajectory,
    limits: &MotionLimits,
) -> Result<CompiledTrajectory, TrajectoryError> {
    let order = names(limits.len());
    CompiledTrajectory::compile(trajectory, &order, limits, &TrajectoryOptions::default())
}

/// Panics unless positions sent every `period_s` obey `limits` as a controller can see it: each
/// position, each difference, each second difference.
fn assert_legal(positions: &[JointVector], period_s: f64, limits: &MotionLimits) {
    for (joint, axis) in limits.iter().enumerate() {
        let largest = positions.iter().map(|x| x[joint].abs()).fold(1.0, f64::max);
        // Three positions, each rounded some times.
        let rounding = 16.0 * f64::EPSILON * largest;
        for (tick, x) in positions.iter().enumerate() {
            let outside = (axis.lower - x[joint]).max(x[joint] - axis.upper);
            assert!(outside <= 1e-9, "joint {joint}, tick {tick}: {} is outside", x[joint]);
        }
        for (tick, x) in positions.windows(2).enumerate() {
            let speed = ((x[1][joint] - x[0][joint]) / period_s).abs();
            let highest = axis.velocity * (1.0 + 1e-9) + rounding / period_s;
            assert!(speed <= highest, "joint {joint}, tick {tick}: speed {speed} > {highest}");
        }
        for (tick, x) in positions.windows(3).enumerate() {
            let second = x[2][joint] - 2.0 * x[1][joint] + x[0][joint];
            let acceleration = (second / period_s / period_s).abs();
            let highest = axis.acceleration * (1.0 + 1e-9) + rounding / period_s / period_s;
            assert!(
                acceleration <= highest,
                "joint {joint}, tick {tick}: acceleration {acceleration} > {highest}"
            );
        }
    }
}
