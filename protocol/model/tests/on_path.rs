//! Operations on a motion under way: what they refuse, where and when they end.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod counting_allocator;
mod paths;
mod set_points;
mod uniform;

use armada_model::{
    JerkLimitedMove, JointLimits, JointMove, JointVector, MotionLimits, MotionState, OnPath,
    OnPathError, OnlineOptions, OnlineState, TimedCurve,
};
use counting_allocator::allocations_of;
use paths::{Path, path};
use set_points::SetPoints;
use uniform::Uniform;

const PERIOD_S: f64 = 1e-3;

fn limits(acceleration: f64, jerk: f64) -> MotionLimits {
    let joint = JointLimits {
        velocity: 1.0,
        acceleration: Some(acceleration),
        jerk: Some(jerk),
        ..JointLimits::default()
    };
    MotionLimits::new(&[joint, joint]).expect("complete limits")
}

fn vector(values: [f64; 2]) -> JointVector {
    JointVector::from_slice(&values).expect("finite")
}

/// Two joints from zero, the second half as far.
fn straight(limits: &MotionLimits, distance: f64) -> JointMove {
    let start = MotionState { position: vector([0.0; 2]), velocity: vector([0.0; 2]) };
    JointMove::plan(&start, &vector([distance, 0.5 * distance]), limits).expect("legal")
}

#[test]
fn ratios_beyond_their_range_and_orders_after_a_stop_are_refused() {
    let limits = limits(2.0, 40.0);
    let curve = straight(&limits, 3.0);
    let mut motion = OnPath::start(&curve, &limits).expect("two joints");
    let text = |ratio, motion: &mut OnPath| {
        motion.set_speed_ratio(ratio).expect_err("it is refused").to_string()
    };
    assert_eq!(text(1.1, &mut motion), "speed ratio is 1.1, expected 0 to 1");
    assert_eq!(text(-0.1, &mut motion), "speed ratio is -0.1, expected 0 to 1");
    assert_eq!(text(f64::NAN, &mut motion), "speed ratio is NaN, expected 0 to 1");
    motion.stop();
    assert_eq!(motion.resume(), Err(OnPathError::Stopped));
    assert_eq!(motion.pause(), Err(OnPathError::Stopped));
    assert_eq!(text(0.5, &mut motion), "the motion was stopped");
    let one = MotionLimits::new(&[JointLimits {
        velocity: 1.0,
        acceleration: Some(1.0),
        ..JointLimits::default()
    }])
    .expect("complete limits");
    let refused = OnPath::start(&curve, &one).expect_err("another robot");
    assert_eq!(refused.to_string(), "the curve has 2 joints, the limits 1");
}

#[test]
fn a_motion_that_is_not_interfered_with_is_the_curve() {
    let Path { curve, limits } = path(&mut Uniform::seeded(1));
    let mut motion = OnPath::start(&curve, &limits).expect("as many joints");
    let (mut hint, mut time_s) = (0, 0.0);
    while !motion.is_finished() {
        time_s += PERIOD_S;
        let seen = motion.tick(&curve, PERIOD_S);
        let sample = curve.sample(time_s, &mut hint);
        assert!(seen.state.position.max_abs_difference(&sample.position) < 1e-12);
        assert!(seen.state.velocity.max_abs_difference(&sample.velocity) < 1e-9);
    }
    assert!((time_s - curve.duration_s()).abs() < 2.0 * PERIOD_S && motion.is_at_rest());
}

#[test]
fn a_stop_while_cruising_takes_the_time_of_a_ramp_limited_in_jerk() {
    // From cruise at 1 rad/s under 2 rad/s² and 400 rad/s³: 0.5 s and 5 ms, and a little more for
    // the calmer way back.
    let limits = limits(2.0, 400.0);
    let curve = straight(&limits, 5.0);
    let mut motion = OnPath::start(&curve, &limits).expect("two joints");
    motion.tick(&curve, 2.0);
    let predicted = motion.predicted_stop(&curve);
    motion.stop();
    let mut ticks = 0;
    while !motion.is_at_rest() {
        motion.tick(&curve, PERIOD_S);
        ticks += 1;
    }
    let time_s = f64::from(ticks) * PERIOD_S;
    assert!((0.505..0.52).contains(&time_s), "{time_s} s");
    assert!((time_s - predicted.time_s).abs() <= PERIOD_S, "{predicted:?}, took {time_s} s");
    let end = motion.tick(&curve, 10.0);
    assert!((end.phase_s - predicted.phase_s).abs() < 1e-9 && end.state.is_at_rest());
    assert!(
        (end.state.position[0] - 0.5 * end.state.position[0] - end.state.position[1]).abs() < 1e-12
    );
}

