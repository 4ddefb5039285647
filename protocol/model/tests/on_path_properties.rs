//! Random stories on random trajectories: no set-point breaks a limit or leaves the path.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod paths;
mod set_points;
mod uniform;

use std::fmt::Arguments;

use armada_model::{OnPath, PathState, TimedCurve};
use paths::{Path, path};
use set_points::SetPoints;
use uniform::Uniform;

const PERIOD_S: f64 = 1e-3;

/// What a loop saw of one motion so far.
struct Watch<'a> {
    path: &'a Path,
    time_s: f64,
    phase_s: f64,
    sent: Vec<SetPoints>,
    phases: SetPoints,
    punctual: u32,
    asked: f64,
    has_settled: bool,
}

impl<'a> Watch<'a> {
    fn new(path: &'a Path) -> Self {
        let sent = path.limits.iter().map(|_| SetPoints::default()).collect();
        let phases = SetPoints::default();
        Self {
            path,
            time_s: 0.0,
            phase_s: 0.0,
            sent,
            phases,
            punctual: 0,
            asked: 1.0,
            has_settled: true,
        }
    }

    fn see(&mut self, dt_s: f64, seen: &PathState, told: Arguments<'_>) {
        self.time_s += dt_s;
        let Path { curve, limits } = self.path;
        assert!(seen.phase_s >= self.phase_s, "{told}: the phase went backward");
        self.phase_s = seen.phase_s;
        assert!((0.0..=1.0).contains(&seen.rate), "{told}: rate {}", seen.rate);
        let above = seen.rate > self.asked;
        assert!(!(above && self.has_settled), "{told}: {} above {}", seen.rate, self.asked);
        self.has_settled |= seen.rate == self.asked;
        let on_curve = curve.sample(seen.phase_s, &mut 0).position;
        assert!(seen.state.position.max_abs_difference(&on_curve) < 1e-12, "{told}: off the path");
        for ((joint, axis), sent) in limits.iter().enumerate().zip(&mut self.sent) {
            sent.push(self.time_s, seen.state.position[joint]);
            for (order, bound) in [(1, axis.velocity), (2, axis.acceleration)] {
                let rounding = 1e-14 / PERIOD_S.powi(order);
                let order = usize::try_from(order).expect("small");
                let value = sent.mean_derivative(order).unwrap_or_default();
                let within = value.abs() <= bound * (1.0 + 3e-6) + rounding;
                assert!(within, "{told}, joint {joint}: difference {order} {value}, limit {bound}");
            }
            let (v, a) = (seen.state.velocity[joint].abs(), seen.state.acceleration[joint].abs());
            assert!(v <= axis.velocity * (1.0 + 3e-6), "{told}: velocity {v} of {axis:?}");
            assert!(a <= axis.acceleration * (1.0 + 3e-6), "{told}: acceleration {a} of {axis:?}");
        }
        self.see_jerk(dt_s, seen, told);
    }

    /// The jerk that the motion adds to its curve, from the differences of the phase over three
    /// punctual ticks. They are means, and the curve may have a knot among the ticks, so the jerk is
    /// taken where it is lowest.
    fn see_jerk(&mut self, dt_s: f64, seen: &PathState, told: Arguments<'_>) {
        self.phases.push(self.time_s, seen.phase_s);
        self.punctual = if dt_s == PERIOD_S { self.punctual + 1 } else { 0 };
        let Path { curve, limits } = self.path;
        let (Some(slope), Some(curvature)) =
            (self.phases.mean_derivative(2), self.phases.mean_derivative(3))
        else {
            return;
        };
        if self.punctual < 4 || seen.phase_s >= curve.duration_s() {
            return;
        }
        let points = [0.0, 1.0, 2.0, 3.0]
            .map(|ticks_ago| curve.point(seen.phase_s - ticks_ago * PERIOD_S * seen.rate, &mut 0));
        for (joint, axis) in limits.iter().enumerate() {
            let added = points.iter().map(|point| {
                let cross = 3.0 * point.second[joint] * seen.rate * slope;
                (point.first[joint] * curvature + cross).abs()
            });
            let added = added.fold(f64::INFINITY, f64::min);
            let within = added <= axis.jerk * 1.02 + 0.1;
            assert!(within, "{told}, joint {joint}: adds jerk {added}, limit {}", axis.jerk);
        }
    }
}

fn random_dt(random: &mut Uniform) -> f64 {
    if random.chance(0.1) { PERIOD_S * random.between(1.0, 20.0) } else { PERIOD_S }
}

/// Asks for something, and returns the rate that it asks for.
fn random_demand(random: &mut Uniform, motion: &mut OnPath, ratio: &mut f64) -> f64 {
    match random.below(4.0) {
        0 => {
            motion.pause().expect("not stopped");
            return 0.0;
        }
        1 => motion.resume().expect("not stopped"),
        _ => {
            *ratio = if random.chance(0.2) { 1.0 } else { random.next() };
            motion.set_speed_ratio(*ratio).expect("a ratio");
            motion.resume().expect("not stopped");
        }
    }
    *ratio
}

#[test]
fn no_story_of_pauses_speeds_and_late_ticks_breaks_a_limit() {
    for seed in 0..60 {
        let mut random = Uniform::seeded(seed);
        let path = path(&mut random);
        let mut motion = OnPath::start(&path.curve, &path.limits).expect("as many joints");
        let mut watch = Watch::new(&path);
        let mut ratio = 1.0;
        for event in 0..12 {
            for _ in 0..random.below(150.0) {
                let dt_s = random_dt(&mut random);
                let seen = motion.tick(&path.curve, dt_s);
                let time_s = watch.time_s;
                watch.see(dt_s, &seen, format_args!("seed {seed}, event {event}, {time_s} s"));
            }
            watch.asked = random_demand(&mut random, &mut motion, &mut ratio);
            watch.has_settled = false;
        }
        // It goes on to exactly the end.
        motion.resume().expect("not stopped");
        motion.set_speed_ratio(1.0).expect("a ratio");
        (watch.asked, watch.has_settled) = (1.0, false);
        let mut ticks = 0;
        while !motion.is_finished() {
            let seen = motion.tick(&path.curve, PERIOD_S);
            watch.see(PERIOD_S, &seen, format_args!("seed {seed}, the end"));
            ticks += 1;
            assert!(ticks < 100_000, "seed {seed}: does not end");
        }
        let end = motion.tick(&path.curve, 1.0);
        assert!(motion.is_at_rest() && end.state.position == path.curve.end(), "seed {seed}");
        assert!(end.state.is_at_rest(), "seed {seed}");
    }
}
