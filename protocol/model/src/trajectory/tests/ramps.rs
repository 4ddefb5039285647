//! The stop: legal from any tick of a legal motion.

use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::trajectory::{JointMove, MotionState, StopRamp};

const PERIOD: Duration = Duration::from_millis(10);

fn limits() -> MotionLimits {
    MotionLimits::new(&[joint_limits(1.0, 2.0, 10.0), joint_limits(1.0, 2.0, 5.0)])
        .expect("complete limits")
}

fn state(position: [f64; 2], velocity: [f64; 2]) -> MotionState {
    MotionState { position: vector(&position), velocity: vector(&velocity) }
}

/// All positions that are sent until standstill, and as often again.
fn run(mut ramp: StopRamp) -> Vec<JointVector> {
    let mut sent = Vec::new();
    while !ramp.is_standstill() {
        sent.push(ramp.step().position);
        assert!(sent.len() < 100_000, "never stands still");
    }
    for _ in 0..sent.len() + 3 {
        assert_eq!(ramp.step().velocity, ramp.current().velocity.map_indexed(|_, _| 0.0));
        sent.push(ramp.current().position);
    }
    sent
}

#[test]
fn the_joint_that_needs_longest_sets_the_pace_of_all() {
    // 0.5 / 5 s is more than 0.5 / 10 s, so both take ten ticks and go straight.
    let mut ramp = StopRamp::plan(&state([0.0; 2], [0.5, -0.5]), &limits(), PERIOD);
    assert_eq!(ramp.duration(), Duration::from_millis(100));
    for tick in 1..=10 {
        let now = ramp.step();
        let expected = 0.5 * (1.0 - 0.1 * f64::from(tick));
        assert!((now.velocity[0] - expected).abs() < 1e-15, "{tick}: {now:?}");
        assert_eq!(now.position[0], -now.position[1]);
        assert_eq!(ramp.is_standstill(), tick == 10);
    }
    assert!((ramp.current().position[0] - 0.5 * 0.01 * 4.5).abs() < 1e-15);
    assert_eq!(ramp.current().position, ramp.stop_position());
}

#[test]
fn a_joint_near_its_limit_brakes_alone() {
    // Together: 0.3 s at 1 goes 0.145; alone at 10 it goes 0.045. Joint 0 has room for 0.05.
    let near = state([0.95, 0.0], [1.0, 1.5]);
    let ramp = StopRamp::plan(&near, &limits(), PERIOD);
    assert!((ramp.stop_position()[0] - 0.995).abs() < 1e-12, "{:?}", ramp.stop_position());
    assert!((ramp.stop_position()[1] - 0.2175).abs() < 1e-12, "{:?}", ramp.stop_position());
    let mirrored = state([-0.95, 0.0], [-1.0, 1.5]);
    let ramp = StopRamp::plan(&mirrored, &limits(), PERIOD);
    assert!((ramp.stop_position()[0] + 0.995).abs() < 1e-12, "{:?}", ramp.stop_position());
}

#[test]
fn an_illegal_start_never_exceeds_deceleration_and_tells_where_it_ends() {
    let ramp = StopRamp::plan(&state([0.99, 0.0], [1.0, 0.0]), &limits(), PERIOD);
    assert!((ramp.stop_position()[0] - 1.035).abs() < 1e-12, "{:?}", ramp.stop_position());
}

#[test]
fn from_rest_and_from_less_than_one_tick_of_deceleration_it_holds() {
    let still = StopRamp::plan(&state([0.1, 0.2], [0.0; 2]), &limits(), PERIOD);
    assert!(still.is_standstill());
    assert_eq!(still.duration(), Duration::ZERO);
    assert_eq!(still.stop_position(), vector(&[0.1, 0.2]));
    let mut creeping = StopRamp::plan(&state([0.1, 0.2], [0.01, -1e-13]), &limits(), PERIOD);
    assert_eq!(creeping.step(), state([0.1, 0.2], [0.0; 2]));
    assert!(creeping.is_standstill());
}

#[test]
fn what_is_not_known_of_a_joint_holds_it() {
    let unknown = MotionState { position: vector(&[0.1, 0.2]), velocity: JointVector::EMPTY };
    assert!(StopRamp::plan(&unknown, &limits(), PERIOD).is_standstill());
    let fast = state([0.1, 0.2], [1.0, 1.0]);
    let one = MotionLimits::new(&[joint_limits(1.0, 2.0, 10.0)]).expect("complete limits");
    let ramp = StopRamp::plan(&fast, &one, PERIOD);
    assert_eq!(ramp.stop_position()[1], 0.2);
    assert!(ramp.stop_position()[0] > 0.1);
    assert!(StopRamp::plan(&fast, &limits(), Duration::ZERO).is_standstill());
}

proptest! {
    #![proptest_config(seeded(256))]

    #[test]
    fn a_stop_from_any_tick_of_a_legal_motion_is_legal(
        from in prop::array::uniform2(-1.0..=1.0_f64),
        via in prop::array::uniform2(-1.0..=1.0_f64),
        to in prop::array::uniform2(prop_oneof![Just(-1.0), Just(1.0), -1.0..=1.0_f64]),
        (retarget, stop) in (0_u32..80, 0_u32..80),
        period_us in 1_000_u64..20_000,
    ) {
        let period = Duration::from_micros(period_us);
        let period_s = period.as_secs_f64();
        let first = JointMove::plan(&state(from, [0.0; 2]), &vector(&via), &limits())
            .expect("inside");
        let turn = first.at(f64::from(retarget) * period_s);
        // From motion each joint goes its fastest way, right up to the limit.
        let second = JointMove::plan(&turn, &vector(&to), &limits()).expect("can brake");
        let mut sent: Vec<JointVector> = (0..=retarget)
            .map(|tick| first.at(f64::from(tick) * period_s).position)
            .chain((1..=stop).map(|tick| second.at(f64::from(tick) * period_s).position))
            .collect();
        let last = sent[sent.len() - 1];
        let before = if sent.len() > 1 { sent[sent.len() - 2] } else { last };
        let velocity = last.map_indexed(|joint, x| (x - before[joint]) / period_s);
        let ramp =
            StopRamp::plan(&MotionState { position: last, velocity }, &limits(), period);
        let stops = run(ramp);
        let longest = velocity.iter().zip(limits().iter())
            .map(|(w, axis)| w.abs() / axis.acceleration)
            .fold(0.0, f64::max);
        prop_assert!(ramp.duration().as_secs_f64() <= longest + period_s * 1.001);
        prop_assert_eq!(stops[stops.len() - 1], ramp.stop_position());
        sent.extend(stops);
        assert_legal(&sent, period_s, &limits());
    }

    #[test]
    fn away_from_limits_a_stop_goes_straight(
        velocity in prop::array::uniform2(-1.5..1.5_f64), period_us in 1_000_u64..20_000,
    ) {
        let wide = MotionLimits::new(&[joint_limits(9.0, 2.0, 10.0), joint_limits(9.0, 2.0, 5.0)])
            .expect("complete limits");
        let start = state([0.0; 2], velocity);
        let ramp = StopRamp::plan(&start, &wide, Duration::from_micros(period_us));
        for x in run(ramp) {
            let off = x[0] * velocity[1] - x[1] * velocity[0];
            prop_assert!(off.abs() < 1e-14, "{off}");
        }
    }
}
