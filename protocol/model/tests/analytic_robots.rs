//! Closed-form inverse kinematics of real six-axis arms, against forward kinematics.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod analytic_arms;
mod common;

use std::f64::consts::FRAC_PI_2;

use analytic_arms::{Subject, angles, distance, for_random};
use armada_model::{AnalyticArm, AnalyticError, ArmFamily, Branch, Mismatch, RobotModel};
use proptest::prelude::*;

/// Largest error of position \[m\] and orientation \[rad\] away from singularities.
const EXACT: f64 = 1e-9;

/// Robot file, base link, tip link.
const THREE_PARALLEL: [(&str, &str, &str); 4] = [
    ("ur5e/ur5e.urdf", "base", "tool0"),
    ("ur10e/ur10e.urdf", "world", "tool0"),
    ("dual_ur10e_table/dual_ur10e_table.urdf", "map", "left_tool0"),
    ("dual_ur10e_table/dual_ur10e_table.urdf", "table", "right_tool0"),
];
const SPHERICAL_WRIST: [(&str, &str, &str); 3] = [
    ("abb_irb1200/irb1200_5_90.urdf", "base_link", "tool0"),
    ("abb_irb1200/irb1200_7_70.urdf", "base_link", "tool0"),
    ("realman/rm_65.urdf", "base_link", "Link6"),
];

fn recognised(model: RobotModel, base: &str, tip: &str) -> (Subject, AnalyticArm) {
    let arm = AnalyticArm::recognise(&model, base, tip).unwrap_or_else(|error| panic!("{error}"));
    (Subject::new(model, base, tip, arm.variables()), arm)
}

fn arms(files: &[(&str, &str, &str)]) -> Vec<(Subject, AnalyticArm)> {
    let Some(folder) = common::shared("robots") else { return Vec::new() };
    let load = |&(file, base, tip): &(&str, &str, &str)| {
        recognised(common::load(&folder.join(file)), base, tip)
    };
    files.iter().map(load).collect()
}

fn own() -> (Subject, AnalyticArm) {
    recognised(common::own_robot("six_axis_arm.urdf"), "base_link", "tool0")
}

fn all() -> Vec<(Subject, AnalyticArm)> {
    let mut all = arms(&THREE_PARALLEL);
    all.extend(arms(&SPHERICAL_WRIST));
    all.push(own());
    all
}

#[test]
fn families_follow_from_the_geometry() {
    for (subject, arm) in arms(&THREE_PARALLEL).iter().chain([&own()]) {
        assert_eq!(arm.family(), ArmFamily::ThreeParallelAxes, "{}", subject.name);
    }
    for (subject, arm) in arms(&SPHERICAL_WRIST) {
        assert_eq!(arm.family(), ArmFamily::SphericalWrist, "{}", subject.name);
    }
}

#[test]
fn branches_contain_the_posture_and_each_reaches_the_pose() {
    for (subject, arm) in all() {
        for_random(1500, angles::<6>(), |q| {
            let target = subject.pose(&q);
            let branches = arm.solve_near(&target, &q);
            let near = |branch: &Branch| {
                let limit = if branch.singular.any() { 1e-4 } else { 1e-6 };
                distance(&branch.joint_position, &q) < limit
            };
            prop_assert!(branches.iter().any(near), "{}: {q:?} is lost", subject.name);
            for branch in branches.iter() {
                let error = subject.error(&branch.joint_position, &target);
                let limit = if branch.singular.any() { 1e-6 } else { EXACT };
                prop_assert!(error <= limit, "{}: {branch:?} off by {error:e}", subject.name);
            }
            Ok(())
        });
    }
}

#[test]
fn branches_differ_in_letters_and_in_joints() {
    for (subject, arm) in all() {
        for_random(500, angles::<6>(), |q| {
            let branches = arm.solve(&subject.pose(&q));
            for (index, a) in branches.iter().enumerate() {
                for b in &branches[..index] {
                    let apart = distance(&a.joint_position, &b.joint_position);
                    prop_assert!(apart > 1e-6, "{}: {apart:e}", subject.name);
                    prop_assert_ne!(a.configuration, b.configuration, "{}", &subject.name);
                }
            }
            Ok(())
        });
    }
}

#[test]
fn each_posture_of_a_pose_leads_to_the_same_postures() {
    for (subject, arm) in all() {
        for_random(100, angles::<6>(), |q| {
            let branches = arm.solve(&subject.pose(&q));
            for branch in branches.iter() {
                let again = arm.solve(&subject.pose(&branch.joint_position));
                prop_assert_eq!(again.len(), branches.len(), "{}", &subject.name);
                let same = again.iter().find(|other| other.configuration == branch.configuration);
                let same = same.map(|o| distance(&o.joint_position, &branch.joint_position));
                prop_assert!(same.is_some_and(|d| d < 1e-6), "{}: {same:?}", subject.name);
            }
            Ok(())
        });
    }
}

#[test]
fn most_poses_of_an_industrial_arm_are_reached_in_eight_postures() {
    for (subject, arm) in arms(&SPHERICAL_WRIST) {
        let count = arm.solve(&subject.pose(&[0.3, 0.5, 0.4, -0.6, 0.9, 1.2])).len();
        assert_eq!(count, 8, "{}", subject.name);
    }
}

#[test]
fn an_arm_with_a_wrist_offset_is_refused_with_joint_and_value() {
    let (Some(folder), own) = (common::shared("robots"), own().0) else { return };
    // Read as if its tip were the fifth link: five joints.
    assert_eq!(
        AnalyticArm::recognise(&own.model, "base_link", "wrist_2_link").map(drop),
        Err(AnalyticError::JointCount { expected: 6, given: 5 })
    );
    let model = common::load(&folder.join("vega/vega_1u.urdf"));
    let arm = AnalyticArm::recognise(&model, "L_arm_l1", "L_arm_l7").map(drop);
    let Err(AnalyticError::SixAxes { three_parallel, spherical_wrist }) = arm else {
        panic!("{arm:?}");
    };
    let Mismatch::AxesNotParallel { first, second, angle_rad } = *three_parallel else {
        panic!("{three_parallel}");
    };
    assert_eq!((first.as_str(), second.as_str()), ("L_arm_j3", "L_arm_j4"));
    assert!((angle_rad - FRAC_PI_2).abs() < 1e-9, "{angle_rad}");
    let Mismatch::AxesDoNotMeet { joint, offset_m, .. } = *spherical_wrist else {
        panic!("{spherical_wrist}");
    };
    // Axes 6 and 7 are 65 mm apart: the nearest point is half way.
    assert!(joint == "L_arm_j6" || joint == "L_arm_j7", "{joint}");
    assert!((offset_m - 0.0325).abs() < 1e-6, "{offset_m}");
}
