//! Everything that can be wrong in an SRDF, each with its line.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use armada_model::Severity::{Error, Warning};
use armada_model::{RobotModel, Severity, Srdf, SrdfErrorKind, SrdfProblem};

/// Line, severity and a part of the message of each problem.
type Expected<'e> = &'e [(u32, Severity, &'e str)];

/// base -a- one -b- two -c(mimics b)- three -fix- tip; a 1 rad both ways, b free.
const URDF: &str = r#"<robot name="r">
<link name="base"/><link name="one"/><link name="two"/><link name="three"/><link name="tip"/>
<joint name="a" type="revolute"><parent link="base"/><child link="one"/>
  <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="b" type="continuous"><parent link="one"/><child link="two"/></joint>
<joint name="c" type="continuous"><parent link="two"/><child link="three"/>
  <mimic joint="b" multiplier="2" offset="0.5"/></joint>
<joint name="fix" type="fixed"><parent link="three"/><child link="tip"/></joint>
</robot>"#;

/// Line 2 of every case.
const GROUP: &str = r#"<group name="g"><chain base_link="base" tip_link="tip"/></group>"#;

fn read(body: &str) -> (Srdf, Vec<SrdfProblem>) {
    let model = RobotModel::from_urdf(URDF, "r.urdf").expect("a robot");
    let text = format!("<robot name=\"r\">\n{GROUP}\n{body}\n</robot>");
    Srdf::read(&text, "r.srdf", &model).unwrap_or_else(|error| panic!("{error}"))
}

#[track_caller]
fn expect(body: &str, expected: Expected<'_>) -> Srdf {
    let (srdf, problems) = read(body);
    let texts: Vec<_> = problems.iter().map(ToString::to_string).collect();
    assert_eq!(problems.len(), expected.len(), "{body}: {texts:#?}");
    for ((problem, text), &(line, severity, part)) in problems.iter().zip(&texts).zip(expected) {
        assert!(text.contains(part), "{part:?} is not in {text:?}");
        assert!(text.starts_with(&format!("r.srdf:{line}: {severity}: <")), "{text}");
        assert!(!problem.fault.remedy().is_empty());
    }
    srdf
}

#[test]
fn a_clean_file_has_no_problems() {
    let srdf = expect(
        r#"<group_state name="s" group="g"><joint name="a" value="0.5"/>
           <joint name="b" value="0.25"/><joint name="c" value="1"/></group_state>
           <disable_default_collisions link="tip"/><enable_collisions link1="tip" link2="base"/>
           <joint_property joint_name="a" property_name="p" value="1"/>
           <link_sphere_approximation link="one"><sphere center="0 0 1" radius="0.5"/>
           </link_sphere_approximation>"#,
        &[],
    );
    assert_eq!(srdf.states[0].positions, [(0, 0.5), (1, 0.25)]);
    assert!(srdf.is_disabled(4, 1) && srdf.is_disabled(2, 4) && !srdf.is_disabled(0, 4));
    assert_eq!(srdf.link_spheres[0].spheres, [([0.0, 0.0, 1.0], 0.5)]);
}

#[test]
fn groups_with_problems_are_listed() {
    let cases: [(&str, Expected<'_>); 12] = [
        (r#"<group/>"#, &[(3, Error, "\"name\" is missing")]),
        (r#"<group name="x"/>"#, &[(3, Error, "has no link and no joint")]),
        (r#"<group name="g"><joint name="a"/></group>"#, &[(3, Error, "taken since line 2")]),
        (
            "<group name=\"x\"><joint name=\"a\"/>\n<joint name=\"z\"/></group>",
            &[(4, Error, "joint \"z\" does not exist")],
        ),
        (
            "<group name=\"x\"><link name=\"z\"/>\n<joint/></group>",
            &[
                (3, Error, "has no link and no joint"),
                (3, Error, "link \"z\" does not exist"),
                (4, Error, "\"name\""),
            ],
        ),
        (
            r#"<group name="x"><chain base_link="tip" tip_link="tip"/><joint name="a"/></group>"#,
            &[(3, Error, "begins and ends at link \"tip\"")],
        ),
        (
            r#"<group name="x"><chain base_link="z"/><joint name="a"/></group>"#,
            &[(3, Error, "\"z\""), (3, Error, "\"tip_link\" is missing")],
        ),
        (
            r#"<group name="x"><group name="z"/><joint name="a"/></group>"#,
            &[(3, Error, "group \"z\" does not exist")],
        ),
        (
            r#"<group name="x"><joint name="a"/><group name="x"/></group>"#,
            &[(3, Error, "group \"x\" is a part of itself")],
        ),
        (
            "<group name=\"x\"><group name=\"y\"/></group>\n<group name=\"y\"><group name=\"x\"/></group>",
            &[(3, Error, "group \"x\" is a part"), (4, Error, "group \"y\" is a part")],
        ),
        (
            "<group name=\"x\"><joint name=\"a\"/><group name=\"y\"/></group>\n<group name=\"y\"/>",
            &[(3, Error, "group \"y\" is not usable"), (4, Error, "has no link and no joint")],
        ),
        (
            r#"<group name="x"><joint name="a"/><passive_joint name="b"/></group>"#,
            &[(3, Warning, "<group> has no such element")],
        ),
    ];
    for (body, expected) in cases {
        expect(body, expected);
    }
}

#[test]
fn what_is_right_in_a_group_is_used() {
    let srdf = expect(
        r#"<group name="x"><joint name="b"/><joint name="z"/></group>"#,
        &[(3, Error, "\"z\"")],
    );
    let group = srdf.group("x").expect("usable");
    assert_eq!((&*group.joints, &*group.links, &*group.variables), (&[1][..], &[2][..], &[1][..]));
}

#[test]
fn a_chain_goes_over_the_common_ancestor() {
    let srdf = expect(r#"<group name="x"><chain base_link="three" tip_link="base"/></group>"#, &[]);
    let group = srdf.group("x").expect("usable");
    assert_eq!((&*group.joints, &*group.links), (&[0, 1, 2][..], &[0, 1, 2, 3][..]));
}

#[test]
fn states_with_problems_are_listed() {
    let state = |body: &str| format!("<group_state name=\"s\" group=\"g\">\n{body}</group_state>");
    let open = (3, Warning, "1 driven joint(s) of the group are not set, the first is \"b\"");
    let a = r#"<joint name="a" value="0"/>"#;
    let both = r#"<joint name="a" value="0"/><joint name="b" value="0"/>"#;
    let cases: [(String, Expected<'_>); 14] = [
        (state(a), &[open]),
        (
            r#"<group_state name="s" group="z"/>"#.into(),
            &[(3, Error, "group \"z\" does not exist")],
        ),
        (r#"<group_state group="g"/>"#.into(), &[(3, Error, "\"name\"")]),
        (format!("{0}\n{0}", state(both)), &[(5, Error, "\"s\" is taken since line 3")]),
        (state(r#"<joint name="z" value="0"/>"#), &[(4, Error, "joint \"z\" does not exist")]),
        (state(r#"<joint name="a"/>"#), &[(4, Error, "\"value\" is missing")]),
        (state(r#"<joint name="a" value="1 2"/>"#), &[(4, Error, "is not 1 finite number")]),
        (state(r#"<joint name="a" value="NaN"/>"#), &[(4, Error, "is not 1 finite number")]),
        (state(r#"<joint name="a" value="1.5"/>"#), &[(4, Error, "at 1.5 is outside -1 to 1")]),
        (state(&format!("{a}{a}")), &[(4, Error, "\"a\" is set twice")]),
        (
            state(&format!("{both}<joint name=\"fix\" value=\"0\"/>")),
            &[(4, Warning, "\"fix\" is fixed")],
        ),
        (
            state(&format!("{both}<joint name=\"c\" value=\"0\"/>")),
            &[(4, Warning, "\"c\" at 0, but the joint it mimics puts it at 0.5")],
        ),
        (
            state(&format!("{a}<joint name=\"c\" value=\"0\"/>")),
            &[open, (4, Warning, "\"c\" mimics \"b\"")],
        ),
        (state(&format!("{both}<link/>")), &[(4, Warning, "<group_state> has no such element")]),
    ];
    for (body, expected) in cases {
        expect(&body, expected);
    }
    let joint = r#"<group name="x"><joint name="b"/></group>
        <group_state name="s" group="x"><joint name="a" value="0"/></group_state>"#;
    let srdf = expect(joint, &[(4, Error, "joint \"a\" is not in group \"x\"")]);
    assert!(srdf.states.is_empty(), "a state that is wrong in part is not used");
}

#[test]
fn joints_and_end_effectors_with_problems_are_listed() {
    let cases: [(&str, Expected<'_>); 13] = [
        (
            r#"<virtual_joint name="v" type="fixed" parent_frame="w" child_link="z"/>"#,
            &[(3, Error, "link \"z\" does not exist")],
        ),
        (
            r#"<virtual_joint name="v" type="ball" parent_frame="w" child_link="base"/>"#,
            &[(3, Error, "\"ball\" is none of")],
        ),
        (
            r#"<virtual_joint name="a" type="fixed" parent_frame="w" child_link="base"/>"#,
            &[(3, Error, "the URDF has a joint \"a\"")],
        ),
        (
            r#"<virtual_joint name="v" type="fixed" parent_frame="w" child_link="tip"/>"#,
            &[(3, Error, "\"tip\" is not the root, which is \"base\"")],
        ),
        (
            "<virtual_joint name=\"v\" type=\"fixed\" parent_frame=\"w\" child_link=\"base\"/>\n\
             <virtual_joint name=\"v\" type=\"fixed\" parent_frame=\"w\" child_link=\"base\"/>",
            &[(4, Error, "\"v\" is taken since line 3")],
        ),
        (r#"<passive_joint name="z"/>"#, &[(3, Warning, "joint \"z\" does not exist")]),
        (
            "<passive_joint name=\"b\"/>\n<passive_joint name=\"b\"/>",
            &[(4, Warning, "\"b\" is passive already")],
        ),
        (
            r#"<end_effector name="e" parent_link="z" group="y"/>"#,
            &[(3, Error, "group \"y\""), (3, Error, "link \"z\"")],
        ),
        (
            r#"<end_effector name="e" parent_link="base" group="g" parent_group="y"/>"#,
            &[
                (3, Error, "group \"y\" does not exist"),
                (3, Warning, "\"base\" is in the end effector's own group \"g\""),
            ],
        ),
        (
            r#"<link_sphere_approximation link="one"><sphere center="0 0" radius="-1"/><x/>
               </link_sphere_approximation>"#,
            &[
                (3, Error, "center \"0 0\" is not 3 finite"),
                (3, Error, "radius -1 is below zero"),
                (3, Warning, "has no such element"),
            ],
        ),
        (
            "<link_sphere_approximation link=\"one\"/>\n<link_sphere_approximation link=\"one\"/>",
            &[(4, Warning, "the same entry stands in line 3")],
        ),
        (r#"<gazebo/>"#, &[(3, Warning, "<robot> has no such element")]),
        (r#"<x:gazebo xmlns:x="y"/>"#, &[]),
    ];
    for (body, expected) in cases {
        expect(body, expected);
    }
    let virtual_value = "<virtual_joint name=\"v\" type=\"fixed\" parent_frame=\"w\" \
        child_link=\"base\"/><passive_joint name=\"v\"/><group name=\"x\"><joint name=\"v\"/></group>\n\
        <group_state name=\"s\" group=\"x\"><joint name=\"v\" value=\"1 2 3\"/></group_state>";
    expect(virtual_value, &[(4, Warning, "\"v\" is virtual")]);
}

#[test]
fn pairs_with_problems_are_listed() {
    let pair = |kind: &str, a: &str, b: &str| format!("<{kind} link1=\"{a}\" link2=\"{b}\"/>\n");
    let disable = |a: &str, b: &str| pair("disable_collisions", a, b);
    let enable = |a: &str, b: &str| pair("enable_collisions", a, b);
    let cases: [(String, Expected<'_>); 8] = [
        (disable("y", "z"), &[(3, Warning, "link \"y\""), (3, Warning, "link \"z\"")]),
        (disable("", "one"), &[(3, Error, "\"link1\" is missing or empty")]),
        (disable("one", "one"), &[(3, Warning, "\"one\" is paired with itself")]),
        (
            disable("one", "tip") + &disable("tip", "one"),
            &[(4, Warning, "the same entry stands in line 3")],
        ),
        (
            disable("one", "tip") + &enable("tip", "one"),
            &[(4, Error, "disabled in line 3 and enabled here")],
        ),
        (enable("one", "tip"), &[(3, Warning, "nothing disables the pair")]),
        (
            "<disable_default_collisions link=\"one\"/>\n".to_owned()
                + &enable("one", "tip")
                + &enable("one", "tip"),
            &[(5, Warning, "the same entry stands in line 4")],
        ),
        (
            "<disable_default_collisions link=\"z\"/>\n<disable_default_collisions link=\"one\"/>\n\
             <disable_default_collisions link=\"one\"/>"
                .into(),
            &[(3, Warning, "\"z\""), (5, Warning, "stands in line 4")],
        ),
    ];
    for (body, expected) in cases {
        expect(&body, expected);
    }
    let (srdf, _) = read(&(disable("one", "tip") + &enable("tip", "one")));
    assert!(!srdf.is_disabled(1, 4), "a pair in doubt is checked");
}

#[test]
fn the_name_of_another_robot_is_doubtful() {
    let model = RobotModel::from_urdf(URDF, "r.urdf").expect("a robot");
    let (_, problems) = Srdf::read("<robot name=\"x\"/>", "r.srdf", &model).expect("an SRDF");
    let text = problems[0].to_string();
    assert!(text.starts_with("r.srdf:1: warning: <robot>: name \"x\", but the URDF's"), "{text}");
}

#[test]
fn text_that_is_no_srdf_is_refused() {
    let model = RobotModel::from_urdf(URDF, "r.urdf").expect("a robot");
    let read = |text: &str| Srdf::read(text, "r.srdf", &model).expect_err("refused");
    assert!(matches!(read("<robot>").kind, SrdfErrorKind::Xml(_)));
    assert!(matches!(read("").kind, SrdfErrorKind::Xml(_)));
    assert!(matches!(read("<!DOCTYPE r []><robot/>").kind, SrdfErrorKind::Xml(_)));
    assert_eq!(read("\n<sdf/>").to_string(), "r.srdf:2: root element is <sdf>, expected <robot>");
    assert_eq!(
        read(URDF).to_string(),
        "r.srdf:2: <robot> has a <link>: this is a URDF, expected an SRDF"
    );
    let xacro =
        "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'>\n<xacro:arm/></robot>";
    let error = read(xacro);
    assert_eq!(error.kind, SrdfErrorKind::Xacro { element: "arm".into() });
    assert_eq!(error.place.line, 2);
    let many: String = (0..300).map(|n| format!(" a{n}=''")).collect();
    let error = read(&format!("<robot{many}/>"));
    assert_eq!(error.kind, SrdfErrorKind::TooManyAttributes { limit: 256 });
    let error = read(&" ".repeat(17 * 1024 * 1024));
    assert!(matches!(error.kind, SrdfErrorKind::TooLarge { .. }));
}
