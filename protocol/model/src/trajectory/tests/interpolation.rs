//! What is sampled between waypoints.

use super::*;

/// Three joints with velocities at four uneven waypoints.
fn hermite() -> JointTrajectory {
    trajectory(
        &[0.0, 0.5, 0.7, 2.0],
        &[&[0.1, 0.2, 0.3], &[0.4, -0.2, 0.35], &[0.5, 0.0, 0.4], &[1.0 / 3.0, 0.7, 0.1]],
        &[&[0.0; 3], &[0.3, 0.1, -0.2], &[0.2, 0.0, 0.1], &[0.0; 3]],
    )
}

#[test]
fn waypoints_are_passed_with_the_velocities_given() {
    let asked = hermite();
    let compiled = compile(&asked, &generous(3)).expect("legal");
    let mut hint = 0;
    for (index, waypoint) in asked.waypoints.iter().enumerate() {
        let sample = compiled.sample(waypoint.time_from_start_s, &mut hint);
        assert_eq!(sample.waypoint, index);
        assert_eq!(*sample.position, waypoint.joint_position[..]);
        assert_eq!(*sample.velocity, waypoint.joint_velocity[..]);
    }
    let before = compiled.sample(0.7 - 1e-9, &mut hint);
    assert!(before.position.max_abs_difference(&vector(&[0.5, 0.0, 0.4])) < 1e-9);
    assert!(before.velocity.max_abs_difference(&vector(&[0.2, 0.0, 0.1])) < 1e-7);
}

#[test]
fn joints_come_in_the_robots_order_whatever_the_order_of_the_names() {
    let asked = hermite();
    let shuffled = asked
        .select(&[2, 0, 1], ["c", "a", "b"].map(str::to_owned).to_vec())
        .expect("the columns exist");
    assert_eq!(compile(&shuffled, &generous(3)), compile(&asked, &generous(3)));
}

#[test]
fn without_velocities_the_acceleration_is_continuous_and_both_ends_rest() {
    let mut asked = hermite();
    asked.waypoints.iter_mut().for_each(|waypoint| waypoint.joint_velocity.clear());
    let compiled = compile(&asked, &generous(3)).expect("legal");
    assert_smooth(&compiled);
    assert_acceleration_is_continuous(&compiled);
    let velocity = |t_s: f64| compiled.sample(t_s, &mut 0).velocity;
    assert!(velocity(1e-6).iter().chain(velocity(2.0 - 1e-6).iter()).all(|v| v.abs() < 1e-4));
}

#[test]
fn with_velocities_velocity_is_continuous() {
    assert_smooth(&compile(&hermite(), &generous(3)).expect("legal"));
}

#[test]
fn the_natural_spline_has_no_acceleration_at_the_ends_and_moves_there() {
    let mut asked = hermite();
    asked.interpolation = Interpolation::CubicSplineNatural;
    asked.waypoints.iter_mut().for_each(|waypoint| waypoint.joint_velocity.clear());
    let compiled = compile_with(&asked, &generous(3), &IN_MOTION).expect("legal");
    assert_smooth(&compiled);
    assert_acceleration_is_continuous(&compiled);
    let (start, end) = (compiled.state_at(0.0, &mut 0), compiled.end_state());
    for (joint, axis) in start.acceleration.iter().chain(end.acceleration.iter()).enumerate() {
        assert!(axis.abs() < 1e-12, "{joint}: {axis}");
    }
    assert!(start.velocity.iter().chain(end.velocity.iter()).all(|v| v.abs() > 1e-3));
    assert_eq!(compiled.sample(9.0, &mut 0).velocity, end.velocity);
    assert_eq!(compiled.state_at(9.0, &mut 0).acceleration, vector(&[0.0; 3]));
}

#[test]
fn a_natural_spline_over_a_tip_is_the_textbook_one() {
    // Through (0, 0), (1, 1), (2, 0): 3/2 t - 1/2 t³ up to the tip.
    let mut asked = trajectory(&[0.0, 1.0, 2.0], &[&[0.0], &[1.0], &[0.0]], &[]);
    asked.interpolation = Interpolation::CubicSplineNatural;
    let compiled = compile_with(&asked, &generous(1), &IN_MOTION).expect("legal");
    for t in [0.0, 0.25, 0.5, 1.0] {
        let state = compiled.state_at(t, &mut 0);
        assert!((state.position[0] - (1.5 * t - 0.5 * t * t * t)).abs() < 1e-15);
        assert!((state.velocity[0] - (1.5 - 1.5 * t * t)).abs() < 1e-15);
        assert!((state.acceleration[0] + 3.0 * t).abs() < 1e-14);
    }
    assert!((compiled.jerk_at(0.5, &mut 0)[0] + 3.0).abs() < 1e-14);
    assert!((compiled.end_state().velocity[0] + 1.5).abs() < 1e-15);
}

