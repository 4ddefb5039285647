//! Inverse kinematics: each cause of a failure, on a case that has that cause.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(non_snake_case, reason = "X_BT is the pose of frame T in frame B")]

mod common;
mod counting_allocator;
mod inverse_common;

use armada_model::{
    Chain, InverseCause, InverseKinematics, InverseOptions, InverseTarget, KinematicsError,
    LimitSide, RobotModel,
};
use counting_allocator::allocations_of;
use inverse_common::{off, own, solver};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Links of 0.4 m and 0.3 m in the x-y plane; the elbow bends from 0.2 to 1 rad.
fn planar() -> Chain {
    let text = r#"<robot name="planar"><link name="base"/><link name="one"/><link name="two"/>
        <link name="tip"/>
        <joint name="shoulder" type="continuous"><parent link="base"/><child link="one"/>
          <axis xyz="0 0 1"/></joint>
        <joint name="elbow" type="revolute"><origin xyz="0.4 0 0"/><parent link="one"/>
          <child link="two"/><axis xyz="0 0 1"/><limit lower="0.2" upper="1" velocity="1"/></joint>
        <joint name="end" type="fixed"><origin xyz="0.3 0 0"/>
          <parent link="two"/><child link="tip"/></joint></robot>"#;
    let model = RobotModel::from_urdf(text, "planar.urdf").expect("a robot");
    Chain::from_root(&model, "tip").expect("a chain")
}

/// Distance from the shoulder to the tip with the elbow bent.
fn distance(bend: f64) -> f64 {
    (0.16 + 0.09 + 2.0 * 0.4 * 0.3 * f64::cos(bend)).sqrt()
}

fn at(x: f64, y: f64) -> InverseTarget {
    InverseTarget::Position(Vector3::new(x, y, 0.0))
}

#[test]
fn a_target_beyond_the_stretched_arm_is_out_of_reach_by_the_distance() {
    let chain = planar();
    let solver = solver(&chain);
    for failure in
        [solver.solve(&[0.3, 0.5], &at(0.0, 0.95)), solver.solve_warm(&[0.3, 0.5], &at(0.0, 0.95))]
    {
        let failure = failure.expect_err("too far");
        let InverseCause::OutOfReach { excess } = failure.cause else { panic!("{failure}") };
        assert!((excess - 0.25).abs() < 1e-12, "{excess}");
        // The best posture points at it.
        assert!((failure.residual.position - (0.95 - distance(0.2))).abs() < 1e-3, "{failure}");
        assert_eq!(off(&chain, &failure.positions, &at(0.0, 0.95)), failure.residual);
    }
}

#[test]
fn the_orientation_asked_for_counts_for_reach() {
    // The tool points back at the base: only the first link's length is left.
    let chain = planar();
    let back = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let target =
        InverseTarget::Pose(Isometry3::from_parts(Vector3::new(0.5, 0.0, 0.0).into(), back));
    let failure = solver(&chain).solve(&[0.0, 0.5], &target).expect_err("too far");
    let InverseCause::OutOfReach { excess } = failure.cause else { panic!("{failure}") };
    assert!((excess - 0.4).abs() < 1e-12, "{excess}");
}

#[test]
fn a_joint_that_would_pass_its_limit_is_named_with_side_value_and_limit() {
    let chain = planar();
    let solver = solver(&chain);
    for (bend, side, limit) in [(1.5, LimitSide::Upper, 1.0), (0.1, LimitSide::Lower, 0.2)] {
        let target = at(distance(bend), 0.0);
        for answer in [solver.solve(&[0.0, 0.5], &target), solver.solve_warm(&[0.0, 0.5], &target)]
        {
            let failure = answer.expect_err("beyond the limit");
            let InverseCause::JointLimit { joint, side: found, value, limit: at } = failure.cause
            else {
                panic!("{failure}")
            };
            assert_eq!((joint, found, at), (1, side, limit));
            assert!((value - bend).abs() < 1e-3, "{value}");
            assert!((failure.positions[1] - limit).abs() < 1e-12, "best is at the limit");
        }
    }
}

#[test]
fn a_margin_counts_as_the_limit() {
    let options = InverseOptions { limit_margin: 0.1, ..inverse_common::options() };
    let solver = InverseKinematics::new(&planar(), options);
    let failure = solver.solve(&[0.0, 0.5], &at(distance(0.95), 0.0)).expect_err("in the margin");
    let InverseCause::JointLimit { limit, value, .. } = failure.cause else { panic!("{failure}") };
    assert!((limit - 0.9).abs() < 1e-12 && (value - 0.95).abs() < 1e-3, "{failure}");
}

