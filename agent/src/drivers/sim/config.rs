//! The table `driver.sim` of a robot file.

use std::collections::BTreeMap;
use std::net::SocketAddr;

use armada_protocol::messages::OperationalMode;
use serde::Deserialize;

use super::settings::{
    HomingConfig, ParameterConfig, SignalConfig, check_parameters, check_signals,
    default_parameters, default_signals,
};
use super::{SimDriver, SimEmulator};
use crate::config::{Problem, check_range};
use crate::drivers::{DriverSetup, SetupError};

/// Settings of the emulated controller and of the way to it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the emulator listens for datagrams and the driver sends them, `127.0.0.1:47101`.
    pub address: SocketAddr,
    /// What the emulated controller is like.
    #[serde(default)]
    pub emulator: EmulatorConfig,
}

/// What the emulated controller is like. The driver reads of it only what a vendor's manual would
/// tell: signals, parameters, and what the controller can do.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatorConfig {
    /// Period of the controller, and of its status \[ms\], 0.5 to 100; the loop's own by default.
    pub cycle_ms: Option<f64>,
    /// Time constant of the lag with which a joint follows \[ms\], 1 to 1000; default 8.
    pub time_constant_ms: f64,
    /// Speed and acceleration of the drives over those of the robot file, 1 to 10; default 1.2.
    pub limit_ratio: f64,
    /// Deceleration of the brakes over the drives' acceleration, 0.5 to 100; default 2.
    pub brake_ratio: f64,
    /// Silence of commands in motion that ends it with an error \[ms\], 10 to 10000; default 100.
    pub watchdog_ms: f64,
    /// Silence after which another client may take over \[ms\], 10 to 60000; default 500.
    pub client_timeout_ms: f64,
    /// Time to switch the drives on \[ms\], 0 to 60000; default 200.
    pub enable_time_ms: f64,
    /// Delay of what comes in \[ms\], 0 to 500; default 0.
    pub command_latency_ms: f64,
    /// Delay of what goes out \[ms\], 0 to 500; default 0.
    pub status_latency_ms: f64,
    /// Standard deviation of measured positions of joints that turn \[rad\]; default 1e-5.
    pub position_noise_rad: f64,
    /// Standard deviation of measured positions of joints that slide \[m\]; default 1e-6.
    pub position_noise_m: f64,
    /// Standard deviation of measured speeds of joints that turn \[rad/s\]; default 1e-4.
    pub velocity_noise_rad_s: f64,
    /// Standard deviation of measured speeds of joints that slide \[m/s\]; default 1e-5.
    pub velocity_noise_m_s: f64,
    /// Seed of the noise; equal seeds give equal noise. Default 1.
    pub noise_seed: u64,
    /// Distance between reference and position that is an error \[rad\]; default 0.5.
    pub following_error_rad: f64,
    /// The same for joints that slide \[m\]; default 0.1.
    pub following_error_m: f64,
    /// Where the key switch stands at the start; default `cobot`.
    pub operational_mode: OperationalMode,
    /// Whether the pendant has control at the start; default false.
    pub local_control: bool,
    /// Whether drives go on in a manual mode only while the enabling switch is held; default false.
    pub enabling_switch_required: bool,
    /// What an open guard does; default `controlled_stop`.
    pub guard_stop: GuardStop,
    /// How joints find their references.
    pub homing: HomingConfig,
    /// Whether it offers moves of its own to joint positions and poses; default false.
    pub own_moves: bool,
    /// Highest speed of the tool in straight moves of its own \[m/s\]; default 1.
    pub tool_speed_m_s: f64,
    /// Poses that it reports, of the first two chains; default `none`.
    pub reports_tip: ReportsTip,
    /// Inputs and outputs, 32 values together at most; DI1 to DI4, DO1 to DO4, AI1, AO1 by default.
    pub signals: Vec<SignalConfig>,
    /// Settings, 16 at most; one of each type by default.
    pub parameters: Vec<ParameterConfig>,
    /// Where joints that turn are at the start \[rad\]; 0, or the limit next to it, if not named.
    pub initial_rad: BTreeMap<String, f64>,
    /// Where joints that slide are at the start \[m\]; as `initial_rad`.
    pub initial_m: BTreeMap<String, f64>,
}

/// What an open guard does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GuardStop {
    /// The drives decelerate at their limits and hold; they stay on.
    #[default]
    ControlledStop,
    /// Drives go off, brakes.
    DrivesOff,
}