#[test]
fn a_natural_spline_that_rests_by_chance_is_taken() {
    let mut asked = trajectory(&[0.0, 1.0, 3.0], &[&[0.5], &[0.5], &[0.5]], &[]);
    asked.interpolation = Interpolation::CubicSplineNatural;
    let compiled = compile(&asked, &generous(1)).expect("it stands still");
    assert_eq!(compiled.sample(2.0, &mut 0).position, vector(&[0.5]));
}

#[test]
fn ends_in_motion_keep_the_velocities_given() {
    let asked = trajectory(&[0.0, 1.0], &[&[0.0], &[1.0]], &[&[0.5], &[2.0]]);
    let compiled = compile_with(&asked, &generous(1), &IN_MOTION).expect("legal");
    assert_eq!(compiled.state_at(0.0, &mut 0).velocity, vector(&[0.5]));
    assert!((compiled.end_state().velocity[0] - 2.0).abs() < 1e-15);
    // 2 c2 + 6 c3 with c2 = 3 - 1 - 2 and c3 = 0.5 + 2 - 2.
    assert!((compiled.end_state().acceleration[0] - 3.0).abs() < 1e-14);
}

#[test]
fn outside_of_the_motion_acceleration_and_jerk_are_zero() {
    let compiled = compile(&hermite(), &generous(3)).expect("legal");
    for outside in [-1.0, f64::NAN, 2.0, 3.0] {
        assert_eq!(compiled.state_at(outside, &mut 0).acceleration, vector(&[0.0; 3]));
        assert_eq!(compiled.jerk_at(outside, &mut 0), vector(&[0.0; 3]));
    }
    assert!(compiled.state_at(0.0, &mut 0).acceleration[0].abs() > 0.1);
}

#[test]
fn segments_follow_each_other_without_gaps() {
    let compiled = compile(&hermite(), &generous(3)).expect("legal");
    let segments: Vec<_> = compiled.segments().collect();
    assert_eq!((segments.len(), compiled.segment_count()), (3, 3));
    let mut end_s = 0.0;
    for (index, bounds) in segments.iter().enumerate() {
        assert_eq!((bounds.start_s, bounds.waypoint), (end_s, index));
        end_s = bounds.start_s + bounds.length_s;
    }
    assert_eq!(end_s, compiled.duration_s());
    for (t_s, first) in [(-1.0, 0), (0.6, 1), (0.7, 2), (9.0, 2)] {
        let rest: Vec<_> = compiled.segments_at(t_s, &mut 0).collect();
        assert_eq!(rest, segments[first..], "at {t_s}");
    }
}

#[test]
fn tolerances_are_those_of_the_waypoint_and_in_the_robots_order() {
    let mut asked = hermite();
    asked.waypoints[1].position_tolerance = vec![0.1, 0.2, 0.3];
    asked.waypoints[3].velocity_tolerance = vec![1.0, 2.0, 3.0];
    let shuffled = asked
        .select(&[2, 0, 1], ["c", "a", "b"].map(str::to_owned).to_vec())
        .expect("the columns exist");
    let compiled = compile(&shuffled, &generous(3)).expect("legal");
    let at = |t_s| compiled.tolerance(compiled.sample(t_s, &mut 0).waypoint);
    let nothing: &[f64] = &[];
    assert_eq!((at(0.4).position, at(0.4).velocity), (nothing, nothing));
    assert_eq!((at(0.6).position, at(0.6).velocity), (&[0.1, 0.2, 0.3][..], nothing));
    assert_eq!((at(0.8).position, at(0.8).velocity), (nothing, nothing));
    assert_eq!((at(2.0).position, at(2.0).velocity), (nothing, &[1.0, 2.0, 3.0][..]));
    assert_eq!(compiled.tolerance(4).velocity, nothing);
    assert_eq!(compiled.tolerance(usize::MAX).velocity, nothing);
}

