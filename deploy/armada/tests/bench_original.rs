//! `armada bench original` as a real process: what it says of itself, and where the original is
//! missing. No network and no Python packages are needed.
#![expect(clippy::expect_used, reason = "helpers of tests may panic as the tests do")]

use std::os::unix::fs::PermissionsExt as _;
use std::path::PathBuf;
use std::process::{Command, Output};

use tempfile::TempDir;

/// Runs the measurement with a cache of its own, where nothing but `program` is called `python3`.
fn original(arguments: &[&str], folder: &TempDir) -> Output {
    Command::new(env!("CARGO_BIN_EXE_armada"))
        .args(["bench", "original"])
        .args(arguments)
        .env("XDG_CACHE_HOME", folder.path().join("cache"))
        .env("PATH", folder.path())
        .env_remove("RUST_LOG")
        .output()
        .expect("it runs")
}

/// A program in place of Python.
fn python(folder: &TempDir, script: &str) -> PathBuf {
    let path = folder.path().join("python3");
    std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).expect("written");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("permitted");
    path
}

/// What it told as it failed.
#[track_caller]
fn failure(output: &Output) -> String {
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(output.stdout.is_empty(), "nothing was measured");
    errors
}

#[test]
fn the_help_tells_what_is_compared_what_is_installed_and_how_long_it_takes() {
    let folder = tempfile::tempdir().expect("a directory");
    let output = original(&["--help"], &folder);
    let help = String::from_utf8(output.stdout).expect("text");
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    for words in [
        "robotraconteur-abstract-robot",
        "over the network",
        "user's cache folder",
        "minutes",
        "--python <PROGRAM>",
        "--arms <NUMBERS>",
        "Examples:",
    ] {
        assert!(help.contains(words), "{words:?} is not in the help:\n{help}");
    }
}

#[test]
fn the_help_of_scale_tells_what_runs_where() {
    let output = Command::new(env!("CARGO_BIN_EXE_armada"))
        .args(["bench", "scale", "--help"])
        .output()
        .expect("it runs");
    let help = String::from_utf8(output.stdout).expect("text");
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    for words in ["one agent process", "second process", "until half of all periods are missed"] {
        assert!(help.contains(words), "{words:?} is not in the help:\n{help}");
    }
}

#[test]
fn a_python_that_cannot_be_run_is_named() {
    let folder = tempfile::tempdir().expect("a directory");
    let errors = failure(&original(&["--python", "/no/such/python"], &folder));
    assert!(errors.contains("cannot run /no/such/python"), "{errors}");
}

#[test]
fn a_python_without_the_original_is_refused_with_the_remedy() {
    let folder = tempfile::tempdir().expect("a directory");
    let ready = r#"{"python": "3.0", "packages": {"robotraconteur-abstract-robot": null}}"#;
    let program = python(&folder, &format!("echo '{ready}'"));
    let program = program.to_str().expect("text");
    let errors = failure(&original(&["--python", program], &folder));
    assert!(errors.contains("lacks robotraconteur-abstract-robot"), "{errors}");
    assert!(errors.contains("-m pip install robotraconteur=="), "{errors}");
}

#[test]
fn without_a_network_the_way_out_is_told_and_the_next_try_begins_anew() {
    let folder = tempfile::tempdir().expect("a directory");
    let calls = folder.path().join("calls");
    let script = format!("echo x >> {}\necho 'no route to host' >&2\nexit 1", calls.display());
    python(&folder, &script);
    for _ in 0..2 {
        let errors = failure(&original(&[], &folder));
        assert!(errors.contains("cannot install the original"), "{errors}");
        assert!(errors.contains("no route to host"), "{errors}");
        assert!(errors.contains("--python PROGRAM"), "{errors}");
    }
    assert_eq!(std::fs::read_to_string(calls).expect("called").lines().count(), 2);
}
