//! Whole motions: every refusal, closed forms, brute force, and random ones at random periods.

mod interpolation;
mod legality;
mod linear;
mod moves;
mod payload;
mod polynomials;
mod profiles;
mod quintic;
mod ramps;
mod refusals;
mod refused_requests;

use proptest::test_runner::{Config as ProptestConfig, RngSeed};

use super::{
    AxisLimits, CompiledTrajectory, Ends, Interpolation, JerkLimit, JointTrajectory,
    LIMIT_TOLERANCE, LimitedQuantity, MotionLimits, SegmentBounds, TrajectoryContext,
    TrajectoryError, TrajectoryOptions, Waypoint,
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
            jerk: Some(axis.jerk).filter(|&jerk| jerk > 0.0),
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
                ..Waypoint::default()
            })
            .collect(),
        ..JointTrajectory::default()
    }
}

fn names(count: usize) -> Vec<String> {
    ('a'..='z').take(count).map(String::from).collect()
}

fn compile(
    trajectory: &JointTrajectory,
    limits: &MotionLimits,
) -> Result<CompiledTrajectory, TrajectoryError> {
    compile_with(trajectory, limits, &TrajectoryOptions::default())
}

fn compile_with(
    trajectory: &JointTrajectory,
    limits: &MotionLimits,
    options: &TrajectoryOptions,
) -> Result<CompiledTrajectory, TrajectoryError> {
    CompiledTrajectory::compile(trajectory, &names(limits.len()), limits, options)
}

fn generous(joints: usize) -> MotionLimits {
    MotionLimits::new(&vec![joint_limits(1e3, 1e3, 1e6); joints]).expect("complete limits")
}

const IN_MOTION: TrajectoryOptions = TrajectoryOptions {
    max_duration_s: 3600.0,
    max_waypoints: 100_000,
    ends: Ends::InMotion,
    jerk: JerkLimit::Ignored,
};

/// Panics unless position and velocity are continuous, and velocity, acceleration and jerk are the
/// derivatives everywhere and within the bounds of their segment, which are met.
fn assert_smooth(compiled: &CompiledTrajectory) {
    let mut hint = 0;
    for bounds in compiled.segments() {
        let mut seen = [[0.0_f64; 3]; crate::MAX_JOINTS];
        // Inside the segment, so that one polynomial holds all around.
        const SAMPLES: u32 = 500;
        let step = bounds.length_s / f64::from(SAMPLES);
        for sample in 1..SAMPLES {
            let t_s = bounds.start_s + f64::from(sample) * step;
            let state = compiled.state_at(t_s, &mut hint);
            let jerk = compiled.jerk_at(t_s, &mut hint);
            let [before, after] =
                [-1.0, 1.0].map(|side| compiled.state_at(t_s + side * 0.5 * step, &mut hint));
            for joint in 0..compiled.joint_count() {
                let values = [state.velocity[joint], state.acceleration[joint], jerk[joint]];
                for (seen, value) in seen[joint].iter_mut().zip(values) {
                    *seen = seen.max(value.abs());
                }
                let [v, a, j] =
                    [bounds.velocity[joint], bounds.acceleration[joint], bounds.jerk[joint]];
                let moved = after.position[joint] - before.position[joint];
                let position_error = (moved / step - state.velocity[joint]).abs();
                let clock = 1e-15 * (1.0 + t_s);
                let rounding = (1e-14 * (1.0 + state.position[joint].abs()) + clock * v) / step;
                assert!(position_error <= j * step * step + 1e-12 * v + rounding, "{t_s}");
                let gained = after.velocity[joint] - before.velocity[joint];
                let velocity_error = (gained / step - state.acceleration[joint]).abs();
                let rounding = (1e-14 * (1.0 + v) + clock * a) / step;
                assert!(velocity_error <= j * step + 1e-12 * a + rounding, "{t_s}");
            }
        }
        for (joint, seen) in seen.iter().enumerate().take(compiled.joint_count()) {
            let rows = [bounds.velocity, bounds.acceleration, bounds.jerk];
            for (derivative, (seen, row)) in seen.iter().zip(rows).enumerate() {
                let bound = row[joint];
                let next = rows.get(derivative + 1).map_or(bound, |row| row[joint] * step);
                assert!(*seen <= bound * (1.0 + 1e-9), "{seen} above {bound} of {derivative}");
                assert!(*seen >= bound - 2.0 * next - 1e-9, "{bound} of {derivative} is not met");
            }
        }
        if bounds.start_s > 0.0 {
            assert_joined(compiled, &bounds);
        }
    }
}

/// Panics if position or velocity jump where a segment begins.
fn assert_joined(compiled: &CompiledTrajectory, bounds: &SegmentBounds<'_>) {
    let at = |t_s: f64| compiled.state_at(t_s, &mut 0);
    let (before, after) = (at(bounds.start_s.next_down()), at(bounds.start_s));
    assert!(before.position.max_abs_difference(&after.position) < 1e-12);
    assert!(before.velocity.max_abs_difference(&after.velocity) < 1e-9);
}

/// Panics if acceleration jumps anywhere but at the ends.
fn assert_acceleration_is_continuous(compiled: &CompiledTrajectory) {
    for bounds in compiled.segments().skip(1) {
        let at = |t_s: f64| compiled.state_at(t_s, &mut 0).acceleration;
        let (before, after) = (at(bounds.start_s.next_down()), at(bounds.start_s));
        let largest = bounds.acceleration.iter().fold(1.0, |a: f64, b| a.max(*b));
        assert!(
            before.max_abs_difference(&after) < 1e-9 * largest,
            "{before:?}, then {after:?} at {}",
            bounds.start_s
        );
    }
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
