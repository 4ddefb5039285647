//! The SRDFs of real robots, in `../shared/robots`.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use std::collections::BTreeSet;

use armada_model::{RobotModel, Severity, Srdf, SrdfFault, SrdfProblem, VirtualJointType};

/// File without its ending; pairs, groups, states and end effectors that are usable.
const ROBOTS: [(&str, [usize; 4]); 14] = [
    ("abb_irb1200/irb1200_5_90", [10, 1, 1, 0]),
    ("abb_irb1200/irb1200_7_70", [12, 1, 1, 0]),
    ("abb_yumi/yumi", [51, 5, 0, 2]),
    ("dual_ur10e_table/dual_ur10e_table", [70, 0, 0, 0]),
    // Of 8 and 4 states those named "extended" put an elbow outside its limits.
    ("fr3/dual_fr3", [82, 5, 6, 2]),
    ("fr3/fr3", [41, 2, 3, 1]),
    ("hsrb/hsrb4s", [17, 0, 0, 0]),
    ("panda/panda", [34, 3, 5, 1]),
    // Of its 1163 pairs two stand twice.
    ("pr2/pr2", [1161, 11, 2, 2]),
    ("realman/rm_65", [14, 1, 2, 0]),
    // Of its 25 pairs four name a link that no URDF has.
    ("realman/rm_75", [21, 1, 2, 0]),
    ("vega/vega_1_gripper", [149, 0, 0, 0]),
    ("vega/vega_1u", [74, 0, 0, 0]),
    ("xarm7/xarm7", [18, 1, 2, 0]),
];

fn read(name: &str) -> Option<(RobotModel, Srdf, Vec<SrdfProblem>)> {
    let path = common::shared("robots")?.join(name);
    let model = common::load(&path.with_extension("urdf"));
    let text = std::fs::read_to_string(path.with_extension("srdf")).expect("the SRDF is readable");
    let (srdf, problems) =
        Srdf::read(&text, name, &model).unwrap_or_else(|error| panic!("{error}"));
    Some((model, srdf, problems))
}

fn names<'m>(model: &'m RobotModel, links: &[usize]) -> Vec<&'m str> {
    links.iter().map(|&link| model.links()[link].name.as_str()).collect()
}

#[test]
fn every_robot_has_the_entries_that_its_file_lists() {
    for (name, expected) in ROBOTS {
        let Some((_, srdf, problems)) = read(name) else { return };
        let counts = [
            srdf.disabled_pairs.len(),
            srdf.groups.len(),
            srdf.states.len(),
            srdf.end_effectors.len(),
        ];
        let listed: Vec<_> = problems.iter().map(ToString::to_string).collect();
        assert_eq!(counts, expected, "{name}: {listed:#?}");
    }
}

#[test]
fn the_problems_of_real_files_are_these() {
    for (name, _) in ROBOTS {
        let Some((_, _, problems)) = read(name) else { return };
        let (errors, warnings): (Vec<_>, Vec<_>) =
            problems.iter().partition(|problem| problem.severity == Severity::Error);
        let expected = match name {
            // For each arm: a virtual joint on a link "base" that does not exist, a state outside
            // the limits, and a passive joint inside a group.
            "fr3/dual_fr3" => (4, 2),
            // And a state that sets the arm of a group of arm and hand.
            "fr3/fr3" => (2, 2),
            // A passive joint inside a group.
            "panda/panda" => (0, 1),
            // Two pairs stand twice.
            "pr2/pr2" => (0, 2),
            // The robot's name is not that of the URDF; four pairs with an unknown link.
            "realman/rm_65" => (0, 1),
            "realman/rm_75" => (0, 5),
            _ => (0, 0),
        };
        let listed: Vec<_> = problems.iter().map(ToString::to_string).collect();
        assert_eq!((errors.len(), warnings.len()), expected, "{name}: {listed:#?}");
    }
}

#[test]
fn a_link_that_no_urdf_has_is_listed_with_its_line() {
    let Some((_, _, problems)) = read("realman/rm_75") else { return };
    let (name, pairs) = problems.split_first().expect("problems");
    assert!(matches!(name.fault, SrdfFault::RobotName { .. }), "{name}");
    for problem in pairs {
        assert_eq!(problem.fault, SrdfFault::UnknownLink { link: "bottom_link".into() });
        assert_eq!(
            (problem.severity, &*problem.element),
            (Severity::Warning, "disable_collisions")
        );
        assert!(problem.to_string().contains("\"bottom_link\" does not exist"), "{problem}");
    }
    let lines: BTreeSet<_> = pairs.iter().map(|problem| problem.place.line).collect();
    assert_eq!(lines.len(), 4);
}

#[test]
fn pr2_groups_follow_their_chains() {
    let Some((model, srdf, _)) = read("pr2/pr2") else { return };
    let arm = srdf.group("left_arm").expect("a group");
    let joints: Vec<_> =
        arm.variables.iter().map(|&v| model.variables().nth(v).expect("driven").name).collect();
    let expected = [
        "l_shoulder_pan_joint",
        "l_shoulder_lift_joint",
        "l_upper_arm_roll_joint",
        "l_forearm_roll_joint",
        "l_elbow_flex_joint",
        "l_wrist_flex_joint",
        "l_wrist_roll_joint",
    ];
    assert_eq!(joints, expected);
    let links = names(&model, &arm.links);
    assert!(links.contains(&"torso_lift_link") && links.contains(&"l_wrist_roll_link"));
    assert!(!links.contains(&"l_gripper_palm_link"));

    let with_torso = srdf.group("left_arm_and_torso").expect("a group");
    assert_eq!(with_torso.variables.len(), 8);
    let whole = srdf.group("whole_body").expect("a group");
    assert_eq!(whole.variables.len(), 7 + 7 + 1);
    assert_eq!((whole.subgroups.len(), whole.virtual_joints.len()), (3, 1));
    assert_eq!(srdf.virtual_joints[0].kind, VirtualJointType::Planar);
}

#[test]
fn a_state_has_the_values_of_the_file() {
    let Some((model, srdf, _)) = read("panda/panda") else { return };
    let ready = srdf.state("panda_arm", "ready").expect("a state");
    let values: Vec<_> = ready.positions.iter().map(|&(_, value)| value).collect();
    assert_eq!(values, [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]);
    let first = ready.positions[0].0;
    assert_eq!(model.variables().nth(first).expect("driven").name, "panda_joint1");
    // The second finger mimics the first, so its value adds none.
    assert_eq!(srdf.state("hand", "open").expect("a state").positions.len(), 1);
    let hand = &srdf.end_effectors[0];
    assert_eq!(srdf.groups[hand.group].name, "hand");
    assert_eq!(model.links()[hand.parent_link].name, "panda_link8");
}

/// The semantic digital twin lists pairs of links with shapes only.
#[test]
fn pr2_pairs_include_those_of_the_semantic_digital_twin() {
    let (Some((model, srdf, _)), Some(golden)) = (read("pr2/pr2"), common::shared("golden")) else {
        return;
    };
    let text = std::fs::read_to_string(golden.join("semantic/pr2.json")).expect("readable");
    let golden: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let pairs = golden["srdf"]["allowed_pairs"].as_array().expect("pairs");
    assert_eq!(pairs.len(), 257);
    for pair in pairs {
        let link = |index: usize| {
            model.link_index(pair[index].as_str().expect("a name")).expect("the link exists")
        };
        assert!(srdf.is_disabled(link(0), link(1)) && srdf.is_disabled(link(1), link(0)), "{pair}");
    }
}
