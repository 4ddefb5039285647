//! What is doubtful about a robot description that can be used.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
#![allow(clippy::print_stdout, reason = "how many warnings there are is worth seeing")]

mod common;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use armada_model::{RobotModel, UrdfDoubt};

/// Links `a` and `b` and joint `j`, with these contents; everything is on line 1.
fn pair(link: &str, joint: &str) -> String {
    format!(
        r#"<robot name="r" version="1.2"><link name="a"/><link name="b">{link}</link><joint name="j" {joint}<parent link="a"/><child link="b"/></joint></robot>"#
    )
}

/// A joint about which nothing is doubtful.
const SOUND: &str =
    r#"type="prismatic"><limit lower="0" upper="1" velocity="1" acceleration="1"/>"#;

#[track_caller]
fn check(text: &str, warnings: &[&str]) {
    let report = RobotModel::check_urdf(text, "r.urdf");
    assert_eq!(report.problems, []);
    let told: Vec<_> = report.warnings.iter().map(ToString::to_string).collect();
    let expected: Vec<_> = warnings.iter().map(|warning| format!("r.urdf:1: {warning}")).collect();
    assert_eq!(told, expected, "{text}");
    assert!(report.warnings.iter().all(|warning| !warning.remedy().is_empty()));
}

#[test]
fn joints_that_cannot_or_should_not_move_so_are_doubted() {
    let joint = |content: &str| pair("", content);
    check(&joint(SOUND), &[]);
    let acceleration = r#"1 driven joints have no acceleration limit, joint "j" is the first"#;
    let velocity = r#"joint "j": no velocity limit above 0, so nothing may move it"#;
    check(&joint(r#"type="continuous">"#), &[velocity, acceleration]);
    check(
        &joint(r#"type="prismatic"><limit lower="0" upper="1" velocity="0" acceleration="0"/>"#),
        &[acceleration, velocity],
    );
    check(
        &joint(
            r#"type="revolute"><limit lower="2" upper="2" velocity="1" acceleration="1"/><axis xyz="0 0 2"/>"#,
        ),
        &[
            r#"joint "j": limit lower and upper are both 2, so it cannot move"#,
            r#"joint "j": axis xyz has length 2, expected 1"#,
        ],
    );
    check(
        &joint(r#"type="revolute"><limit lower="-7" upper="7" velocity="1" acceleration="1"/>"#),
        &[r#"joint "j": limits are 14 rad apart, more than two turns"#],
    );
}

#[test]
fn sound_joints_are_not_doubted() {
    for joint in [
        r#"type="fixed"><axis xyz="0 0 9"/><limit lower="0" upper="0"/>"#,
        r#"type="continuous"><limit velocity="1" acceleration="1" lower="3" upper="3"/>"#,
        r#"type="revolute"><limit velocity="1" acceleration="1" lower="-6.2831853071795862" upper="6.2831853071795862"/>"#,
        r#"type="prismatic"><limit velocity="1" acceleration="1"/><axis xyz="0.7071 0 0.7071"/>"#,
    ] {
        check(&pair("", joint), &[]);
    }
}

#[test]
fn a_joint_that_follows_a_follower_is_doubted() {
    let more = r#"<link name="c"/><joint name="k" type="continuous"><parent link="a"/><child link="c"/><mimic joint="j"/></joint>
    <link name="d"/><joint name="l" type="continuous"><parent link="a"/><child link="d"/><mimic joint="k"/></joint></robot>"#
        .replace('\n', "");
    let text = pair("", SOUND).replace("</robot>", &more);
    check(&text, &[r#"joint "l": mimics joint "k", which mimics another itself"#]);
}

#[test]
fn links_without_mass_or_shape_are_doubted_but_frames_are_not() {
    let link = |content: &str| pair(content, SOUND);
    let sphere = "<geometry><sphere radius='1'/></geometry>";
    check(
        &link(&format!("<visual>{sphere}</visual>")),
        &[
            r#"link "b": has a <visual>, but no <collision>"#,
            r#"link "b": has a shape, but no <inertial>"#,
        ],
    );
    let root = link("").replacen(
        r#"<link name="a"/>"#,
        &format!(r#"<link name="a"><collision>{sphere}</collision></link>"#),
        1,
    );
    check(&root, &[]);
    let mesh = |file: &str| format!("<geometry><mesh filename='{file}'/></geometry>");
    let meshes = format!(
        "<inertial><mass value='0'/><inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/>\
         </inertial><visual>{}</visual><collision>{}</collision><collision>{}</collision>",
        mesh("x.stl"),
        mesh("y.stl"),
        mesh("x.stl")
    );
    check(&link(&meshes), &[r#"2 mesh files have to be found, "x.stl" is the first"#]);
}

#[test]
fn an_inertia_that_no_body_has_is_doubted() {
    let inertial = |mass: &str, moments: [&str; 4]| {
        let [xx, xy, yy, zz] = moments;
        let content = format!(
            "<inertial><mass value='{mass}'/>\
             <inertia ixx='{xx}' ixy='{xy}' ixz='0' iyy='{yy}' iyz='0' izz='{zz}'/></inertial>"
        );
        pair(&content, SOUND)
    };
    check(&inertial("1", ["1", "0", "1", "2"]), &[]);
    check(&inertial("1", ["1", "0.2", "1", "1.9"]), &[]);
    check(
        &inertial("0", ["1", "0", "1", "1"]),
        &[r#"link "b": mass is 0, but the inertia is not"#],
    );
    check(
        &inertial("1", ["1", "0", "1", "0"]),
        &[r#"link "b": inertia has the principal moment 0 kg m², expected above 0"#],
    );
    check(
        &inertial("1", ["1", "0", "1", "3"]),
        &["link \"b\": inertia has the principal moment 3 kg m², above the sum 2 of the other two"],
    );
    // Positive on its diagonal, and still not positive definite.
    let report = RobotModel::check_urdf(&inertial("1", ["1", "2", "1", "1"]), "r.urdf");
    let [warning] = report.warnings.as_slice() else { panic!("{:?}", report.warnings) };
    let UrdfDoubt::InertiaNotPositive { moment, .. } = warning.doubt else { panic!("{warning}") };
    assert!((moment + 1.0).abs() < 1e-12, "{moment}");
}

#[test]
fn what_is_passed_over_is_counted_by_its_kind() {
    let text = pair("<colision/><visuals/><visuals/>", SOUND)
        .replace(r#"upper="1""#, r#"upper="1" speed="3""#)
        .replace("</robot>", "<gazebo><x/></gazebo></robot>");
    check(
        &text,
        &[
            "<colision> in <link> is passed over, 1 of them",
            "<visuals> in <link> is passed over, 2 of them",
            r#"attribute "speed" of <limit> is passed over, 1 of them"#,
            "<gazebo> in <robot> is passed over, 1 of them",
        ],
    );
    let older = pair("", SOUND).replace("1.2", "1.0");
    check(
        &older,
        &[
            r#"1 driven joints have no acceleration limit, joint "j" is the first"#,
            r#"attribute "acceleration" of <limit> is passed over, 1 of them"#,
        ],
    );
}

#[test]
fn names_that_cannot_stand_in_a_key_are_doubted() {
    for (name, character) in
        [("left arm", ' '), ("ärm", 'ä'), ("a/b", '/'), ("a*", '*'), (" ", ' ')]
    {
        let text = pair("", SOUND).replace(r#"name="j""#, &format!(r#"name="{name}""#));
        check(&text, &[&format!(r#"joint "{name}": the name holds {character:?}"#)]);
    }
}

#[test]
fn a_chain_of_more_than_sixteen_driven_joints_is_doubted_at_its_tip() {
    let joint = |index: usize| {
        let parent = index - 1;
        format!(
            "<link name='l{index}'/><joint name='j{index}' type='prismatic'>\
             <limit velocity='1' acceleration='1'/>\
             <parent link='l{parent}'/><child link='l{index}'/></joint>"
        )
    };
    let robot = |joints: usize| {
        let chain: String = (1..=joints).map(joint).collect();
        format!("<robot name='r' version='1.2'><link name='l0'/>{chain}</robot>")
    };
    check(&robot(16), &[]);
    check(&robot(17), &[r#"17 driven joints lead to link "l17", above the limit of 16"#]);
}

/// Files of a folder and its folders, by their name.
fn urdf_files(folder: &Path) -> BTreeMap<String, PathBuf> {
    let entries = std::fs::read_dir(folder).expect("the folder is readable");
    let mut files = BTreeMap::new();
    for path in entries.map(|entry| entry.expect("an entry").path()) {
        if path.is_dir() {
            files.extend(urdf_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "urdf") {
            let name = path.file_name().expect("a file").to_string_lossy().into_owned();
            files.insert(name, path);
        }
    }
    files
}

#[test]
fn the_robots_of_others_have_no_problems_and_few_warnings() {
    let Some(folder) = common::shared("robots") else { return };
    let files = urdf_files(&folder);
    assert_eq!(files.len(), 19, "{files:?}");
    for (name, path) in files {
        let text = std::fs::read_to_string(path).expect("readable");
        let report = RobotModel::check_urdf(&text, &name);
        assert_eq!(report.problems, [], "{name}");
        let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
        for warning in &report.warnings {
            let doubt = format!("{:?}", warning.doubt);
            let kind = doubt.split_once(' ').map_or(doubt.as_str(), |(kind, _)| kind);
            *kinds.entry(kind.to_owned()).or_default() += 1;
        }
        println!("{name}: {kinds:?}");
        assert_eq!(report.omitted_warnings, 0, "{name}");
    }
}

#[test]
fn our_own_robots_lack_nothing_but_what_the_robot_file_gives() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/robots");
    for (name, path) in urdf_files(&folder) {
        let text = std::fs::read_to_string(path).expect("readable");
        let report = RobotModel::check_urdf(&text, &name);
        assert_eq!(report.problems, [], "{name}");
        for warning in &report.warnings {
            let expected = matches!(
                warning.doubt,
                UrdfDoubt::NoAcceleration { .. } | UrdfDoubt::NoInertial { .. }
            );
            assert!(expected, "{warning}");
        }
    }
}
