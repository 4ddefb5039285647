//! `armada model` as a real process: answers, exit codes, JSON in and out.
#![expect(clippy::expect_used, reason = "helpers of tests may panic as the tests do")]
#![allow(clippy::print_stdout, reason = "a skipped test says so")]

mod model_process;

use std::process::Output;

use model_process::{model, model_with_input, own, shared, text};
use serde_json::{Value, json};

/// Largest difference in any element of a transform.
const TOLERANCE: f64 = 1e-9;

#[track_caller]
fn answer(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// Compares every link in every golden configuration of a robot; gives how many.
fn compare_with_golden(name: &str, urdf: &str) -> usize {
    let (Some(golden), Some(urdf)) = (shared(&format!("golden/fk/{name}.json")), shared(urdf))
    else {
        return 0;
    };
    let golden = std::fs::read_to_string(golden).expect("readable");
    let golden: Value = serde_json::from_str(&golden).expect("JSON");
    let mut compared = 0;
    for configuration in golden["configurations"].as_array().expect("a list") {
        let urdf = urdf.to_str().expect("a path");
        let joints = configuration["joint_positions"].to_string();
        let arguments = ["fk", urdf, "--joints", "-", "--json"];
        let answer = answer(&model_with_input(&arguments, &joints));
        assert_eq!(answer["joints"], configuration["joint_positions"]);
        let expected = configuration["root_T_link_row_major"].as_object().expect("an object");
        let links = answer["links"].as_object().expect("an object");
        assert_eq!(links.len(), expected.len());
        for (link, matrix) in links {
            let rows = matrix.as_array().expect("rows").iter();
            let cells = rows.flat_map(|row| row.as_array().expect("a row"));
            let expected = expected[link].as_array().expect("16 numbers");
            for (index, (cell, expected)) in cells.zip(expected).enumerate() {
                let difference =
                    cell.as_f64().expect("a number") - expected.as_f64().expect("a number");
                assert!(difference.abs() <= TOLERANCE, "{name} {link} {index}: {difference:e}");
            }
            compared += 1;
        }
    }
    assert!(compared > 0, "{name}: nothing compared");
    compared
}

#[test]
fn fk_puts_every_link_of_panda_and_pr2_where_pinocchio_does() {
    let panda = compare_with_golden("panda", "robots/panda/panda.urdf");
    let pr2 = compare_with_golden("pr2", "robots/pr2/pr2.urdf");
    println!("{panda} and {pr2} poses compared");
}

#[test]
fn fk_takes_joints_as_text_array_and_file() {
    let urdf = own("six_axis_arm.urdf");
    let folder = tempfile::tempdir().expect("a directory");
    let file = folder.path().join("joints.json");
    let named = r#"{"elbow_joint": 1.5}"#;
    std::fs::write(&file, named).expect("written");
    let at_file = format!("@{}", file.display());
    let answers = [named, "[0, 0, 1.5, 0, 0, 0]", &at_file].map(|joints| {
        answer(&model(&["fk", &urdf, "--joints", joints, "--link", "tool0", "--json"]))
    });
    assert_eq!(answers[0], answers[1]);
    assert_eq!(answers[0], answers[2]);
    assert_eq!(answers[0]["links"].as_object().map(serde_json::Map::len), Some(1));
    assert_eq!(answers[0]["warnings"], json!([]));
}

#[test]
fn fk_warns_of_positions_outside_limits_such_as_degrees() {
    let output =
        model(&["fk", &own("six_axis_arm.urdf"), "--joints", r#"{"elbow_joint": 90}"#, "--json"]);
    let answer = answer(&output);
    let warning = answer["warnings"][0].as_str().expect("a warning").to_owned();
    assert!(warning.contains(r#""elbow_joint": 90 rad is outside its limits"#), "{warning}");
    assert!(text(&output.stderr).contains(&warning));
}

#[test]
fn arguments_that_do_not_fit_end_with_2_and_say_why() {
    let urdf = own("six_axis_arm.urdf");
    let cases: [(&[&str], &str); 9] = [
        (&["--joints", r#"{"elbow": 1}"#], r#"there is no joint "elbow""#),
        (&["--joints", r#"{"elbow_joint": NaN}"#], r#"after "elbow_joint""#),
        (&["--joints", r#"{"elbow_joint": "1 rad"}"#], r#""1 rad" is not a number"#),
        (&["--joints", "[1, 2]"], "2 positions, but the robot has 6 driven joints"),
        (&["--joints", "elbow_joint=1"], "neither"),
        (&["--link", "hand"], r#"there is no link "hand""#),
        (&["--root-pose", "[1]"], "--root-pose: neither position_m"),
        (&["--joints", "-", "--root-pose", "-"], "standard input"),
        (&["--degrees"], "--degrees"),
    ];
    for (arguments, reason) in cases {
        let output = model(&[&["fk", &urdf], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        let error = text(&output.stderr);
        assert!(error.contains(reason), "{arguments:?}: {error}");
    }
}

const BROKEN: &str = "<robot name='r'>
  <link name='a'/>
  <link name='b'/>
  <joint name='j' type='revolute'>
    <parent link='a'/><child link='b'/><axis xyz='0 0 0'/>
    <limit lower='1' upper='0' velocity='1'/>
  </joint>
</robot>";

#[test]
fn check_tells_all_problems_with_their_remedies_and_ends_with_1() {
    let output = model_with_input(&["check", "-"], BROKEN);
    assert_eq!(output.status.code(), Some(1));
    let told = text(&output.stdout);
    for line in [
        r#"standard input:5:40: problem: joint "j": axis xyz has zero length"#,
        "    give <axis> a direction",
        r#"standard input:6:5: problem: joint "j": limit lower 1 is above upper 0"#,
        "    swap lower and upper",
        "standard input CANNOT BE USED: problems 2, warnings 0",
    ] {
        assert!(told.contains(line), "{line}\n{told}");
    }
    let output = model_with_input(&["check", "-", "--json"], BROKEN);
    assert_eq!(output.status.code(), Some(1));
    let answer: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(answer["usable"], json!(false));
    assert_eq!(answer["problems"][1]["line"], json!(6));
}

#[test]
fn check_sums_up_a_sound_robot_and_ends_with_0() {
    let answer = answer(&model(&["check", &own("seven_axis_arm.urdf"), "--json"]));
    assert_eq!(answer["usable"], json!(true));
    assert_eq!(answer["robot"]["driven"], json!(7));
    let output = model(&["check", &own("seven_axis_arm.urdf")]);
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains("can be used: problems 0"));
}

#[test]
fn a_file_that_cannot_be_used_ends_every_other_subcommand_with_1() {
    for subcommand in ["fk", "info"] {
        let output = model_with_input(&[subcommand, "-"], BROKEN);
        assert_eq!(output.status.code(), Some(1), "{subcommand}");
        let error = text(&output.stderr);
        let expected = r#"standard input:5: joint "j": axis xyz has zero length"#;
        assert!(error.contains(expected), "{error}");
        assert!(error.contains("1 more problem"), "{error}");
        let output = model(&[subcommand, "no/such.urdf"]);
        assert_eq!(output.status.code(), Some(1), "{subcommand}");
        assert!(text(&output.stderr).contains("no/such.urdf: "));
    }
}

#[test]
fn info_draws_the_tree_and_has_json() {
    let output = model(&["info", &own("lift_torso.urdf")]);
    assert_eq!(output.status.code(), Some(0));
    let tree = text(&output.stdout);
    assert!(tree.contains("carriage  (#0 lift_joint: prismatic, 0 to 0.5 m, 0.15 m/s)"), "{tree}");
    let answer = answer(&model(&["info", &own("lift_torso.urdf"), "--json"]));
    assert_eq!(answer["robot"], json!("lift_torso"));
}
