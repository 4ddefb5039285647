//! The payload: what it looks like in JSON, its parts, its units.

use super::*;
use crate::{JointType, JointUnit};

fn two_robots() -> JointTrajectory {
    let row = |time_from_start_s, base: f64| Waypoint {
        time_from_start_s,
        joint_position: vec![base, base + 1.0, base + 2.0],
        joint_velocity: vec![0.0; 3],
        ..Waypoint::default()
    };
    JointTrajectory {
        joint_names: ["left/a", "left/b", "right/a"].map(str::to_owned).to_vec(),
        waypoints: vec![row(0.0, 0.0), row(1.0, 10.0)],
        ..JointTrajectory::default()
    }
}

/// Every field has a value.
fn full() -> JointTrajectory {
    let mut trajectory = two_robots();
    trajectory.joint_units = vec![JointUnit::Degree, JointUnit::Meter, JointUnit::Implicit];
    trajectory.interpolation = Interpolation::QuinticHermite;
    for waypoint in &mut trajectory.waypoints {
        waypoint.joint_acceleration = vec![1.0, 2.0, 3.0];
        waypoint.position_tolerance = vec![4.0, 5.0, 6.0];
        waypoint.velocity_tolerance = vec![7.0, 8.0, 9.0];
    }
    trajectory
}

#[test]
fn what_was_written_before_decodes_and_is_written_as_before() {
    let text = r#"{"joint_names":["a"],"waypoints":[
        {"time_from_start_s":0.0,"joint_position":[0.5]}]}"#;
    let trajectory: JointTrajectory = serde_json::from_str(text).expect("decodes");
    assert_eq!(trajectory.interpolation, Interpolation::CubicSpline);
    assert_eq!(
        serde_json::to_string(&trajectory).expect("encodes"),
        r#"{"joint_names":["a"],"waypoints":[{"time_from_start_s":0.0,"joint_position":[0.5]}],"interpolation":"cubic_spline"}"#
    );
    assert_eq!(
        serde_json::to_string(&two_robots()).expect("encodes"),
        r#"{"joint_names":["left/a","left/b","right/a"],"waypoints":[{"time_from_start_s":0.0,"joint_position":[0.0,1.0,2.0],"joint_velocity":[0.0,0.0,0.0]},{"time_from_start_s":1.0,"joint_position":[10.0,11.0,12.0],"joint_velocity":[0.0,0.0,0.0]}],"interpolation":"cubic_spline"}"#
    );
}

#[test]
fn every_field_survives_json() {
    let text = serde_json::to_string(&full()).expect("encodes");
    for part in [
        r#""joint_units":["degree","meter","implicit"]"#,
        r#""joint_acceleration":[1.0,2.0,3.0]"#,
        r#""position_tolerance":[4.0,5.0,6.0]"#,
        r#""velocity_tolerance":[7.0,8.0,9.0]"#,
        r#""interpolation":"quintic_hermite""#,
    ] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    assert_eq!(serde_json::from_str::<JointTrajectory>(&text).expect("decodes"), full());
}

#[test]
fn interpolations_are_shown_as_they_are_written() {
    for interpolation in [
        Interpolation::CubicSpline,
        Interpolation::CubicSplineNatural,
        Interpolation::JointLinear,
        Interpolation::QuinticHermite,
    ] {
        let text = serde_json::to_string(&interpolation).expect("encodes");
        assert_eq!(text, format!("\"{interpolation}\""));
    }
}

#[test]
fn a_field_or_a_name_that_does_not_exist_is_refused_by_name() {
    let text = r#"{"joint_names":[],"waypoints":[
        {"time_from_start_s":0.0,"joint_position":[],"waypoint_type":1}]}"#;
    let error = serde_json::from_str::<JointTrajectory>(text).expect_err("unknown field");
    assert!(error.to_string().contains("waypoint_type"), "{error}");
    let text = r#"{"joint_names":[],"waypoints":[],"interpolation":"spherical"}"#;
    let error = serde_json::from_str::<JointTrajectory>(text).expect_err("unknown variant");
    assert!(error.to_string().contains("spherical"), "{error}");
    let text = r#"{"joint_names":["a"],"joint_units":["gon"],"waypoints":[]}"#;
    let error = serde_json::from_str::<JointTrajectory>(text).expect_err("unknown unit");
    assert!(error.to_string().contains("gon"), "{error}");
}

#[test]
fn selection_reorders_every_row_and_renames_joints() {
    let part =
        full().select(&[2, 0], vec!["x".to_owned(), "y".to_owned()]).expect("both columns exist");
    assert_eq!(part.joint_names, ["x", "y"]);
    assert_eq!(part.joint_units, [JointUnit::Implicit, JointUnit::Degree]);
    assert_eq!(part.interpolation, Interpolation::QuinticHermite);
    let waypoint = &part.waypoints[1];
    assert_eq!(waypoint.joint_position, [12.0, 10.0]);
    assert_eq!(waypoint.joint_velocity, [0.0, 0.0]);
    assert_eq!(waypoint.joint_acceleration, [3.0, 1.0]);
    assert_eq!(waypoint.position_tolerance, [6.0, 4.0]);
    assert_eq!(waypoint.velocity_tolerance, [9.0, 7.0]);
    assert_eq!(waypoint.time_from_start_s, 1.0);
}

