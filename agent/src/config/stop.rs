//! The table of a robot file about stops and what a reset needs.

use std::path::{Path, PathBuf};
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::messages::{ResetZone, SignalInfo, SignalType, StopLevel};
use armada_protocol::signature::SigningKey;
use serde::Deserialize;

use super::{ConfigError, Problem, RobotConfig, check_range};
use crate::control::MAX_STOP_TIME;
use crate::stop_sources::StopSourceSetting;

/// Most sources of stops that have to check in.
const MAX_SOURCES: usize = 16;

/// Stops, and what a reset needs.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StopConfig {
    /// How long a stop may take to measured standstill \[s\], 0.05 to 60, before its level is
    /// raised; by default twice the longest ramp from full speed, and a second.
    pub time_s: Option<f64>,
    /// Whether an emergency stop of this controller stops the whole cell; it does not by default.
    pub estop_stops_cell: bool,
    /// What a reset needs besides the list of stops.
    pub reset: ResetConfig,
    /// Sources elsewhere that have to check in; none by default.
    pub sources: Vec<StopSourceConfig>,
}

/// What a reset needs besides the list of stops.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ResetConfig {
    /// Whether somebody has to acknowledge at the arm first; nobody has to by default.
    pub zone: ResetZone,
    /// Signal of the controller, on or off, whose rise is the acknowledgement; with zone `manual`.
    pub acknowledge_signal: Option<String>,
    /// File with the key that resets have to be signed with, relative to this file; none by
    /// default.
    pub key_file: Option<PathBuf>,
}

/// A source of stops that has to check in.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopSourceConfig {
    /// Its name, of the form of a robot's.
    pub name: String,
    /// How hard it stops; L1 by default.
    #[serde(default = "default_level")]
    pub level: StopLevel,
    /// File with the key that its check-ins have to be signed with, relative to this file; none by
    /// default.
    #[serde(default)]
    pub key_file: Option<PathBuf>,
}

const fn default_level() -> StopLevel {
    StopLevel::L1
}

impl StopConfig {
    /// How long a stop may take, if the file says so.
    #[must_use]
    pub fn time(&self) -> Option<Duration> {
        self.time_s.and_then(|time_s| Duration::try_from_secs_f64(time_s).ok())
    }

    pub(super) fn check(&self) -> Result<(), Problem> {
        if let Some(time_s) = self.time_s {
            check_range("time_s", time_s, 0.05..=MAX_STOP_TIME.as_secs_f64())?;
        }
        self.reset.check().map_err(|problem| problem.under("reset"))?;
        if self.sources.len() > MAX_SOURCES {
            let text = format!("{} sources, above the limit {MAX_SOURCES}", self.sources.len());
            return Err(Problem::new("sources", text));
        }
        for (index, source) in self.sources.iter().enumerate() {
            let refuse = |text: &str| {
                let text = format!("{:?} {text}", source.name);
                Err(Problem::new(format!("sources.{index}.name"), text))
            };
            if source.name.parse::<RobotName>().is_err() {
                return refuse("is not a name: 1 to 64 of a-z, 0-9 and _, beginning with a letter");
            }
            if self.sources.iter().take(index).any(|earlier| earlier.name == source.name) {
                return refuse("is named twice");
            }
        }
        Ok(())
    }

    /// Makes the paths relative to `base` ones that can be opened as they are.
    pub(super) fn resolve(&mut self, base: &Path) {
        let sources = self.sources.iter_mut().map(|source| &mut source.key_file);
        for path in sources.chain([&mut self.reset.key_file]).flatten() {
            *path = base.join(&*path);
        }
    }
}

impl ResetConfig {
    fn check(&self) -> Result<(), Problem> {
        match (self.zone, &self.acknowledge_signal) {
            (ResetZone::Manual, None) => {
                let text = "is missing: in zone manual no reset could ever succeed without it";
                Err(Problem::new("acknowledge_signal", text))
            }
            (ResetZone::Remote, Some(_)) => {
                let text = "is given, but in zone remote nobody acknowledges";
                Err(Problem::new("acknowledge_signal", text))
            }
            _ => Ok(()),
        }
    }
}

impl RobotConfig {
    /// Which of a controller's signals, in their order, acknowledges at the arm; `None` if nobody
    /// has to.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if the controller has no such signal, or it is not simply on or off:
    /// no reset could ever succeed.
    pub fn acknowledge_signal(&self, signals: &[SignalInfo]) -> Result<Option<usize>, ConfigError> {
        let Some(name) = &self.stop.reset.acknowledge_signal else { return Ok(None) };
        let refuse = |text: String| self.error(Problem::new("stop.reset.acknowledge_signal", text));
        let found = signals.iter().enumerate().find(|(_, signal)| signal.name == *name);
        let Some((index, signal)) = found else {
            let names: Vec<_> = signals.iter().map(|signal| signal.name.as_str()).collect();
            let text =
                format!("the controller has no signal {name:?}, it has {}", names.join(", "));
            return Err(refuse(text));
        };
        if signal.signal_type != SignalType::Digital || signal.size != 1 {
            return Err(refuse(format!("{name:?} is not a signal that is on or off")));
        }
        Ok(Some(index))
    }

    /// The key that resets have to be signed with, if they do.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if its file cannot be read or is empty: no reset could ever succeed.
    pub fn reset_key(&self) -> Result<Option<SigningKey>, ConfigError> {
        self.key("stop.reset.key_file", self.stop.reset.key_file.as_deref())
    }

    /// The sources of stops that have to check in.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if the file of a key cannot be read or is empty: its source would be
    /// pressed for ever.
    pub fn stop_sources(&self) -> Result<Vec<StopSourceSetting>, ConfigError> {
        let setting = |(index, source): (usize, &StopSourceConfig)| {
            let field = format!("stop.sources.{index}.key_file");
            let key = self.key(&field, source.key_file.as_deref())?;
            Ok(StopSourceSetting { name: source.name.clone(), level: source.level, key })
        };
        self.stop.sources.iter().enumerate().map(setting).collect()
    }

    fn key(&self, field: &str, path: Option<&Path>) -> Result<Option<SigningKey>, ConfigError> {
        let key = path.map(SigningKey::read).transpose();
        key.map_err(|error| self.error(Problem::new(field, error.to_string())))
    }
}
