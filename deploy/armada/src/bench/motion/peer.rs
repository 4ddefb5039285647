//! Other libraries, timed by a Python process that this program starts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use anyhow::{Context as _, bail};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader, Lines};
use tokio::process::{Child, ChildStdin, ChildStdout, Command};
use tokio::time::timeout;

/// The process, as text, so that it needs no file beside this program.
const SCRIPT: &str = include_str!("peer.py");
/// Python of a virtual environment, where one usually is.
const VENV: &str = ".venv/bin/python";
/// How long it may take to start, and to answer.
const PATIENCE: Duration = Duration::from_secs(120);

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
    _process: Child,
    asks: ChildStdin,
    answers: Lines<BufReader<ChildStdout>>,
    /// What it has.
    pub(super) installed: Installed,
}

impl Peer {
    /// Starts Python: the one given, else that of `.venv`, else `python3`.
    pub(super) async fn start(python: Option<&Path>) -> anyhow::Result<Self> {
        let python = python.map_or_else(default_python, Path::to_owned);
        let mut process = Command::new(&python)
            // One core for either side: libraries beneath numpy may start threads.
            .env("OMP_NUM_THREADS", "1")
            .args(["-u", "-c", SCRIPT])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .kill_on_drop(true)
            .spawn()
            .with_context(|| format!("cannot run {}", python.display()))?;
        let asks = process.stdin.take().context("no standard input")?;
        let answers = process.stdout.take().context("no standard output")?;
        let mut answers = BufReader::new(answers).lines();
        let installed = next(&mut answers).await.with_context(|| python.display().to_string())?;
        Ok(Self { _process: process, asks, answers, installed })
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
        self.asks.write_all(format!("{ask}\n").as_bytes()).await?;
        let answer: Value = next(&mut self.answers).await?;
        if let Some(error) = answer.get("error").and_then(Value::as_str) {
            bail!("the peer: {error}");
        }
        Ok(serde_json::from_value(answer)?)
    }
}

async fn next<T: DeserializeOwned>(
    answers: &mut Lines<BufReader<ChildStdout>>,
) -> anyhow::Result<T> {
    let line = timeout(PATIENCE, answers.next_line()).await;
    let line = line.context("the peer does not answer")??.context("the peer has ended")?;
    Ok(serde_json::from_str(&line)?)
}

fn default_python() -> PathBuf {
    let venv = PathBuf::from(VENV);
    if venv.exists() { venv } else { PathBuf::from("python3") }
}
