//! Every variant of [`TrajectoryError`] that compiling gives, with its message.

use super::*;

const REST: &[f64] = &[0.0, 0.0];

fn limits() -> MotionLimits {
    MotionLimits::new(&[joint_limits(2.0, 1.5, 10.0), joint_limits(2.0, 1.5, 10.0)])
        .expect("complete limits")
}

/// From (0, 0) to (0.5, 0.5) and back in two seconds.
fn good() -> JointTrajectory {
    trajectory(&[0.0, 1.0, 2.0], &[REST, &[0.5, 0.5], REST], &[])
}

fn refusal(change: impl FnOnce(&mut JointTrajectory)) -> String {
    let mut changed = good();
    change(&mut changed);
    compile(&changed, &limits()).expect_err("the change is not allowed").to_string()
}

#[test]
fn the_trajectory_that_the_other_tests_break_is_accepted() {
    compile(&good(), &limits()).expect("legal");
}

#[test]
fn names_must_be_the_robots_joints() {
    assert_eq!(
        refusal(|t| t.joint_names[1] = "wrist".to_owned()),
        "joint_names has wrist, which the robot does not have"
    );
    assert_eq!(refusal(|t| t.joint_names.truncate(1)), "joint_names lacks the robot's joint b");
    assert_eq!(refusal(|t| t.joint_names.push("a".to_owned())), "joint_names has a more than once");
    assert_eq!(refusal(|t| t.joint_names.clear()), "joint_names lacks the robot's joint a");
}

#[test]
fn the_number_of_waypoints_is_bounded_on_both_sides() {
    assert_eq!(refusal(|t| t.waypoints.truncate(1)), "1 waypoints, at least 2 are needed");
    assert_eq!(refusal(|t| t.waypoints.clear()), "0 waypoints, at least 2 are needed");
    let options = TrajectoryOptions { max_waypoints: 2, ..TrajectoryOptions::default() };
    let error = CompiledTrajectory::compile(&good(), &["a", "b"], &limits(), &options)
        .expect_err("three waypoints");
    assert_eq!(error.to_string(), "3 waypoints, at most 2 are allowed");
    assert_eq!(TrajectoryOptions::default().max_waypoints, 100_000);
}

#[test]
fn every_row_has_one_value_per_joint() {
    assert_eq!(
        refusal(|t| t.waypoints[2].joint_position.push(0.0)),
        "waypoint 2: joint_position has 3 values, expected one for each of 2 joints"
    );
    assert_eq!(
        refusal(|t| t.waypoints[1].joint_velocity.push(0.0)),
        "waypoint 1: joint_velocity has 1 values, expected one for each of 2 joints"
    );
}

#[test]
fn velocities_come_with_every_waypoint_or_with_none() {
    let message = "waypoint 1: joint_velocity must be given at every waypoint or at none, \
                   waypoint 0 is different";
    assert_eq!(refusal(|t| t.waypoints[1].joint_velocity = REST.to_vec()), message);
    assert_eq!(refusal(|t| t.waypoints[0].joint_velocity = REST.to_vec()), message);
}

#[test]
fn infinite_values_and_not_a_number_are_refused() {
    assert_eq!(
        refusal(|t| t.waypoints[1].time_from_start_s = f64::NAN),
        "waypoint 1: time_from_start_s is NaN, which is not finite"
    );
    assert_eq!(
        refusal(|t| t.waypoints[1].joint_position[1] = f64::NEG_INFINITY),
        "waypoint 1: joint_position of b is -inf, which is not finite"
    );
    assert_eq!(
        refusal(|t| {
            t.waypoints.iter_mut().for_each(|w| w.joint_velocity = REST.to_vec());
            t.waypoints[1].joint_velocity[0] = f64::NAN;
        }),
        "waypoint 1: joint_velocity of a is NaN, which is not finite"
    );
}

#[test]
fn times_start_at_zero_and_increase_and_end_in_time() {
    assert_eq!(
        refusal(|t| t.waypoints[0].time_from_start_s = 1e-6),
        "waypoint 0: time_from_start_s is 0.000001, expected 0"
    );
    assert_eq!(
        refusal(|t| t.waypoints[2].time_from_start_s = 0.5),
        "waypoint 2: time_from_start_s is 0.5, expected at least 0.0001 s after the 1 of \
         waypoint 1"
    );
    assert_eq!(
        refusal(|t| t.waypoints[2].time_from_start_s = 1.00009),
        "waypoint 2: time_from_start_s is 1.00009, expected at least 0.0001 s after the 1 of \
         waypoint 1"
    );
    assert_eq!(
        refusal(|t| t.waypoints[2].time_from_start_s = 3601.0),
        "duration is 3601 s, at most 3600 s is allowed"
    );
}

#[test]
fn rounding_of_the_first_time_and_of_the_spacing_is_no_fault() {
    let mut rounded = good();
    rounded.waypoints[0].time_from_start_s = -1e-10;
    let compiled = compile(&rounded, &limits()).expect("zero but for rounding");
    assert_eq!(compiled.sample(0.0, &mut 0).position, compiled.start());
    let times: Vec<f64> = (0..1000).map(|index| f64::from(index) * 1e-4).collect();
    compile(&trajectory(&times, &[REST; 1000], &[]), &limits()).expect("nominal spacing");
}

