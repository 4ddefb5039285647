//! A motion whose curve is changed ahead of it, and one that goes over to the next: every set-point
//! stays legal, whatever is asked of the rate meanwhile.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod paths;
mod set_points;
mod uniform;

use armada_model::{
    CurveBounds, CurvePoint, JerkLimitedMove, JointLimits, JointVector, MotionLimits, OnPath,
    OnPathError, OnlineOptions, OnlineState, PathState, TimedCurve,
};
use set_points::SetPoints;
use uniform::Uniform;

const PERIOD_S: f64 = 1e-3;

/// A move that is left at a phase for another one, which begins in the state there.
struct Spliced<'a> {
    first: &'a JerkLimitedMove,
    leave_s: f64,
    second: JerkLimitedMove,
}

impl TimedCurve for Spliced<'_> {
    fn joint_count(&self) -> usize {
        TimedCurve::joint_count(self.first)
    }

    fn duration_s(&self) -> f64 {
        self.leave_s + TimedCurve::duration_s(&self.second)
    }

    fn limits_jerk(&self) -> bool {
        true
    }

    fn point(&self, phase_s: f64, hint: &mut usize) -> CurvePoint {
        if phase_s < self.leave_s {
            self.first.point(phase_s, hint)
        } else {
            self.second.point(phase_s - self.leave_s, hint)
        }
    }

    fn bounds(&self, from_s: f64, to_s: f64, hint: &mut usize, bounds: &mut CurveBounds) {
        *bounds = CurveBounds::EMPTY;
        let mut part = CurveBounds::EMPTY;
        if from_s < self.leave_s {
            self.first.bounds(from_s, to_s.min(self.leave_s), hint, &mut part);
            widen(bounds, &part);
        }
        if to_s >= self.leave_s {
            let from_s = (from_s - self.leave_s).max(0.0);
            self.second.bounds(from_s, to_s - self.leave_s, hint, &mut part);
            widen(bounds, &part);
        }
    }
}

fn widen(bounds: &mut CurveBounds, part: &CurveBounds) {
    let orders = [
        (&mut bounds.first, &part.first),
        (&mut bounds.second, &part.second),
        (&mut bounds.third, &part.third),
    ];
    for (spans, others) in orders {
        for (span, other) in spans.iter_mut().zip(others) {
            span.include(other.low);
            span.include(other.high);
        }
    }
}

/// What a loop sent of one motion so far; each new set-point must keep all limits with those before.
struct Sent {
    time_s: f64,
    joints: Vec<SetPoints>,
}

impl Sent {
    fn new(limits: &MotionLimits) -> Self {
        Self { time_s: 0.0, joints: limits.iter().map(|_| SetPoints::default()).collect() }
    }

    fn see(&mut self, state: &PathState, limits: &MotionLimits, seed: u64) {
        self.time_s += PERIOD_S;
        for ((joint, axis), sent) in limits.iter().enumerate().zip(&mut self.joints) {
            sent.push(self.time_s, state.state.position[joint]);
            for (order, bound) in [(1, axis.velocity), (2, axis.acceleration), (3, axis.jerk)] {
                let rounding = 4e-14 / PERIOD_S.powi(order);
                let order = usize::try_from(order).expect("small");
                let value = sent.mean_derivative(order).unwrap_or_default().abs();
                let within = value <= bound * (1.0 + 1e-5) + rounding;
                let at_s = self.time_s;
                assert!(
                    within,
                    "seed {seed}, {at_s} s, joint {joint}: {order} is {value}, {bound}"
                );
            }
        }
    }
}

fn rest(random: &mut Uniform, joints: usize) -> OnlineState {
    let values: Vec<_> = (0..joints).map(|_| 2.0 * random.signed()).collect();
    OnlineState::at_rest(JointVector::from_slice(&values).expect("finite"))
}

fn go(from: &OnlineState, to: &OnlineState, limits: &MotionLimits) -> JerkLimitedMove {
    JerkLimitedMove::plan(from, to, limits, &OnlineOptions::default()).expect("there is a way")
}

