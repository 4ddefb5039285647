//! All joints: straight, exact, inside limits, also when the target changes on the way.

use proptest::prelude::*;

use super::*;
use crate::trajectory::{JointMove, JointMoveError, MotionState};

fn limits() -> MotionLimits {
    MotionLimits::new(&[
        joint_limits(3.0, 2.0, 10.0),
        joint_limits(3.0, 1.0, 4.0),
        joint_limits(0.5, 0.1, 0.5),
    ])
    .expect("complete limits")
}

fn standing(position: [f64; 3]) -> MotionState {
    MotionState { position: vector(&position), velocity: vector(&[0.0; 3]) }
}

fn refusal(start: &MotionState, target: &[f64]) -> String {
    JointMove::plan(start, &vector(target), &limits()).expect_err("refused").to_string()
}

#[test]
fn the_duration_from_rest_is_that_of_the_slowest_joint() {
    // Joint 1 needs 2/1 + 1/4 s, the others less.
    let target = vector(&[1.0, 2.0, 0.1]);
    let planned = JointMove::plan(&standing([0.0; 3]), &target, &limits()).expect("legal");
    assert!((planned.duration_s() - 2.25).abs() < 1e-12, "{}", planned.duration_s());
    assert_eq!(planned.target(), target);
}

#[test]
fn a_move_to_where_the_arm_stands_takes_no_time() {
    let here = standing([0.1, 0.2, 0.3]);
    let planned = JointMove::plan(&here, &here.position, &limits()).expect("legal");
    assert!(planned.duration_s() < 1e-100);
    assert_eq!(planned.at(0.0).position, here.position);
    assert_eq!(planned.at(1e-3), here);
}

#[test]
fn a_target_beyond_a_limit_is_refused() {
    assert_eq!(
        refusal(&standing([0.0; 3]), &[0.0, -3.5, 0.0]),
        "joint 1: target -3.5 is beyond the limit -3"
    );
}

#[test]
fn what_cannot_brake_inside_the_limits_is_refused() {
    let mut start = standing([2.9, 0.0, 0.0]);
    start.velocity = vector(&[2.0, 0.0, 0.0]);
    assert_eq!(refusal(&start, &[0.0; 3]), "joint 0: turns back only at 3.1, beyond the limit 3");
    start.position = vector(&[2.8, 0.0, 0.0]);
    JointMove::plan(&start, &vector(&[0.0; 3]), &limits()).expect("turns at the limit");
}

#[test]
fn an_arm_outside_its_limits_can_be_driven_back_but_no_further_out() {
    let outside = standing([3.4, 0.0, 0.0]);
    JointMove::plan(&outside, &vector(&[2.0, 0.0, 0.0]), &limits()).expect("back inside");
    assert_eq!(refusal(&outside, &[3.2, 0.0, 0.0]), "joint 0: target 3.2 is beyond the limit 3");
    let moving = MotionState { velocity: vector(&[0.1, 0.0, 0.0]), ..outside };
    assert!(refusal(&moving, &[2.0, 0.0, 0.0]).starts_with("joint 0: turns back only at 3.400"));
}

#[test]
fn vectors_of_wrong_length_and_values_that_are_not_finite_are_refused() {
    let start = standing([0.0; 3]);
    assert_eq!(
        refusal(&start, &[0.0; 2]),
        "target has 2 values, expected one for each of 3 joints"
    );
    let unknown = MotionState { velocity: JointVector::EMPTY, ..start };
    assert_eq!(
        refusal(&unknown, &[0.0; 3]),
        "start velocity has 0 values, expected one for each of 3 joints"
    );
    let mut broken = start;
    broken.position[2] = f64::NAN;
    assert_eq!(refusal(&broken, &[0.0; 3]), "joint 2: start position is NaN, which is not finite");
    assert!(matches!(
        JointMove::plan(&broken, &start.position, &limits()),
        Err(JointMoveError::Profile { joint: 2, .. })
    ));
}

