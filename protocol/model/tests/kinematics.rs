//! Forward kinematics against closed forms.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

mod common;

use armada_model::{KinematicsError, RobotModel};
use nalgebra::{Isometry3, Vector3};

const TOLERANCE: f64 = 1e-14;

fn load(text: &str) -> RobotModel {
    RobotModel::from_urdf(text, "robot.urdf").unwrap_or_else(|error| panic!("{error}"))
}

/// Two links of 0.4 m and 0.3 m in the x-y plane.
fn planar_arm() -> RobotModel {
    load(
        r#"<robot name="planar"><link name="base"/><link name="one"/><link name="two"/><link name="tip"/>
        <joint name="q1" type="continuous">
          <parent link="base"/><child link="one"/><axis xyz="0 0 1"/></joint>
        <joint name="q2" type="revolute"><origin xyz="0.4 0 0"/>
          <parent link="one"/><child link="two"/><axis xyz="0 0 2"/>
          <limit lower="-3" upper="3" velocity="1"/></joint>
        <joint name="end" type="fixed"><origin xyz="0.3 0 0"/>
          <parent link="two"/><child link="tip"/></joint></robot>"#,
    )
}

/// A gripper: finger `right` mirrors `left` with an offset, both slide along y.
fn gripper() -> RobotModel {
    load(
        r#"<robot name="gripper"><link name="palm"/><link name="left"/><link name="right"/>
        <joint name="left_slide" type="prismatic"><origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/>
          <parent link="palm"/><child link="left"/>
          <limit lower="0" upper="0.05" velocity="0.1"/></joint>
        <joint name="right_slide" type="prismatic"><origin xyz="0 0 0.1"/>
          <parent link="palm"/><child link="right"/><axis xyz="0 1 0"/>
          <limit lower="-0.05" upper="0" velocity="0.1"/>
          <mimic joint="left_slide" multiplier="-2" offset="-0.01"/></joint></robot>"#,
    )
}

#[test]
fn a_planar_arm_reaches_where_trigonometry_says() {
    let model = planar_arm();
    let tip = model.link_index("tip").expect("there is a tip");
    for step in 0_i32..50 {
        let (q1, q2) = (0.7 * f64::from(step) - 11.0, 2.9 - 0.11 * f64::from(step));
        let pose = common::link_poses(&model, &[q1, q2])[tip];
        let expected = Vector3::new(
            0.4 * q1.cos() + 0.3 * (q1 + q2).cos(),
            0.4 * q1.sin() + 0.3 * (q1 + q2).sin(),
            0.0,
        );
        let turn = Isometry3::rotation(Vector3::z() * (q1 + q2));
        assert!((pose.translation.vector - expected).amax() < TOLERANCE, "q = {q1}, {q2}");
        let rotation = pose.rotation.to_rotation_matrix();
        let expected = turn.rotation.to_rotation_matrix();
        assert!((rotation.matrix() - expected.matrix()).amax() < TOLERANCE, "q = {q1}, {q2}");
    }
}

#[test]
fn a_prismatic_joint_slides_along_its_axis_in_its_own_frame() {
    let poses = common::link_poses(&gripper(), &[0.03]);
    // The joint frame is turned by a right angle about z, so its x axis is y of the palm.
    let expected = Vector3::new(0.0, 0.03, 0.1);
    assert!((poses[1].translation.vector - expected).amax() < TOLERANCE, "{}", poses[1]);
}

#[test]
fn a_mimic_joint_follows_with_factor_and_offset() {
    let model = gripper();
    assert_eq!(model.variable_count(), 1);
    let poses = common::link_poses(&model, &[0.03]);
    let expected = Vector3::new(0.0, -2.0 * 0.03 - 0.01, 0.1);
    assert!((poses[2].translation.vector - expected).amax() < TOLERANCE, "{}", poses[2]);
}

#[test]
fn an_oblique_axis_turns_by_the_right_hand_rule() {
    let model = load(
        r#"<robot name="o"><link name="a"/><link name="b"/>
        <joint name="j" type="continuous"><origin xyz="1 0 0"/>
          <parent link="a"/><child link="b"/><axis xyz="1 1 1"/></joint></robot>"#,
    );
    // A third of a turn about the diagonal takes x to y, y to z, z to x.
    let third = std::f64::consts::TAU / 3.0;
    let pose = common::link_poses(&model, &[third])[1];
    let turned = pose.rotation * Vector3::x();
    assert!((turned - Vector3::y()).amax() < TOLERANCE, "{turned}");
    assert_eq!(pose.translation.vector, Vector3::x());
}

#[test]
fn the_root_stands_in_itself() {
    let model = planar_arm();
    assert_eq!(common::link_poses(&model, &[0.3, 0.2])[0], Isometry3::identity());
    assert_eq!(model.link_pose(&[0.3, 0.2], 0), Ok(Isometry3::identity()));
}

#[test]
fn vectors_of_wrong_length_are_refused_with_both_lengths() {
    let model = planar_arm();
    let mut poses = [Isometry3::identity(); 4];
    let count = KinematicsError::PositionCount { expected: 2, given: 3 };
    assert_eq!(model.link_poses(&[0.0; 3], &mut poses), Err(count));
    assert_eq!(model.link_pose(&[0.0; 3], 1), Err(count));
    let count = KinematicsError::PoseCount { expected: 4, given: 3 };
    assert_eq!(model.link_poses(&[0.0; 2], &mut poses[..3]), Err(count));
    let unknown = KinematicsError::UnknownLink { link: 4, links: 4 };
    assert_eq!(model.link_pose(&[0.0; 2], 4), Err(unknown));
}

#[test]
fn positions_that_are_not_finite_are_refused_with_their_joint() {
    let model = planar_arm();
    let mut poses = [Isometry3::identity(); 4];
    let infinite = KinematicsError::NotFinite { joint: 1, value: f64::INFINITY };
    assert_eq!(model.link_poses(&[0.0, f64::INFINITY], &mut poses), Err(infinite));
    assert_eq!(model.link_pose(&[0.0, f64::INFINITY], 3), Err(infinite));
    let error = model.link_poses(&[f64::NAN, 0.0], &mut poses).expect_err("not a number");
    assert_eq!(error.to_string(), "joint 0 has position NaN, which is not finite");
}

#[test]
fn a_mimic_joint_beyond_all_numbers_is_refused() {
    let mut poses = [Isometry3::identity(); 3];
    let overflow = KinematicsError::NotFinite { joint: 1, value: f64::NEG_INFINITY };
    assert_eq!(gripper().link_poses(&[1e308], &mut poses), Err(overflow));
}
