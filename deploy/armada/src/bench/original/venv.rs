//! The Python that has the original: one that is given, or a virtual environment in the cache.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

use anyhow::{Context as _, bail};
use serde::{Deserialize, Serialize};
use tokio::process::Command;

use super::SCRIPT;
use crate::bench::python::Python;
use crate::output::Progress;

/// What is installed, in the versions that were measured.
const REQUIREMENTS: [&str; 3] = [
    "robotraconteur==1.2.9",
    "robotraconteurcompanion==0.4.0",
    "robotraconteur-abstract-robot==0.2.2",
];
/// Folder in the cache; another one for other versions.
const FOLDER: &str = "armada/abstract-robot-0.2.2";
/// File that is there when the installation was completed.
const COMPLETE: &str = "complete";

/// What the Python has.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(super) struct Versions {
    /// Version of Python.
    python: String,
    /// Version of each package, `None` if it is not installed.
    packages: BTreeMap<String, Option<String>>,
}

/// The Python that was given, else the one in the cache, which is installed if it is not there.
///
/// # Errors
/// It cannot be run or installed, or lacks a package; the message tells what to do.
pub(super) async fn find(
    given: Option<&Path>,
    progress: &mut Progress,
) -> anyhow::Result<(PathBuf, Versions)> {
    let program = match given {
        Some(given) => given.to_owned(),
        None => installed(progress).await?,
    };
    let arguments = ["versions".to_owned()];
    let (python, versions) = Python::start::<Versions>(&program, SCRIPT, &arguments).await?;
    python.end().await?;
    let missing: Vec<_> =
        versions.packages.iter().filter(|(_, v)| v.is_none()).map(|(name, _)| &**name).collect();
    if !missing.is_empty() {
        bail!("{} lacks {}: {}", program.display(), missing.join(", "), remedy(&program));
    }
    Ok((program, versions))
}

async fn installed(progress: &mut Progress) -> anyhow::Result<PathBuf> {
    let folder = cache()?.join(FOLDER);
    let (program, complete) = (folder.join("bin/python"), folder.join(COMPLETE));
    if complete.exists() {
        return Ok(program);
    }
    progress.show(&format!("installing the original into {}", folder.display()));
    let mut make = Command::new("python3");
    run(make.args(["-m", "venv", "--clear"]).arg(&folder)).await?;
    let mut install = Command::new(&program);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    run(install.args(REQUIREMENTS)).await?;
    std::fs::write(&complete, "").with_context(|| complete.display().to_string())?;
    Ok(program)
}

async fn run(command: &mut Command) -> anyhow::Result<()> {
    let output = command.stdin(Stdio::null()).kill_on_drop(true).output().await;
    let why = match output {
        Ok(output) if output.status.success() => return Ok(()),
        Ok(output) => last_line(&output),
        Err(error) => error.to_string(),
    };
    bail!(
        "cannot install the original, which is fetched from the Python package index over the \
         network: {why}; where there is none, give a Python that has it with --python PROGRAM: {}",
        remedy(Path::new("PROGRAM"))
    );
}

fn last_line(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr);
    let line = text.lines().rfind(|line| !line.trim().is_empty());
    line.map_or_else(|| output.status.to_string(), |line| line.trim().to_owned())
}

fn remedy(program: &Path) -> String {
    format!("{} -m pip install {}", program.display(), REQUIREMENTS.join(" "))
}

/// The user's folder for what can be made again.
fn cache() -> anyhow::Result<PathBuf> {
    let of = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let cache = of("XDG_CACHE_HOME").or_else(|| Some(of("HOME")?.join(".cache")));
    cache.context("neither XDG_CACHE_HOME nor HOME is set: give a Python with --python PROGRAM")
}
