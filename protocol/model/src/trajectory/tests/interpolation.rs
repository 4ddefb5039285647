//! What is sampled between waypoints.

use super::*;

fn generous(joints: usize) -> MotionLimits {
    MotionLimits::new(&vec![joint_limits(1e3, 1e3, 1e6); joints]).expect("complete limits")
}

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
fn without_velocities_the_acceleration_is_continuous() {
    let mut asked = hermite();
    asked.waypoints.iter_mut().for_each(|waypoint| waypoint.joint_velocity.clear());
    let compiled = compile(&asked, &generous(3)).expect("legal");
    let velocity = |t_s: f64| compiled.sample(t_s, &mut 0).velocity;
    let step = 1e-6;
    for knot in [0.5, 0.7] {
        for joint in 0..3 {
            let before = (velocity(knot)[joint] - velocity(knot - step)[joint]) / step;
            let after = (velocity(knot + step)[joint] - velocity(knot)[joint]) / step;
            assert!((before - after).abs() < 1e-3, "{knot} s: {before}, then {after}");
        }
    }
    assert!(velocity(step).iter().chain(velocity(2.0 - step).iter()).all(|v| v.abs() < 1e-4));
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
