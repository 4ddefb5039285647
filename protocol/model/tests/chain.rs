//! Chains of joints: what they consist of and where their tip is.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(non_snake_case, reason = "X_RT is the pose of frame T in frame R")]

mod common;

use armada_model::{Chain, ChainError, KinematicsError, Pose, RobotModel};
use nalgebra::{Isometry3, Vector3};

const TOLERANCE: f64 = 1e-12;

/// A torso that slides, a gripper whose second finger mirrors the first, and a turning wheel.
fn gripper() -> RobotModel {
    let text = r#"<robot name="g">
        <link name="base"/><link name="torso"/><link name="palm"/><link name="left"/>
        <link name="right"/><link name="wheel"/>
        <joint name="lift" type="prismatic"><parent link="base"/><child link="torso"/>
          <axis xyz="0 0 1"/><limit lower="0" upper="0.4" velocity="0.1"/></joint>
        <joint name="roll" type="continuous"><origin xyz="0.2 0 0" rpy="0.3 0.2 0.1"/>
          <parent link="torso"/><child link="palm"/><axis xyz="1 0.2 0"/></joint>
        <joint name="left_slide" type="prismatic"><origin xyz="0 0 0.1"/>
          <parent link="palm"/><child link="left"/><axis xyz="0 1 0"/>
          <limit lower="0" upper="0.05" velocity="0.1"/></joint>
        <joint name="right_slide" type="prismatic"><origin xyz="0 0 0.1"/>
          <parent link="palm"/><child link="right"/><axis xyz="0 1 0"/>
          <limit lower="-0.1" upper="0" velocity="0.1"/>
          <mimic joint="left_slide" multiplier="-2" offset="-0.01"/></joint>
        <joint name="spin" type="revolute"><parent link="right"/><child link="wheel"/>
          <axis xyz="1 0 0"/><limit lower="-9" upper="9" velocity="1"/>
          <mimic joint="roll" multiplier="0.5"/></joint></robot>"#;
    RobotModel::from_urdf(text, "g.urdf").unwrap_or_else(|error| panic!("{error}"))
}

fn names(chain: &Chain) -> Vec<&str> {
    chain.variables().iter().map(|variable| variable.name.as_str()).collect()
}

fn pose_between(model: &RobotModel, positions: &[f64], base: &str, tip: &str) -> Isometry3<f64> {
    let of = |name: &str| {
        let link = model.link_index(name).expect("the link exists");
        model.link_pose(positions, link).expect("positions fit")
    };
    of(base).inverse() * of(tip)
}

#[test]
fn variables_are_those_that_move_the_tip_from_base_to_tip() {
    let model = gripper();
    let chain = |base, tip| Chain::new(&model, base, tip).expect("a chain");
    assert_eq!(names(&chain("base", "right")), ["lift", "roll", "left_slide"]);
    assert_eq!(names(&chain("torso", "left")), ["roll", "left_slide"]);
    // Joints outside the chain that one inside follows.
    assert_eq!(names(&chain("palm", "wheel")), ["left_slide", "roll"]);
    // Up and down again.
    assert_eq!(names(&chain("left", "wheel")), ["left_slide", "roll"]);
}

#[test]
fn a_joint_is_periodic_if_a_whole_turn_changes_nothing() {
    let model = gripper();
    let periodic = |tip| {
        let chain = Chain::from_root(&model, tip).expect("a chain");
        chain.variables().iter().map(|variable| variable.periodic).collect::<Vec<_>>()
    };
    assert_eq!(periodic("left"), [false, true, false]);
    // The wheel turns half as far.
    assert_eq!(periodic("wheel"), [false, false, false]);
}

#[test]
fn the_tip_stands_where_the_whole_robot_has_it() {
    let model = gripper();
    for (base, tip) in [("base", "wheel"), ("left", "wheel"), ("wheel", "base"), ("palm", "left")] {
        let chain = Chain::new(&model, base, tip).expect("a chain");
        for positions in [[0.0, 0.0, 0.0], [0.3, -1.2, 0.04], [0.1, 7.5, 0.02]] {
            let own = chain.gather(&positions).expect("positions fit");
            let X_BT = chain.forward(&own).expect("positions fit");
            let expected = pose_between(&model, &positions, base, tip).to_homogeneous();
            let difference = common::difference(&X_BT, &expected);
            assert!(difference < TOLERANCE, "{base} {tip} {positions:?}: {difference:e}");
        }
    }
}

