//! Random stories of retargets, stops and late ticks: no set-point breaks a limit.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod set_points;
mod uniform;

use armada_model::{
    AxisLimits, JerkLimitedMove, JerkLimitedStop, JointLimits, JointVector, MotionLimits,
    OnlineError, OnlineOptions, OnlineState, Retargeter, Synchronisation,
};
use set_points::SetPoints;
use uniform::Uniform;

const PERIOD_S: f64 = 1e-3;

fn random_limits(random: &mut Uniform, joints: usize) -> MotionLimits {
    let limits: Vec<_> = (0..joints)
        .map(|_| {
            let acceleration = random.between(2.0, 20.0);
            JointLimits {
                lower: Some(-random.between(1.0, 3.0)),
                upper: Some(random.between(1.0, 3.0)),
                velocity: random.between(0.3, 3.0),
                acceleration: Some(acceleration),
                jerk: Some(acceleration * random.between(5.0, 60.0)),
                effort: None,
            }
        })
        .collect();
    MotionLimits::new(&limits).expect("complete limits")
}

fn vector(values: impl IntoIterator<Item = f64>) -> JointVector {
    JointVector::from_slice(&values.into_iter().collect::<Vec<_>>()).expect("finite")
}

/// Inside the position limits; at rest, or with a velocity and acceleration that may be there.
fn random_target(random: &mut Uniform, limits: &MotionLimits) -> OnlineState {
    let position =
        limits.iter().map(|axis| random.between(axis.lower, axis.upper)).collect::<Vec<_>>();
    let mut target = OnlineState::at_rest(vector(position));
    if random.chance(0.3) {
        for (joint, axis) in limits.iter().enumerate() {
            target.velocity[joint] = 0.5 * axis.velocity * random.signed();
            let most = (axis.velocity * axis.jerk).sqrt().min(axis.acceleration);
            target.acceleration[joint] = 0.5 * most * random.signed();
        }
    }
    target
}

fn random_options(random: &mut Uniform) -> OnlineOptions {
    let all = [Synchronisation::Time, Synchronisation::Phase, Synchronisation::None];
    let minimum_duration_s = if random.chance(0.2) { random.between(0.0, 3.0) } else { 0.0 };
    OnlineOptions { synchronisation: all[random.below(3.0)], minimum_duration_s }
}

/// One to twenty periods, most of them one.
fn random_dt(random: &mut Uniform) -> f64 {
    if random.chance(0.1) { PERIOD_S * random.between(1.0, 20.0) } else { PERIOD_S }
}

/// Checks velocity, acceleration and jerk of the last set-points, with rounding of positions.
fn check_differences(sent: &SetPoints, limits: &AxisLimits, told: &str) {
    let bounds = [limits.velocity, limits.acceleration, limits.jerk];
    for (order, bound) in (1..=3).zip(bounds) {
        let rounding = 1e-14 / PERIOD_S.powi(order);
        let order = usize::try_from(order).expect("small");
        if let Some(value) = sent.mean_derivative(order) {
            let within = value.abs() <= bound * (1.0 + 1e-6) + rounding;
            assert!(within, "{told}: difference {order} is {value}, limit {bound}");
        }
    }
}

fn check_state(state: &OnlineState, limits: &MotionLimits, told: &str) {
    for (joint, axis) in limits.iter().enumerate() {
        let (x, v, a) = (state.position[joint], state.velocity[joint], state.acceleration[joint]);
        let inside = x >= axis.lower - 1e-8 && x <= axis.upper + 1e-8;
        assert!(inside, "{told}, joint {joint}: position {x} of {axis:?}");
        assert!(v.abs() <= axis.velocity * (1.0 + 1e-8), "{told}, joint {joint}: {v} of {axis:?}");
        let within = a.abs() <= axis.acceleration * (1.0 + 1e-8);
        assert!(within, "{told}, joint {joint}: {a} of {axis:?}");
    }
}

