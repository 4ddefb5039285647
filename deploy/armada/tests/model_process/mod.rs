//! What the tests of `armada model` as a process have in common.

#![allow(clippy::expect_used, reason = "helpers of tests fail by panicking")]
#![allow(clippy::print_stdout, reason = "a skipped test says so")]
#![allow(dead_code, reason = "each test binary uses a part of this module")]

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Runs `armada model` without input.
pub(crate) fn model(arguments: &[&str]) -> Output {
    model_with_input(arguments, "")
}

/// Runs `armada model` with `input` on its standard input.
pub(crate) fn model_with_input(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_armada"))
        .arg("model")
        .args(arguments)
        .env_remove("RUST_LOG")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut stdin = child.stdin.take().expect("a pipe");
    // It may end without reading.
    drop(stdin.write_all(input.as_bytes()));
    drop(stdin);
    child.wait_with_output().expect("it ends")
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// One of our own robots.
pub(crate) fn own(file: &str) -> String {
    format!("{}/../../config/robots/{file}", env!("CARGO_MANIFEST_DIR"))
}

/// A path beside the checkout; `None`, and a printed line, where it is absent.
pub(crate) fn shared(path: &str) -> Option<PathBuf> {
    let found = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared").join(path);
    if !found.exists() {
        println!("SKIPPED: ../shared/{path} is not beside the checkout");
        return None;
    }
    Some(found)
}
