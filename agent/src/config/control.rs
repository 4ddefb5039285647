//! The tables of a robot file about the control loop, publishing and Zenoh.

use std::path::PathBuf;
use std::time::Duration;

use armada_protocol::codec::WireEncoding;
use armada_protocol::messages::OperationalMode;
use serde::Deserialize;
use serde::de::Deserializer;

use super::{Problem, check_range, millis};

/// The control loop.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ControlConfig {
    /// Period of the loop \[ms\], 0.5 to 100; default 2.
    pub period_ms: f64,
    /// Age of feedback that is a loss of communication \[ms\], two periods to 5000; default 100.
    pub communication_timeout_ms: f64,
    /// How far a joint that turns may be from where a trajectory begins \[rad\]; default 0.02.
    pub start_tolerance_rad: f64,
    /// The same for one that slides \[m\]; default 0.005.
    pub start_tolerance_m: f64,
    /// How far a joint that turns may be from its set-point, lag allowed for \[rad\]; default 0.1.
    pub tracking_tolerance_rad: f64,
    /// The same for one that slides \[m\]; default 0.02.
    pub tracking_tolerance_m: f64,
    /// How far behind its set-point the robot is when it follows well \[ms\], 0 to 1000; default
    /// 10.
    pub tracking_lag_ms: f64,
    /// Speed below which a joint that turns stands still \[rad/s\]; default 0.01.
    pub standstill_velocity_rad_s: f64,
    /// The same for one that slides \[m/s\]; default 0.002.
    pub standstill_velocity_m_s: f64,
    /// How long every joint must be below \[ms\], 0 to 5000; default 100.
    pub standstill_hold_ms: f64,
    /// How long the controller has to switch its drives, clear its errors, take or end a move of its
    /// own \[ms\], 100 to 7000 (the contract lets clients wait 8000); default 5000.
    pub request_timeout_ms: f64,
    /// Silence of a stream of commands after which the robot decelerates \[ms\], 8 to 200; default
    /// 40. With streamed positions it begins when a sample is twice as late as usual, if that is
    /// sooner.
    pub stream_timeout_ms: f64,
    /// Highest age of the state that a sample of a stream was made for \[ms\], 20 to 1000; default
    /// 100. Clients need states that often: see `publish.state_rate_hz`.
    pub stream_max_age_ms: f64,
    /// How long the controller may search the references of one group of joints \[ms\], 100 to
    /// 600000; default 60000.
    pub homing_timeout_ms: f64,
    /// The operational mode of a controller that reports none; by default it is not known, which
    /// is as restricted as `manual_reduced_speed`.
    pub operational_mode: OperationalMode,
    /// Whether drives are switched on when the controller first answers; default false, and
    /// nothing else for a real robot.
    pub enable_on_start: bool,
    /// Whether modes are entered and motions are begun under a lease only, so that none outlives its
    /// client; default false: while nobody holds a lease anybody may command.
    pub lease_required: bool,
    /// Who makes single moves when nobody says: the agent (`never`, default), or the controller
    /// where it can (`auto`).
    pub delegate: Delegate,
    /// How the loop's thread is scheduled.
    pub realtime: RealtimeConfig,
}

/// How the loop's thread is scheduled; what the system does not permit is done without.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RealtimeConfig {
    /// Priority under SCHED_FIFO, 1 to 99; `null` leaves the ordinary scheduler. Default 80.
    pub priority: Option<u8>,
    /// The one processor the thread runs on, from 0; any by default.
    pub cpu: Option<u16>,
    /// Whether the program's memory is kept from being paged out; default true.
    pub lock_memory: bool,
}

/// Most rates at which the state is published besides.
const MAX_STATE_CLASSES: usize = 8;

/// Rates at which the state is published besides, if the file gives none \[Hz\].
const STATE_CLASSES_HZ: [u32; 3] = [1, 10, 30];

/// How many states are published in the time in which a sample of a stream has to refer to one.
const STATES_IN_MAX_AGE: f64 = 2.0;

