//! Closed-form inverse kinematics of seven-axis arms with spherical shoulder and wrist.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod analytic_arms;
mod common;
mod counting_allocator;

use std::f64::consts::FRAC_PI_2;

use analytic_arms::{Axes, Convention, Subject, angles, distance, for_random};
use armada_model::{
    AnalyticError, Branch, BranchError, JointVector, Mismatch, RobotModel, Selection, SevenAxisArm,
};
use counting_allocator::allocations_of;
use nalgebra::Vector3;
use proptest::prelude::*;

const NEAREST: Selection = Selection::Nearest { weights: JointVector::EMPTY };

fn recognised(model: RobotModel, base: &str, tip: &str) -> (Subject, SevenAxisArm) {
    let arm = SevenAxisArm::recognise(&model, base, tip).unwrap_or_else(|error| panic!("{error}"));
    (Subject::new(model, base, tip, arm.variables()), arm)
}

fn invented() -> (Subject, SevenAxisArm) {
    let axes = Axes::seven([0.36, 0.42, 0.4, 0.1, 0.0]);
    recognised(axes.model(&Convention::plain()), "base", "tool")
}

fn real() -> Vec<(Subject, SevenAxisArm)> {
    let Some(folder) = common::shared("robots") else { return Vec::new() };
    [
        ("iiwa14/iiwa14.urdf", "base", "iiwa_link_ee"),
        ("iiwa14/dual_iiwa14.urdf", "base", "right_iiwa_link_7"),
        ("realman/rm_75.urdf", "base_link", "Link7"),
    ]
    .map(|(file, base, tip)| recognised(common::load(&folder.join(file)), base, tip))
    .into()
}

/// Each branch reaches the pose, and at the posture's own arm angle one is that posture.
fn check(subject: &Subject, arm: &SevenAxisArm, q: &[f64; 7]) -> Result<usize, TestCaseError> {
    let target = subject.pose(q);
    let angle = arm.arm_angle(q).ok_or_else(|| TestCaseError::reject("wrist in the shoulder"))?;
    let branches = arm.solve_near(&target, angle, q);
    // A rounded arm keeps the arm angle to some 1e-5 only, and worse near a singularity.
    let regular = [q[1], q[3], q[5]].map(|angle| angle.sin().abs()).iter().product::<f64>();
    let near = |branch: &Branch| distance(&branch.joint_position, q) * regular < 1e-4;
    prop_assert!(branches.iter().any(near), "{}: {q:?} lost in {branches:?}", subject.name);
    for branch in branches.iter() {
        let error = subject.error(&branch.joint_position, &target);
        let limit = if branch.singular.any() { 1e-6 } else { 1e-9 };
        prop_assert!(error <= limit, "{}: {branch:?} off by {error:e}", subject.name);
        // By how far the elbow is off, as a part of its distance when it is at a right angle.
        let bend = branch.joint_position[3].sin().abs();
        let off = arm.arm_angle(&branch.joint_position).map(|found| distance(&[found], &[angle]));
        let is_near = off.is_some_and(|off| off * bend < 1e-4);
        prop_assert!(is_near, "{}: arm angle off by {off:?} in {branch:?}", subject.name);
    }
    Ok(branches.len())
}

#[test]
fn real_arms_are_solved_at_the_arm_angle_of_the_posture() {
    for (subject, arm) in real() {
        for_random(500, angles::<7>(), |q| check(&subject, &arm, &q).map(drop));
    }
}

#[test]
fn a_posture_away_from_singularities_is_one_of_eight() {
    for (subject, arm) in real().into_iter().chain([invented()]) {
        let q = [0.3, 0.7, -0.5, 1.1, 0.4, -0.8, 0.2];
        assert_eq!(check(&subject, &arm, &q).unwrap_or_else(|error| panic!("{error}")), 8);
        let branches = arm.solve(&subject.pose(&q), arm.arm_angle(&q).expect("an angle"));
        for (index, a) in branches.iter().enumerate() {
            for b in &branches[..index] {
                assert_ne!(a.configuration, b.configuration);
                assert!(distance(&a.joint_position, &b.joint_position) > 1e-3);
            }
        }
    }
}

#[test]
fn arms_are_solved_however_described() {
    let lengths = (0.1..0.5, 0.2..0.6, 0.2..0.6, 0.0..0.2, -0.1..0.1);
    for_random(200, (lengths, Convention::any(), angles()), |(lengths, convention, q)| {
        let axes = Axes::seven([lengths.0, lengths.1, lengths.2, lengths.3, lengths.4]);
        let (subject, arm) = recognised(axes.model(&convention), "base", "tool");
        check(&subject, &arm, &q).map(drop)
    });
}

#[test]
fn the_elbow_goes_round_while_the_tip_stays() {
    let (subject, arm) = invented();
    let q = [0.3, 0.7, -0.5, 1.1, 0.4, -0.8, 0.2];
    let target = subject.pose(&q);
    for step in -6..=6 {
        let angle = f64::from(step) * 0.5;
        let branches = arm.solve(&target, angle);
        assert_eq!(branches.len(), 8);
        for branch in branches.iter() {
            let found = arm.arm_angle(&branch.joint_position).expect("an angle");
            assert!(distance(&[found], &[angle]) < 1e-9, "{found} for {angle}");
            assert!(subject.error(&branch.joint_position, &target) < 1e-9);
        }
    }
}