#[test]
fn hand_to_hand_leads_over_the_link_that_carries_both() {
    let Some(robots) = common::shared("robots") else { return };
    let model = common::load(&robots.join("pr2/pr2.urdf"));
    let (base, tip) = ("l_gripper_tool_frame", "r_gripper_tool_frame");
    let chain = Chain::new(&model, base, tip).expect("a chain");
    assert_eq!(chain.len(), 14, "{:?}", names(&chain));
    assert_eq!(chain.variables()[0].name, "l_wrist_roll_joint");
    let positions: Vec<f64> = (0..model.variable_count()).map(|k| 0.1 + 0.03 * k as f64).collect();
    let own = chain.gather(&positions).expect("positions fit");
    let expected = pose_between(&model, &positions, base, tip).to_homogeneous();
    let difference = common::difference(&chain.forward(&own).expect("fits"), &expected);
    assert!(difference < TOLERANCE, "{difference:e}");
}

#[test]
fn a_tool_stands_at_its_pose_in_the_tip() {
    let model = gripper();
    let X_LT = Pose::from_isometry(Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::y()));
    let chain = Chain::from_root(&model, "left").expect("a chain");
    let positions = [0.2, 0.4, 0.03];
    let X_BL = chain.forward(&positions).expect("positions fit");
    // A second tool replaces the first.
    let with_tool = chain.with_tool(&Pose::from_translation(9.0, 9.0, 9.0)).with_tool(&X_LT);
    let X_BT = with_tool.forward(&positions).expect("positions fit");
    let difference = common::difference(&X_BT, &(X_BL * X_LT.isometry()).to_homogeneous());
    assert!(difference < TOLERANCE, "{difference:e}");
    assert_eq!(*with_tool.tool(), X_LT);
}

#[test]
fn positions_go_to_and_come_from_the_whole_robot() {
    let model = gripper();
    let chain = Chain::new(&model, "palm", "wheel").expect("a chain");
    let mut positions = [1.0, 2.0, 3.0];
    assert_eq!(*chain.gather(&positions).expect("fits"), [3.0, 2.0]);
    chain.scatter(&[30.0, 20.0], &mut positions).expect("fits");
    assert_eq!(positions, [1.0, 20.0, 30.0]);
    let short = KinematicsError::PositionCount { expected: 3, given: 2 };
    assert_eq!(chain.gather(&[0.0; 2]), Err(short));
    assert_eq!(chain.scatter(&[0.0; 2], &mut [0.0; 2]), Err(short));
    let count = KinematicsError::PositionCount { expected: 2, given: 3 };
    assert_eq!(chain.scatter(&[0.0; 3], &mut positions), Err(count));
    assert_eq!(positions, [1.0, 20.0, 30.0], "a refusal changes nothing");
}

#[test]
fn links_that_make_no_chain_are_refused() {
    let model = gripper();
    let unknown = ChainError::UnknownLink { link: "thumb".to_owned() };
    assert_eq!(Chain::new(&model, "base", "thumb").expect_err("no such link"), unknown);
    let rigid = ChainError::Rigid { base: "palm".to_owned(), tip: "palm".to_owned() };
    assert_eq!(Chain::new(&model, "palm", "palm").expect_err("nothing moves"), rigid);
    let mut text = "<robot name=\"long\"><link name=\"l0\"/>".to_owned();
    for index in 0..17 {
        let next = index + 1;
        text += &format!(
            "<link name=\"l{next}\"/><joint name=\"j{index}\" type=\"continuous\">
             <parent link=\"l{index}\"/><child link=\"l{next}\"/></joint>"
        );
    }
    let model = RobotModel::from_urdf(&(text + "</robot>"), "long.urdf").expect("a robot");
    let error = Chain::new(&model, "l0", "l17").expect_err("too many");
    assert_eq!(error.to_string(), "more than 16 driven joints move \"l17\" relative to \"l0\"");
    assert_eq!(Chain::new(&model, "l0", "l16").expect("just fits").len(), 16);
}

#[test]
fn positions_no_joint_has_are_refused() {
    let model = gripper();
    let chain = Chain::from_root(&model, "wheel").expect("a chain");
    let count = KinematicsError::PositionCount { expected: 3, given: 1 };
    assert_eq!(chain.forward(&[0.0]), Err(count));
    assert_eq!(chain.forward_and_jacobian(&[0.0]).expect_err("too short"), count);
    let infinite = KinematicsError::NotFinite { joint: 1, value: f64::INFINITY };
    assert_eq!(chain.forward(&[0.0, f64::INFINITY, 0.0]), Err(infinite));
    // The mimic joint alone overflows.
    let overflow = KinematicsError::NotFinite { joint: 3, value: f64::NEG_INFINITY };
    assert_eq!(chain.forward_and_jacobian(&[0.0, 0.0, 1e308]).expect_err("overflow"), overflow);
}