/// What is published and how.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PublishConfig {
    /// How often the state is published \[Hz\], to the loop's rate; default 100. At least twice in
    /// `control.stream_max_age_ms`: a stream has to answer a state that is younger.
    pub state_rate_hz: f64,
    /// Rates at which the state is published besides, for clients that need less, each under a key
    /// of its own \[Hz\]: whole numbers of 1 to the loop's rate, at most 8, none twice; default 1,
    /// 10 and 30, as far as the loop is as fast.
    pub state_classes_hz: Option<Vec<u32>>,
    /// Encoding of what is published: `json` (default) or `msgpack`.
    #[serde(deserialize_with = "encoding")]
    pub encoding: WireEncoding,
}

/// The recorder of the control loop.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecorderConfig {
    /// How much of the loop is kept to be written down when a fault is latched \[s\], 0 to 60;
    /// default 10, 0 for none. One second takes some 2 kB for each tick.
    pub seconds: f64,
    /// Folder of the recordings; by default `armada-recordings` in the system's folder for
    /// temporary files.
    pub directory: Option<PathBuf>,
    /// How many recordings of the robot are kept, 1 to 1000; default 20.
    pub keep: usize,
}

/// Zenoh endpoints, such as `tcp/127.0.0.1:7450`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ZenohConfig {
    /// Where this agent listens; none by default.
    pub listen: Vec<String>,
    /// Where it connects to; none by default.
    pub connect: Vec<String>,
}

/// Who makes single moves when nobody says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Delegate {
    /// The agent: every set-point passes its limiter.
    #[default]
    Never,
    /// The controller, where it can; the agent else.
    Auto,
}

impl Default for ControlConfig {
    fn default() -> Self {
        Self {
            period_ms: 2.0,
            communication_timeout_ms: 100.0,
            start_tolerance_rad: 0.02,
            start_tolerance_m: 0.005,
            tracking_tolerance_rad: 0.1,
            tracking_tolerance_m: 0.02,
            tracking_lag_ms: 10.0,
            standstill_velocity_rad_s: 0.01,
            standstill_velocity_m_s: 0.002,
            standstill_hold_ms: 100.0,
            request_timeout_ms: 5000.0,
            stream_timeout_ms: 40.0,
            stream_max_age_ms: 100.0,
            homing_timeout_ms: 60_000.0,
            operational_mode: OperationalMode::Undefined,
            enable_on_start: false,
            lease_required: false,
            delegate: Delegate::Never,
            realtime: RealtimeConfig::default(),
        }
    }
}

impl Default for RealtimeConfig {
    fn default() -> Self {
        Self { priority: Some(80), cpu: None, lock_memory: true }
    }
}

impl Default for RecorderConfig {
    fn default() -> Self {
        Self { seconds: 10.0, directory: None, keep: 20 }
    }
}

impl RecorderConfig {
    pub(super) fn check(&self) -> Result<(), Problem> {
        check_range("seconds", self.seconds, 0.0..=60.0)?;
        check_range("keep", self.keep as f64, 1.0..=1000.0)
    }
}

impl Default for PublishConfig {
    fn default() -> Self {
        Self { state_rate_hz: 100.0, state_classes_hz: None, encoding: WireEncoding::Json }
    }
}

impl ControlConfig {
    /// Period of the loop.
    #[must_use]
    pub fn period(&self) -> Duration {
        millis(self.period_ms)
    }