#[test]
fn at_arm_angle_zero_the_elbow_is_above_the_line_to_the_wrist() {
    let (subject, arm) = invented();
    let target = subject.pose(&[0.3, 0.7, -0.5, 1.1, 0.4, -0.8, 0.2]);
    let elbow = subject.model.link_index("link4").expect("there is a link4");
    let wrist = subject.model.link_index("link6").expect("there is a link6");
    let shoulder = Vector3::new(0.0, 0.0, 0.36);
    let branches = arm.solve(&target, 0.0);
    assert_eq!(branches.len(), 8);
    for branch in branches.iter() {
        let place = |link| {
            let pose = subject.model.link_pose(&branch.joint_position, link).expect("fits");
            pose.translation.vector - shoulder
        };
        let (elbow, line) = (place(elbow), place(wrist).normalize());
        let off = elbow - line * line.dot(&elbow);
        assert!(off.z > 0.01, "{branch:?}: {off}");
        assert!(off.cross(&Vector3::z()).dot(&line).abs() < 1e-9, "not in the plane: {off}");
    }
}

#[test]
fn singular_postures_keep_the_joints_of_the_reference() {
    let (subject, arm) = invented();
    for (q, expected) in [
        ([0.3, 0.7, -0.5, 1.1, 0.4, 0.0, 0.2], (false, false, true)),
        ([0.3, 0.0, -0.5, 1.1, 0.4, -0.8, 0.2], (true, false, false)),
        ([0.3, 0.7, -0.5, 0.0, 0.4, -0.8, 0.2], (false, true, false)),
        ([0.3, 0.0, -0.5, 1.1, 0.4, 0.0, 0.2], (true, false, true)),
        ([0.0; 7], (true, true, true)),
    ] {
        let (target, angle) = (subject.pose(&q), arm.arm_angle(&q).expect("an angle"));
        let chosen = arm.select(&target, angle, &q, &NEAREST).expect("within reach");
        let singular = chosen.singular;
        assert_eq!((singular.shoulder, singular.elbow, singular.wrist), expected, "{q:?}");
        assert!(distance(&chosen.joint_position, &q) < 1e-6, "{q:?}: {chosen:?}");
        assert!(subject.error(&chosen.joint_position, &target) < 1e-7, "{chosen:?}");
    }
}

#[test]
fn arms_with_another_geometry_are_refused_with_joint_and_value() {
    let model = common::own_robot("seven_axis_arm.urdf");
    let Err(AnalyticError::SevenAxes { mismatch }) =
        SevenAxisArm::recognise(&model, "base_link", "tool0").map(drop)
    else {
        panic!("recognised");
    };
    let Mismatch::AxesDoNotMeet { first, last, offset_m, .. } = *mismatch else {
        panic!("{mismatch}");
    };
    assert_eq!((first.as_str(), last.as_str()), ("joint_5", "joint_7"));
    // Axis 7 of a Franka is 88 mm from where axes 5 and 6 meet, across both: the nearest point to
    // all three is a third of that from two of them.
    assert!((offset_m - 0.088 * 2.0 / 3.0).abs() < 1e-6, "{offset_m}");
    let model = common::own_robot("six_axis_arm.urdf");
    assert_eq!(
        SevenAxisArm::recognise(&model, "base_link", "tool0").map(drop),
        Err(AnalyticError::JointCount { expected: 7, given: 6 })
    );
}

#[test]
fn what_does_not_fit_is_refused() {
    let (subject, arm) = invented();
    let q = [0.3, FRAC_PI_2, -0.5, 0.0, 0.4, -0.8, 0.2];
    let target = subject.pose(&q);
    let select = |shift: f64, angle: f64, reference: &[f64]| {
        let target =
            nalgebra::Translation3::new(0.3_f64.cos() * shift, 0.3_f64.sin() * shift, 0.0) * target;
        arm.select(&target, angle, reference, &NEAREST).map_err(Box::new)
    };
    let Err(error) = select(0.25, 0.0, &q) else { panic!("reached") };
    assert!(
        matches!(*error, BranchError::OutOfReach { excess_m } if (excess_m - 0.25).abs() < 1e-9),
        "{error}"
    );
    let not_finite = BranchError::NotFinite { field: "arm angle" };
    assert_eq!(select(0.0, f64::NAN, &q), Err(Box::new(not_finite)));
    let length = BranchError::ReferenceLength { expected: 7, given: 6 };
    assert_eq!(select(0.0, 0.0, &q[..6]), Err(Box::new(length)));
    assert_eq!(arm.arm_angle(&q[..6]), None);
    assert_eq!(arm.arm_angle(&[f64::NAN; 7]), None);
}

#[test]
fn solving_and_selecting_allocate_nothing() {
    let (subject, arm) = invented();
    let q = [0.3, 0.7, -0.5, 1.1, 0.4, -0.8, 0.2];
    let target = subject.pose(&q);
    let mut found = 0;
    let allocations = allocations_of(|| {
        let angle = arm.arm_angle(&q).expect("an angle");
        found += arm.solve(&target, angle).len();
        found += usize::from(arm.select(&target, angle, &q, &NEAREST).is_ok());
    });
    assert_eq!((allocations, found), (0, 9));
}
