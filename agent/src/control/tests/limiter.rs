use std::time::Duration;

use armada_model::{
    JointLimits, JointMove, JointVector, LIMIT_TOLERANCE, MotionLimits, MotionState, StopRamp,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use crate::control::limit::{Limiter, Senseless};

const LOWER: f64 = -1.0;
const UPPER: f64 = 1.5;
const VELOCITY: f64 = 2.0;
const ACCELERATION: f64 = 8.0;

fn limits() -> MotionLimits {
    let one = JointLimits {
        lower: Some(LOWER),
        upper: Some(UPPER),
        velocity: VELOCITY,
        acceleration: Some(ACCELERATION),
        jerk: None,
        effort: None,
    };
    MotionLimits::new(&[one]).expect("complete")
}

fn vector(value: f64) -> JointVector {
    JointVector::zeros(1).expect("short").map_indexed(|_, _| value)
}

fn state(position: f64) -> MotionState {
    MotionState { position: vector(position), velocity: vector(0.0) }
}

fn limiter(position: f64, period: Duration) -> Limiter {
    let mut limiter = Limiter::new(&limits(), period);
    limiter.begin(vector(position));
    limiter
}

/// What a controller sees of the positions that are sent.
struct Seen {
    position: f64,
    velocity: f64,
    period_s: f64,
}

impl Seen {
    fn new(position: f64, period: Duration) -> Self {
        Self { position, velocity: 0.0, period_s: period.as_secs_f64() }
    }

    fn check(&mut self, position: f64) {
        let velocity = (position - self.position) / self.period_s;
        let acceleration = (velocity - self.velocity) / self.period_s;
        let (lower, upper) = (LOWER.min(self.position), UPPER.max(self.position));
        assert!(
            position >= lower - LIMIT_TOLERANCE * 1.01
                && position <= upper + LIMIT_TOLERANCE * 1.01,
            "position {position}"
        );
        assert!(velocity.abs() <= VELOCITY * 1.000_01, "velocity {velocity}");
        let rounding = 1e-14 / (self.period_s * self.period_s);
        let highest = ACCELERATION * 1.000_01 + rounding;
        assert!(acceleration.abs() <= highest, "acceleration {acceleration}");
        (self.position, self.velocity) = (position, velocity);
    }
}

fn config() -> ProptestConfig {
    ProptestConfig {
        rng_seed: RngSeed::Fixed(7),
        failure_persistence: None,
        ..ProptestConfig::with_cases(400)
    }
}

fn periods() -> impl Strategy<Value = Duration> {
    prop_oneof![
        Just(Duration::from_micros(125)),
        Just(Duration::from_millis(1)),
        Just(Duration::from_millis(4)),
        Just(Duration::from_millis(20)),
    ]
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn whatever_is_asked_for_what_leaves_is_legal_and_can_be_braked(
        period in periods(),
        start in LOWER..UPPER,
        wishes in prop::collection::vec((-3.0..3.0f64, 1..40u32), 1..40),
    ) {
        let mut limiter = limiter(start, period);
        let mut seen = Seen::new(start, period);
        for (wish, ticks) in wishes {
            for _ in 0..ticks {
                let sent = limiter.pass(&state(wish)).expect("finite");
                seen.check(sent.joint_position[0]);
            }
            let last = limiter.last().expect("sending");
            let stop = StopRamp::plan(last, &limits(), period).stop_position()[0];
            let room = 2.0 * LIMIT_TOLERANCE;
            prop_assert!(stop >= LOWER - room && stop <= UPPER + room, "it would stop at {}", stop);
        }
    }

    #[test]
    fn planned_motions_and_their_ramps_pass_untouched(
        period in periods(),
        start in LOWER..UPPER,
        goals in prop::collection::vec((LOWER..=UPPER, 0.001..1.0f64), 1..8),
        end in 0..2u8,
    ) {
        let mut limiter = limiter(start, period);
        let mut seen = Seen::new(start, period);
        let period_s = period.as_secs_f64();
        let mut curve = state(start);
        for (goal, share) in goals {
            let plan = JointMove::plan(&curve, &vector(goal), &limits()).expect("legal");
            let ticks = (share * plan.duration_s() / period_s).ceil().max(1.0);
            for tick in 1..=(ticks as u64) {
                curve = plan.at(tick as f64 * period_s);
                let sent = limiter.pass(&curve).expect("finite");
                prop_assert_eq!(sent.joint_position, curve.position);
                prop_assert_eq!(sent.joint_velocity, curve.velocity);
                seen.check(sent.joint_position[0]);
            }
        }
        if end == 1 {
            let last = *limiter.last().expect("sending");
            let mut ramp = StopRamp::plan(&last, &limits(), period);
            while !ramp.is_standstill() {
                let step = ramp.step();
                prop_assert_eq!(limiter.pass(&step).expect("finite").joint_position, step.position);
            }
        }
        prop_assert_eq!(limiter.changed(), 0);
    }

    #[test]
    fn the_way_toward_a_target_is_legal_and_ends_there_exactly(
        period in periods(),
        start in LOWER..UPPER,
        first in LOWER..UPPER,
        turn in 0..200u32,
        target in LOWER..UPPER,
    ) {
        let mut limiter = limiter(start, period);
        let mut seen = Seen::new(start, period);
        let longest = (3.0 / period.as_secs_f64()) as u32;
        for tick in 0..turn + longest {
            let goal = if tick < turn { first } else { target };
            let step = limiter.toward(&vector(goal)).expect("sending");
            let sent = limiter.pass(&step).expect("finite").joint_position;
            prop_assert_eq!(sent, step.position, "its own steps pass untouched");
            seen.check(sent[0]);
        }
        let last = limiter.last().expect("sending");
        prop_assert_eq!((last.position[0], last.velocity[0]), (target, 0.0));
        prop_assert_eq!(limiter.changed(), 0);
    }
}

#[test]
fn a_jump_becomes_a_legal_motion_that_arrives() {
    let period = Duration::from_millis(2);
    let mut limiter = limiter(0.0, period);
    let mut seen = Seen::new(0.0, period);
    for _ in 0..2000 {
        let sent = limiter.pass(&state(1.2)).expect("finite").joint_position[0];
        seen.check(sent);
        // Whether it is asked to rest there it cannot know before it is asked again.
        assert!(sent <= 1.21, "{sent}");
    }
    assert_eq!((seen.position, seen.velocity), (1.2, 0.0));
    assert!(limiter.changed() > 100, "each of them counted");
}

#[test]
fn a_changed_set_point_carries_the_velocity_it_really_has() {
    let period = Duration::from_millis(1);
    let mut limiter = limiter(0.0, period);
    let sent = limiter.pass(&state(1.0)).expect("finite");
    let velocity = sent.joint_position[0] / 1e-3;
    assert!((sent.joint_velocity[0] - velocity).abs() < 1e-12 && velocity > 0.0);
    assert_eq!(limiter.changed(), 1);
}

#[test]
fn a_velocity_that_does_not_belong_there_is_replaced() {
    let mut limiter = limiter(0.0, Duration::from_millis(1));
    for wrong in [9.0, f64::NAN, f64::NEG_INFINITY] {
        let desired = MotionState { position: vector(0.0), velocity: vector(wrong) };
        let sent = limiter.pass(&desired).expect("the position is finite");
        assert_eq!((sent.joint_position[0], sent.joint_velocity[0]), (0.0, 0.0));
    }
    assert_eq!(limiter.changed(), 3);
}

#[test]
fn a_joint_found_outside_may_stay_or_come_back_but_not_go_further() {
    let period = Duration::from_millis(1);
    let mut limiter = limiter(2.0, period);
    assert_eq!(limiter.pass(&state(2.0)).expect("finite").joint_position[0], 2.0);
    assert_eq!(limiter.changed(), 0, "staying is no change");
    assert_eq!(limiter.pass(&state(2.1)).expect("finite").joint_position[0], 2.0);
    assert_eq!(limiter.changed(), 1);
    let mut seen = Seen::new(2.0, period);
    for _ in 0..3000 {
        seen.check(limiter.pass(&state(1.0)).expect("finite").joint_position[0]);
    }
    assert_eq!(seen.position, 1.0);
}

#[test]
fn what_has_no_number_near_it_is_not_sent() {
    let period = Duration::from_millis(1);
    let mut limiter = limiter(0.5, period);
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(limiter.pass(&state(wrong)), Err(Senseless));
    }
    let two = JointVector::zeros(2).expect("short");
    assert_eq!(limiter.pass(&MotionState { position: two, velocity: two }), Err(Senseless));
    assert_eq!(limiter.last().expect("sending").position[0], 0.5, "as if it had not been asked");
    limiter.end();
    assert_eq!(limiter.pass(&state(0.5)), Err(Senseless), "there is no stream");
}

#[test]
fn numbers_of_any_size_are_brought_into_the_limits() {
    let period = Duration::from_millis(1);
    let mut limiter = limiter(0.0, period);
    let mut seen = Seen::new(0.0, period);
    for wish in [f64::MAX, f64::MIN, f64::MIN_POSITIVE, 1e300, -1e-300] {
        for _ in 0..100 {
            seen.check(limiter.pass(&state(wish)).expect("finite").joint_position[0]);
        }
    }
}