    pub(super) fn check(&self) -> Result<(), Problem> {
        check_range("period_ms", self.period_ms, 0.5..=100.0)?;
        let two_periods = 2.0 * self.period_ms;
        check_range("communication_timeout_ms", self.communication_timeout_ms, two_periods..=5e3)?;
        check_range("start_tolerance_rad", self.start_tolerance_rad, 1e-5..=1.0)?;
        check_range("start_tolerance_m", self.start_tolerance_m, 1e-6..=1.0)?;
        check_range("tracking_tolerance_rad", self.tracking_tolerance_rad, 1e-5..=3.0)?;
        check_range("tracking_tolerance_m", self.tracking_tolerance_m, 1e-6..=1.0)?;
        check_range("tracking_lag_ms", self.tracking_lag_ms, 0.0..=1000.0)?;
        check_range("standstill_velocity_rad_s", self.standstill_velocity_rad_s, 1e-5..=0.5)?;
        check_range("standstill_velocity_m_s", self.standstill_velocity_m_s, 1e-6..=0.5)?;
        check_range("standstill_hold_ms", self.standstill_hold_ms, 0.0..=5e3)?;
        check_range("request_timeout_ms", self.request_timeout_ms, 100.0..=7e3)?;
        check_range("stream_timeout_ms", self.stream_timeout_ms, 8.0..=200.0)?;
        check_range("stream_max_age_ms", self.stream_max_age_ms, 20.0..=1e3)?;
        check_range("homing_timeout_ms", self.homing_timeout_ms, 100.0..=6e5)?;
        match self.realtime.priority {
            Some(priority) => check_range("realtime.priority", f64::from(priority), 1.0..=99.0),
            None => Ok(()),
        }
    }
}

impl PublishConfig {
    /// The rates of `state_classes_hz`, or the default ones that a loop of `loop_rate_hz` \[Hz\] has.
    #[must_use]
    pub fn state_classes(&self, loop_rate_hz: f64) -> Vec<u32> {
        let possible = |rate: &u32| f64::from(*rate) <= loop_rate_hz;
        let default = || STATE_CLASSES_HZ.into_iter().filter(possible).collect();
        self.state_classes_hz.clone().unwrap_or_else(default)
    }

    pub(super) fn check(&self, control: &ControlConfig) -> Result<(), Problem> {
        let loop_rate_hz = 1e3 / control.period_ms;
        check_range("state_rate_hz", self.state_rate_hz, 1.0..=loop_rate_hz)?;
        let max_age_ms = control.stream_max_age_ms;
        let lowest_hz = (STATES_IN_MAX_AGE * 1e3 / max_age_ms).min(loop_rate_hz);
        if self.state_rate_hz < lowest_hz {
            let text = format!(
                "{} is below {lowest_hz}: a stream needs a state that is younger than \
                 control.stream_max_age_ms, which is {max_age_ms}",
                self.state_rate_hz
            );
            return Err(Problem::new("state_rate_hz", text));
        }
        let classes = self.state_classes_hz.as_deref().unwrap_or_default();
        if classes.len() > MAX_STATE_CLASSES {
            let text = format!("{} rates, above the limit {MAX_STATE_CLASSES}", classes.len());
            return Err(Problem::new("state_classes_hz", text));
        }
        for (index, &rate) in classes.iter().enumerate() {
            check_range("state_classes_hz", f64::from(rate), 1.0..=loop_rate_hz)?;
            if classes.iter().take(index).any(|&earlier| earlier == rate) {
                return Err(Problem::new("state_classes_hz", format!("{rate} is given twice")));
            }
        }
        Ok(())
    }
}

impl ZenohConfig {
    pub(super) fn check(&self) -> Result<(), Problem> {
        for (list, endpoints) in [("listen", &self.listen), ("connect", &self.connect)] {
            for (index, endpoint) in endpoints.iter().enumerate() {
                let (protocol, address) = endpoint.split_once('/').unwrap_or_default();
                if protocol.is_empty() || address.is_empty() {
                    let text =
                        format!("{endpoint:?} is not an endpoint such as tcp/127.0.0.1:7450");
                    return Err(Problem::new(format!("{list}.{index}"), text));
                }
            }
        }
        Ok(())
    }
}

/// Names of the encodings in a robot file.
#[derive(Deserialize)]
enum EncodingName {
    #[serde(rename = "json")]
    Json,
    #[serde(rename = "msgpack")]
    MessagePack,
}

fn encoding<'de, D: Deserializer<'de>>(deserializer: D) -> Result<WireEncoding, D::Error> {
    Ok(match EncodingName::deserialize(deserializer)? {
        EncodingName::Json => WireEncoding::Json,
        EncodingName::MessagePack => WireEncoding::MessagePack,
    })
}
