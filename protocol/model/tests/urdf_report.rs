//! All problems of a robot description at once, and none twice.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

use armada_model::{RobotModel, UrdfReport};

/// A correct hand; joint `c` mimics joint `b`.
const HAND: &str = r#"<robot name="hand" version="1.2">
  <link name="base"/>
  <link name="palm"/>
  <link name="left"/>
  <link name="right"/>
  <joint name="a" type="revolute">
    <parent link="base"/><child link="palm"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" velocity="2" effort="3" acceleration="9"/>
  </joint>
  <joint name="b" type="prismatic">
    <parent link="palm"/><child link="left"/>
    <limit lower="0" upper="0.5" velocity="0.1" acceleration="1"/>
  </joint>
  <joint name="c" type="prismatic">
    <parent link="palm"/><child link="right"/><mimic joint="b"/>
    <limit lower="0" upper="0.5" velocity="0.1" acceleration="1"/>
  </joint>
</robot>"#;

/// The hand with texts replaced, each of which must occur in it.
fn hand_with(edits: &[(&str, &str)]) -> String {
    edits.iter().fold(HAND.to_owned(), |text, (old, new)| {
        assert!(text.contains(old), "{old} is not in the hand");
        text.replacen(old, new, 1)
    })
}

#[track_caller]
fn check(edits: &[(&str, &str)], problems: &[&str]) -> UrdfReport {
    let report = RobotModel::check_urdf(&hand_with(edits), "hand.urdf");
    let told: Vec<_> = report.problems.iter().map(ToString::to_string).collect();
    assert_eq!(told, problems);
    assert!(report.model.is_none());
    report
}

#[test]
fn a_correct_text_has_no_problem_and_no_warning() {
    let report = RobotModel::check_urdf(HAND, "hand.urdf");
    assert_eq!(report.model.map(|model| model.variable_count()), Some(2));
    assert_eq!((report.problems, report.warnings), (vec![], vec![]));
}

