//! `armada bench` as real processes: short measurements, and that nothing of them is left behind.
#![expect(clippy::expect_used, reason = "helpers of tests may panic as the tests do")]

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;

const DEADLINE: Duration = Duration::from_secs(30);

/// A measurement with a directory of its own for temporary files.
fn bench(arguments: &[&str], temporary: &TempDir) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_armada"));
    command.arg("bench").args(arguments).env("TMPDIR", temporary.path()).env_remove("RUST_LOG");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn is_empty(folder: &Path) -> bool {
    std::fs::read_dir(folder).expect("the folder is there").next().is_none()
}

/// Runs a measurement to its end; returns its report.
fn report(arguments: &[&str]) -> Value {
    let temporary = tempfile::tempdir().expect("a directory");
    let output = bench(arguments, &temporary).output().expect("it runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
    assert!(is_empty(temporary.path()), "{arguments:?} left files behind");
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

/// Every figure of the rows with this text in their names.
fn figures(report: &Value, row: &str) -> Vec<f64> {
    let list = |value: &Value, name: &str| value[name].as_array().cloned().unwrap_or_default();
    let sections = list(report, "sections");
    let rows = sections.iter().flat_map(|section| list(section, "rows"));
    let named = rows.filter(|found| found["name"].as_str().is_some_and(|name| name.contains(row)));
    let cells: Vec<Value> = named.flat_map(|row| list(&row, "cells")).collect();
    cells.iter().flat_map(|cell| list(cell, "values")).filter_map(|value| value.as_f64()).collect()
}

#[track_caller]
fn assert_measured(report: &Value, rows: &[&str]) {
    for row in rows {
        let figures = figures(report, row);
        let sensible = |&figure: &f64| figure.is_finite() && figure >= 0.0;
        assert!(!figures.is_empty() && figures.iter().all(sensible), "{row}: {report:#}");
        assert!(figures.iter().any(|&figure| figure > 0.0), "{row}: {report:#}");
    }
}

#[test]
fn loop_measures_both_loops_in_pairs() {
    let report =
        report(&["loop", "--pairs", "2", "--seconds", "0.3", "--policy", "other", "--json"]);
    assert_measured(&report, &["armada", "bare loop", "ratio"]);
    assert_eq!(figures(&report, "bare loop").len(), 2 * 5, "five columns, two pairs");
    assert!(report["machine"]["cores"].as_u64().is_some_and(|cores| cores > 0));
}

#[test]
fn latency_measures_both_publishers() {
    let report =
        report(&["latency", "--pairs", "1", "--seconds", "0.5", "--policy", "other", "--json"]);
    assert_measured(&report, &["armada", "raw put", "ratio"]);
}

#[test]
fn stop_measures_every_stage_of_arms_that_are_flooded_too() {
    for flood in ["0", "500"] {
        let arguments = ["stop", "--rounds", "2", "--arms", "3", "--flood", flood];
        let report = report(&[&arguments[..], &["--policy", "other", "--json"]].concat());
        let stages = ["A1 received", "A2 commanded", "A3 standstill"];
        assert_measured(&report, &["A1 received, the slowest arm", "raw query and reply", "ratio"]);
        assert_measured(&report, &stages);
        let flooded = report["settings"]["flooded_hz"].as_f64().unwrap_or_default();
        assert_eq!(flooded > 100.0, flood == "500", "{report:#}");
    }
}

#[test]
fn lease_measures_when_the_holder_has_lost_it_and_is_told() {
    let report = report(&["lease", "--rounds", "2", "--policy", "other", "--json"]);
    assert_measured(&report, &["the holder has lost it", "the holder is told", "is granted it"]);
}

/// Nothing runs beside it (`.config/nextest.toml`): arms that do not hear each other stop.
#[test]
fn group_measures_starts_phases_and_the_loss_of_a_partner() {
    let report = report(&["group", "--rounds", "2", "--policy", "other", "--json"]);
    assert_measured(
        &report,
        &["difference of phase", "longest silence", "silence when it aborted"],
    );
}

#[test]
fn accept_measures_the_whole_and_its_parts() {
    let arguments =
        ["accept", "--pairs", "1", "--rounds", "2", "--waypoints", "101", "--policy", "other"];
    let report = report(&[&arguments[..], &["--json"]].concat());
    assert_measured(&report, &["request to answer", "raw query", "encode", "decode", "compile"]);
}

#[test]
fn cpu_measures_agent_and_emulator() {
    let report =
        report(&["cpu", "--pairs", "1", "--seconds", "0.2", "--policy", "other", "--json"]);
    assert_measured(&report, &["agent", "emulator", "bare loop"]);
}

#[test]
fn scale_measures_every_number_of_arms_that_was_asked_for() {
    let report = report(&[
        "scale",
        "--arms",
        "2,3",
        "--most",
        "3",
        "--seconds",
        "2",
        "--policy",
        "other",
        "--json",
    ]);
    assert_measured(&report, &["one agent process", "bare loops", "emulators"]);
    let sections = report["sections"].as_array().expect("sections");
    let titles: Vec<_> = sections.iter().map(|section| section["title"].as_str()).collect();
    assert_eq!(titles, [Some("2 arms at 100 Hz"), Some("3 arms at 100 Hz")]);
    let note = report["notes"][0].as_str().expect("a note");
    assert!(note.contains("half of the periods are missed"), "{note}");
}

#[test]
fn step_measures_every_kind_without_an_allocation() {
    let report = report(&["step", "--repetitions", "1", "--steps", "1000", "--json"]);
    assert_measured(&report, &["trajectory", "jog", "hold", "ramp"]);
    for row in ["trajectory", "jog", "hold", "ramp"] {
        assert_eq!(figures(&report, row).last(), Some(&0.0), "{row} allocates");
    }
}

/// A measurement that runs, with the processes it has started.
struct Running {
    bench: Child,
    parts: Vec<u32>,
    temporary: TempDir,
}

impl Running {
    fn start() -> Self {
        let temporary = tempfile::tempdir().expect("a directory");
        let bench = bench(&["loop", "--seconds", "600", "--policy", "other"], &temporary)
            .spawn()
            .expect("it runs");
        let mut parts = Vec::new();
        wait_until("emulator and agent run", || {
            parts = children(bench.id());
            parts.len() == 2
        });
        Self { bench, parts, temporary }
    }

    fn signal(&self, signal: Signal) {
        let pid = i32::try_from(self.bench.id()).ok().and_then(Pid::from_raw).expect("a process");
        kill_process(pid, signal).expect("sent");
    }

    fn wait_for_all(&mut self) -> Option<i32> {
        let status = self.bench.wait().expect("it ends");
        wait_until("every part has ended", || self.parts.iter().all(|&part| has_ended(part)));
        status.code()
    }
}

#[test]
fn ctrl_c_ends_every_process_and_removes_the_files() {
    let mut running = Running::start();
    running.signal(Signal::INT);
    assert_eq!(running.wait_for_all(), Some(130));
    assert!(is_empty(running.temporary.path()));
}

#[test]
fn a_measurement_that_is_killed_takes_its_processes_along() {
    let mut running = Running::start();
    running.signal(Signal::KILL);
    assert_eq!(running.wait_for_all(), None);
}

#[track_caller]
#[expect(clippy::disallowed_methods, reason = "a test waits with a deadline")]
fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !condition() {
        assert!(begin.elapsed() < DEADLINE, "{what}: not after {DEADLINE:?}");
        std::thread::park_timeout(Duration::from_millis(5));
    }
}

/// State letter and parent of a process; `None` if there is none.
fn stat(pid: &str) -> Option<(char, u32)> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name before it may hold anything but the last bracket.
    let (_, rest) = stat.rsplit_once(") ")?;
    let mut fields = rest.split(' ');
    Some((fields.next()?.chars().next()?, fields.next()?.parse().ok()?))
}

fn has_ended(pid: u32) -> bool {
    stat(&pid.to_string()).is_none_or(|(state, _)| matches!(state, 'Z' | 'X'))
}

fn children(pid: u32) -> Vec<u32> {
    let entries = std::fs::read_dir("/proc").expect("there is a /proc").filter_map(Result::ok);
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let of_bench = |name: &String| stat(name).is_some_and(|(_, parent)| parent == pid);
    names.filter(of_bench).filter_map(|name| name.parse().ok()).collect()
}