#[test]
fn stops_are_nearly_as_short_as_acceleration_allows_and_end_as_predicted() {
    let mut worst = 0.0_f64;
    for seed in 0..60 {
        let mut random = Uniform::seeded(seed);
        let Path { curve, limits } = path(&mut random);
        // So much jerk that acceleration is what limits.
        let axes: Vec<_> = limits
            .iter()
            .map(|axis| JointLimits {
                velocity: axis.velocity,
                acceleration: Some(axis.acceleration),
                jerk: Some(1000.0 * axis.acceleration),
                ..JointLimits::default()
            })
            .collect();
        let limits = MotionLimits::new(&axes).expect("complete limits");
        let mut motion = OnPath::start(&curve, &limits).expect("as many joints");
        motion.tick(&curve, random.next() * curve.duration_s());
        let (least_s, predicted) = (
            greedy_stop_s(&curve, &limits, motion.state(&curve).phase_s),
            motion.predicted_stop(&curve),
        );
        motion.stop();
        let mut time_s = 0.0;
        while !motion.is_at_rest() {
            motion.tick(&curve, PERIOD_S);
            time_s += PERIOD_S;
        }
        assert!(
            time_s <= predicted.time_s + 1.001 * PERIOD_S,
            "seed {seed}: {time_s} s, {predicted:?}"
        );
        let stopped = motion.tick(&curve, 1.0);
        assert!((stopped.phase_s - predicted.phase_s).abs() < 1e-9, "seed {seed}");
        assert!(stopped.state.is_at_rest(), "seed {seed}");
        if least_s > 0.05 {
            worst = worst.max(predicted.time_s / least_s);
        }
    }
    assert!(worst < 1.1 && worst > 1.0, "{worst} times the least time");
}

/// The time of the stop that takes the lowest slope at each instant, in steps of 0.05 ms.
fn greedy_stop_s(curve: &impl TimedCurve, limits: &MotionLimits, from_s: f64) -> f64 {
    let (mut phase_s, mut rate, mut time_s, mut hint) = (from_s, 1.0, 0.0, 0);
    let step_s = 5e-5;
    while rate > 0.0 && phase_s < curve.duration_s() {
        let point = curve.point(phase_s, &mut hint);
        let lowest = limits.iter().enumerate().filter(|&(joint, _)| point.first[joint] != 0.0);
        let lowest = lowest.map(|(joint, axis)| {
            let (first, used) = (point.first[joint], point.second[joint] * rate * rate);
            -(axis.acceleration + used * first.signum()) / first.abs()
        });
        rate += step_s * lowest.fold(-1e4, f64::max).min(0.0);
        phase_s += step_s * rate.max(0.0);
        time_s += step_s;
    }
    time_s
}

#[test]
fn the_jerk_of_a_jerk_limited_curve_stays_limited_in_total() {
    for seed in 0..40 {
        let mut random = Uniform::seeded(seed);
        let limits = paths::limits(&mut random, 3);
        let target = |random: &mut Uniform| {
            let values: Vec<_> = (0..3).map(|_| 2.0 * random.signed()).collect();
            OnlineState::at_rest(JointVector::from_slice(&values).expect("finite"))
        };
        let (from, to) = (target(&mut random), target(&mut random));
        let curve = JerkLimitedMove::plan(&from, &to, &limits, &OnlineOptions::default());
        let curve = curve.expect("rest to rest is legal");
        let mut motion = OnPath::start(&curve, &limits).expect("three joints");
        let mut sent: Vec<SetPoints> = (0..3).map(|_| SetPoints::default()).collect();
        let mut time_s = 0.0;
        while !motion.is_finished() {
            if random.chance(0.02) {
                motion.set_speed_ratio(random.between(0.05, 1.0)).expect("a ratio");
            }
            let dt_s =
                if random.chance(0.1) { random.between(1.0, 9.0) * PERIOD_S } else { PERIOD_S };
            time_s += dt_s;
            let seen = motion.tick(&curve, dt_s);
            for ((joint, axis), sent) in limits.iter().enumerate().zip(&mut sent) {
                sent.push(time_s, seen.state.position[joint]);
                let jerk = sent.mean_derivative(3).unwrap_or_default().abs();
                let within = jerk <= axis.jerk * (1.0 + 1e-5) + 1e-5;
                assert!(within, "seed {seed}, joint {joint}, {time_s} s: {jerk} of {axis:?}");
            }
        }
        assert_eq!(motion.tick(&curve, 1.0).state, to, "seed {seed}");
    }
}