/// A random move and its limits.
fn some_move(random: &mut Uniform) -> (JerkLimitedMove, MotionLimits) {
    let joints = 1 + random.below(7.0);
    let limits = paths::limits(random, joints);
    let (from, to) = (rest(random, joints), rest(random, joints));
    (go(&from, &to, &limits), limits)
}

fn ask(random: &mut Uniform, motion: &mut OnPath) {
    let ratio = if random.chance(0.3) { 1.0 } else { random.next() };
    motion.set_speed_ratio(ratio).expect("a ratio");
    if random.chance(0.2) { motion.pause() } else { motion.resume() }.expect("not stopped");
}

/// `first`, left somewhere after what `motion` has committed, for another goal; none if nothing is
/// left of it, or if the state there allows no way that keeps the limits.
fn splice<'a>(
    random: &mut Uniform,
    motion: &OnPath,
    first: &'a JerkLimitedMove,
    limits: &MotionLimits,
) -> Option<Spliced<'a>> {
    let (committed_s, end_s) = (motion.committed_s(), TimedCurve::duration_s(first));
    let soon = random.chance(0.5);
    let leave_s = committed_s + if soon { 0.0 } else { random.next() * (end_s - committed_s) };
    if leave_s >= end_s {
        return None;
    }
    let state = first.at(leave_s);
    let goal = rest(random, TimedCurve::joint_count(first));
    let second = JerkLimitedMove::plan(&state, &goal, limits, &OnlineOptions::default()).ok()?;
    let mut bounds = CurveBounds::EMPTY;
    second.bounds(0.0, TimedCurve::duration_s(&second), &mut 0, &mut bounds);
    let legal = limits.iter().enumerate().all(|(joint, axis)| {
        bounds.first[joint].is_within(axis.velocity * (1.0 + 1e-9))
            && bounds.second[joint].is_within(axis.acceleration * (1.0 + 1e-9))
    });
    legal.then_some(Spliced { first, leave_s, second })
}

#[test]
fn a_curve_that_changes_beyond_what_is_committed_keeps_every_set_point_legal() {
    let (mut changed_in_a_ramp, mut went_over) = (0, 0);
    for seed in 0..300 {
        let mut random = Uniform::seeded(seed);
        let (first, limits) = some_move(&mut random);
        let mut motion = OnPath::start(&first, &limits).expect("as many joints");
        let mut sent = Sent::new(&limits);
        let begin = 1 + random.below(400.0);
        for tick in 0..begin {
            if tick % 80 == 0 {
                ask(&mut random, &mut motion);
            }
            sent.see(&motion.tick(&first, PERIOD_S), &limits, seed);
        }
        assert!(motion.committed_s() >= motion.phase_s(), "seed {seed}");
        let Some(spliced) = splice(&mut random, &motion, &first, &limits) else { continue };
        changed_in_a_ramp += u32::from(motion.committed_s() > motion.phase_s());
        let (phase_s, rate) = (motion.phase_s(), motion.rate());
        motion.go_over(&spliced, phase_s).expect("as many joints");
        assert_eq!((motion.phase_s(), motion.rate()), (phase_s, rate), "seed {seed}");
        for tick in 0..600 {
            if tick % 120 == 60 {
                ask(&mut random, &mut motion);
            }
            sent.see(&motion.tick(&spliced, PERIOD_S), &limits, seed);
        }
        went_over += u32::from(goes_over(&mut random, motion, &spliced, &limits, sent, seed));
    }
    assert!(changed_in_a_ramp > 60 && went_over > 100, "{changed_in_a_ramp}, {went_over}");
}

