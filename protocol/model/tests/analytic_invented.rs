//! Closed-form inverse kinematics of invented arms, described in any way.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod analytic_arms;

use analytic_arms::{Axes, Convention, Subject, angles, distance, for_random, vector};
use armada_model::{AnalyticArm, AnalyticError, ArmFamily, Branch, Mismatch, RobotModel};
use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;

fn recognised(model: RobotModel) -> Result<(Subject, AnalyticArm), AnalyticError> {
    let arm = AnalyticArm::recognise(&model, "base", "tool")?;
    Ok((Subject::new(model, "base", "tool", arm.variables()), arm))
}

fn ortho_parallel() -> impl Strategy<Value = Axes> {
    let lengths = (-0.3..0.3, -0.2..0.2, -0.2..0.2, 0.1..0.5, 0.2..0.8, 0.2..0.8, 0.0..0.2);
    lengths
        .prop_map(|(a1, a2, b, c1, c2, c3, c4)| Axes::ortho_parallel([a1, a2, b, c1, c2, c3, c4]))
}

fn three_parallel() -> impl Strategy<Value = Axes> {
    let lengths = (0.0..0.3, 0.2..0.8, 0.2..0.8, -0.2..0.2, -0.2..0.2, -0.2..0.2);
    lengths.prop_map(|(d1, a2, a3, d4, d5, d6)| Axes::three_parallel([d1, a2, a3, d4, d5, d6]))
}

/// Each branch reaches the pose, and one is the posture that the pose comes from.
fn check(axes: &Axes, convention: &Convention, q: &[f64; 6]) -> Result<ArmFamily, TestCaseError> {
    let (subject, arm) = recognised(axes.model(convention))
        .map_err(|error| TestCaseError::fail(error.to_string()))?;
    let target = subject.pose(q);
    let branches = arm.solve_near(&target, q);
    let near = |branch: &Branch| {
        let limit = if branch.singular.any() { 1e-4 } else { 1e-6 };
        distance(&branch.joint_position, q) < limit
    };
    prop_assert!(branches.iter().any(near), "lost among {branches:?}");
    for branch in branches.iter() {
        let error = subject.error(&branch.joint_position, &target);
        let limit = if branch.singular.any() { 1e-6 } else { 1e-9 };
        prop_assert!(error <= limit, "{branch:?} off by {error:e}");
    }
    Ok(arm.family())
}

#[test]
fn arms_with_spherical_wrist_are_solved_however_described() {
    for_random(300, (ortho_parallel(), Convention::any(), angles()), |(axes, convention, q)| {
        prop_assert_eq!(check(&axes, &convention, &q)?, ArmFamily::SphericalWrist);
        Ok(())
    });
}

#[test]
fn arms_with_three_parallel_axes_are_solved_however_described() {
    for_random(300, (three_parallel(), Convention::any(), angles()), |(axes, convention, q)| {
        prop_assert_eq!(check(&axes, &convention, &q)?, ArmFamily::ThreeParallelAxes);
        Ok(())
    });
}

#[test]
fn wrist_axes_need_not_be_at_right_angles() {
    let tilt = prop::array::uniform2(-0.8..0.8_f64);
    for_random(300, (ortho_parallel(), tilt, angles()), |(mut axes, tilt, q)| {
        axes.lines[4].0 = Rotation3::from_axis_angle(&Vector3::x_axis(), tilt[0]) * axes.lines[4].0;
        axes.lines[5].0 = Rotation3::from_axis_angle(&Vector3::x_axis(), tilt[1]) * axes.lines[5].0;
        let (middle, last) = (axes.lines[4].0, axes.lines[5].0);
        prop_assume!(middle.cross(&last).norm() > 0.1);
        prop_assert_eq!(check(&axes, &Convention::plain(), &q)?, ArmFamily::SphericalWrist);
        Ok(())
    });
}

/// Away from what is singular: bent elbow, turned wrist, wrist well off axis 1.
fn regular() -> impl Strategy<Value = [f64; 6]> {
    let ranges = (-3.0..3.0, 0.3..0.8, 0.4..1.2, -3.0..3.0, 0.4..2.7, -3.0..3.0);
    ranges.prop_map(|(q1, q2, q3, q4, q5, q6)| [q1, q2, q3, q4, q5, q6])
}

#[test]
fn calibrated_arms_are_solved_exactly() {
    // Each axis off by about a milliradian and half a millimetre, as calibration finds.
    let errors = prop::array::uniform6((vector(5e-4), vector(3e-4)));
    let spherical = Axes::ortho_parallel([0.1, 0.05, 0.0, 0.4, 0.45, 0.4, 0.1]);
    let parallel = Axes::three_parallel([0.18, 0.6, 0.57, 0.17, 0.12, 0.11]);
    for_random(300, (errors, regular()), |(errors, q)| {
        for ideal in [&spherical, &parallel] {
            let mut axes = ideal.clone();
            for ((direction, point), (turn, shift)) in axes.lines.iter_mut().zip(&errors) {
                *direction = Rotation3::new(*turn) * *direction;
                *point += shift;
            }
            check(&axes, &Convention::plain(), &q)?;
        }
        Ok(())
    });
}

