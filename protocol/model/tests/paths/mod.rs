//! Random legal trajectories, as fast as their limits allow or slower.
#![allow(dead_code, reason = "each test binary uses a part of this module")]
#![allow(clippy::expect_used, reason = "helpers of tests fail by panicking")]

use armada_model::{
    CompiledTrajectory, Interpolation, JerkLimit, JointLimits, JointTrajectory, MotionLimits,
    TrajectoryOptions, Waypoint,
};

use crate::uniform::Uniform;

pub(crate) struct Path {
    pub(crate) curve: CompiledTrajectory,
    pub(crate) limits: MotionLimits,
}

pub(crate) fn limits(random: &mut Uniform, joints: usize) -> MotionLimits {
    // Of some robots so high that acceleration alone limits.
    let jerk = if random.chance(0.3) { 100.0 } else { 1.0 };
    let limits: Vec<_> = (0..joints)
        .map(|_| {
            let acceleration = random.between(2.0, 20.0);
            JointLimits {
                velocity: random.between(0.5, 3.0),
                acceleration: Some(acceleration),
                jerk: Some(acceleration * jerk * random.between(10.0, 100.0)),
                ..JointLimits::default()
            }
        })
        .collect();
    MotionLimits::new(&limits).expect("complete limits")
}

/// Of any interpolation; some are limited in jerk, others have jumps of acceleration.
pub(crate) fn path(random: &mut Uniform) -> Path {
    let joints = 1 + random.below(7.0);
    let limits = limits(random, joints);
    let names: Vec<String> = (0..joints).map(|joint| format!("joint_{joint}")).collect();
    let count = 2 + random.below(9.0);
    let interpolation = match random.below(6.0) {
        0 => Interpolation::JointLinear,
        1 | 2 => Interpolation::QuinticHermite,
        _ => Interpolation::CubicSpline,
    };
    let quintic = interpolation == Interpolation::QuinticHermite;
    let options = TrajectoryOptions {
        jerk: if quintic && random.chance(0.5) { JerkLimit::Enforced } else { JerkLimit::Ignored },
        ..TrajectoryOptions::default()
    };
    let takes_velocities = interpolation != Interpolation::JointLinear;
    let spacing = random.between(0.02, 1.0);
    let has_velocities = takes_velocities && random.chance(0.5);
    let mut times = vec![0.0];
    let mut rows = vec![vec![0.0; joints]];
    for _ in 1..count {
        times.push(times[times.len() - 1] + spacing * random.between(0.3, 1.7));
        let last = rows[rows.len() - 1].clone();
        rows.push(last.iter().map(|x| x + random.signed()).collect());
    }
    let slopes: Vec<Vec<f64>> = (0..count)
        .map(|at| {
            let is_inner = at > 0 && at + 1 < count;
            (0..joints).map(|_| if is_inner { random.signed() } else { 0.0 }).collect()
        })
        .collect();
    let compile = |scale: f64| {
        let waypoints = (0..count)
            .map(|at| Waypoint {
                time_from_start_s: times[at] * scale,
                joint_position: rows[at].clone(),
                joint_velocity: if has_velocities {
                    slopes[at].iter().map(|slope| slope / scale).collect()
                } else {
                    Vec::new()
                },
                ..Waypoint::default()
            })
            .collect();
        let asked = JointTrajectory {
            joint_names: names.clone(),
            waypoints,
            interpolation,
            ..JointTrajectory::default()
        };
        CompiledTrajectory::compile(&asked, &names, &limits, &options)
    };
    // The fastest that is legal, or something slower.
    let (mut low, mut high) = (0.0, 200.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if middle > 1e-3 && compile(middle).is_ok() { high = middle } else { low = middle }
    }
    let slack = if random.chance(0.5) { 1.0 } else { random.between(1.0, 2.0) };
    let curve = compile(high * slack).expect("it was legal, so slower is");
    Path { curve, limits }
}
