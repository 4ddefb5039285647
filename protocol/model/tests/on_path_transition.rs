//! From one motion into the next: limits are kept across the change, and time is not lost.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod paths;
mod set_points;
mod uniform;

use armada_model::{
    JerkLimitedMove, JointLimits, JointVector, MotionLimits, OnPath, OnlineError, OnlineOptions,
    OnlineState, TimedCurve, Transition,
};
use set_points::SetPoints;
use uniform::Uniform;

const PERIOD_S: f64 = 1e-3;

fn limits(random: &mut Uniform, joints: usize) -> MotionLimits {
    let wide = paths::limits(random, joints);
    let bounded: Vec<_> = wide
        .iter()
        .map(|axis| JointLimits {
            lower: Some(-2.0),
            upper: Some(2.0),
            velocity: axis.velocity,
            acceleration: Some(axis.acceleration),
            jerk: Some(axis.jerk),
            effort: None,
        })
        .collect();
    MotionLimits::new(&bounded).expect("complete limits")
}

fn rest(random: &mut Uniform, joints: usize) -> OnlineState {
    let values: Vec<_> = (0..joints).map(|_| 1.9 * random.signed()).collect();
    OnlineState::at_rest(JointVector::from_slice(&values).expect("finite"))
}

fn go(from: &OnlineState, to: &OnlineState, limits: &MotionLimits) -> JerkLimitedMove {
    JerkLimitedMove::plan(from, to, limits, &OnlineOptions::default()).expect("rest to rest")
}

#[test]
fn a_motion_that_is_cancelled_into_the_next_keeps_all_limits_and_saves_time() {
    let (mut flying, mut saved_s) = (0, 0.0);
    for seed in 0..150 {
        let mut random = Uniform::seeded(seed);
        let joints = 1 + random.below(7.0);
        let limits = limits(&mut random, joints);
        let [a, b, c, d] = std::array::from_fn(|_| rest(&mut random, joints));
        let (first, next) = (go(&a, &b, &limits), go(&c, &d, &limits));
        let now = first.at(random.next() * first.duration_s());
        let latest_s = random.next() * next.duration_s();
        let plan = Transition::plan(&now, &next, &limits, latest_s).expect("there is a way");
        assert!(plan.join_s() <= latest_s, "seed {seed}");
        assert_eq!(plan.at(0.0), now, "seed {seed}");
        let joined = plan.at(plan.duration_s());
        let point = next.point(plan.join_s(), &mut 0);
        assert!(joined.position.max_abs_difference(&point.position) < 1e-9, "seed {seed}");
        assert!(joined.velocity.max_abs_difference(&point.first) < 1e-9, "seed {seed}");

        let whole_s = follow(&plan, &next, &limits, seed);
        let stop = armada_model::JerkLimitedStop::plan(&now, &limits).expect("usable");
        let stopped = OnlineState::at_rest(stop.stop_position());
        let by_halts_s =
            stop.duration_s() + go(&stopped, &c, &limits).duration_s() + next.duration_s();
        assert!(whole_s <= by_halts_s + 2.0 * PERIOD_S, "seed {seed}: {whole_s}, {by_halts_s}");
        saved_s += by_halts_s - whole_s;
        flying += u32::from(plan.join_s() > 0.0);
    }
    assert!(flying > 30 && saved_s > 20.0, "{flying} joined in motion, {saved_s} s saved");
}

/// Sends the transition and the rest of the curve, checks every set-point, and returns the time.
fn follow(plan: &Transition, next: &JerkLimitedMove, limits: &MotionLimits, seed: u64) -> f64 {
    let mut sent: Vec<SetPoints> = limits.iter().map(|_| SetPoints::default()).collect();
    let mut time_s = 0.0;
    let mut check = |time_s: f64, state: &OnlineState| {
        for ((joint, axis), sent) in limits.iter().enumerate().zip(&mut sent) {
            let x = state.position[joint];
            assert!(axis.lower - 1e-8 <= x && x <= axis.upper + 1e-8, "seed {seed}: {x}");
            sent.push(time_s, x);
            for (order, bound) in [(1, axis.velocity), (2, axis.acceleration), (3, axis.jerk)] {
                let rounding = 1e-14 / PERIOD_S.powi(order);
                let order = usize::try_from(order).expect("small");
                let value = sent.mean_derivative(order).unwrap_or_default().abs();
                let within = value <= bound * (1.0 + 1e-5) + rounding;
                assert!(within, "seed {seed}, joint {joint}, {time_s} s: {order} is {value}");
            }
        }
    };
    while time_s + PERIOD_S < plan.duration_s() {
        check(time_s, &plan.at(time_s));
        time_s += PERIOD_S;
    }
    let mut motion = OnPath::join(next, limits, plan.join_s()).expect("as many joints");
    // The tick in which it joins belongs to both.
    let mut dt_s = time_s - plan.duration_s();
    while !motion.is_finished() {
        let state = if dt_s < 0.0 { plan.at(time_s) } else { motion.tick(next, dt_s).state };
        check(time_s, &state);
        dt_s = if dt_s < 0.0 { dt_s + PERIOD_S } else { PERIOD_S };
        time_s += PERIOD_S;
    }
    time_s
}

#[test]
fn a_start_that_is_out_of_reach_is_refused_and_one_without_room_stops_first() {
    let joint = JointLimits {
        lower: Some(-1.0),
        upper: Some(1.0),
        velocity: 1.0,
        acceleration: Some(2.0),
        jerk: Some(40.0),
        effort: None,
    };
    let limits = MotionLimits::new(&[joint]).expect("complete limits");
    let wide = JointLimits { lower: Some(-9.0), upper: Some(9.0), ..joint };
    let wide = MotionLimits::new(&[wide]).expect("complete limits");
    let at = |x: f64| OnlineState::at_rest(JointVector::from_slice(&[x]).expect("finite"));
    let far = go(&at(5.0), &at(6.0), &wide);
    let refused = Transition::plan(&at(0.0), &far, &limits, 0.0).expect_err("it starts outside");
    assert!(matches!(refused, OnlineError::TargetBeyondLimit { joint: 0, .. }), "{refused}");
    // On its way out already: nothing keeps it inside, so it stops, and comes back.
    let mut outward = at(0.95);
    outward.velocity[0] = 0.9;
    let next = go(&at(0.0), &at(0.5), &limits);
    let plan = Transition::plan(&outward, &next, &limits, 1.0).expect("there is a way");
    assert!(plan.stops_first() && plan.join_s() == 0.0);
    assert_eq!(plan.at(plan.duration_s()), at(0.0));
}
