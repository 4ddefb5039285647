//! One joint of the emulated controller: the joint, its drive, its supervision.

use armada_model::JointType;
use armada_protocol::messages::JointInfo;

use super::EmulatorConfig;
use super::dynamics::{Drive, Joint};
use crate::drivers::{DriverSetup, SetupError};

/// How far past a position limit the joint hits a mechanical stop \[rad or m\].
const STOP_DISTANCE: f64 = 0.05;
/// How far past a position limit the controller lets pass, for noise and rounding \[rad or m\].
const LIMIT_TOLERANCE: f64 = 1e-3;
/// Effort limit of a joint that has none \[Nm or N\].
const DEFAULT_EFFORT: f64 = 100.0;

/// One joint with its drive and its supervision.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) joint: Joint,
    pub(super) drive: Drive,
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) following_error: f64,
    pub(super) position_noise: f64,
    pub(super) velocity_noise: f64,
    pub(super) blocked: bool,
}

impl Axis {
    /// The joint of `info` at rest where the file says it begins.
    pub(super) fn new(config: &EmulatorConfig, info: &JointInfo) -> Result<Self, SetupError> {
        let limits = &info.limits;
        let acceleration = limits
            .acceleration
            .ok_or_else(|| SetupError::NoAcceleration { joint: info.name.clone() })?;
        let slides = info.joint_type == JointType::Prismatic;
        let of_type = |rad: f64, m: f64| if slides { m } else { rad };
        let lower = limits.lower.unwrap_or(f64::NEG_INFINITY);
        let upper = limits.upper.unwrap_or(f64::INFINITY);
        let drive = Drive {
            velocity: config.limit_ratio * limits.velocity,
            acceleration: config.limit_ratio * acceleration,
            brake: config.brake_ratio * config.limit_ratio * acceleration,
            time_constant: config.time_constant_ms / 1e3,
            lower_stop: lower - STOP_DISTANCE,
            upper_stop: upper + STOP_DISTANCE,
            effort: limits.effort.unwrap_or(DEFAULT_EFFORT),
            turns: !slides,
        };
        Ok(Self {
            joint: Joint::at(initial_position(config, info)?),
            drive,
            lower,
            upper,
            following_error: of_type(config.following_error_rad, config.following_error_m),
            position_noise: of_type(config.position_noise_rad, config.position_noise_m),
            velocity_noise: of_type(config.velocity_noise_rad_s, config.velocity_noise_m_s),
            blocked: false,
        })
    }

    /// Whether `position` lies past a limit in the direction of `motion`; the way back is free.
    pub(super) fn passes_limit(&self, position: f64, motion: f64) -> bool {
        (position > self.upper + LIMIT_TOLERANCE && motion > 0.0)
            || (position < self.lower - LIMIT_TOLERANCE && motion < 0.0)
    }
}

fn initial_position(config: &EmulatorConfig, info: &JointInfo) -> Result<f64, SetupError> {
    let (lower, upper) = (info.limits.lower, info.limits.upper);
    let slides = info.joint_type == JointType::Prismatic;
    let (field, table, other) = if slides {
        ("initial_m", &config.initial_m, &config.initial_rad)
    } else {
        ("initial_rad", &config.initial_rad, &config.initial_m)
    };
    if other.contains_key(&info.name) {
        let wrong = if slides { "initial_rad" } else { "initial_m" };
        let verb = if slides { "slides" } else { "turns" };
        return Err(initial_error(wrong, &info.name, format!("the joint {verb}, give {field}")));
    }
    let Some(&position) = table.get(&info.name) else {
        let near = upper.map_or(0.0, |upper| upper.min(0.0));
        return Ok(lower.map_or(near, |lower| lower.max(near)));
    };
    if !info.limits.contains(position) {
        let (lower, upper) = (lower.unwrap_or(f64::NEG_INFINITY), upper.unwrap_or(f64::INFINITY));
        let limits = format!("{lower} to {upper}");
        let problem = format!("{position} is outside the joint's limits {limits}");
        return Err(initial_error(field, &info.name, problem));
    }
    Ok(position)
}

/// Refuses initial positions of joints that the robot does not have.
pub(super) fn check_initial_names(
    config: &EmulatorConfig,
    setup: &DriverSetup,
) -> Result<(), SetupError> {
    for (field, table) in [("initial_rad", &config.initial_rad), ("initial_m", &config.initial_m)] {
        let unknown =
            |name: &&String| setup.joints.iter().all(|joint| joint.name.as_str() != name.as_str());
        if let Some(name) = table.keys().find(unknown) {
            return Err(initial_error(field, name, "the robot has no such joint".to_owned()));
        }
    }
    Ok(())
}

fn initial_error(field: &str, joint: &str, problem: String) -> SetupError {
    SetupError::Config { vendor: "sim", field: format!("emulator.{field}.{joint}"), problem }
}