#[test]
fn selection_never_hides_a_row_of_wrong_length() {
    let refusal = |change: fn(&mut JointTrajectory)| {
        let mut trajectory = full();
        change(&mut trajectory);
        let error = trajectory.select(&[0], vec!["x".to_owned()]).expect_err("row is short");
        error.to_string()
    };
    let message = |field: &str| {
        format!("waypoint 1: {field} has 2 values, expected one for each of 3 joints")
    };
    assert_eq!(refusal(|t| t.waypoints[1].joint_velocity.truncate(2)), message("joint_velocity"));
    assert_eq!(
        refusal(|t| t.waypoints[1].joint_acceleration.truncate(2)),
        message("joint_acceleration")
    );
    assert_eq!(
        refusal(|t| t.waypoints[1].position_tolerance.truncate(2)),
        message("position_tolerance")
    );
    assert_eq!(
        refusal(|t| t.waypoints[1].velocity_tolerance.truncate(2)),
        message("velocity_tolerance")
    );
    assert_eq!(
        refusal(|t| t.joint_units.truncate(2)),
        "joint_units has 2 values, expected none or one for each of 3 joints"
    );
}

#[test]
fn selection_refuses_columns_that_do_not_exist_or_have_no_name() {
    let error = two_robots().select(&[3], vec!["x".to_owned()]).expect_err("no column 3");
    assert_eq!(error.to_string(), "column 3 does not exist, the trajectory has 3 joints");
    let error = two_robots().select(&[0], Vec::new()).expect_err("no name");
    assert_eq!(error.to_string(), "1 columns, but 0 names");
}

const TYPES: [JointType; 3] = [JointType::Revolute, JointType::Prismatic, JointType::Continuous];

#[test]
fn conversion_touches_every_row_but_no_time() {
    let own = full().to_si(&TYPES).expect("units fit");
    assert!(own.joint_units.is_empty());
    assert_eq!((own.joint_names, own.interpolation), (full().joint_names, full().interpolation));
    let (before, after) = (&full().waypoints[1], &own.waypoints[1]);
    assert_eq!(before.time_from_start_s, after.time_from_start_s);
    for (before, after) in [
        (&before.joint_position, &after.joint_position),
        (&before.joint_velocity, &after.joint_velocity),
        (&before.joint_acceleration, &after.joint_acceleration),
        (&before.position_tolerance, &after.position_tolerance),
        (&before.velocity_tolerance, &after.velocity_tolerance),
    ] {
        assert!((before[0].to_radians() - after[0]).abs() < 1e-15);
        assert_eq!(before[1..], after[1..]);
    }
}

#[test]
fn conversion_refuses_what_does_not_fit() {
    let refusal = |change: fn(&mut JointTrajectory)| {
        let mut trajectory = full();
        change(&mut trajectory);
        trajectory.to_si(&TYPES).expect_err("does not fit").to_string()
    };
    assert_eq!(
        refusal(|t| t.joint_units[1] = JointUnit::Degree),
        "joint_units has degree for left/b, which slides"
    );
    assert_eq!(
        refusal(|t| t.joint_units[2] = JointUnit::TicksLin),
        "joint_units has ticks_lin for right/a, which turns"
    );
    assert_eq!(
        refusal(|t| t.joint_units.push(JointUnit::Implicit)),
        "joint_units has 4 values, expected none or one for each of 3 joints"
    );
    assert_eq!(
        refusal(|t| t.waypoints[0].joint_position.truncate(2)),
        "waypoint 0: joint_position has 2 values, expected one for each of 3 joints"
    );
    let error = full().to_si(&TYPES[..2]).expect_err("two types");
    assert_eq!(error.to_string(), "3 joints, but types of 2");
}

#[test]
fn a_trajectory_in_other_units_is_the_same_motion() {
    let limits = limits_of(
        &[AxisLimits { lower: -1e3, upper: 1e3, velocity: 1e3, acceleration: 1e6, jerk: 1e6 }; 3],
    );
    let order = ["right/a", "left/b", "left/a"];
    let types = [TYPES[2], TYPES[1], TYPES[0]];
    let context =
        TrajectoryContext { joint_order: &order, joint_types: Some(&types), limits: &limits };
    let options = TrajectoryOptions::default();
    let compile = |trajectory: &JointTrajectory| {
        CompiledTrajectory::compile_for(trajectory, &context, &options).expect("legal")
    };
    assert_eq!(compile(&full()), compile(&full().to_si(&TYPES).expect("units fit")));
}