#[test]
fn a_trajectory_starts_and_ends_at_rest() {
    let moving = |index: usize| {
        refusal(|t| {
            t.waypoints.iter_mut().for_each(|w| w.joint_velocity = REST.to_vec());
            t.waypoints[index].joint_velocity[1] = 0.01;
        })
    };
    let message = |index: usize| {
        format!(
            "waypoint {index}: joint_velocity of b is 0.01, but a trajectory starts and ends at \
             rest"
        )
    };
    assert_eq!(moving(0), message(0));
    assert_eq!(moving(2), message(2));
}

#[test]
fn a_waypoint_beyond_a_position_limit_is_refused() {
    assert_eq!(
        refusal(|t| {
            t.waypoints[1].joint_position[1] = -2.5;
            t.waypoints[1].time_from_start_s = 10.0;
            t.waypoints[2].time_from_start_s = 20.0;
        }),
        "b: position -2.5 at 10 s, between waypoints 0 and 1, is beyond the limit -2"
    );
}

#[test]
fn overshoot_between_legal_waypoints_is_refused() {
    // The spline rises to 2 at 5 s, passes above it, and is back at 2 at 10 s: symmetric about
    // 7.5 s, with slopes (m, -m) at the inner knots. 4 m - m = 3 * 2 / 5, so m = 0.4, and a
    // symmetric cubic rises by m h / 4 = 0.5 between.
    let arc = trajectory(&[0.0, 5.0, 10.0, 15.0], &[REST, &[2.0, 0.0], &[2.0, 0.0], REST], &[]);
    let error = compile(&arc, &limits()).expect_err("overshoots to 2.5");
    let TrajectoryError::BeyondLimit { quantity, joint, segment, time_s, value, limit } = error
    else {
        panic!("not a limit: {error}");
    };
    assert_eq!((quantity, joint.as_str(), segment), (LimitedQuantity::Position, "a", 1));
    assert!((time_s - 7.5).abs() < 1e-9 && (value - 2.5).abs() < 1e-9, "{value} at {time_s}");
    assert_eq!(limit, 2.0);
}

#[test]
fn velocity_between_waypoints_is_limited() {
    // Rest to rest over 1.2 in 1 s: highest velocity 1.5 * 1.2 in the middle.
    assert_eq!(
        refusal(|t| {
            t.waypoints.truncate(2);
            t.waypoints[1].joint_position = vec![0.0, -1.2];
        }),
        "b: velocity -1.8 at 0.5 s, between waypoints 0 and 1, is beyond the \
         limit 1.5"
    );
}

#[test]
fn acceleration_is_limited_on_both_sides_of_a_knot() {
    // Rest to rest over d in h accelerates by 6 d / h² at both ends.
    let jump = |first: f64, second: f64| {
        let rest = [REST; 3];
        let times = [0.0, first, first + second];
        let positions: [&[f64]; 3] = [REST, &[0.2, 0.0], REST];
        compile(&trajectory(&times, &positions, &rest), &limits())
    };
    jump(0.4, 0.4).expect("7.5 is legal");
    assert_eq!(
        jump(0.4, 0.3).expect_err("13.3 after the knot").to_string(),
        "a: acceleration -13.333333333 at 0.4 s, between waypoints 1 and 2, is beyond \
         the limit 10"
    );
    assert_eq!(
        jump(0.3, 0.4).expect_err("13.3 before the knot").to_string(),
        "a: acceleration 13.333333333 at 0 s, between waypoints 0 and 1, is beyond \
         the limit 10"
    );
}

#[test]
fn what_overflows_is_refused() {
    let limits = MotionLimits::new(&[JointLimits {
        lower: None,
        upper: None,
        ..joint_limits(0.0, 1e300, 1e300)
    }])
    .expect("complete limits");
    for far in [f64::MAX, -f64::MAX] {
        let jump = trajectory(&[0.0, 1e-4, 2e-4], &[&[far], &[-far], &[far]], &[]);
        let error = compile(&jump, &limits).expect_err("beyond every limit");
        assert!(matches!(error, TrajectoryError::BeyondLimit { .. }), "{error}");
    }
}

#[test]
fn a_limit_may_be_touched_but_not_passed_by_more_than_the_tolerance() {
    let reach = |position: f64| {
        let positions: [&[f64]; 3] = [REST, &[position, 0.0], REST];
        compile(&trajectory(&[0.0, 10.0, 20.0], &positions, &[REST; 3]), &limits())
    };
    reach(2.0).expect("on the limit");
    reach(2.0 + 0.9 * LIMIT_TOLERANCE).expect("rounding");
    reach(2.0 + 1.1 * LIMIT_TOLERANCE).expect_err("beyond");
}

#[test]
fn limits_of_another_robot_are_refused() {
    let error = CompiledTrajectory::compile(
        &good(),
        &["a", "b", "c"],
        &limits(),
        &TrajectoryOptions::default(),
    )
    .expect_err("three names, two limits");
    assert_eq!(error.to_string(), "3 joints in the robot's order, but limits of 2");
}
