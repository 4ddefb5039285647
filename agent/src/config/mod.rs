//! The robot file: everything an agent is told about its robot.
//!
//! ```text
//! YAML --serde--> RobotConfig --check--> valid by itself
//!                 RobotConfig + RobotModel --robot--> joints, chains, control::Params
//! ```
//!
//! A value that no robot may have is refused when the file is loaded, one that does not fit the
//! robot description when the two meet; both errors name file, line, field, value and limit.

mod chains;
mod control;
mod error;
mod joints;
mod locate;
mod problem;
mod robot;
mod stop;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::time::Duration;

use armada_model::{MAX_JOINTS, Pose, RobotModel};
use armada_protocol::RobotName;
use armada_protocol::messages::ToolInfo;
use serde::Deserialize;
use uuid::Uuid;

pub use chains::ChainConfig;
pub use control::{
    ControlConfig, Delegate, PublishConfig, RealtimeConfig, RecorderConfig, ZenohConfig,
};
pub use error::ConfigError;
pub use joints::{JointConfig, JointOverrides};
pub use problem::Problem;
pub(crate) use problem::check_range;
pub use stop::{ResetConfig, StopConfig, StopSourceConfig};

use crate::drivers::DriverConfig;
use locate::Origin;

/// Largest robot file \[bytes\].
const MAX_FILE: usize = 1 << 20;

/// One robot: who it is, its joints, how its control loop runs and how its controller is reached.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// Name in the cell.
    pub robot: RobotName,
    /// Identity that stays the same over restarts and renaming.
    pub uuid: Uuid,
    /// Model name of the maker.
    pub model: String,
    /// Serial number; empty if not known.
    #[serde(default)]
    pub serial: String,
    /// Path of the robot description; in the file relative to the file, here to be opened as is.
    pub urdf: PathBuf,
    /// The driven joints in the order of every vector, 1 to 16. Driven joints of the description
    /// that are not named are not moved by this robot.
    #[serde(deserialize_with = "joints::names_or_table")]
    pub joints: Vec<JointConfig>,
    /// Chains whose tip poses are reported; none by default.
    #[serde(default)]
    pub chains: Vec<ChainConfig>,
    /// Tools that can be attached by their names; none by default.
    #[serde(default)]
    pub tools: Vec<ToolInfo>,
    /// Where the root of the robot description stands in the world; at its origin by default.
    #[serde(default)]
    pub mount: Pose,
    /// The control loop.
    #[serde(default)]
    pub control: ControlConfig,
    /// Stops, and what a reset needs.
    #[serde(default)]
    pub stop: StopConfig,
    /// What is published and how.
    #[serde(default)]
    pub publish: PublishConfig,
    /// The recorder of the control loop.
    #[serde(default)]
    pub recorder: RecorderConfig,
    /// Zenoh endpoints of this agent; the cell file normally gives them.
    #[serde(default)]
    pub zenoh: ZenohConfig,
    /// The driver of the controller: exactly one vendor's table.
    pub driver: DriverConfig,
    /// Where the values stand, for errors that are found later.
    #[serde(skip)]
    origin: Origin,
}

impl RobotConfig {
    /// Reads and checks a robot file.
    ///
    /// # Errors
    /// [`ConfigError::Read`] if it cannot be read, else as [`RobotConfig::from_yaml`].
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = error::read(path)?;
        let base = path.parent().unwrap_or_else(|| Path::new(""));
        Self::from_yaml(&text, &path.display().to_string(), base)
    }

    /// The checked robot file with this `text`; `label` names it in errors, paths in it are
    /// relative to `base_dir`.
    ///
    /// # Errors
    /// [`ConfigError::TooLarge`] above 1 MiB; [`ConfigError::Syntax`] if it is no YAML or not of
    /// the form of a robot file; [`ConfigError::Invalid`] if a value is not allowed.
    pub fn from_yaml(text: &str, label: &str, base_dir: &Path) -> Result<Self, ConfigError> {
        if text.len() > MAX_FILE {
            let (label, bytes) = (label.to_owned(), text.len());
            return Err(ConfigError::TooLarge { label, bytes, limit: MAX_FILE });
        }
        let origin = Origin::new(label, text);
        let parsed = serde_saphyr::from_str_with_options(text, locate::options());
        let mut config: Self = parsed.map_err(|error| origin.syntax(&error))?;
        config.origin = origin;
        config.check().map_err(|problem| config.error(problem))?;
        config.urdf = base_dir.join(&config.urdf);
        config.stop.resolve(base_dir);
        Ok(config)
    }

    /// Reads the robot description: its text, and the model it describes.
    ///
    /// # Errors
    /// [`ConfigError::Read`] if it cannot be read, [`ConfigError::Urdf`] if it is not a robot
    /// description.
    pub fn read_urdf(&self) -> Result<(String, RobotModel), ConfigError> {
        let text = error::read(&self.urdf)?;
        let model = RobotModel::from_urdf(&text, &self.urdf.display().to_string())?;
        Ok((text, model))
    }

    /// `problem` with the file and line it is found in.
    fn error(&self, problem: Problem) -> ConfigError {
        self.origin.error(problem)
    }

    fn check(&self) -> Result<(), Problem> {
        if self.uuid.is_nil() {
            return Err(Problem::new("uuid", "is nil, which identifies nothing"));
        }
        check_text("model", &self.model, 1)?;
        check_text("serial", &self.serial, 0)?;
        if self.urdf.as_os_str().is_empty() {
            return Err(Problem::new("urdf", "is empty"));
        }
        self.check_joints()?;
        self.check_chains()?;
        self.check_tools()?;
        self.control.check().map_err(|problem| problem.under("control"))?;
        self.publish.check(&self.control).map_err(|problem| problem.under("publish"))?;
        self.stop.check().map_err(|problem| problem.under("stop"))?;
        self.recorder.check().map_err(|problem| problem.under("recorder"))?;
        self.zenoh.check().map_err(|problem| problem.under("zenoh"))?;
        self.driver.check().map_err(|problem| problem.under("driver"))
    }

    fn check_joints(&self) -> Result<(), Problem> {
        let count = self.joints.len();
        if count == 0 || count > MAX_JOINTS {
            let text = format!("{count} joints, but a robot has 1 to {MAX_JOINTS}");
            return Err(Problem::new("joints", text));
        }
        for (index, joint) in self.joints.iter().enumerate() {
            check_text("joints", &joint.name, 1)?;
            if self.joints.iter().take(index).any(|earlier| earlier.name == joint.name) {
                return Err(Problem::new("joints", format!("{:?} is named twice", joint.name)));
            }
            joint.check()?;
        }
        Ok(())
    }
}

/// A time given in milliseconds; zero if it is negative, not finite or longer than any time.
pub(crate) fn millis(milliseconds: f64) -> Duration {
    Duration::try_from_secs_f64(milliseconds / 1e3).unwrap_or_default()
}

/// Longest name or other text \[bytes\].
const MAX_TEXT: usize = 256;

fn check_text(field: &str, text: &str, min: usize) -> Result<(), Problem> {
    if text.len() < min {
        return Err(Problem::new(field, "is empty"));
    }
    if text.len() > MAX_TEXT {
        let problem = format!("{} bytes long, above the limit {MAX_TEXT}", text.len());
        return Err(Problem::new(field, problem));
    }
    Ok(())
}