/// What poses the controller reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReportsTip {
    /// None.
    #[default]
    None,
    /// Those of the flanges.
    Flange,
    /// Those of the tool centre points, with the tools it was told.
    Tcp,
}

impl Default for EmulatorConfig {
    fn default() -> Self {
        Self {
            cycle_ms: None,
            time_constant_ms: 8.0,
            limit_ratio: 1.2,
            brake_ratio: 2.0,
            watchdog_ms: 100.0,
            client_timeout_ms: 500.0,
            enable_time_ms: 200.0,
            command_latency_ms: 0.0,
            status_latency_ms: 0.0,
            position_noise_rad: 1e-5,
            position_noise_m: 1e-6,
            velocity_noise_rad_s: 1e-4,
            velocity_noise_m_s: 1e-5,
            noise_seed: 1,
            following_error_rad: 0.5,
            following_error_m: 0.1,
            operational_mode: OperationalMode::Cobot,
            local_control: false,
            enabling_switch_required: false,
            guard_stop: GuardStop::default(),
            homing: HomingConfig::default(),
            own_moves: false,
            tool_speed_m_s: 1.0,
            reports_tip: ReportsTip::default(),
            signals: default_signals(),
            parameters: default_parameters(),
            initial_rad: BTreeMap::new(),
            initial_m: BTreeMap::new(),
        }
    }
}

impl Config {
    /// Builds the client's side.
    ///
    /// # Errors
    /// As [`DriverSetup::joint_count`]; [`SetupError::Config`] if `address` has port 0.
    pub fn driver(&self, setup: &DriverSetup) -> Result<SimDriver, SetupError> {
        SimDriver::new(self, setup)
    }

    /// Builds the emulated controller.
    ///
    /// # Errors
    /// As [`DriverSetup::joint_count`]; [`SetupError::Config`] if an initial position names a joint
    /// that the robot does not have or that moves in another unit, or lies outside its limits.
    pub fn emulator(&self, setup: &DriverSetup) -> Result<SimEmulator, SetupError> {
        SimEmulator::new(self, setup)
    }

    pub(crate) fn check(&self) -> Result<(), Problem> {
        self.emulator.check().map_err(|problem| problem.under("emulator"))
    }
}

impl EmulatorConfig {
    fn check(&self) -> Result<(), Problem> {
        if let Some(cycle_ms) = self.cycle_ms {
            check_range("cycle_ms", cycle_ms, 0.5..=100.0)?;
        }
        check_range("time_constant_ms", self.time_constant_ms, 1.0..=1000.0)?;
        check_range("limit_ratio", self.limit_ratio, 1.0..=10.0)?;
        check_range("brake_ratio", self.brake_ratio, 0.5..=100.0)?;
        check_range("watchdog_ms", self.watchdog_ms, 10.0..=10_000.0)?;
        check_range("client_timeout_ms", self.client_timeout_ms, 10.0..=60_000.0)?;
        check_range("enable_time_ms", self.enable_time_ms, 0.0..=60_000.0)?;
        check_range("command_latency_ms", self.command_latency_ms, 0.0..=500.0)?;
        check_range("status_latency_ms", self.status_latency_ms, 0.0..=500.0)?;
        check_range("position_noise_rad", self.position_noise_rad, 0.0..=0.1)?;
        check_range("position_noise_m", self.position_noise_m, 0.0..=0.1)?;
        check_range("velocity_noise_rad_s", self.velocity_noise_rad_s, 0.0..=1.0)?;
        check_range("velocity_noise_m_s", self.velocity_noise_m_s, 0.0..=1.0)?;
        check_range("following_error_rad", self.following_error_rad, 1e-4..=100.0)?;
        check_range("following_error_m", self.following_error_m, 1e-4..=100.0)?;
        check_range("tool_speed_m_s", self.tool_speed_m_s, 1e-3..=100.0)?;
        if self.operational_mode == OperationalMode::Undefined {
            return Err(Problem::new("operational_mode", "undefined is no position of a switch"));
        }
        self.homing.check().map_err(|problem| problem.under("homing"))?;
        check_signals(&self.signals)?;
        check_parameters(&self.parameters)?;
        for (table, values) in [("initial_rad", &self.initial_rad), ("initial_m", &self.initial_m)]
        {
            for (joint, &position) in values {
                check_range(joint, position, -1000.0..=1000.0).map_err(|p| p.under(table))?;
            }
        }
        Ok(())
    }
}
