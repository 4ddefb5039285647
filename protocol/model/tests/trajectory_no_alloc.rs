//! Evaluating a motion allocates nothing: a control loop does it at every tick.

#![expect(clippy::expect_used, reason = "a test fails by panicking, its helpers too")]

mod counting_allocator;

use std::hint::black_box;
use std::time::Duration;

use armada_model::{
    CompiledTrajectory, Ends, Interpolation, JointLimits, JointMove, JointTrajectory, JointVector,
    MAX_JOINTS, MotionLimits, MotionState, StopRamp, TrajectoryOptions, Waypoint,
};
use counting_allocator::allocations_of;

fn limits() -> MotionLimits {
    let joint = JointLimits {
        lower: Some(-3.0),
        upper: Some(3.0),
        velocity: 2.0,
        acceleration: Some(10.0),
        jerk: None,
        effort: None,
    };
    MotionLimits::new(&[joint; MAX_JOINTS]).expect("complete limits")
}

fn all(value: f64) -> JointVector {
    JointVector::from_slice(&[value; MAX_JOINTS]).expect("finite")
}

#[test]
fn an_allocation_is_counted() {
    assert_eq!(allocations_of(|| drop(black_box(Box::new(1)))), 1);
}

#[test]
fn sampling_a_trajectory_allocates_nothing() {
    let names: Vec<String> = (0..MAX_JOINTS).map(|joint| format!("joint_{joint}")).collect();
    let waypoints = (0..100_u32)
        .map(f64::from)
        .map(|index| Waypoint {
            time_from_start_s: index * 0.1,
            joint_position: vec![0.5 - 0.5 * (index * 0.1).cos(); MAX_JOINTS],
            position_tolerance: vec![0.1; MAX_JOINTS],
            ..Waypoint::default()
        })
        .collect();
    let mut asked =
        JointTrajectory { joint_names: names.clone(), waypoints, ..JointTrajectory::default() };
    let options = TrajectoryOptions { ends: Ends::InMotion, ..TrajectoryOptions::default() };
    for interpolation in [
        Interpolation::CubicSpline,
        Interpolation::CubicSplineNatural,
        Interpolation::JointLinear,
        Interpolation::QuinticHermite,
    ] {
        asked.interpolation = interpolation;
        let compiled =
            CompiledTrajectory::compile(&asked, &names, &limits(), &options).expect("legal");
        let mut hint = 0;
        let count = allocations_of(|| {
            for tick in -10..11_000 {
                let t_s = f64::from(tick) * 1e-3;
                let sample = black_box(compiled.sample(t_s, &mut hint));
                black_box(compiled.tolerance(sample.waypoint));
                black_box(compiled.state_at(t_s, &mut hint));
                black_box(compiled.jerk_at(t_s, &mut hint));
                black_box(compiled.segments_at(t_s, &mut hint).next());
            }
            black_box(compiled.end_state());
        });
        assert_eq!(count, 0, "{interpolation}");
    }
}

#[test]
fn planning_and_sampling_moves_and_ramps_allocates_nothing() {
    let limits = limits();
    let period = Duration::from_millis(1);
    let start = MotionState { position: all(0.0), velocity: all(0.0) };
    let count = allocations_of(|| {
        let first = JointMove::plan(&start, &all(1.0), &limits).expect("legal");
        let second = JointMove::plan(&first.at(0.3), &all(-1.0), &limits).expect("legal");
        let mut ramp = StopRamp::plan(&second.at(0.5), &limits, period);
        for _ in 0..1000 {
            black_box((ramp.step(), ramp.is_standstill(), ramp.stop_position()));
        }
    });
    assert_eq!(count, 0);
}