#[test]
fn no_set_point_of_any_story_of_retargets_and_late_ticks_breaks_a_limit() {
    let (mut accepted, mut refused) = (0, 0);
    for seed in 0..150 {
        let mut random = Uniform::seeded(seed);
        let limits = {
            let joints = 1 + random.below(16.0);
            random_limits(&mut random, joints)
        };
        let start = OnlineState::at_rest(random_target(&mut random, &limits).position);
        let options = random_options(&mut random);
        let mut loop_ = Retargeter::new(&start, &limits, options).expect("a stop exists");
        let mut sent: Vec<SetPoints> = limits.iter().map(|_| SetPoints::default()).collect();
        let mut time_s = 0.0;
        for event in 0..25 {
            if random.chance(0.1) {
                loop_.stop();
            } else {
                let before = loop_.state();
                match loop_.retarget(&random_target(&mut random, &limits)) {
                    Ok(()) => accepted += 1,
                    Err(OnlineError::OvershootBeyondLimit { .. }) => refused += 1,
                    Err(error) => panic!("seed {seed}: {error}"),
                }
                assert!(before.position.max_abs_difference(&loop_.state().position) < 1e-12);
            }
            for _ in 0..random.below(120.0) {
                let dt_s = random_dt(&mut random);
                time_s += dt_s;
                let state = loop_.tick(dt_s);
                let told = format!("seed {seed}, event {event}, {options:?}, {time_s} s");
                check_state(&state, &limits, &told);
                for ((joint, axis), sent) in limits.iter().enumerate().zip(&mut sent) {
                    sent.push(time_s, state.position[joint]);
                    check_differences(sent, axis, &told);
                }
            }
        }
        assert_eq!(loop_.failures(), 0, "seed {seed}");
        loop_.tick(f64::INFINITY);
        assert!(loop_.state().is_at_rest() && loop_.is_at_rest(), "seed {seed}");
    }
    println_counts(accepted, refused);
    assert!(accepted > 20 * refused, "{accepted} accepted, {refused} refused");
}

#[allow(clippy::print_stdout, reason = "how often a plan is refused is worth knowing")]
fn println_counts(accepted: u32, refused: u32) {
    println!("{accepted} accepted, {refused} refused");
}

/// Any state: up to half above the limits of velocity and acceleration, and a little outside.
fn any_state(random: &mut Uniform, limits: &MotionLimits) -> OnlineState {
    let zero = JointVector::zeros(limits.len()).expect("few");
    let mut state = OnlineState { position: zero, velocity: zero, acceleration: zero };
    for (joint, axis) in limits.iter().enumerate() {
        state.position[joint] = random.between(axis.lower - 0.1, axis.upper + 0.1);
        state.velocity[joint] = 1.5 * axis.velocity * random.signed();
        state.acceleration[joint] = 1.5 * axis.acceleration * random.signed();
    }
    state
}

#[test]
fn a_stop_from_any_state_is_at_rest_in_the_time_and_at_the_place_it_says() {
    for seed in 0..2_000 {
        let mut random = Uniform::seeded(seed);
        let limits = random_limits(&mut random, 3);
        let state = any_state(&mut random, &limits);
        let stop = JerkLimitedStop::plan(&state, &limits).expect("usable");
        let end = stop.at(stop.duration_s());
        assert!(end.is_at_rest() && end.position == stop.stop_position(), "seed {seed}");
        let just_before = stop.at(stop.duration_s() * (1.0 - 1e-9));
        assert!(just_before.position.max_abs_difference(&end.position) < 1e-9, "seed {seed}");
        assert!(just_before.velocity.max_abs_difference(&end.velocity) < 1e-6, "seed {seed}");
        let (low, high) = stop.position_extrema();
        for step in 0..=200 {
            let at = stop.at(stop.duration_s() * f64::from(step) / 200.0);
            for (joint, axis) in limits.iter().enumerate() {
                let (x, a) = (at.position[joint], at.acceleration[joint].abs());
                assert!(x >= low[joint] - 1e-12 && x <= high[joint] + 1e-12, "seed {seed}");
                let most = axis.acceleration.max(state.acceleration[joint].abs());
                assert!(a <= most * (1.0 + 1e-9), "seed {seed}: {a} of {most}");
            }
        }
    }
}

#[test]
fn a_start_beyond_the_limits_comes_back_and_stays_inside() {
    let (mut planned, mut refused) = (0, 0);
    for seed in 0..2_000 {
        let mut random = Uniform::seeded(seed);
        let limits = random_limits(&mut random, 2);
        let state = any_state(&mut random, &limits);
        let target = OnlineState::at_rest(random_target(&mut random, &limits).position);
        let options = random_options(&mut random);
        let motion = match JerkLimitedMove::plan(&state, &target, &limits, &options) {
            Ok(motion) => motion,
            Err(OnlineError::OvershootBeyondLimit { .. }) => {
                refused += 1;
                continue;
            }
            Err(error) => panic!("seed {seed}: {error}"),
        };
        planned += 1;
        let mut was_inside = [false; 2];
        for step in 0..=1_000 {
            let at = motion.at(motion.duration_s() * f64::from(step) / 1_000.0);
            for (joint, axis) in limits.iter().enumerate() {
                let (v, a) = (at.velocity[joint].abs(), at.acceleration[joint].abs());
                let inside = v <= axis.velocity * (1.0 + 1e-8)
                    && a <= axis.acceleration * (1.0 + 1e-8)
                    && v + a * a / (2.0 * axis.jerk) <= axis.velocity * (1.0 + 1e-8);
                was_inside[joint] |= inside;
                let legal =
                    v <= axis.velocity * (1.0 + 1e-8) && a <= axis.acceleration * (1.0 + 1e-8);
                assert!(legal || !was_inside[joint], "seed {seed}, joint {joint}: {v}, {a}");
                let start = state.position[joint];
                let x = at.position[joint];
                let outside = x < axis.lower.min(start) - 1e-7 || x > axis.upper.max(start) + 1e-7;
                assert!(!outside, "seed {seed}, joint {joint}: {x} of {axis:?}, from {start}");
            }
        }
        assert_eq!(was_inside, [true; 2], "seed {seed}");
    }
    println_counts(planned, refused);
    assert!(planned > 500, "{planned} planned, {refused} refused");
}