/// Goes on from a motion that is past where its curve was spliced: on the second part alone it is
/// the same motion. Says whether it was.
fn goes_over(
    random: &mut Uniform,
    mut motion: OnPath,
    spliced: &Spliced<'_>,
    limits: &MotionLimits,
    mut sent: Sent,
    seed: u64,
) -> bool {
    if motion.phase_s() < spliced.leave_s || motion.is_finished() {
        return false;
    }
    let mut stays = motion.clone();
    let after_s = motion.phase_s() - spliced.leave_s;
    motion.go_over(&spliced.second, after_s).expect("as many joints");
    motion.resume().expect("not stopped");
    stays.resume().expect("not stopped");
    let ratio = random.between(0.2, 1.0);
    motion.set_speed_ratio(ratio).expect("a ratio");
    stays.set_speed_ratio(ratio).expect("a ratio");
    let mut ticks = 0;
    while !motion.is_finished() {
        let seen = motion.tick(&spliced.second, PERIOD_S);
        let same = stays.tick(spliced, PERIOD_S).state;
        sent.see(&seen, limits, seed);
        let off = seen.state.position.max_abs_difference(&same.position);
        assert!(off < 1e-9, "seed {seed}: {off} off the curve that it left");
        ticks += 1;
        assert!(ticks < 100_000, "seed {seed}: does not end");
    }
    let end = motion.state(&spliced.second);
    assert!(end.state.is_at_rest() && motion.is_at_rest(), "seed {seed}: {end:?}");
    assert_eq!(end.state.position, spliced.second.rest_position(), "seed {seed}");
    true
}

#[test]
fn a_motion_that_joins_its_curve_is_one_that_ran_there() {
    for seed in 0..100 {
        let mut random = Uniform::seeded(seed);
        let (curve, limits) = some_move(&mut random);
        let mut ran = OnPath::start(&curve, &limits).expect("as many joints");
        let ticks = 1 + random.below(TimedCurve::duration_s(&curve) / PERIOD_S);
        for _ in 0..ticks {
            ran.tick(&curve, PERIOD_S);
        }
        let mut joined = OnPath::join(&curve, &limits, ran.phase_s()).expect("as many joints");
        assert_eq!((joined.rate(), joined.committed_s()), (1.0, ran.phase_s()), "seed {seed}");
        joined.stop();
        ran.stop();
        while !ran.is_at_rest() {
            let (a, b) = (ran.tick(&curve, PERIOD_S), joined.tick(&curve, PERIOD_S));
            assert_eq!(a, b, "seed {seed}");
        }
        assert!(joined.is_at_rest() && joined.is_stopped(), "seed {seed}");
    }
}

#[test]
fn going_over_keeps_the_rate_and_refuses_another_number_of_joints() {
    let joint = JointLimits {
        velocity: 1.0,
        acceleration: Some(2.0),
        jerk: Some(40.0),
        ..JointLimits::default()
    };
    let limits = MotionLimits::new(&[joint]).expect("complete limits");
    let at = |x: f64| OnlineState::at_rest(JointVector::from_slice(&[x]).expect("finite"));
    let (curve, other) = (go(&at(0.0), &at(3.0), &limits), go(&at(3.0), &at(0.0), &limits));
    let mut motion = OnPath::start(&curve, &limits).expect("one joint");
    motion.set_speed_ratio(0.5).expect("a ratio");
    motion.tick(&curve, 0.5);
    // At rest or not, the joints are under way: a rate changes at once before the first tick only.
    motion.go_over(&other, -1.0).expect("one joint");
    motion.set_speed_ratio(1.0).expect("a ratio");
    assert_eq!((motion.phase_s(), motion.rate(), motion.is_finished()), (0.0, 0.5, false));
    motion.go_over(&other, 99.0).expect("one joint");
    assert!(motion.is_finished() && motion.phase_s() == TimedCurve::duration_s(&other));
    let two = MotionLimits::new(&[joint, joint]).expect("complete limits");
    let start = OnlineState::at_rest(JointVector::from_slice(&[0.0; 2]).expect("finite"));
    let wide = go(&start, &start, &two);
    let refused = motion.go_over(&wide, 0.0);
    assert_eq!(refused, Err(OnPathError::JointCount { joints: 2, limits: 1 }));
    assert!(motion.is_finished(), "a refusal changes nothing");
}
