//! The real program, where no cell runs.
#![expect(clippy::expect_used, reason = "helpers of tests may panic as the tests do")]

use std::process::{Command, Output, Stdio};

/// A port that nothing listens on: it was free a moment ago.
fn unused_endpoint() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    format!("tcp/{}", listener.local_addr().expect("bound"))
}

/// The program, with a temporary directory of its own so that no cell of this machine is found.
fn armada(arguments: &[&str]) -> Output {
    let temporary = tempfile::tempdir().expect("a directory");
    Command::new(env!("CARGO_BIN_EXE_armada"))
        .args(arguments)
        .env("TMPDIR", temporary.path())
        .env_remove("RUST_LOG")
        .stdin(Stdio::null())
        .output()
        .expect("it runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn help_lists_every_command_and_the_exit_codes() {
    let output = armada(&["--help"]);
    assert_eq!(output.status.code(), Some(0));
    let help = text(&output.stdout);
    for word in [
        "status",
        "why",
        "watch",
        "info",
        "events",
        "move",
        "jog",
        "home",
        "run",
        "check-clearance",
        "pause",
        "resume",
        "cancel",
        "speed",
        "lease",
        "tool",
        "payload",
        "signal",
        "param",
        "tcp",
        "ik",
        "record",
        "halt",
        "stop",
        "stop-button",
        "reset",
        "mode",
        "enable",
        "disable",
        "reset-errors",
        "call",
        "completions",
        "agent",
        "gateway",
        "emulator",
        "up",
        "Exit codes",
        "Examples",
    ] {
        assert!(help.contains(word), "{word} is not in the help:\n{help}");
    }
}

#[test]
fn the_help_of_stop_says_that_it_is_no_safety_function() {
    for command in ["stop", "stop-button"] {
        let help = text(&armada(&[command, "--help"]).stdout);
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(help.contains("NEVER A RATED SAFETY FUNCTION"), "{help}");
    }
}

#[test]
fn wrong_arguments_are_told_on_standard_error_with_code_2() {
    for (arguments, reason) in [
        (&["move", "left_arm"][..], "--joints"),
        (&["move", "Left", "--joints", "0"], "is not a robot name"),
        (&["move", "left_arm", "--joints", "0,x"], "\"x\" is not a number"),
        (&["move", "left_arm", "--joints", "0", "--speed", "1.5"], "at most 1"),
        (&["stop", "--level", "L9"], "L9"),
        (&["mode", "left_arm", "dance"], "dance"),
        (&["status", "--timeout", "0"], "above 0"),
        (&["move", "left_arm", "--home", "--joints", "0"], "cannot be used with"),
        (&["move", "left_arm", "--pose", "1,2,3"], "3 numbers, expected X,Y,Z"),
        (&["jog", "left_arm", "--joint", "a=0.1"], "--for"),
        (&["jog", "left_arm", "--for", "1"], "--joint"),
        (&["jog", "left_arm", "--tool", "up=1", "--for", "1"], "there is no axis"),
        (&["speed", "left_arm", "0"], "from 0.01 to 1"),
        (&["lease", "hold", "left_arm", "--ttl", "0"], "from 0.2 to 60"),
        (&["lease", "hold"], "ROBOT"),
        (&["lease", "take", "left_arm", "--reason", "mine"], "--role"),
        (&["lease", "take", "left_arm", "--role", "program", "--reason", "mine"], "supervisor"),
        (&["lease", "delegate", "left_arm", "--to", "ui"], "--lease"),
        (&["lease", "delegate", "left_arm", "--to", "ui", "--scope", "all"], "end-effector"),
        (&["cancel", "left_arm", "this_one"], "this_one"),
        (&["pause", "left-arm"], "neither robot nor motion"),
        (&["run", "lift.json", "--coupling", "welded"], "time_synced"),
        (&["run", "lift.json", "--robot", "a", "--coupling", "rigid"], "cannot be used with"),
        (&["run", "lift.json", "--leases", "left_arm"], "ROBOT=UUID"),
        (&["check-clearance", "lift.json", "--offset-ms", "-1"], "--offset-ms"),
        (&["run", "sweep.json", "--queue", "append"], "--robot"),
        (&["payload", "attach", "left_arm", "box"], "--mass"),
        (&["halt", "--lease", "mine"], "mine"),
        (&["stop-button", "--name", "door_1"], "--stdin-level"),
        (&["fly"], "fly"),
    ] {
        let output = armada(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        let error = text(&output.stderr);
        assert!(error.contains(reason), "{arguments:?}: {error}");
    }
}

#[test]
fn where_no_cell_answers_every_tool_says_so_with_code_2() {
    let endpoint = unused_endpoint();
    for arguments in [
        &["status"][..],
        &["watch", "left_arm"],
        &["info", "left_arm"],
        &["events"],
        &["move", "left_arm", "--joints", "0,0,0,0,0,0"],
        &["stop"],
        &["reset"],
        &["halt"],
        &["call", "cell", "reset"],
        &["jog", "left_arm", "--joint", "a=0.1", "--for", "1"],
        &["home", "left_arm"],
        &["pause", "left_arm"],
        &["speed", "left_arm", "0.5"],
        &["lease", "show"],
        &["lease", "hold", "left_arm", "right_arm"],
        &["lease", "take", "left_arm", "--role", "operator", "--reason", "hangs"],
        &["why"],
        &["resume"],
        &["tool", "list", "left_arm"],
        &["payload", "detach", "left_arm"],
        &["signal", "get", "left_arm", "a"],
        &["param", "set", "left_arm", "a", "1"],
        &["tcp", "left_arm"],
        &["ik", "left_arm", "--pose", "0,0,0,0,0,0"],
        &["record", "left_arm"],
    ] {
        let output = armada(&[arguments, &["--connect", &endpoint]].concat());
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(&format!("no cell answers at {endpoint}")), "{error}");
        assert!(error.contains("armada up"), "{error}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
}

#[test]
fn a_trajectory_file_is_checked_before_anybody_is_dialled() {
    let folder = tempfile::tempdir().expect("a directory");
    let file = folder.path().join("sweep.json");
    std::fs::write(&file, r#"{"joint_names":["a"],"waypoints":[]}"#).expect("written");
    let output = armada(&["run", file.to_str().expect("a path")]);
    assert_eq!(output.status.code(), Some(2));
    let error = text(&output.stderr);
    assert!(error.contains("sweep.json: it has no waypoints"), "{error}");
}

#[test]
fn completions_are_written_for_every_shell() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = armada(&["completions", shell]);
        assert_eq!(output.status.code(), Some(0), "{shell}");
        let script = text(&output.stdout);
        assert!(script.contains("reset-errors"), "{shell}");
    }
}

#[test]
fn a_reader_that_goes_away_ends_the_program_quietly() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_armada"))
        .args(["completions", "bash"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
}