fn inside() -> impl Strategy<Value = [f64; 3]> {
    (-3.0..3.0_f64, -3.0..3.0_f64, -0.5..0.5_f64).prop_map(|(a, b, c)| [a, b, c])
}

proptest! {
    #![proptest_config(seeded(256))]

    #[test]
    fn a_move_from_rest_is_straight_legal_and_exact(
        from in inside(), to in inside(), period_s in 1e-3..0.1_f64, phase in 0.0..1.0_f64,
    ) {
        let target = vector(&to);
        let planned = JointMove::plan(&standing(from), &target, &limits()).expect("inside");
        let ticks = (planned.duration_s() / period_s) as u32 + 4;
        let sent: Vec<JointVector> = (0..ticks)
            .map(|tick| planned.at((f64::from(tick) + phase - 2.0) * period_s).position)
            .collect();
        prop_assert_eq!(sent[0], vector(&from));
        prop_assert_eq!(sent[sent.len() - 1], target);
        assert_legal(&sent, period_s, &limits());
        for x in &sent {
            let shares = [0, 1, 2].map(|joint| (x[joint] - from[joint]) / (to[joint] - from[joint]));
            for joint in [1, 2] {
                let off = (shares[joint] - shares[0]) * (to[joint] - from[joint]);
                let rounding = 1e-14 * (1.0 + ((to[joint] - from[joint]) / (to[0] - from[0])).abs());
                prop_assert!(off.abs() <= rounding, "{off} off the line");
            }
        }
    }

    #[test]
    fn changing_the_target_on_the_way_stays_legal(
        from in inside(),
        targets in prop::collection::vec((inside(), 0_u32..60), 1..6),
        period_s in 2e-3..0.05_f64,
    ) {
        let mut state = standing(from);
        let mut sent = vec![state.position; 2];
        let mut last = None;
        for (target, ticks) in &targets {
            let planned = JointMove::plan(&state, &vector(target), &limits()).expect("can brake");
            for tick in 1..=*ticks {
                state = planned.at(f64::from(tick) * period_s);
                sent.push(state.position);
            }
            last = Some((planned, *ticks));
        }
        let (planned, ticks) = last.expect("one target at least");
        let to_end = (planned.duration_s() / period_s) as u32 + 3;
        sent.extend((ticks + 1..to_end).map(|tick| planned.at(f64::from(tick) * period_s).position));
        assert_legal(&sent, period_s, &limits());
        let end = planned.at(planned.duration_s());
        prop_assert_eq!(end.position, planned.target());
        prop_assert_eq!(end.velocity, vector(&[0.0; 3]));
    }

    #[test]
    fn lower_limits_on_the_way_are_reached_by_braking(
        from in inside(), to in inside(), ticks in 0_u32..40, period_s in 2e-3..0.05_f64,
    ) {
        let first = JointMove::plan(&standing(from), &vector(&to), &limits()).expect("inside");
        let state = first.at(f64::from(ticks) * period_s);
        let slow = limits().with_max_velocity(&vector(&[0.3, 0.2, 0.05])).expect("lower");
        let second = JointMove::plan(&state, &vector(&to), &slow).expect("can brake");
        let sent: Vec<JointVector> = (0..=ticks)
            .map(|tick| first.at(f64::from(tick) * period_s))
            .chain((1..400).map(|tick| second.at(f64::from(tick) * period_s)))
            .map(|state| state.position)
            .collect();
        assert_legal(&sent, period_s, &limits());
        for (joint, axis) in slow.iter().enumerate() {
            let braked_s = (state.velocity[joint].abs() - axis.velocity).max(0.0) / axis.acceleration;
            let speed = second.at(braked_s).velocity[joint].abs();
            prop_assert!(speed <= axis.velocity + 1e-9, "joint {joint}: {speed}");
        }
    }
}
