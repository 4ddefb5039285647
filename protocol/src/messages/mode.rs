//! Modes, controller states and flags of a robot.
//!
//! Source: Robot Raconteur `com.robotraconteur.robotics.robot` service definition 0.10.

use serde::{Deserialize, Serialize};

/// What kind of command the robot's agent follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CommandMode {
    /// No motion is possible: a fault, no communication, or not ready.
    #[default]
    InvalidState,
    /// Standing still; the mode from which all others are entered.
    Halt,
    /// Point-to-point moves of single joints.
    Jog,
    /// Timed trajectories.
    Trajectory,
    /// Streamed joint positions.
    PositionCommand,
    /// Streamed joint velocities.
    VelocityCommand,
    /// Searching the joints' reference positions.
    Homing,
}

/// Where the controller's key switch stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OperationalMode {
    /// Not known.
    #[default]
    Undefined,
    /// By hand, at reduced speed.
    ManualReducedSpeed,
    /// By hand, at full speed.
    ManualFullSpeed,
    /// Automatic operation.
    Auto,
    /// Collaborative operation.
    Cobot,
}

/// What the robot's controller does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControllerState {
    /// Not known: no communication.
    #[default]
    Undefined,
    /// Starting up.
    Init,
    /// Drives are on.
    MotorOn,
    /// Drives are off.
    MotorOff,
    /// Stopped by a safeguard or an error.
    GuardStop,
    /// Stopped by an emergency stop.
    EmergencyStop,
    /// The emergency stop is being reset.
    EmergencyStopReset,
}

/// Conditions of a robot as a bit set; [`RobotFlags::NAMES`] gives each bit its name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct RobotFlags(u64);

impl RobotFlags {
    /// An error is present or latched.
    pub const ERROR: Self = Self(0x1);
    /// An error that no reset clears.
    pub const FATAL_ERROR: Self = Self(0x2);
    /// An emergency stop or a latched stop is in force.
    pub const ESTOP: Self = Self(0x4);
    /// The stop was asked for by software: Armada's own latch.
    pub const ESTOP_SOFTWARE: Self = Self(0x800);
    /// The emergency stop came from the controller's own circuit.
    pub const ESTOP_INTERNAL: Self = Self(0x2000);
    /// Drives are on.
    pub const ENABLED: Self = Self(0x2_0000);
    /// The controller takes commands.
    pub const READY: Self = Self(0x4_0000);
    /// No feedback has come for longer than the allowed time.
    pub const COMMUNICATION_FAILURE: Self = Self(0x20_0000);
    /// A trajectory is in progress.
    pub const TRAJECTORY_RUNNING: Self = Self(0x400_0000);

    /// Every bit with its name on the wire, lowest bit first.
    pub const NAMES: [(&'static str, Self); 9] = [
        ("error", Self::ERROR),
        ("fatal_error", Self::FATAL_ERROR),
        ("estop", Self::ESTOP),
        ("estop_software", Self::ESTOP_SOFTWARE),
        ("estop_internal", Self::ESTOP_INTERNAL),
        ("enabled", Self::ENABLED),
        ("ready", Self::READY),
        ("communication_failure", Self::COMMUNICATION_FAILURE),
        ("trajectory_running", Self::TRAJECTORY_RUNNING),
    ];

    /// No bit set.
    pub const NONE: Self = Self(0);

    /// The bits as a number.
    #[must_use]
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Whether all bits of `other` are set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// These bits, and those of `other` if `condition` holds.
    #[must_use]
    pub const fn with(self, other: Self, condition: bool) -> Self {
        if condition { Self(self.0 | other.0) } else { self }
    }

    /// Names of the bits that are set.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(_, bit)| self.contains(*bit)).map(|(name, _)| name)
    }
}
