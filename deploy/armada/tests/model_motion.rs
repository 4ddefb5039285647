//! `armada model jacobian|ik|retime|clearance|check` with an SRDF, as a real process.
#![expect(clippy::expect_used, reason = "helpers of tests may panic as the tests do")]
#![allow(clippy::print_stdout, reason = "a skipped test says so")]

mod model_process;

use model_process::{model, own, shared, text};
use serde_json::{Value, json};

#[track_caller]
fn answer(arguments: &[&str]) -> Value {
    let output = model(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

const Q: [f64; 6] = [0.3, -1.2, 1.9, -2.4, -1.1, 0.5];

fn tool_pose(urdf: &str, q: &[f64]) -> Value {
    let joints = json!(q).to_string();
    let found = answer(&["fk", urdf, "--joints", &joints, "--link", "tool0", "--json"]);
    found["links"]["tool0"].clone()
}

#[test]
fn jacobian_columns_are_finite_differences_of_fk() {
    let urdf = own("six_axis_arm.urdf");
    let joints = json!(Q).to_string();
    let found = answer(&["jacobian", &urdf, "--tip", "tool0", "--joints", &joints, "--json"]);
    let pose = tool_pose(&urdf, &Q);
    for index in 0..16 {
        let (row, column) = (index / 4, index % 4);
        let off = number(&found["pose"][row][column]) - number(&pose[row][column]);
        assert!(off.abs() < 1e-12, "{row} {column}: {off:e}");
    }
    let step = 1e-5;
    for column in 0..6 {
        let moved = |by: f64| {
            let mut q = Q;
            q[column] += by;
            tool_pose(&urdf, &q)
        };
        let (ahead, behind) = (moved(step), moved(-step));
        for row in 0..3 {
            let slope = (number(&ahead[row][3]) - number(&behind[row][3])) / (2.0 * step);
            let cell = number(&found["jacobian"][row][column]);
            assert!((slope - cell).abs() < 1e-8, "{row} {column}: {slope} {cell}");
        }
    }
    let values = found["singular_values"].as_array().expect("a list");
    assert_eq!(values.last(), Some(&found["distance_to_singularity"]));
}

#[test]
fn jacobian_of_shared_robots_is_pinocchios() {
    let Some(robots) = shared("robots") else { return };
    let golden = include_str!("../../../protocol/model/tests/golden/jacobian.json");
    let golden: Value = serde_json::from_str(golden).expect("JSON");
    for case in golden["cases"].as_array().expect("a list").iter().step_by(8) {
        let name = |field: &str| case[field].as_str().expect("a name").to_owned();
        let (urdf, tip) = (robots.join(name("urdf")), name("tip"));
        let urdf = urdf.to_str().expect("a path");
        let joints = case["joint_positions"].to_string();
        let found = answer(&["jacobian", urdf, "--tip", &tip, "--joints", &joints, "--json"]);
        for (index, joint) in found["joints"].as_array().expect("a list").iter().enumerate() {
            let expected = &case["columns"][joint.as_str().expect("a name")];
            for row in 0..6 {
                let off = number(&found["jacobian"][row][index]) - number(&expected[row]);
                assert!(off.abs() < 1e-9, "{urdf} {tip} {joint} {row}: {off:e}");
            }
        }
    }
}

#[test]
fn ik_finds_joints_that_fk_puts_at_the_pose() {
    let urdf = own("six_axis_arm.urdf");
    let goal = tool_pose(&urdf, &Q);
    let pose = goal.to_string();
    let found = answer(&["ik", &urdf, "--tip", "tool0", "--pose", &pose, "--json"]);
    assert_eq!((&found["solved"], &found["cause"]), (&json!(true), &Value::Null));
    let joints = found["joints"].to_string();
    let reached = answer(&["fk", &urdf, "--joints", &joints, "--link", "tool0", "--json"]);
    for row in 0..4 {
        for column in 0..4 {
            let off = number(&reached["links"]["tool0"][row][column]) - number(&goal[row][column]);
            assert!(off.abs() < 5e-6, "{row} {column}: {off:e}");
        }
    }
    let all = answer(&["ik", &urdf, "--tip", "tool0", "--pose", &pose, "--all", "--json"]);
    assert_eq!(all["branches"].as_array().map(Vec::len), Some(8));
}

#[test]
fn ik_of_a_position_alone_leaves_the_orientation_free() {
    let urdf = own("six_axis_arm.urdf");
    let pose =
        r#"{"position_m":{"x":0.6,"y":0.2,"z":0.5},"orientation":{"w":0,"x":1,"y":0,"z":0}}"#;
    let tip = ["ik", &urdf, "--tip", "tool0", "--pose", pose, "--position-only", "--json"];
    let found = answer(&tip);
    let joints = found["joints"].to_string();
    let placed = answer(&["fk", &urdf, "--joints", &joints, "--json"]);
    for (row, wanted) in [0.6, 0.2, 0.5].into_iter().enumerate() {
        let reached = number(&placed["links"]["tool0"][row][3]);
        assert!((reached - wanted).abs() < 1e-5, "{row}: {reached} for {wanted}");
    }
}

#[test]
fn every_posture_of_a_seven_axis_arm_reaches_the_pose() {
    let Some(urdf) = shared("robots/iiwa14/iiwa14.urdf") else { return };
    let urdf = urdf.to_string_lossy().into_owned();
    let q = r#"[0.3, 0.5, -0.2, -1.2, 0.4, 0.7, 0.1]"#;
    let tip = "iiwa_link_ee";
    let wanted = &answer(&["fk", &urdf, "--joints", q, "--json"])["links"][tip];
    let pose = wanted.to_string();
    let all = ["ik", &urdf, "--tip", tip, "--pose", &pose, "--seed", q, "--all", "--json"];
    let found = answer(&all);
    let branches = found["branches"].as_array().expect("branches");
    assert!(branches.len() >= 4, "{found}");
    for branch in branches {
        let joints = branch["joints"].to_string();
        let reached = &answer(&["fk", &urdf, "--joints", &joints, "--json"])["links"][tip];
        for (row, column) in (0..3).flat_map(|row| (0..4).map(move |column| (row, column))) {
            let (a, b) = (number(&reached[row][column]), number(&wanted[row][column]));
            assert!((a - b).abs() < 1e-6, "{branch}: {a} for {b}");
        }
    }
}

#[test]
fn ik_out_of_reach_ends_with_1_says_by_how_much_and_has_the_best_in_json() {
    let far = "[[1,0,0,9],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let urdf = own("six_axis_arm.urdf");
    let output = model(&["ik", &urdf, "--tip", "tool0", "--pose", far, "--json"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("m out of reach"), "{}", text(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(found["cause"]["kind"], json!("out_of_reach"));
    assert_eq!(found["joints"].as_object().map(serde_json::Map::len), Some(6));
    let output = model(&["ik", &urdf, "--tip", "hand", "--pose", far]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("there is no link \"hand\""));
}

const TRAJECTORY: &str = r#"{"joint_names": ["elbow_joint", "shoulder_pan_joint"], "waypoints": [
  {"time_from_start_s": 0, "joint_position": [0, 0], "joint_velocity": [0, 0]},
  {"time_from_start_s": 9, "joint_position": [0.5, 0.4], "joint_velocity": [0.1, 0]},
  {"time_from_start_s": 20, "joint_position": [1.0, -0.3], "joint_velocity": [0, 0]}]}"#;

#[test]
fn retime_answers_a_trajectory_that_it_takes_again() {
    let folder = tempfile::tempdir().expect("a directory");
    let urdf = own("six_axis_arm.urdf");
    let file = folder.path().join("move.json");
    std::fs::write(&file, TRAJECTORY).expect("written");
    let path = file.to_str().expect("a path");
    for extra in [None, Some("--jerk-limited")] {
        let mut arguments = vec!["retime", &urdf, path, "--acceleration", "2", "--json"];
        arguments.extend(extra);
        let found = answer(&arguments);
        let duration = number(&found["duration_s"]);
        assert!(duration > 0.5 && duration < 5.0, "{extra:?}: {duration}");
        assert_eq!(found["before_duration_s"], json!(20.0));
        let waypoints = found["trajectory"]["waypoints"].as_array().expect("a list");
        let last = waypoints.last().expect("a waypoint");
        assert_eq!(number(&last["time_from_start_s"]), duration);
        assert!((number(&last["joint_position"][1]) + 0.3).abs() < 1e-9);
        assert!(found["warnings"][0].as_str().expect("text").starts_with("velocities"));
        let again = folder.path().join("again.json");
        std::fs::write(&again, found["trajectory"].to_string()).expect("written");
        let again = again.to_str().expect("a path");
        answer(&["retime", &urdf, again, "--acceleration", "2", "--json"]);
    }
}

#[test]
fn retime_without_acceleration_ends_with_2_and_names_joint_and_option() {
    let folder = tempfile::tempdir().expect("a directory");
    let file = folder.path().join("move.json");
    std::fs::write(&file, TRAJECTORY).expect("written");
    let path = file.to_str().expect("a path");
    let output = model(&["retime", &own("six_axis_arm.urdf"), path]);
    assert_eq!(output.status.code(), Some(2));
    let error = text(&output.stderr);
    assert!(error.contains("joint \"elbow_joint\" has no acceleration limit"), "{error}");
    assert!(error.contains("--acceleration"), "{error}");
}

#[test]
fn clearance_of_our_own_arm_has_pairs_points_and_capsules() {
    let urdf = own("six_axis_arm.urdf");
    let joints = json!(Q).to_string();
    let found = answer(&["clearance", &urdf, "--joints", &joints, "--below", "0.5", "--json"]);
    let (near, capsules) = (&found["minimum"], &found["minimum_capsules"]);
    let distance = number(&near["distance_m"]);
    assert!(distance > 0.0 && number(&capsules["distance_m"]) <= distance + 1e-9);
    let (a, b) = (&near["point_a"], &near["point_b"]);
    let square = |k: usize| (number(&a[k]) - number(&b[k])).powi(2);
    let apart = (0..3).map(square).sum::<f64>().sqrt();
    assert!((apart - distance).abs() < 1e-6, "{apart} {distance}");
    assert_eq!(found["below"][0]["distance_m"], near["distance_m"]);
    assert_eq!(found["without_shape"], json!([]));
}

#[test]
fn check_lists_the_link_that_an_srdf_names_and_the_robot_does_not_have() {
    let files = ["urdf", "srdf"].map(|kind| shared(&format!("robots/realman/rm_75.{kind}")));
    let [Some(urdf), Some(srdf)] = files else { return };
    let files = [&urdf, &srdf].map(|path| path.to_str().expect("a path"));
    let output = model(&["check", files[0], files[1], "--json"]);
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(found["srdf"]["readable"], json!(true));
    let problems = found["srdf"]["problems"].as_array().expect("a list");
    let named = |problem: &Value| problem["message"].to_string().contains("bottom_link");
    assert!(problems.iter().any(named), "{problems:?}");
    let has_error = problems.iter().any(|problem| problem["severity"] == json!("error"));
    assert_eq!(output.status.code(), Some(i32::from(has_error)));
}

#[test]
fn check_ends_with_1_for_a_urdf_in_place_of_an_srdf() {
    let urdf = own("six_axis_arm.urdf");
    let output = model(&["check", &urdf, &urdf]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stdout).contains("this is a URDF"), "{}", text(&output.stdout));
}