#[test]
fn limits_of_a_real_arm_are_named() {
    // The margin leaves the elbow 0.94 rad to each side, and the other joints more than a turn.
    let chain = own("six_axis_arm.urdf");
    let margin = 2.2;
    let options = InverseOptions { limit_margin: margin, ..inverse_common::options() };
    let limited = InverseKinematics::new(&chain, options);
    let bent = [0.4, -1.2, 1.8, -0.7, 1.1, 0.2];
    let target = InverseTarget::Pose(chain.forward(&bent).expect("fits"));
    let seed = [0.2, -1.0, 0.7, -0.5, 1.0, 0.0];
    solver(&chain).solve(&seed, &target).expect("reachable with the elbow bent");
    let failure = limited.solve(&seed, &target).expect_err("beyond the margin");
    let InverseCause::JointLimit { joint, value, limit, .. } = failure.cause else {
        panic!("{failure}")
    };
    assert_eq!(joint, 2, "{failure}");
    assert!((limit.abs() - (std::f64::consts::PI - margin)).abs() < 1e-9, "{failure}");
    assert!(value.abs() > limit.abs() && value * limit > 0.0, "{failure}");
}

#[test]
fn a_stretched_arm_is_singular_in_the_direction_it_stretches_to() {
    // Further out than the arm goes, but not as far as its links are long together: the first link
    // stands aside of the others.
    let chain = own("six_axis_arm.urdf");
    let stretched = [0.3, -1.2, 0.0, -0.7, 1.1, 0.2];
    let (X_BT, jacobian) = chain.forward_and_jacobian(&stretched).expect("fits");
    let lost = jacobian.weakest_direction(1.0).linear.normalize();
    let outward = lost * X_BT.translation.vector.dot(&lost).signum();
    let mut far = X_BT;
    far.translation.vector += outward * 0.02;
    let solver = solver(&chain);
    let target = InverseTarget::Pose(far);
    let failure = solver.solve_warm(&stretched, &target).expect_err("too far");
    let InverseCause::Singular { smallest, direction } = failure.cause else { panic!("{failure}") };
    assert!(smallest < 1e-2, "{smallest}");
    let along = direction.linear.normalize().dot(&outward).abs();
    assert!(along > 0.9, "{direction:?} is not {outward}");
    assert!(failure.residual.position <= 0.0201, "{failure}");
    // Nor does any other posture reach it.
    solver.solve(&stretched, &target).expect_err("too far");
}

#[test]
fn too_few_iterations_are_told_as_such() {
    let chain = own("six_axis_arm.urdf");
    let options = InverseOptions { warm_iterations: 1, ..inverse_common::options() };
    let solver = InverseKinematics::new(&chain, options);
    let X_BT = chain.forward(&[0.4, -1.2, 1.3, -0.7, 1.1, 0.2]).expect("fits");
    let far = [0.8, -1.0, 0.9, -0.4, 1.5, 0.6];
    let failure = solver.solve_warm(&far, &InverseTarget::Pose(X_BT)).expect_err("one is too few");
    assert_eq!(failure.cause, InverseCause::Iterations { iterations: 1 }, "{failure}");
    assert_eq!((failure.iterations, failure.starts), (1, 1));
}

#[test]
fn seeds_and_targets_that_are_no_numbers_are_refused() {
    let solver = solver(&planar());
    let cause = |seed: &[f64], target: &InverseTarget| {
        let failure = solver.solve(seed, target).expect_err("refused");
        assert_eq!(solver.solve_warm(seed, target).expect_err("refused").cause, failure.cause);
        assert!(failure.positions.is_empty());
        failure.cause
    };
    let count = KinematicsError::PositionCount { expected: 2, given: 3 };
    assert_eq!(cause(&[0.0; 3], &at(0.5, 0.0)), InverseCause::Seed(count));
    let infinite = KinematicsError::NotFinite { joint: 1, value: f64::INFINITY };
    assert_eq!(cause(&[0.0, f64::INFINITY], &at(0.5, 0.0)), InverseCause::Seed(infinite));
    assert_eq!(cause(&[0.0; 2], &at(f64::NAN, 0.0)), InverseCause::Target);
}

#[test]
fn neither_solutions_nor_failures_allocate() {
    let chain = own("seven_axis_arm.urdf");
    let solver = solver(&chain);
    let seed = [0.1, -0.5, 0.2, -2.0, 0.1, 1.6, 0.5];
    let near = InverseTarget::Pose(chain.forward(&[0.15; 7].map(|q| q - 0.2)).expect("fits"));
    let far = InverseTarget::Position(Vector3::new(3.0, 0.0, 0.0));
    let allocations = allocations_of(|| {
        for target in [&near, &far] {
            let answers = (solver.solve(&seed, target), solver.solve_warm(&seed, target));
            std::hint::black_box(answers).0.ok();
        }
    });
    assert_eq!(allocations, 0);
}