#[test]
fn a_stop_just_before_the_curve_itself_brakes_keeps_the_limit_of_acceleration() {
    // The curve cruises at 1 rad/s and jumps to its full braking of 2 rad/s² after 2.5 s.
    let (acceleration, fine_s) = (2.0, 2.5e-4);
    let limits = limits(acceleration, 400.0);
    let curve = straight(&limits, 2.5);
    for ahead in 0..40 {
        let mut motion = OnPath::start(&curve, &limits).expect("two joints");
        motion.tick(&curve, 2.5 - 5e-3 * f64::from(ahead));
        motion.stop();
        let mut sent = SetPoints::default();
        let mut time_s = 0.0;
        while !motion.is_at_rest() {
            let seen = motion.tick(&curve, fine_s).state;
            time_s += fine_s;
            sent.push(time_s, seen.position[0]);
            let now = seen.acceleration[0].abs();
            assert!(now <= acceleration * (1.0 + 2e-6), "{ahead}: {now} at {time_s} s");
            let mean = sent.mean_derivative(2).unwrap_or_default().abs();
            assert!(mean <= acceleration * (1.0 + 2e-6) + 1e-7, "{ahead}: {mean} at {time_s} s");
        }
        assert!(time_s < 0.6, "{ahead}: {time_s} s");
    }
}

#[test]
fn a_ratio_before_the_first_tick_holds_from_the_start() {
    let limits = limits(2.0, 40.0);
    let curve = straight(&limits, 3.0);
    let mut motion = OnPath::start(&curve, &limits).expect("two joints");
    motion.set_speed_ratio(0.25).expect("a ratio");
    assert_eq!(motion.remaining_s(), Some(4.0 * curve.duration_s()));
    let seen = motion.tick(&curve, 0.4);
    assert!((seen.phase_s - 0.1).abs() < 1e-15 && seen.rate == 0.25);
    motion.pause().expect("not stopped");
    assert_eq!(motion.remaining_s(), None);
}

#[test]
fn time_that_is_not_a_number_or_goes_backward_does_not_move_the_joints() {
    let limits = limits(2.0, 40.0);
    let curve = straight(&limits, 3.0);
    let mut motion = OnPath::start(&curve, &limits).expect("two joints");
    let before = motion.tick(&curve, 1.0);
    assert_eq!(motion.tick(&curve, f64::NAN), before);
    assert_eq!(motion.tick(&curve, -1.0), before);
    motion.stop();
    assert_eq!(motion.tick(&curve, 0.0), before);
}

#[test]
fn a_tick_of_endless_time_ends_a_stop_and_a_motion() {
    let limits = limits(2.0, 40.0);
    let curve = straight(&limits, 3.0);
    let mut motion = OnPath::start(&curve, &limits).expect("two joints");
    motion.tick(&curve, 1.0);
    let mut stopping = motion.clone();
    stopping.stop();
    let at_once = stopping.tick(&curve, f64::INFINITY);
    assert!(stopping.is_at_rest() && !stopping.is_finished() && at_once.state.is_at_rest());
    let end = motion.tick(&curve, f64::INFINITY);
    assert!(motion.is_finished() && end.state.position == curve.target());
    let mut slowing = OnPath::join(&curve, &limits, 1.0).expect("two joints");
    slowing.set_speed_ratio(0.5).expect("a ratio");
    slowing.tick(&curve, f64::INFINITY);
    assert!(slowing.is_finished() && slowing.is_at_rest());
}

#[test]
fn ticks_of_all_kinds_allocate_nothing() {
    let Path { curve, limits } = path(&mut Uniform::seeded(3));
    let mut motion = OnPath::start(&curve, &limits).expect("as many joints");
    let count = allocations_of(|| {
        for round in 0..200 {
            let ratio = if round % 2 == 0 { 0.1 } else { 0.3 };
            motion.set_speed_ratio(ratio).expect("a ratio");
            std::hint::black_box(motion.tick(&curve, 1e-3 * f64::from(round % 30)));
        }
        std::hint::black_box(motion.predicted_stop(&curve));
        motion.stop();
        std::hint::black_box(motion.tick(&curve, 1.0));
    });
    assert_eq!((count, allocations_of(|| drop(std::hint::black_box(Box::new(1))))), (0, 1));
}
