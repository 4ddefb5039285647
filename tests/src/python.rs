//! The Python of the project's own environment.

use std::path::{Path, PathBuf};

/// The interpreter that `make` has set up with the `armada` package; `None`, with a line that says
/// so, if it has not.
#[must_use]
#[expect(clippy::print_stderr, reason = "a test that is skipped says so")]
pub fn python() -> Option<PathBuf> {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("../.venv/bin/python");
    if python.exists() {
        return Some(python);
    }
    eprintln!("SKIPPED: {} is missing; `make python` sets it up", python.display());
    None
}