#[test]
fn limits_that_are_lowered_on_the_way_are_kept_after_a_legal_recovery() {
    for seed in 0..300 {
        let mut random = Uniform::seeded(seed);
        let limits = random_limits(&mut random, 4);
        let start = OnlineState::at_rest(random_target(&mut random, &limits).position);
        let mut joints =
            Retargeter::new(&start, &limits, OnlineOptions::default()).expect("usable");
        let target = OnlineState::at_rest(random_target(&mut random, &limits).position);
        joints.retarget(&target).expect("rest to rest is legal");
        joints.tick(0.5 * joints.remaining_s());
        let slow = vector(limits.iter().map(|axis| 0.3 * axis.velocity));
        let slower = limits.with_max_velocity(&slow).expect("lower");
        let before = joints.state();
        joints.set_limits(&slower).expect("the target is still legal");
        assert!(joints.state().position.max_abs_difference(&before.position) < 1e-12);
        let mut was_inside = [false; 4];
        while !joints.is_at_rest() {
            let at = joints.tick(0.01);
            for (joint, axis) in slower.iter().enumerate() {
                let inside = at.velocity[joint].abs() <= axis.velocity * (1.0 + 1e-8);
                assert!(inside || !was_inside[joint], "seed {seed}, joint {joint}: {at:?}");
                was_inside[joint] |= inside && at.acceleration[joint].abs() < 1e-6;
            }
        }
        assert_eq!(joints.state(), target, "seed {seed}");
    }
}

/// How many of 20 000 random plans from rest or motion succeed and have no profile, with sizes from
/// `10^low` to `10^high`.
fn plans_of_sizes(low: f64, high: f64) -> (u32, u32) {
    let (mut planned, mut without_profile) = (0, 0);
    for seed in 0..20_000 {
        let mut random = Uniform::seeded(seed);
        let size = |random: &mut Uniform| 10.0_f64.powf(random.between(low, high));
        let any = |random: &mut Uniform| match random.below(4.0) {
            0 => 0.0,
            _ => size(random).copysign(random.signed()),
        };
        let joints = 1 + random.below(3.0);
        let axes: Vec<_> = (0..joints)
            .map(|_| JointLimits {
                velocity: size(&mut random),
                acceleration: Some(size(&mut random)),
                jerk: Some(size(&mut random)),
                ..JointLimits::default()
            })
            .collect();
        let limits = MotionLimits::new(&axes).expect("complete limits");
        let mut row = || vector((0..joints).map(|_| any(&mut random)));
        let state = OnlineState { position: row(), velocity: row(), acceleration: row() };
        let target = OnlineState::at_rest(row());
        let options = random_options(&mut random);
        match JerkLimitedMove::plan(&state, &target, &limits, &options) {
            Ok(motion) => {
                planned += 1;
                let end = motion.at(motion.rest_s());
                assert_eq!(
                    (end.position, end.is_at_rest()),
                    (target.position, true),
                    "seed {seed}"
                );
            }
            Err(OnlineError::NoProfile { .. }) => without_profile += 1,
            Err(error) => panic!("seed {seed}: {error}"),
        }
        let stop = JerkLimitedStop::plan(&state, &limits).expect("usable");
        assert!(stop.at(stop.duration_s()).is_at_rest(), "seed {seed}");
    }
    println_counts(planned, without_profile);
    (planned, without_profile)
}

#[test]
fn states_and_limits_of_any_size_are_planned_or_refused_and_never_panic() {
    let (planned, without_profile) = plans_of_sizes(-9.0, 6.0);
    assert!(planned > 0 && planned + without_profile == 20_000);
    // Beyond that the ways are so long that rounding leaves more than is allowed at their ends.
    let (_, without_profile) = plans_of_sizes(-0.5, 0.5);
    assert_eq!(without_profile, 0, "within a decade");
}
