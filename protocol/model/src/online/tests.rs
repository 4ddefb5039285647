//! Refusals, closed forms, and a generator that fails.

use super::axis::Range;
use super::*;
use crate::{AxisLimits, JointLimits, JointVector, MotionLimits};

fn limits(joints: usize) -> MotionLimits {
    let joint = JointLimits {
        lower: Some(-2.0),
        upper: Some(2.0),
        velocity: 1.0,
        acceleration: Some(2.0),
        jerk: Some(40.0),
        effort: None,
    };
    MotionLimits::new(&vec![joint; joints]).expect("complete limits")
}

fn state(position: &[f64], velocity: &[f64], acceleration: &[f64]) -> OnlineState {
    let vector = |values| JointVector::from_slice(values).expect("finite");
    let [position, velocity, acceleration] = [position, velocity, acceleration].map(vector);
    OnlineState { position, velocity, acceleration }
}

fn rest(position: &[f64]) -> OnlineState {
    OnlineState::at_rest(JointVector::from_slice(position).expect("finite"))
}

fn refusal(from: &OnlineState, to: &OnlineState, options: &OnlineOptions) -> String {
    let planned = JerkLimitedMove::plan(from, to, &limits(2), options);
    planned.expect_err("it is refused").to_string()
}

#[test]
fn every_refusal_names_field_joint_value_and_limit() {
    let free = OnlineOptions::default();
    let origin = rest(&[0.0, 0.0]);
    let texts = [
        refusal(&rest(&[0.0]), &origin, &free),
        refusal(&origin, &rest(&[0.0, 2e6]), &free),
        refusal(&origin, &rest(&[0.0, 2.5]), &free),
        refusal(&origin, &state(&[0.0; 2], &[0.0, -1.1], &[0.0; 2]), &free),
        refusal(&origin, &state(&[0.0; 2], &[0.0; 2], &[3.0, 0.0]), &free),
        refusal(&origin, &state(&[0.0; 2], &[0.96, 0.0], &[2.0, 0.0]), &free),
        refusal(&origin, &state(&[0.0, 1.9], &[0.0, 0.9], &[0.0; 2]), &free),
        refusal(&origin, &origin, &OnlineOptions { minimum_duration_s: -1.0, ..free }),
    ];
    let expected = [
        "start position has 1 values, expected one for each of 2 joints",
        "joint 1: target position is 2000000, expected a number within 1000000",
        "joint 1: target position 2.5 is beyond the limit 2",
        "joint 1: target velocity -1.1 is beyond the limit 1",
        "joint 0: target acceleration 3 is beyond the limit 2",
        "joint 0: target velocity 1.01 is beyond the limit 1",
        "joint 1: turns back only at 2.125, beyond the limit 2",
        "minimum duration is -1 s, expected 0 to 1000000",
    ];
    assert_eq!(texts, expected);
}

#[test]
fn not_a_number_is_refused_wherever_it_is() {
    let mut broken = rest(&[0.0, 0.0]);
    broken.acceleration[1] = f64::NAN;
    let text = refusal(&broken, &rest(&[0.0, 0.0]), &OnlineOptions::default());
    assert_eq!(text, "joint 1: start acceleration is NaN, expected a number within 1000000");
    let options = OnlineOptions { minimum_duration_s: f64::NAN, ..OnlineOptions::default() };
    let text = refusal(&rest(&[0.0; 2]), &rest(&[1.0; 2]), &options);
    assert_eq!(text, "minimum duration is NaN s, expected 0 to 1000000");
    assert!(JerkLimitedStop::plan(&broken, &limits(2)).is_err());
}

#[test]
fn a_stop_from_constant_speed_takes_the_textbook_time_and_way() {
    // v / a + a / j = 0.5 s + 0.05 s, the way is half of speed times time.
    let stop = JerkLimitedStop::plan(&state(&[0.0], &[-1.0], &[0.0]), &limits(1)).expect("usable");
    assert!((stop.duration_s() - 0.55).abs() < 1e-15);
    assert!((stop.stop_position()[0] + 0.275).abs() < 1e-15);
    assert!(stop.at(0.55).is_at_rest() && stop.overshoot(&limits(1)).is_none());
    // Too slow to reach the limit of acceleration: 2 sqrt(v / j).
    let stop = JerkLimitedStop::plan(&state(&[0.0], &[0.025], &[0.0]), &limits(1)).expect("usable");
    assert!((stop.duration_s() - 0.05).abs() < 1e-15);
}

#[test]
fn a_stop_without_room_turns_back_just_as_far_as_it_must() {
    let (position, limits) = (1.7, limits(1));
    let least =
        JerkLimitedStop::plan(&state(&[position], &[1.0], &[0.0]), &limits).expect("usable");
    let (_, high) = least.position_extrema();
    // The least-time stop needs 0.275 rad from standstill of the acceleration: it has 0.3.
    assert!((high[0] - 1.975).abs() < 1e-12);
    let from = state(&[1.725_15], &[1.0], &[0.0]);
    let turning = JerkLimitedStop::plan(&from, &limits).expect("usable");
    let (_, high) = turning.position_extrema();
    assert!(high[0] <= 2.0 && high[0] > 2.0 - 1e-9, "{high:?}");
    assert!(turning.stop_position()[0] < high[0] && turning.overshoot(&limits).is_none());
    assert!(turning.duration_s() > 0.55);
    let hopeless = JerkLimitedStop::plan(&state(&[1.9], &[1.0], &[0.0]), &limits).expect("usable");
    let (joint, excess) = hopeless.overshoot(&limits).expect("it is beyond");
    assert!(joint == 0 && excess > 0.17 && excess < 0.175, "{excess}");
}

