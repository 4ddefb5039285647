//! Polynomials of fifth degree.

use super::*;

fn quintic(asked: JointTrajectory) -> JointTrajectory {
    JointTrajectory { interpolation: Interpolation::QuinticHermite, ..asked }
}

#[test]
fn two_waypoints_give_the_motion_of_least_jerk() {
    let asked = quintic(trajectory(&[0.0, 2.0], &[&[1.0], &[4.0]], &[]));
    let compiled = compile(&asked, &generous(1)).expect("legal");
    assert_smooth(&compiled);
    for share in [0.0_f64, 0.1, 0.5, 0.9] {
        let state = compiled.state_at(2.0 * share, &mut 0);
        let rest = 1.0 - share;
        let position = 1.0 + 3.0 * share.powi(3) * (10.0 - 15.0 * share + 6.0 * share * share);
        assert!((state.position[0] - position).abs() < 1e-14);
        assert!((state.velocity[0] - 1.5 * 30.0 * (share * rest).powi(2)).abs() < 1e-14);
        let acceleration = 0.75 * 60.0 * share * rest * (rest - share);
        assert!((state.acceleration[0] - acceleration).abs() < 1e-13);
    }
    // Peaks 15/8, 10/√3 and 60 of the unit step, which is stretched by 3 and takes 2 s.
    let bounds = compiled.segments().next().expect("one segment");
    assert!((bounds.velocity[0] - 1.875 * 1.5).abs() < 1e-13);
    assert!((bounds.acceleration[0] - 10.0 / 3.0_f64.sqrt() * 0.75).abs() < 1e-13);
    assert!((bounds.jerk[0] - 60.0 * 0.375).abs() < 1e-12);
}

#[test]
fn waypoints_are_passed_with_what_is_given() {
    let mut asked = quintic(trajectory(
        &[0.0, 0.5, 1.25],
        &[&[0.1, 0.2], &[0.4, -0.2], &[0.3, 0.7]],
        &[&[0.0; 2], &[0.3, 0.1], &[0.0; 2]],
    ));
    for (waypoint, row) in asked.waypoints.iter_mut().zip([[1.0, -1.0], [0.5, 2.0], [-1.5, 0.0]]) {
        waypoint.joint_acceleration = row.to_vec();
    }
    let compiled = compile(&asked, &generous(2)).expect("legal");
    assert_smooth(&compiled);
    assert_acceleration_is_continuous(&compiled);
    for waypoint in &asked.waypoints[..2] {
        let state = compiled.state_at(waypoint.time_from_start_s, &mut 0);
        assert_eq!(*state.position, waypoint.joint_position[..]);
        assert_eq!(*state.velocity, waypoint.joint_velocity[..]);
        assert_eq!(*state.acceleration, waypoint.joint_acceleration[..]);
    }
    assert_eq!(compiled.sample(1.25, &mut 0).position, compiled.end());
    assert!(compiled.end_state().acceleration.max_abs_difference(&vector(&[-1.5, 0.0])) < 1e-12);
}

#[test]
fn what_is_not_given_is_the_cubic_splines_but_for_rest_at_the_ends() {
    let asked =
        trajectory(&[0.0, 0.5, 0.7, 2.0, 3.0], &[&[0.1], &[0.4], &[0.5], &[-0.3], &[0.0]], &[]);
    let spline = compile(&asked, &generous(1)).expect("legal");
    let compiled = compile(&quintic(asked), &generous(1)).expect("legal");
    assert_smooth(&compiled);
    assert_acceleration_is_continuous(&compiled);
    // Where the spline's accelerations are taken on both sides it is the spline itself.
    for t in [0.5, 0.6, 0.7, 1.3, 1.9] {
        let (a, b) = (compiled.state_at(t, &mut 0), spline.state_at(t, &mut 0));
        assert!(a.position.max_abs_difference(&b.position) < 1e-14);
        assert!(a.acceleration.max_abs_difference(&b.acceleration) < 1e-12);
    }
    assert_eq!(compiled.state_at(0.0, &mut 0).acceleration[0], 0.0);
    assert!(compiled.end_state().acceleration[0].abs() < 1e-12);
    assert!(spline.state_at(0.0, &mut 0).acceleration[0].abs() > 0.1);
}

