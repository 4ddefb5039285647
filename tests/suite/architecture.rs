//! The shape of the project, checked on its sources: who depends on whom, what stays pure, where
//! keys are spelled, how long files are.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::fs;
use std::path::{Path, PathBuf};

/// Folders that must not know a clock, socket, thread, lock, log, randomness or hash-map order.
const PURE: [&str; 9] = [
    "protocol/model/src",
    "agent/src/control",
    "agent/src/drivers",
    "agent/src/equipment",
    "agent/src/moves",
    "agent/src/recorder",
    "agent/src/stop_sources",
    "gateway/src/coordinator",
    "gateway/src/world",
];

/// What gives such knowledge away.
const IMPURE: [&str; 16] = [
    "std::time::Instant",
    "SystemTime",
    "UdpSocket",
    "TcpStream",
    "std::thread",
    "std::fs",
    "std::env",
    "Mutex",
    "RwLock",
    "Atomic",
    "tracing",
    "tokio",
    "zenoh",
    "HashMap",
    "HashSet",
    "rand::",
];

/// The packages with those of ours that each may use.
const PACKAGES: [(&str, &[&str]); 6] = [
    ("protocol/model", &[]),
    ("protocol", &["armada-model"]),
    ("agent", &["armada-model", "armada-protocol"]),
    ("gateway", &["armada-model", "armada-protocol"]),
    ("deploy/armada", &["armada-agent", "armada-gateway", "armada-model", "armada-protocol"]),
    ("tests", &["armada-agent", "armada-gateway", "armada-model", "armada-protocol"]),
];

const LONGEST_FILE: usize = 600;

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Lines of a file that are code, with their numbers; tests at its end are left out.
fn code(path: &Path) -> Vec<(usize, String)> {
    let text = fs::read_to_string(path).expect("a source file");
    let tests = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    let numbered = text[..tests].lines().enumerate().map(|(at, line)| (at + 1, line.to_owned()));
    numbered.filter(|(_, line)| !line.trim_start().starts_with("//")).collect()
}

fn is_test_code(path: &Path) -> bool {
    // The project itself may be written as `tests/..`.
    let ours = path.strip_prefix(project()).unwrap_or(path);
    ours.components().any(|part| part.as_os_str() == "tests")
        || path.file_name().is_some_and(|name| name == "tests.rs")
}

#[test]
fn pure_folders_know_no_clock_socket_thread_lock_log_or_hash_order() {
    let mut found = Vec::new();
    for folder in PURE {
        for path in sources(&project().join(folder)).iter().filter(|path| !is_test_code(path)) {
            for (number, line) in code(path) {
                let word = IMPURE.iter().find(|word| line.contains(**word));
                found.extend(word.map(|word| format!("{}:{number}: {word}", path.display())));
            }
        }
    }
    assert!(found.is_empty(), "in pure code:\n{}", found.join("\n"));
}

#[test]
fn packages_depend_in_one_direction() {
    for (folder, allowed) in PACKAGES {
        let manifest = fs::read_to_string(project().join(folder).join("Cargo.toml"));
        let manifest = manifest.expect("a manifest");
        let dependencies = manifest.split("[dev-dependencies]").next().expect("a first part");
        let ours = dependencies.lines().filter_map(|line| line.split('.').next());
        for name in ours.filter(|name| name.starts_with("armada-")) {
            assert!(allowed.contains(&name), "{folder} must not depend on {name}");
        }
    }
}

#[test]
fn every_package_is_in_the_table() {
    let manifest = fs::read_to_string(project().join("Cargo.toml")).expect("the manifest");
    let members = manifest.lines().find(|line| line.starts_with("members")).expect("members");
    assert_eq!(members.matches('"').count() / 2, PACKAGES.len(), "{members}");
}

#[test]
fn no_file_but_the_table_spells_a_key() {
    let mut found = Vec::new();
    for folder in ["protocol/src", "agent/src", "gateway/src", "deploy/armada/src"] {
        for path in sources(&project().join(folder)) {
            let is_table = path.ends_with("protocol/src/keys.rs");
            if is_table || is_test_code(&path) || path.ends_with("protocol/src/generated.rs") {
                continue;
            }
            for (number, line) in code(&path) {
                if line.contains("\"robots/") || line.contains("\"cell/") {
                    found.push(format!("{}:{number}: {}", path.display(), line.trim()));
                }
            }
        }
    }
    assert!(found.is_empty(), "keys outside the table:\n{}", found.join("\n"));
}

#[test]
fn invariant_10_nothing_but_a_real_input_answers_a_stop_source() {
    let places = |word: &str| {
        let mut found = Vec::new();
        for folder in ["protocol/src", "agent/src", "gateway/src", "deploy/armada/src"] {
            for path in sources(&project().join(folder)) {
                if !is_test_code(&path) && code(&path).iter().any(|(_, line)| line.contains(word)) {
                    let path = path.strip_prefix(project()).expect("ours").to_owned();
                    found.push(path.display().to_string());
                }
            }
        }
        found.sort();
        found
    };
    let key = [
        "agent/src/runtime/stop_sources.rs",
        "protocol/src/client/stop_source.rs",
        "protocol/src/keys.rs",
    ];
    assert_eq!(places("CELL_STOP_SOURCE"), key, "the key is asked by agents and answered once");
    let answers =
        ["deploy/armada/src/commands/stop_button.rs", "protocol/src/client/stop_source.rs"];
    assert_eq!(places("answer_stop_source("), answers, "and its caller reads an input");
}

#[test]
fn no_source_file_is_longer_than_it_may_be() {
    let mut found = Vec::new();
    for (folder, _) in PACKAGES {
        for path in sources(&project().join(folder)) {
            let lines = fs::read_to_string(&path).expect("a source file").lines().count();
            if lines > LONGEST_FILE {
                found.push(format!("{}: {lines} lines", path.display()));
            }
        }
    }
    assert!(found.is_empty(), "files to split:\n{}", found.join("\n"));
}

#[test]
fn the_top_level_holds_what_it_should_and_nothing_else() {
    let allowed = [
        "ARCHITECTURE.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "Cargo.lock",
        "Cargo.toml",
        "LICENSE",
        "Makefile",
        "README.md",
        "agent",
        "config",
        "deploy",
        "gateway",
        "protocol",
        "target",
        "tests",
    ];
    for entry in fs::read_dir(project()).expect("the project") {
        let name = entry.expect("an entry").file_name().to_string_lossy().into_owned();
        assert!(
            name.starts_with('.') || allowed.contains(&name.as_str()),
            "{name} at the top level"
        );
    }
}
