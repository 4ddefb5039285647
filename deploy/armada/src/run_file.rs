//! The file by which a running `armada up` tells other terminals of this user where its cell is.
//!
//! `{temporary directory}/armada-{uid}/cells/{cell}.json`, in a directory that only the user may
//! enter, written whole or not at all, and removed at the end. One whose process is gone counts
//! for nothing.

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use armada_protocol::RobotName;
use rustix::process::{Pid, getuid, test_kill_process};
use serde::{Deserialize, Serialize};

/// Where a cell that runs on this machine is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RunFile {
    /// Process of `armada up`.
    pub(crate) pid: u32,
    /// Name of the cell.
    pub(crate) cell: String,
    /// Prefix of every key.
    pub(crate) namespace: Option<String>,
    /// Zenoh endpoint of the gateway.
    pub(crate) gateway: String,
    /// The robots with their agents.
    pub(crate) robots: Vec<RunRobot>,
}

/// A robot of a running cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RunRobot {
    /// Its name.
    pub(crate) robot: RobotName,
    /// Zenoh endpoint of its agent.
    pub(crate) endpoint: String,
}

/// A written run file; removed when dropped.
#[derive(Debug)]
pub(crate) struct Written {
    path: PathBuf,
}

/// The directory of this user's run files.
pub(crate) fn directory() -> PathBuf {
    std::env::temp_dir().join(format!("armada-{}", getuid().as_raw())).join("cells")
}

/// Writes `run` into `directory`, or fails if that cell runs already.
pub(crate) fn write(directory: &Path, run: &RunFile) -> anyhow::Result<Written> {
    make_private(directory)?;
    let path = directory.join(file_name(&run.cell));
    if let Some(other) = read(&path).filter(|other| other.pid != run.pid && is_alive(other.pid)) {
        bail!(
            "cell {} runs already, as process {}: end that first, or give the cell file another \
             name and ports",
            other.cell,
            other.pid
        );
    }
    let text = serde_json::to_vec_pretty(run)?;
    let draft = directory.join(format!(".{}.{}", file_name(&run.cell), run.pid));
    let written = fs::File::create(&draft)
        .and_then(|mut file| file.write_all(&text))
        .and_then(|()| fs::rename(&draft, &path));
    written.with_context(|| format!("cannot write {}", path.display()))?;
    Ok(Written { path })
}

/// The cells that run now, by name.
pub(crate) fn running(directory: &Path) -> Vec<RunFile> {
    if check_private(directory).is_err() {
        return Vec::new();
    }
    let Ok(entries) = fs::read_dir(directory) else { return Vec::new() };
    let mut runs: Vec<RunFile> = entries
        .filter_map(Result::ok)
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        .filter_map(|path| read(&path))
        .filter(|run| is_alive(run.pid))
        .collect();
    runs.sort_by(|a, b| a.cell.cmp(&b.cell));
    runs
}

impl Drop for Written {
    fn drop(&mut self) {
        // One that stays is ignored, for its process is gone.
        drop(fs::remove_file(&self.path));
    }
}

fn read(path: &Path) -> Option<RunFile> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}

/// The name of a cell as a file name that cannot leave its directory.
fn file_name(cell: &str) -> String {
    format!("{}.json", safe_name(cell))
}

/// The name of a cell as one part of a path.
pub(crate) fn safe_name(cell: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    cell.chars().map(safe).collect()
}

fn is_alive(pid: u32) -> bool {
    let pid = i32::try_from(pid).ok().and_then(Pid::from_raw);
    pid.is_some_and(|pid| test_kill_process(pid) != Err(rustix::io::Errno::SRCH))
}

fn make_private(directory: &Path) -> anyhow::Result<()> {
    fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(directory)
        .with_context(|| format!("cannot make {}", directory.display()))?;
    check_private(directory)
}

/// In a temporary directory that all users share, another user may have made ours before us.
fn check_private(directory: &Path) -> anyhow::Result<()> {
    for path in [Some(directory), directory.parent()].into_iter().flatten() {
        let about = fs::symlink_metadata(path)
            .with_context(|| format!("cannot look at {}", path.display()))?;
        if !about.is_dir() || about.uid() != getuid().as_raw() || about.mode() & 0o022 != 0 {
            bail!("{} is not a directory that only this user can write to", path.display());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    fn run(cell: &str, pid: u32) -> RunFile {
        RunFile {
            pid,
            cell: cell.to_owned(),
            namespace: Some("cell7".to_owned()),
            gateway: "tcp/127.0.0.1:7447".to_owned(),
            robots: vec![RunRobot {
                robot: "left_arm".parse().expect("a name"),
                endpoint: "tcp/127.0.0.1:7501".to_owned(),
            }],
        }
    }

    fn cells(base: &tempfile::TempDir) -> PathBuf {
        base.path().join("armada").join("cells")
    }

    #[test]
    fn a_written_run_is_found_until_it_ends() {
        let base = tempfile::tempdir().expect("a directory");
        let written = write(&cells(&base), &run("dual", std::process::id())).expect("written");
        assert_eq!(running(&cells(&base)), [run("dual", std::process::id())]);
        let mode = fs::metadata(cells(&base)).expect("made").permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
        drop(written);
        assert_eq!(running(&cells(&base)), []);
    }

    #[test]
    fn a_run_whose_process_is_gone_counts_for_nothing() {
        let base = tempfile::tempdir().expect("a directory");
        let mut child = std::process::Command::new("true").spawn().expect("a process");
        let pid = child.id();
        child.wait().expect("it ends");
        let _kept = write(&cells(&base), &run("dual", pid)).expect("written");
        assert_eq!(running(&cells(&base)), []);
        let own = run("dual", std::process::id());
        let _written = write(&cells(&base), &own).expect("takes its place");
        assert_eq!(running(&cells(&base)), [own]);
    }

    #[test]
    fn the_same_cell_is_not_started_twice() {
        let base = tempfile::tempdir().expect("a directory");
        let _first = write(&cells(&base), &run("dual", 1)).expect("process 1 always runs");
        let error = write(&cells(&base), &run("dual", std::process::id())).expect_err("runs");
        assert!(error.to_string().contains("runs already, as process 1"), "{error}");
    }

    #[test]
    fn a_directory_that_others_may_write_to_is_not_trusted() {
        let base = tempfile::tempdir().expect("a directory");
        let _written = write(&cells(&base), &run("dual", std::process::id())).expect("written");
        fs::set_permissions(cells(&base), fs::Permissions::from_mode(0o777)).expect("set");
        assert_eq!(running(&cells(&base)), []);
        assert!(write(&cells(&base), &run("other", std::process::id())).is_err());
    }

    #[test]
    fn a_cell_name_cannot_leave_the_directory() {
        assert_eq!(file_name("../../etc/x y"), "______etc_x_y.json");
    }
}