#[test]
fn the_extremes_of_a_motion_are_those_of_its_cubic_pieces() {
    // u³ - 3u from 0 to 2: velocity 3u² - 3, standstill at 1.
    let start = AxisPoint { position: 0.0, velocity: -3.0, acceleration: 0.0 };
    let mut motion = AxisMotion::from_point(start);
    assert!(motion.push(2.0, 6.0) && motion.push(-1.0, 1.0) && motion.push(f64::NAN, 1.0));
    assert_eq!(motion.position_range(), Range { low: -2.0, high: 2.0 });
    assert_eq!(motion.velocity_range(), Range { low: -3.0, high: 9.0 });
    assert_eq!(motion.acceleration_range(), Range { low: 0.0, high: 12.0 });
    assert_eq!(motion.jerk_peak(), 6.0);
}

#[test]
fn a_phase_synchronised_motion_is_straight_where_time_synchronisation_is_not() {
    let options =
        OnlineOptions { synchronisation: Synchronisation::Phase, ..OnlineOptions::default() };
    let (from, to) = (rest(&[0.0, 0.0, 0.5]), rest(&[1.5, -0.1, 0.5]));
    let straight = JerkLimitedMove::plan(&from, &to, &limits(3), &options).expect("legal");
    assert!(straight.is_straight());
    for step in 0..=100 {
        let at = straight.at(straight.duration_s() * f64::from(step) / 100.0).position;
        assert!((at[1] + at[0] / 15.0).abs() < 1e-15 && at[2] == 0.5, "{at:?}");
    }
    let crooked = state(&[0.0, 0.0, 0.5], &[0.0, 0.1, 0.0], &[0.0; 3]);
    let motion = JerkLimitedMove::plan(&crooked, &to, &limits(3), &options).expect("legal");
    assert!(!motion.is_straight());
}

#[test]
fn without_synchronisation_a_joint_is_not_held_up_by_another() {
    let options =
        OnlineOptions { synchronisation: Synchronisation::None, ..OnlineOptions::default() };
    let motion =
        JerkLimitedMove::plan(&rest(&[0.0, 0.0]), &rest(&[1.5, 0.1]), &limits(2), &options)
            .expect("legal");
    assert_eq!(motion.at(0.6).axis(1), AxisPoint::at_rest(0.1));
    assert!(motion.duration_s() > 2.0);
}

/// Answers well until it is told to fail, or to lie.
struct Faulty {
    inner: RuckigGenerator,
    fault: Fault,
}

#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    NoDurations,
    NoMotion,
    TooFast,
}

impl OnlineGenerator for Faulty {
    fn durations(&mut self, joint: usize, request: &AxisRequest) -> Option<AxisDurations> {
        let mut request = *request;
        if self.fault == Fault::TooFast {
            request.limits = AxisLimits { velocity: 10.0, acceleration: 50.0, ..request.limits };
        }
        (self.fault != Fault::NoDurations).then(|| self.inner.durations(joint, &request))?
    }

    fn motion(&mut self, joint: usize, duration_s: f64) -> Option<AxisMotion> {
        (self.fault != Fault::NoMotion).then(|| self.inner.motion(joint, duration_s))?
    }
}

#[test]
fn a_failing_generator_is_counted_and_the_last_good_motion_goes_on() {
    let generator = Faulty { inner: RuckigGenerator::default(), fault: Fault::NoDurations };
    let moving = state(&[0.0, 0.0], &[0.5, 0.0], &[0.0; 2]);
    let mut joints =
        Retargeter::with_generator(generator, &moving, &limits(2), OnlineOptions::default())
            .expect("the state is usable");
    let target = rest(&[1.0, 0.5]);
    // Nothing to follow yet: it brakes.
    assert_eq!(joints.retarget(&target), Err(OnlineError::NoProfile { joint: 0 }));
    assert!(joints.tick(1.0).is_at_rest() && joints.failures() == 1);
    joints.generator_mut().fault = Fault::None;
    joints.retarget(&target).expect("it answers again");
    joints.tick(0.3);
    for (fault, failures) in [(Fault::NoDurations, 2), (Fault::NoMotion, 3), (Fault::TooFast, 4)] {
        joints.generator_mut().fault = fault;
        let before = joints.state();
        assert!(matches!(joints.retarget(&rest(&[-1.0, 0.0])), Err(OnlineError::NoProfile { .. })));
        assert_eq!((joints.state(), joints.failures()), (before, failures));
    }
    assert_eq!(joints.tick(10.0), target);
}

#[test]
fn a_retarget_that_would_overshoot_is_refused_and_the_old_target_kept() {
    let mut joints =
        Retargeter::new(&rest(&[0.0]), &limits(1), OnlineOptions::default()).expect("usable");
    joints.retarget(&rest(&[1.5])).expect("legal");
    joints.tick(0.4);
    let beyond = state(&[1.95], &[0.9], &[0.0]);
    let refused = joints.retarget(&beyond).expect_err("its stop has no room");
    assert!(matches!(refused, OnlineError::OvershootBeyondLimit { joint: 0, .. }), "{refused}");
    assert_eq!((joints.tick(10.0), joints.failures()), (rest(&[1.5]), 0));
}

#[test]
fn time_that_is_not_a_number_or_goes_backward_does_not_move_the_joints() {
    let mut joints =
        Retargeter::new(&rest(&[0.0]), &limits(1), OnlineOptions::default()).expect("usable");
    joints.retarget(&rest(&[1.0])).expect("legal");
    let before = joints.tick(0.5);
    assert_eq!(joints.tick(f64::NAN), before);
    assert_eq!(joints.tick(-0.5), before);
}
