//! Other libraries, timed by a Python process that this program starts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::bench::python::Python;

/// The process, as text, so that it needs no file beside this program.
const SCRIPT: &str = include_str!("peer.py");
/// Python of a virtual environment, where one usually is.
const VENV: &str = ".venv/bin/python";

/// What to do where a library is missing.
pub(super) const INSTALL: &str = "not installed: pip install pin ruckig toppra";

/// What is installed beside Python.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(super) struct Installed {
    /// Version of Python.
    python: String,
    /// Version of each library, `None` if it is not installed.
    packages: BTreeMap<String, Option<String>>,
}

/// A Python process; it is killed if this is dropped.
#[derive(Debug)]
pub(super) struct Peer {
    python: Python,
    /// What it has.
    pub(super) installed: Installed,
}

impl Peer {
    /// Starts Python: the one given, else that of `.venv`, else `python3`.
    pub(super) async fn start(python: Option<&Path>) -> anyhow::Result<Self> {
        let program = python.map_or_else(default_python, Path::to_owned);
        let (python, installed) = Python::start(&program, SCRIPT, &[]).await?;
        Ok(Self { python, installed })
    }

    /// Version of a library, `None` if it is not installed.
    pub(super) fn version(&self, package: &str) -> Option<&str> {
        self.installed.packages.get(package)?.as_deref()
    }

    /// Names and versions of the libraries that are installed.
    pub(super) fn versions(&self) -> Vec<String> {
        let packages = self.installed.packages.iter();
        packages
            .filter_map(|(name, version)| Some(format!("{name} {}", version.as_ref()?)))
            .collect()
    }

    /// Asks for one measurement.
    pub(super) async fn ask<T: DeserializeOwned>(&mut self, ask: &Value) -> anyhow::Result<T> {
        self.python.ask(ask).await
    }
}

fn default_python() -> PathBuf {
    let venv = PathBuf::from(VENV);
    if venv.exists() { venv } else { PathBuf::from("python3") }
}