#[test]
fn waypoints_may_be_a_minute_or_a_tenth_of_a_millisecond_apart() {
    let sparse = trajectory(&[0.0, 60.0], &[&[0.0], &[1.0]], &[]);
    let compiled = compile(&sparse, &generous(1)).expect("legal");
    assert!((compiled.sample(30.0, &mut 0).position[0] - 0.5).abs() < 1e-15);
    let times: Vec<f64> = (0..10_001).map(|index| f64::from(index) * 1e-4).collect();
    let exact = |t: f64| t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
    let rows: Vec<[f64; 1]> = times.iter().map(|&t| [exact(t)]).collect();
    let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
    for interpolation in [Interpolation::CubicSpline, Interpolation::QuinticHermite] {
        let mut dense = trajectory(&times, &rows, &[]);
        dense.interpolation = interpolation;
        let compiled = compile(&dense, &generous(1)).expect("legal");
        let mut hint = 0;
        for sample in 0..1000 {
            let t = f64::from(sample) / 1000.0 + 3e-5;
            let state = compiled.state_at(t, &mut hint);
            assert!((state.position[0] - exact(t)).abs() < 1e-13);
            assert!((state.velocity[0] - 30.0 * t * t * (1.0 - t) * (1.0 - t)).abs() < 1e-9);
            let acceleration = 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t);
            assert!((state.acceleration[0] - acceleration).abs() < 1e-5);
        }
    }
}

#[test]
fn two_waypoints_give_the_smooth_step() {
    let asked = trajectory(&[0.0, 2.0], &[&[1.0], &[3.0]], &[]);
    let compiled = compile(&asked, &generous(1)).expect("legal");
    for share in [0.1, 0.5, 0.9] {
        let sample = compiled.sample(2.0 * share, &mut 0);
        let exact = 1.0 + 2.0 * share * share * (3.0 - 2.0 * share);
        assert!((sample.position[0] - exact).abs() < 1e-15, "{share}: {sample:?}");
        assert!((sample.velocity[0] - 6.0 * share * (1.0 - share)).abs() < 1e-15);
    }
}

#[test]
fn before_the_start_and_after_the_end_it_rests_exactly_at_the_outer_waypoints() {
    let compiled = compile(&hermite(), &generous(3)).expect("legal");
    let rest = vector(&[0.0; 3]);
    let mut hint = 0;
    for early in [0.0, -1.0, f64::NEG_INFINITY, f64::NAN] {
        let sample = compiled.sample(early, &mut hint);
        assert_eq!((sample.position, sample.velocity), (compiled.start(), rest), "{early}");
        assert_eq!(sample.waypoint, 0);
    }
    for late in [2.0, 2.0 + f64::EPSILON, 1e300, f64::INFINITY] {
        let sample = compiled.sample(late, &mut hint);
        assert_eq!(sample.position[0].to_bits(), (1.0_f64 / 3.0).to_bits());
        assert_eq!((sample.position, sample.velocity), (compiled.end(), rest), "{late}");
        assert_eq!(sample.waypoint, 3);
    }
}

#[test]
fn size_and_duration_are_those_of_the_waypoints() {
    let compiled = compile(&hermite(), &generous(3)).expect("legal");
    assert_eq!(compiled.duration_s(), 2.0);
    assert_eq!((compiled.waypoint_count(), compiled.joint_count()), (4, 3));
}

#[test]
fn no_hint_changes_a_sample() {
    let times: Vec<f64> = (0..40).map(|index| f64::from(index) * 0.1).collect();
    let rows: Vec<[f64; 1]> = times.iter().map(|t| [t.sin()]).collect();
    let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
    let compiled = compile(&trajectory(&times, &rows, &[]), &generous(1)).expect("legal");
    for tick in 0..200 {
        let t_s = f64::from(tick) * 0.02;
        let expected = compiled.sample(t_s, &mut 0);
        assert_eq!(expected.waypoint, times.iter().filter(|&&t| t <= t_s).count() - 1);
        for hint in [0, 1, expected.waypoint, 20, 38, 39, 40, usize::MAX] {
            let mut found = hint;
            assert_eq!(compiled.sample(t_s, &mut found), expected, "hint {hint} at {t_s}");
            assert_eq!(found, expected.waypoint.min(38));
        }
    }
}
