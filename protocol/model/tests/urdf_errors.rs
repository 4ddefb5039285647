//! Every way in which a robot description can be wrong, with the place and words of the answer.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

use armada_model::{QuaternionFault, RobotModel, UrdfError, UrdfProblem};

/// A correct arm of three links; joint `b` starts at line 9.
const ARM: &str = r#"<robot name="arm" version="1.0">
  <link name="base"/>
  <link name="upper"/>
  <link name="lower"/>
  <joint name="a" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" velocity="2" effort="3"/>
  </joint>
  <joint name="b" type="prismatic">
    <parent link="upper"/><child link="lower"/>
    <limit lower="0" upper="0.5" velocity="0.1"/>
  </joint>
</robot>"#;

fn refused(text: &str) -> UrdfError {
    RobotModel::from_urdf(text, "arm.urdf").expect_err("the text is wrong")
}

/// The arm with one text replaced, which must occur in it.
fn arm_with(old: &str, new: &str) -> String {
    assert!(ARM.contains(old), "{old} is not in the arm");
    ARM.replacen(old, new, 1)
}

/// The arm with `content` in its first link.
fn arm_with_link(content: &str) -> String {
    arm_with(r#"<link name="base"/>"#, &format!(r#"<link name="base">{content}</link>"#))
}

#[track_caller]
fn check(text: &str, message: &str) {
    assert_eq!(refused(text).to_string(), message);
}

#[test]
fn the_arm_itself_is_correct() {
    let model = RobotModel::from_urdf(ARM, "arm.urdf").expect("the arm loads");
    assert_eq!(model.variable_count(), 2);
}

#[test]
fn an_error_holds_place_and_values_as_data() {
    let error = refused(&arm_with(r#"lower="-1""#, r#"lower="1.2""#));
    assert_eq!(
        (error.place.file.as_ref(), error.place.line, error.place.column),
        ("arm.urdf", 7, 5)
    );
    assert_eq!(
        *error.problem,
        UrdfProblem::LimitOrder {
            subject: r#"joint "a""#.into(),
            kind: "limit",
            lower: 1.2,
            upper: 1.0
        }
    );
}

#[test]
fn text_that_is_no_robot_is_refused() {
    check("", "arm.urdf:1: not valid XML: the document does not have a root node");
    check(
        "<robot name='a'>\n<link></robot>",
        "arm.urdf:2: not valid XML: expected 'link' tag, not 'robot' at 2:7",
    );
    check("<sdf/>", "arm.urdf:1: root element is <sdf>, expected <robot>");
    check("<robot name=''/>", "arm.urdf:1: <robot> has an empty name");
    check("<robot/>", r#"arm.urdf:1: robot: <robot> has no attribute "name""#);
    check("<robot name='a'/>", "arm.urdf:1: the robot has no links");
    check(
        "<robot name='a' version='2.0'/>",
        r#"arm.urdf:1: URDF version "2.0" is not supported, expected 1.0 to 1.2"#,
    );
    check(
        "<robot name='a' xmlns:xacro='http://www.ros.org/wiki/xacro'>\n<xacro:include/></robot>",
        "arm.urdf:2: <xacro:include> is not expanded; run `xacro IN.xacro > OUT.urdf` first",
    );
}

#[test]
fn entities_cannot_be_defined() {
    let bomb = r#"<!DOCTYPE robot [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot name="&b;"/>"#;
    let problem = *refused(bomb).problem;
    assert!(matches!(problem, UrdfProblem::Xml(roxmltree::Error::DtdDetected)), "{problem}");
}

#[test]
fn a_text_above_16_mib_is_refused_unread() {
    let text = " ".repeat(16 * 1024 * 1024 + 1);
    check(&text, "arm.urdf:1: 16777217 bytes, above the limit of 16777216 bytes");
}

#[test]
fn nesting_of_any_depth_ends_in_an_answer() {
    let depth = 200_000;
    let text = format!(
        "<robot name='deep'><link name='a'/>{}{}</robot>",
        "<link>".repeat(depth),
        "</link>".repeat(depth)
    );
    check(&text, r#"arm.urdf:1: robot: <link> has no attribute "name""#);
    let foreign = text.replace("<link>", "<x>").replace("</link>", "</x>");
    RobotModel::from_urdf(&foreign, "arm.urdf").expect("foreign elements are passed over");
}

#[test]
fn an_element_with_a_million_attributes_is_refused_at_once() {
    let attributes: String = (0..1_000_000).map(|n| format!(" a{n}=''")).collect();
    check(
        &format!("<?xml version='1.0'?>\n  <robot{attributes}/>"),
        "arm.urdf:2: an element has more than 256 attributes",
    );
}

#[test]
fn more_than_a_million_nodes_are_refused() {
    let text = format!("<robot name='wide'>{}</robot>", "<x/>".repeat(1_000_001));
    let problem = *refused(&text).problem;
    assert!(matches!(problem, UrdfProblem::Xml(roxmltree::Error::NodesLimitReached)), "{problem}");
}

#[test]
fn names_must_exist_and_be_unique() {
    check(
        &arm_with(r#"<link name="upper"/>"#, "<link/>"),
        r#"arm.urdf:3: robot: <link> has no attribute "name""#,
    );
    check(
        &arm_with(r#"<link name="upper"/>"#, r#"<link name=""/>"#),
        "arm.urdf:3: <link> has an empty name",
    );
    check(
        &arm_with(r#"<link name="lower"/>"#, r#"<link name="base"/>"#),
        r#"arm.urdf:4: link "base": the name is taken since line 2"#,
    );
    check(
        &arm_with(r#"<joint name="b""#, r#"<joint name="a""#),
        r#"arm.urdf:9: joint "a": the name is taken since line 5"#,
    );
}

#[test]
fn missing_and_repeated_elements_are_named() {
    check(
        &arm_with(r#"<parent link="upper"/>"#, ""),
        r#"arm.urdf:9: joint "b": <joint> has no <parent>"#,
    );
    check(
        &arm_with(r#"<child link="lower"/>"#, "<child/>"),
        r#"arm.urdf:10: joint "b": <child> has no attribute "link""#,
    );
    check(
        &arm_with(r#"<axis xyz="0 0 1"/>"#, "<axis/>"),
        r#"arm.urdf:6: joint "a": <axis> has no attribute "xyz""#,
    );
    check(
        &arm_with(r#"<axis xyz="0 0 1"/>"#, "<origin/><origin/>"),
        r#"arm.urdf:6: joint "a": <joint> has more than one <origin>"#,
    );
    check(
        &arm_with(r#" type="revolute""#, ""),
        r#"arm.urdf:5: joint "a": <joint> has no attribute "type""#,
    );
}

#[test]
fn words_that_are_not_numbers_are_shown() {
    let axis = |value: &str| arm_with("0 0 1", value);
    for value in ["0 0", "0 0 1 1", "0 0 z", "0,0,1", "", "${axis}"] {
        check(
            &axis(value),
            &format!(
                "arm.urdf:6: joint \"a\": axis xyz \"{value}\" is not 3 numbers separated by spaces"
            ),
        );
    }
    check(
        &arm_with(r#"effort="3""#, r#"effort="3 Nm""#),
        r#"arm.urdf:7: joint "a": limit effort "3 Nm" is not a number"#,
    );
    for value in ["0 0 inf", "NaN 0 1", "0 1e999 0"] {
        check(
            &axis(value),
            &format!("arm.urdf:6: joint \"a\": axis xyz \"{value}\" is not finite"),
        );
    }
    check(
        &arm_with(
            r#"<link name="base"/>"#,
            r#"<material name="red"><color rgba="1 0 0"/></material><link name="base"/>"#,
        ),
        r#"arm.urdf:2: robot: color rgba "1 0 0" is not 4 numbers separated by spaces"#,
    );
}

#[test]
fn joint_types_are_the_ones_that_move_along_one_axis() {
    check(
        &arm_with("prismatic", "revolut"),
        "arm.urdf:9: joint \"b\": unknown type \"revolut\", expected one of \
         revolute, continuous, prismatic, fixed, floating, planar, spherical",
    );
    for joint_type in ["floating", "planar", "spherical"] {
        check(
            &arm_with("prismatic", joint_type),
            &format!(
                "arm.urdf:9: joint \"b\": type {joint_type} is not supported, \
                 expected one of revolute, continuous, prismatic, fixed"
            ),
        );
    }
}

#[test]
fn limits_must_exist_and_make_sense() {
    let limit = |value: &str| arm_with(r#"<limit lower="0" upper="0.5" velocity="0.1"/>"#, value);
    check(&limit(""), r#"arm.urdf:9: joint "b": a prismatic joint needs a <limit>"#);
    check(&limit("<limit/>"), r#"arm.urdf:11: joint "b": <limit> has no attribute "velocity""#);
    check(
        &limit(r#"<limit lower="1.2" upper="0.5" velocity="1"/>"#),
        r#"arm.urdf:11: joint "b": limit lower 1.2 is above upper 0.5"#,
    );
    check(
        &limit(r#"<limit upper="-0.5" velocity="1"/>"#),
        r#"arm.urdf:11: joint "b": limit lower 0 is above upper -0.5"#,
    );
    check(
        &limit(r#"<limit velocity="-1"/>"#),
        r#"arm.urdf:11: joint "b": limit velocity -1 is below zero"#,
    );
    check(
        &limit(r#"<limit velocity="1" effort="-2"/>"#),
        r#"arm.urdf:11: joint "b": limit effort -2 is below zero"#,
    );
    check(
        &limit(
            r#"<limit velocity="1"/>
               <safety_controller k_velocity="1" soft_lower_limit="2" soft_upper_limit="1"/>"#,
        ),
        r#"arm.urdf:12: joint "b": soft limit lower 2 is above upper 1"#,
    );
    check(
        &limit(r#"<limit velocity="1"/><safety_controller/>"#),
        r#"arm.urdf:11: joint "b": <safety_controller> has no attribute "k_velocity""#,
    );
}

#[test]
fn an_axis_needs_a_direction() {
    check(&arm_with("0 0 1", "0 0 0"), r#"arm.urdf:6: joint "a": axis xyz has zero length"#);
    check(&arm_with("0 0 1", "0 1e-12 0"), r#"arm.urdf:6: joint "a": axis xyz has zero length"#);
}

#[test]
fn quaternions_must_be_orientations() {
    let origin = |version: &str, attributes: &str| {
        arm_with(r#"<axis xyz="0 0 1"/>"#, &format!("<origin {attributes}/>"))
            .replace(r#"version="1.0""#, &format!(r#"version="{version}""#))
    };
    let cases = [
        ("1.0", r#"quat_xyzw="0 0 0 1""#, QuaternionFault::Version),
        ("1.1", r#"quat_xyzw="0 0 0 1" rpy="0 0 0""#, QuaternionFault::WithRpy),
        ("1.1", r#"quat_xyzw="0 0 0 0""#, QuaternionFault::ZeroLength),
    ];
    for (version, attributes, fault) in cases {
        let error = refused(&origin(version, attributes));
        let subject = r#"joint "a""#.to_owned();
        assert_eq!(*error.problem, UrdfProblem::Quaternion { subject, fault });
        assert_eq!(error.place.line, 6);
    }
}

#[test]
fn links_and_joints_form_one_tree() {
    check(
        &arm_with(r#"<parent link="upper"/>"#, r#"<parent link="uper"/>"#),
        r#"arm.urdf:10: joint "b": parent link "uper" does not exist"#,
    );
    check(
        &arm_with(r#"<child link="lower"/>"#, r#"<child link="tip"/>"#),
        r#"arm.urdf:10: joint "b": child link "tip" does not exist"#,
    );
    check(
        &arm_with(r#"<child link="lower"/>"#, r#"<child link="upper"/>"#),
        "arm.urdf:9: joint \"b\": its child link \"upper\" is the child of joint \"a\" already",
    );
    check(
        &arm_with("</robot>", "<link name=\"table\"/></robot>"),
        r#"arm.urdf:13: link "table": no joint leads to it, but "base" is the root already"#,
    );
}

#[test]
fn a_loop_beside_the_root_is_found() {
    let pair = r#"<link name="c"/><link name="d"/>
  <joint name="x" type="fixed"><parent link="c"/><child link="d"/></joint>
  <joint name="y" type="fixed"><parent link="d"/><child link="c"/></joint></robot>"#;
    check(&arm_with("</robot>", pair), r#"arm.urdf:14: joint "x": link "d" is its own ancestor"#);
}

#[test]
fn a_loop_without_any_root_is_found() {
    let text = r#"<robot name="ring"><link name="c"/>
  <joint name="x" type="fixed"><parent link="c"/><child link="c"/></joint></robot>"#;
    check(text, r#"arm.urdf:2: joint "x": link "c" is its own ancestor"#);
}

#[test]
fn mimic_joints_need_a_master_that_moves() {
    let mimic = |content: &str| {
        arm_with(r#"<parent link="upper"/>"#, &format!(r#"<parent link="upper"/>{content}"#))
    };
    check(
        &mimic(r#"<mimic joint="z"/>"#),
        r#"arm.urdf:10: joint "b": mimics joint "z", which does not exist"#,
    );
    check(&mimic("<mimic/>"), r#"arm.urdf:10: joint "b": <mimic> has no attribute "joint""#);
    check(
        &mimic(r#"<mimic joint="a"/>"#).replace("revolute", "fixed"),
        r#"arm.urdf:9: joint "b": mimics joint "a", which is fixed"#,
    );
    check(&mimic(r#"<mimic joint="b"/>"#), r#"arm.urdf:9: joint "b": mimics itself"#);
    let pair =
        mimic(r#"<mimic joint="a"/>"#).replace(r#"<axis xyz="0 0 1"/>"#, r#"<mimic joint="b"/>"#);
    check(&pair, r#"arm.urdf:5: joint "a": mimics itself"#);
}

#[test]
fn a_chain_of_huge_multipliers_is_refused() {
    let third = r#"<link name="tip"/><joint name="c" type="continuous">
      <parent link="lower"/><child link="tip"/><mimic joint="b" multiplier="1e200"/></joint></robot>"#;
    let text = arm_with("</robot>", third).replace(
        r#"<parent link="upper"/>"#,
        r#"<parent link="upper"/><mimic joint="a" multiplier="1e200"/>"#,
    );
    check(&text, r#"arm.urdf:13: joint "c": multiplier and offset towards "a" are not finite"#);
}

#[test]
fn shapes_and_masses_are_checked() {
    let geometry =
        |shape: &str| arm_with_link(&format!("<visual><geometry>{shape}</geometry></visual>"));
    check(
        &arm_with_link("<collision/>"),
        r#"arm.urdf:2: link "base": <collision> has no <geometry>"#,
    );
    let shapes = "expected one of box, cylinder, capsule, sphere, mesh";
    check(
        &geometry(""),
        &format!(r#"arm.urdf:2: link "base": <geometry> holds 0 shapes, {shapes}"#),
    );
    check(
        &geometry("<sphere radius='1'/><sphere radius='1'/>"),
        &format!(r#"arm.urdf:2: link "base": <geometry> holds 2 shapes, {shapes}"#),
    );
    check(
        &geometry("<plane/>"),
        &format!(r#"arm.urdf:2: link "base": <plane> is not a shape, {shapes}"#),
    );
    check(
        &geometry("<box size='1 -1 1'/>"),
        r#"arm.urdf:2: link "base": box size -1 is below zero"#,
    );
    check(
        &geometry("<cylinder radius='1'/>"),
        r#"arm.urdf:2: link "base": <cylinder> has no attribute "length""#,
    );
    check(&geometry("<mesh/>"), r#"arm.urdf:2: link "base": <mesh> has no attribute "filename""#);
    check(
        &arm_with_link(
            "<inertial><mass value='-1'/>\
             <inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>",
        ),
        r#"arm.urdf:2: link "base": mass value -1 is below zero"#,
    );
    check(
        &arm_with_link("<inertial><mass value='1'/></inertial>"),
        r#"arm.urdf:2: link "base": <inertial> has no <inertia>"#,
    );
}

#[test]
fn what_the_reader_alone_refuses_is_told_in_its_words() {
    let text = arm_with_link("<visual><geometry><sphere radius='0'/></geometry></visual>")
        .replace(r#"version="1.0""#, r#"version="1.2""#);
    let problem = *refused(&text).problem;
    let UrdfProblem::Reader { reason } = &problem else { panic!("{problem}") };
    assert!(reason.contains("Sphere radius"), "{reason}");
}