#[test]
fn accelerations_that_are_not_given_are_the_mean_of_both_sides() {
    let rows: [&[f64]; 3] = [&[0.0], &[1.0], &[1.0]];
    let rest: [&[f64]; 3] = [&[0.0]; 3];
    let asked = trajectory(&[0.0, 1.0, 2.0], &rows, &rest);
    let compiled = compile(&quintic(asked), &generous(1)).expect("legal");
    // The cubic to 1 decelerates by 6 at its end, the one after stands.
    assert!((compiled.state_at(1.0, &mut 0).acceleration[0] + 3.0).abs() < 1e-15);
}

#[test]
fn only_it_can_keep_limits_of_jerk_from_rest_to_rest() {
    let asked = trajectory(&[0.0, 2.0], &[&[0.0], &[1.0]], &[]);
    let options = TrajectoryOptions { jerk: JerkLimit::Enforced, ..TrajectoryOptions::default() };
    let jerk = |jerk| {
        limits_of(&[AxisLimits {
            lower: -2.0,
            upper: 2.0,
            velocity: 2.0,
            acceleration: 10.0,
            jerk,
        }])
    };
    // 60 / T³ at both ends.
    compile_with(&quintic(asked.clone()), &jerk(7.5), &options).expect("just legal");
    assert_eq!(
        compile_with(&quintic(asked.clone()), &jerk(7.4), &options).expect_err("above").to_string(),
        "a: jerk 7.5 at 0 s, between waypoints 0 and 1, is beyond the limit 7.4"
    );
    compile(&quintic(asked.clone()), &jerk(0.1)).expect("jerk is ignored if not asked for");
    assert_eq!(
        compile_with(&asked, &jerk(1e3), &options).expect_err("jumps at the start").to_string(),
        "a: acceleration jumps from 0 to 1.5 at 0 s, which no limit of jerk allows"
    );
    let linear = JointTrajectory { interpolation: Interpolation::JointLinear, ..asked };
    assert!(matches!(
        compile_with(&linear, &jerk(1e3), &options),
        Err(TrajectoryError::AccelerationJump { time_s: 0.0, .. })
    ));
}

#[test]
fn with_ends_in_motion_only_jumps_inside_break_limits_of_jerk() {
    let options = TrajectoryOptions { jerk: JerkLimit::Enforced, ..IN_MOTION };
    let limits = MotionLimits::new(&[joint_limits(1e3, 1e3, 1e2)]).expect("complete");
    let smooth = trajectory(&[0.0, 1.0, 2.0], &[&[0.0], &[0.5], &[0.6]], &[]);
    compile_with(&smooth, &limits, &options).expect("the spline has no jumps inside");
    let rest: [&[f64]; 3] = [&[0.0]; 3];
    let jumps = trajectory(&[0.0, 1.0, 2.0], &[&[0.0], &[0.5], &[0.5]], &rest);
    assert_eq!(
        compile_with(&jumps, &limits, &options).expect_err("jumps").to_string(),
        "a: acceleration jumps from -3 to 0 at 1 s, which no limit of jerk allows"
    );
    let mut last = quintic(smooth);
    last.waypoints.iter_mut().for_each(|w| w.joint_acceleration = vec![0.0]);
    last.waypoints[2].joint_acceleration = vec![0.25];
    compile_with(&last, &limits, &options).expect("the end may have acceleration");
    let options = TrajectoryOptions { jerk: JerkLimit::Enforced, ..TrajectoryOptions::default() };
    assert_eq!(
        compile_with(&last, &limits, &options).expect_err("jumps at the end").to_string(),
        "a: acceleration jumps from 0.25 to 0 at 2 s, which no limit of jerk allows"
    );
}