#[test]
fn mistakes_in_many_elements_are_all_told_in_the_order_of_the_text() {
    check(
        &[
            (r#"version="1.2""#, r#"version="9""#),
            (
                r#"<link name="base"/>"#,
                r#"<link name="base"><inertial><mass value="x"/></inertial>
                <visual/><collision><geometry><box size="1 -1 1"/></geometry></collision></link>"#,
            ),
            (r#"xyz="0 0 1""#, r#"xyz="0 0 0""#),
            (r#"lower="-1""#, r#"lower="5""#),
            (r#"velocity="2" effort="3""#, r#"effort="-3""#),
            (r#"type="prismatic""#, r#"type="sliding""#),
            (r#"<mimic joint="b"/>"#, r#"<mimic joint="z" offset="?"/>"#),
        ],
        &[
            r#"hand.urdf:1: URDF version "9" is not supported, expected 1.0 to 1.2"#,
            r#"hand.urdf:2: link "base": <inertial> has no <inertia>"#,
            r#"hand.urdf:2: link "base": mass value "x" is not a number"#,
            r#"hand.urdf:3: link "base": <visual> has no <geometry>"#,
            r#"hand.urdf:3: link "base": box size -1 is below zero"#,
            r#"hand.urdf:8: joint "a": axis xyz has zero length"#,
            r#"hand.urdf:9: joint "a": limit lower 5 is above upper 1"#,
            r#"hand.urdf:9: joint "a": <limit> has no attribute "velocity""#,
            r#"hand.urdf:9: joint "a": limit effort -3 is below zero"#,
            "hand.urdf:11: joint \"b\": unknown type \"sliding\", expected one of \
             revolute, continuous, prismatic, fixed, floating, planar, spherical",
            r#"hand.urdf:16: joint "c": mimics joint "z", which does not exist"#,
            r#"hand.urdf:16: joint "c": mimic offset "?" is not a number"#,
        ],
    );
}

#[test]
fn every_attribute_of_an_element_is_looked_at() {
    check(
        &[
            (
                r#"<link name="base"/>"#,
                r#"<link name="base"><inertial><mass/><inertia ixx="1" iyy="one"/></inertial></link>"#,
            ),
            (
                r#"<axis xyz="0 0 1"/>"#,
                r#"<origin xyz="0 0" rpy="1"/><safety_controller k_position="-1"/>"#,
            ),
        ],
        &[
            r#"hand.urdf:2: link "base": <mass> has no attribute "value""#,
            r#"hand.urdf:2: link "base": <inertia> has no attribute "ixy""#,
            r#"hand.urdf:2: link "base": <inertia> has no attribute "ixz""#,
            r#"hand.urdf:2: link "base": inertia iyy "one" is not a number"#,
            r#"hand.urdf:2: link "base": <inertia> has no attribute "iyz""#,
            r#"hand.urdf:2: link "base": <inertia> has no attribute "izz""#,
            r#"hand.urdf:7: joint "a": origin xyz "0 0" is not 3 numbers separated by spaces"#,
            r#"hand.urdf:7: joint "a": origin rpy "1" is not 3 numbers separated by spaces"#,
            r#"hand.urdf:7: joint "a": safety_controller k_position -1 is below zero"#,
            r#"hand.urdf:7: joint "a": <safety_controller> has no attribute "k_velocity""#,
        ],
    );
}

#[test]
fn a_link_that_is_misspelt_once_is_told_once() {
    let palm = r#"<link name="palm"/>"#;
    check(&[(palm, "<link/>")], &[r#"hand.urdf:3: robot: <link> has no attribute "name""#]);
    check(&[(palm, r#"<link name=""/>"#)], &["hand.urdf:3: <link> has an empty name"]);
    check(
        &[(palm, r#"<link name="base"/>"#)],
        &[r#"hand.urdf:3: link "base": the name is taken since line 2"#],
    );
    check(
        &[(r#"<child link="palm"/>"#, r#"<child link="plam"/>"#)],
        &[r#"hand.urdf:7: joint "a": child link "plam" does not exist"#],
    );
    check(
        &[(r#"<child link="right"/>"#, r#"<child link="left"/>"#)],
        &["hand.urdf:14: joint \"c\": its child link \"left\" is the child of joint \"b\" already"],
    );
    check(
        &[(r#"<parent link="base"/>"#, "")],
        &[r#"hand.urdf:6: joint "a": <joint> has no <parent>"#],
    );
}

#[test]
fn a_joint_that_is_misspelt_once_is_told_once() {
    check(
        &[(r#"<joint name="b""#, "<joint")],
        &[r#"hand.urdf:10: robot: <joint> has no attribute "name""#],
    );
    check(
        &[(r#"<joint name="b""#, r#"<joint name="a""#)],
        &[r#"hand.urdf:10: joint "a": the name is taken since line 6"#],
    );
}

#[test]
fn each_root_and_each_loop_is_told_once() {
    let ring = |a: &str, b: &str| {
        format!(
            r#"<link name="{a}"/><link name="{b}"/>
            <joint name="{a}{b}" type="fixed"><parent link="{a}"/><child link="{b}"/></joint>
            <joint name="{b}{a}" type="fixed"><parent link="{b}"/><child link="{a}"/></joint>
            "#
        )
    };
    let more =
        format!(r#"{}{}<link name="t"/><link name="u"/></robot>"#, ring("p", "q"), ring("r", "s"));
    check(
        &[("</robot>", &more)],
        &[
            r#"hand.urdf:19: joint "pq": link "q" is its own ancestor"#,
            r#"hand.urdf:22: joint "rs": link "s" is its own ancestor"#,
            r#"hand.urdf:24: link "t": no joint leads to it, but "base" is the root already"#,
            r#"hand.urdf:24: link "u": no joint leads to it, but "base" is the root already"#,
        ],
    );
}

#[test]
fn a_wrong_mimic_rule_is_told_once_however_many_follow_it() {
    let third = |rules: [&str; 3]| {
        let joint = |(index, rule): (usize, &str)| {
            format!(
                r#"<link name="l{index}"/><joint name="m{index}" type="continuous">
                <parent link="base"/><child link="l{index}"/>{rule}</joint>
                "#
            )
        };
        rules.into_iter().enumerate().map(joint).collect::<String>() + "</robot>"
    };
    let mimic = |master: &str| format!(r#"<mimic joint="{master}"/>"#);
    let [m0, m1, m2] = ["m0", "m1", "m2"].map(mimic);
    check(
        &[("</robot>", &third([&m1, &m2, &m1]))],
        &[r#"hand.urdf:20: joint "m1": mimics itself"#],
    );
    let huge = |master: &str| format!(r#"<mimic joint="{master}" multiplier="1e200"/>"#);
    check(
        &[("</robot>", &third([&huge("m1"), &huge("m2"), &huge("a")]))],
        &[r#"hand.urdf:20: joint "m1": multiplier and offset towards "a" are not finite"#],
    );
    check(
        &[
            ("</robot>", &third([&mimic("a"), &m0, &m1])),
            (r#"<joint name="a" type="revolute">"#, r#"<joint name="a" type="fixed">"#),
        ],
        &[r#"hand.urdf:18: joint "m0": mimics joint "a", which is fixed"#],
    );
}

#[test]
fn a_text_that_is_no_robot_has_one_problem() {
    for (text, message) in [
        ("<robot", "x.urdf:1: not valid XML: the document does not have a root node"),
        ("<sdf><link/></sdf>", "x.urdf:1: root element is <sdf>, expected <robot>"),
        ("<robot name='r'/>", "x.urdf:1: the robot has no links"),
        (
            "<robot name='r'><joint name='j' type='fixed'>\
             <parent link='a'/><child link='b'/></joint></robot>",
            "x.urdf:1: the robot has no links",
        ),
    ] {
        let report = RobotModel::check_urdf(text, "x.urdf");
        let told: Vec<_> = report.problems.iter().map(ToString::to_string).collect();
        assert_eq!(told, [message], "{text}");
    }
}

#[test]
fn of_a_text_made_of_mistakes_the_first_200_are_kept() {
    let text = format!("<robot name='r'>\n{}</robot>", "<link/>\n".repeat(5000));
    let report = RobotModel::check_urdf(&text, "r.urdf");
    assert_eq!((report.problems.len(), report.omitted_problems), (200, 4800));
    assert_eq!(report.problems[199].place.line, 201);
}

#[test]
fn a_long_chain_of_mimic_joints_is_followed_to_its_end() {
    let joint = |index: usize| {
        let (parent, next) = (index.saturating_sub(1), index + 1);
        format!(
            "<link name='l{index}'/><joint name='j{index}' type='continuous'>\
             <parent link='l{parent}'/><child link='l{index}'/><mimic joint='j{next}'/></joint>"
        )
    };
    let count = 20_000;
    let chain: String = (1..count).map(joint).collect();
    let text = format!(
        "<robot name='r'><link name='l0'/>{chain}<link name='end'/>\
         <joint name='j{count}' type='continuous'>\
         <parent link='l0'/><child link='end'/></joint></robot>"
    );
    let model = RobotModel::from_urdf(&text, "r.urdf").expect("it loads");
    assert_eq!(model.variable_count(), 1);
}

#[test]
fn a_remedy_says_what_to_do() {
    let report = check(
        &[
            (r#"upper="1" velocity="2""#, r#"upper="1""#),
            (r#"<mimic joint="b"/>"#, r#"<mimic joint="z"/>"#),
        ],
        &[
            r#"hand.urdf:8: joint "a": <limit> has no attribute "velocity""#,
            r#"hand.urdf:15: joint "c": mimics joint "z", which does not exist"#,
        ],
    );
    let remedies: Vec<_> = report.problems.iter().map(|problem| problem.remedy()).collect();
    assert_eq!(
        remedies,
        [
            "give <limit> a velocity above 0, or make the joint fixed",
            "correct the name in <mimic>, or add a joint \"z\"",
        ]
    );
}
