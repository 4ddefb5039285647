//! The cell file: which robots a cell has, where they stand and where their agents listen.
//!
//! ```text
//! text --file (YAML, positions kept)--> CellFile --validate--> CellConfig
//! ```
//! A [`CellConfig`] is valid in itself: names and endpoints are unique, every mount leads to the
//! world. Whether the robot files exist is for whoever opens them.

mod error;
mod file;
mod validate;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::messages::{CellRobot, Mount};

pub use error::{CellConfigError, CellProblem, Excerpt};

/// A cell, as its file describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct CellConfig {
    /// Name of the cell.
    pub cell: String,
    /// Prefix of every key, which keeps cells apart that share a network.
    pub namespace: Option<String>,
    /// Zenoh endpoints the gateway listens on.
    pub listen: Vec<String>,
    /// The robots, in the order of the file.
    pub robots: Vec<RobotEntry>,
    /// Timers of motions of several robots.
    pub motion: MotionTimers,
    /// How near robots may come to each other on such a motion.
    pub clearance: ClearanceConfig,
}

/// One robot of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotEntry {
    /// Name in the cell.
    pub name: RobotName,
    /// Its robot file; relative paths were resolved against the cell file's folder.
    pub file: PathBuf,
    /// Zenoh endpoint its agent listens on.
    pub endpoint: String,
    /// Whether `armada up` starts the emulator of the robot's vendor for it.
    pub emulate: bool,
    /// Where its root link is fixed.
    pub mount: Mount,
}

/// Timers of motions of several robots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionTimers {
    /// Least time from the commit to the common start.
    pub start_lead: Duration,
    /// Silence about a running part after which the whole motion fails.
    pub silence: Duration,
    /// Time that parts get to stand still after a cancel or a failure.
    pub ending: Duration,
    /// How well the clock of each agent must be known where robots are tied together.
    pub clock_budget: Duration,
}

impl Default for MotionTimers {
    /// 150 ms, 1 s, 3 s, 2 ms.
    fn default() -> Self {
        Self {
            start_lead: Duration::from_millis(150),
            silence: Duration::from_secs(1),
            ending: Duration::from_secs(3),
            clock_budget: Duration::from_millis(2),
        }
    }
}

/// How near robots may come to each other on a motion of several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClearanceConfig {
    /// The least distance between two robots \[m\].
    pub required_m: f64,
    /// Whether every motion of several robots is checked before it begins.
    pub check: bool,
}

impl Default for ClearanceConfig {
    /// 10 mm, checked.
    fn default() -> Self {
        Self { required_m: 0.01, check: true }
    }
}

impl CellConfig {
    /// Reads and checks the cell file at `path`.
    ///
    /// # Errors
    /// [`CellConfigError::Read`] if the file cannot be read, and as [`Self::parse`].
    pub fn load(path: &Path) -> Result<Self, CellConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|cause| CellConfigError::Read { path: path.to_owned(), cause })?;
        Self::parse(&text, path)
    }

    /// Checks the text of a cell file; `path` is where it came from.
    ///
    /// # Errors
    /// [`CellConfigError::Syntax`] if the text is not YAML of this form,
    /// [`CellConfigError::Invalid`] if a value makes no sense, each with its line.
    pub fn parse(text: &str, path: &Path) -> Result<Self, CellConfigError> {
        validate::checked(file::read(text, path)?, text, path)
    }

    /// The robots as they are published.
    pub fn cell_robots(&self) -> impl Iterator<Item = CellRobot> + '_ {
        self.robots.iter().map(|robot| CellRobot {
            robot: robot.name.clone(),
            mount: robot.mount.clone(),
            endpoint: robot.endpoint.clone(),
        })
    }
}
