//! `armada bench motion` as a real process, with a peer, without libraries, and without Python.
#![expect(clippy::expect_used, reason = "helpers of tests may panic as the tests do")]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};
use tempfile::TempDir;

fn motion(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_armada"))
        .args(["bench", "motion", "--pairs", "2", "--calls", "200"])
        .args(arguments)
        .env_remove("RUST_LOG")
        .output()
        .expect("it runs")
}

fn report(arguments: &[&str]) -> Value {
    let output = motion(&[arguments, &["--json"]].concat());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

/// A program in place of Python, which says and answers the same each time.
fn peer(folder: &TempDir, ready: &str, answer: &str) -> String {
    let path = folder.path().join("python");
    let script =
        format!("#!/bin/sh\necho '{ready}'\nwhile read -r line; do echo '{answer}'; done\n");
    std::fs::write(&path, script).expect("written");
    make_executable(&path);
    path.display().to_string()
}

fn make_executable(path: &Path) {
    use std::os::unix::fs::PermissionsExt as _;
    let permissions = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(path, permissions).expect("permitted");
}

fn titles(report: &Value) -> Vec<String> {
    let sections = report["sections"].as_array().expect("sections");
    sections.iter().map(|section| section["title"].as_str().expect("text").to_owned()).collect()
}

/// Figures of a row of the first section.
fn values(report: &Value, row: usize) -> Value {
    report["sections"][0]["rows"][row]["cells"][0]["values"].clone()
}

#[test]
fn without_python_our_own_side_is_measured_and_the_remedy_told() {
    let report = report(&["--python", "/no/such/python"]);
    let titles = titles(&report);
    let rows = ["fk of all links: six", "fk of all links: seven", "pose and jacobian: seven"];
    let rows = rows.into_iter().chain(["inverse kinematics: six", "inverse kinematics: seven"]);
    let rows = rows.chain(["retiming", "retargeting", "tick", "clearance", "motion on its path"]);
    let rows: Vec<_> = rows.collect();
    assert_eq!(titles.len(), rows.len(), "{titles:?}");
    for (title, begin) in titles.iter().zip(rows) {
        assert!(title.starts_with(begin), "{title:?}, not {begin:?}");
    }
    for section in report["sections"].as_array().expect("sections") {
        let ours = &section["rows"][0];
        assert!(ours["name"].as_str().expect("a name").starts_with("armada, "), "{section}");
        let measured = |cell: &Value| cell["median"].as_f64() > Some(0.0);
        assert!(measured(&ours["cells"][0]), "{section}");
    }
    let ours = values(&report, 0);
    assert!(ours.as_array().expect("figures").iter().all(|ns| ns.as_f64() > Some(0.0)), "{ours}");
    assert_eq!((values(&report, 1), values(&report, 2)), (json!([]), json!([])));
    let note = report["notes"][1].as_str().expect("a note").to_owned();
    assert!(note.contains("cannot run /no/such/python"), "{note}");
    assert!(note.contains("pip install pin ruckig toppra"), "{note}");
}

#[test]
fn targets_stand_beside_the_figures() {
    let report = report(&["--python", "/no/such/python"]);
    let sections = report["sections"].as_array().expect("sections");
    let mut targets = 0;
    for row in sections.iter().flat_map(|section| section["rows"].as_array().expect("rows")) {
        if row["name"].as_str().expect("a name").trim_start().starts_with("target") {
            let numbers = row["cells"].as_array().expect("cells").iter();
            assert!(numbers.filter_map(|cell| cell["median"].as_f64()).all(|number| number > 0.0));
            targets += 1;
        }
    }
    assert_eq!(targets, 8, "jacobian, two for each of two arms, retime, retarget, clearance");
}

#[test]
fn without_the_library_the_remedy_is_told() {
    let folder = tempfile::tempdir().expect("a directory");
    let python = peer(&folder, r#"{"python":"3.0","packages":{"pin":null}}"#, "{}");
    let report = report(&["--python", &python]);
    assert_eq!(values(&report, 1), json!([]));
    let notes = report["notes"].as_array().expect("notes");
    let missing = |name| json!(format!("{name} is not installed: pip install pin ruckig toppra"));
    assert_eq!(notes[1..], ["pin", "toppra", "ruckig"].map(missing));
}

#[test]
fn a_peer_that_fails_or_answers_something_else_fails_the_measurement() {
    let ready = r#"{"python":"3.0","packages":{"pin":"4.1.0"}}"#;
    for (answer, reason) in [
        (r#"{"error":"ValueError: no such joint"}"#, "the peer: ValueError: no such joint"),
        (r#"{"ns":100.0,"links":{}}"#, "the peer knows no link"),
    ] {
        let folder = tempfile::tempdir().expect("a directory");
        let output = motion(&["--python", &peer(&folder, ready, answer)]);
        assert_eq!(output.status.code(), Some(1));
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(error.contains(reason), "{error}");
    }
}
