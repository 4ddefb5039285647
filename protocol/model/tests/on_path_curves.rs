//! Curves as motions on a path see them: derivatives by finite differences, bounds by sampling.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod paths;
mod uniform;

use armada_model::{
    CurveBounds, JerkLimitedMove, JointMove, JointVector, MotionState, OnlineOptions, OnlineState,
    TimedCurve,
};
use paths::{Path, path};
use uniform::Uniform;

fn vector(random: &mut Uniform, joints: usize) -> JointVector {
    JointVector::zeros(joints).expect("few").map_indexed(|_, _| random.signed())
}

fn moves(random: &mut Uniform) -> (JerkLimitedMove, JointMove) {
    let joints = 1 + random.below(7.0);
    let limits = paths::limits(random, joints);
    let (from, to) = (vector(random, joints), vector(random, joints));
    let zero = from.map_indexed(|_, _| 0.0);
    let (a, b) = (OnlineState::at_rest(from), OnlineState::at_rest(to));
    let start = MotionState { position: from, velocity: zero };
    (
        JerkLimitedMove::plan(&a, &b, &limits, &OnlineOptions::default()).expect("legal"),
        JointMove::plan(&start, &to, &limits).expect("legal"),
    )
}

/// Every derivative at random phases of random intervals lies within the bounds of the interval.
fn bounds_hold(curve: &impl TimedCurve, random: &mut Uniform, told: &str) {
    let (mut hint, mut bounds) = (0, CurveBounds::EMPTY);
    for _ in 0..100 {
        let from_s = random.between(0.0, curve.duration_s());
        let length_s = if random.chance(0.5) { 0.01 } else { random.between(0.0, 1.0) };
        curve.bounds(from_s, from_s + length_s, &mut hint, &mut bounds);
        for _ in 0..10 {
            let point = curve.point(random.between(from_s, from_s + length_s), &mut 0);
            for joint in 0..curve.joint_count() {
                let values = [point.first[joint], point.second[joint]];
                for (value, span) in
                    values.into_iter().zip([bounds.first[joint], bounds.second[joint]])
                {
                    let inside = span.low - 1e-9 <= value && value <= span.high + 1e-9;
                    assert!(inside, "{told}, joint {joint}: {value} is not in {span:?}");
                }
            }
        }
    }
}

/// The derivatives are those of the positions, away from knots.
fn derivatives_hold(curve: &impl TimedCurve, random: &mut Uniform, told: &str) {
    let (step_s, mut wrong) = (1e-4, 0);
    for _ in 0..100 {
        let phase_s = random.between(step_s, curve.duration_s() - step_s);
        let [before, at, after] =
            [-step_s, 0.0, step_s].map(|offset| curve.point(phase_s + offset, &mut 0));
        for joint in 0..curve.joint_count() {
            let [x, y, z] = [before, at, after].map(|point| point.position[joint]);
            let first = (z - x) / (2.0 * step_s);
            let second = (z - 2.0 * y + x) / (step_s * step_s);
            let near = (first - at.first[joint]).abs() < 1e-3 + 1e-3 * at.first[joint].abs()
                && (second - at.second[joint]).abs() < 1e-2 + 1e-2 * at.second[joint].abs();
            wrong += u32::from(!near);
        }
    }
    assert!(wrong <= 30, "{told}: {wrong} derivatives are wrong");
}

#[test]
fn bounds_and_derivatives_are_those_of_the_curve() {
    for seed in 0..60 {
        let mut random = Uniform::seeded(seed);
        let Path { curve, .. } = path(&mut random);
        bounds_hold(&curve, &mut random, &format!("seed {seed}, trajectory"));
        derivatives_hold(&curve, &mut random, &format!("seed {seed}, trajectory"));
        let (jerk_limited, trapezoidal) = moves(&mut random);
        bounds_hold(&jerk_limited, &mut random, &format!("seed {seed}, jerk-limited move"));
        derivatives_hold(&jerk_limited, &mut random, &format!("seed {seed}, jerk-limited move"));
        bounds_hold(&trapezoidal, &mut random, &format!("seed {seed}, move"));
        derivatives_hold(&trapezoidal, &mut random, &format!("seed {seed}, move"));
    }
}