fn refusal(axes: &Axes) -> (Mismatch, Mismatch) {
    match recognised(axes.model(&Convention::plain())).map(drop) {
        Err(AnalyticError::SixAxes { three_parallel, spherical_wrist }) => {
            (*three_parallel, *spherical_wrist)
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_axis_off_parallel_is_named_with_its_angle() {
    let mut axes = Axes::ortho_parallel([0.1, 0.05, 0.0, 0.4, 0.45, 0.4, 0.1]);
    axes.lines[2].0 = Rotation3::new(Vector3::x() * 0.02) * axes.lines[2].0;
    for mismatch in [refusal(&axes).0, refusal(&axes).1] {
        let Mismatch::AxesNotParallel { first, second, angle_rad } = mismatch else {
            panic!("{mismatch}");
        };
        assert_eq!((first.as_str(), second.as_str()), ("joint2", "joint3"));
        assert!((angle_rad - 0.02).abs() < 1e-12, "{angle_rad}");
    }
}

#[test]
fn a_wrist_that_is_not_spherical_is_named_with_its_offset() {
    let mut axes = Axes::ortho_parallel([0.1, 0.05, 0.0, 0.4, 0.45, 0.4, 0.1]);
    axes.lines[4].1 += Vector3::x() * 0.03;
    let Mismatch::AxesDoNotMeet { first, last, joint, offset_m } = refusal(&axes).1 else {
        panic!("{}", refusal(&axes).1);
    };
    assert_eq!((first.as_str(), last.as_str(), joint.as_str()), ("joint4", "joint6", "joint5"));
    // Two of the lines are one, so the point nearest to all is a third of the way from them.
    assert!((offset_m - 0.02).abs() < 1e-12, "{offset_m}");
}

#[test]
fn parallel_neighbours_and_short_links_are_named() {
    let mut axes = Axes::ortho_parallel([0.1, 0.05, 0.0, 0.4, 0.45, 0.4, 0.1]);
    axes.lines[4].0 = axes.lines[3].0;
    assert!(matches!(
        refusal(&axes).1,
        Mismatch::AxesParallel { first, second, .. } if first == "joint4" && second == "joint5"
    ));
    let axes = Axes::ortho_parallel([0.1, 0.05, 0.0, 0.4, 0.001, 0.4, 0.1]);
    assert!(matches!(
        refusal(&axes).1,
        Mismatch::TooShort { first, second, length_m }
            if first == "joint2" && second == "joint3" && (length_m - 0.001).abs() < 1e-12
    ));
    let mut axes = Axes::ortho_parallel([0.1, 0.05, 0.0, 0.4, 0.45, 0.4, 0.1]);
    axes.lines[0].0 = axes.lines[1].0;
    assert!(matches!(
        refusal(&axes).1,
        Mismatch::AxesParallel { first, second, .. } if first == "joint1" && second == "joint2"
    ));
}

#[test]
fn links_that_form_no_chain_of_six_turning_joints_are_refused() {
    let model =
        Axes::ortho_parallel([0.1, 0.05, 0.0, 0.4, 0.45, 0.4, 0.1]).model(&Convention::plain());
    let refusal = |base: &str, tip: &str| AnalyticArm::recognise(&model, base, tip).map(drop);
    assert_eq!(
        refusal("base", "hand"),
        Err(AnalyticError::UnknownLink { link: "hand".to_owned() })
    );
    assert_eq!(
        refusal("link6", "base"),
        Err(AnalyticError::NotAChain { base: "link6".to_owned(), tip: "base".to_owned() })
    );
    assert_eq!(refusal("link1", "tool"), Err(AnalyticError::JointCount { expected: 6, given: 5 }));
}

#[test]
fn joints_that_slide_or_mimic_are_refused_by_name() {
    let joint = |name: &str, kind: &str, parent: &str, more: &str| {
        format!(
            "<link name=\"{name}_link\"/><joint name=\"{name}\" type=\"{kind}\">\
             <parent link=\"{parent}\"/><child link=\"{name}_link\"/><axis xyz=\"0 0 1\"/>\
             <limit lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"1\"/>{more}</joint>"
        )
    };
    let text = format!(
        "<robot name=\"r\"><link name=\"base\"/>{}{}{}</robot>",
        joint("turn", "revolute", "base", ""),
        joint("slide", "prismatic", "turn_link", ""),
        joint("follow", "revolute", "turn_link", "<mimic joint=\"turn\"/>"),
    );
    let model = RobotModel::from_urdf(&text, "r").unwrap_or_else(|error| panic!("{error}"));
    let refusal = |tip: &str| AnalyticArm::recognise(&model, "base", tip).map(drop);
    let joint = |name: &str| name.to_owned();
    assert_eq!(refusal("slide_link"), Err(AnalyticError::JointSlides { joint: joint("slide") }));
    assert_eq!(refusal("follow_link"), Err(AnalyticError::JointMimics { joint: joint("follow") }));
}
