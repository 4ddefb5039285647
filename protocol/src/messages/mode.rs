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
    /// The first emergency stop button is pressed.
    pub const ESTOP_BUTTON1: Self = Self(0x8);
    /// The second emergency stop button is pressed.
    pub const ESTOP_BUTTON2: Self = Self(0x10);
    /// The third emergency stop button is pressed.
    pub const ESTOP_BUTTON3: Self = Self(0x20);
    /// The fourth emergency stop button is pressed.
    pub const ESTOP_BUTTON4: Self = Self(0x40);
    /// The first guard is open.
    pub const ESTOP_GUARD1: Self = Self(0x80);
    /// The second guard is open.
    pub const ESTOP_GUARD2: Self = Self(0x100);
    /// The third guard is open.
    pub const ESTOP_GUARD3: Self = Self(0x200);
    /// The fourth guard is open.
    pub const ESTOP_GUARD4: Self = Self(0x400);
    /// The stop was asked for by software: Armada's own latch.
    pub const ESTOP_SOFTWARE: Self = Self(0x800);
    /// The emergency stop came from a fault of the controller.
    pub const ESTOP_FAULT: Self = Self(0x1000);
    /// The emergency stop came from the controller's own circuit.
    pub const ESTOP_INTERNAL: Self = Self(0x2000);
    /// The emergency stop came from elsewhere.
    pub const ESTOP_OTHER: Self = Self(0x4000);
    /// The emergency stop is released, and waits for the reset of its fault.
    pub const ESTOP_RELEASED: Self = Self(0x8000);
    /// The enabling switch is held.
    pub const ENABLING_SWITCH: Self = Self(0x1_0000);
    /// Drives are on.
    pub const ENABLED: Self = Self(0x2_0000);
    /// The controller takes commands.
    pub const READY: Self = Self(0x4_0000);
    /// Every joint knows its reference.
    pub const HOMED: Self = Self(0x8_0000);
    /// A joint does not know its reference.
    pub const HOMING_REQUIRED: Self = Self(0x10_0000);
    /// No feedback has come for longer than the allowed time.
    pub const COMMUNICATION_FAILURE: Self = Self(0x20_0000);
    /// A streamed position was followed in this tick.
    pub const VALID_POSITION_COMMAND: Self = Self(0x100_0000);
    /// A streamed velocity was followed in this tick.
    pub const VALID_VELOCITY_COMMAND: Self = Self(0x200_0000);
    /// A trajectory is in progress.
    pub const TRAJECTORY_RUNNING: Self = Self(0x400_0000);

    /// Every bit with its name on the wire, lowest bit first.
    pub const NAMES: [(&'static str, Self); 25] = [
        ("error", Self::ERROR),
        ("fatal_error", Self::FATAL_ERROR),
        ("estop", Self::ESTOP),
        ("estop_button1", Self::ESTOP_BUTTON1),
        ("estop_button2", Self::ESTOP_BUTTON2),
        ("estop_button3", Self::ESTOP_BUTTON3),
        ("estop_button4", Self::ESTOP_BUTTON4),
        ("estop_guard1", Self::ESTOP_GUARD1),
        ("estop_guard2", Self::ESTOP_GUARD2),
        ("estop_guard3", Self::ESTOP_GUARD3),
        ("estop_guard4", Self::ESTOP_GUARD4),
        ("estop_software", Self::ESTOP_SOFTWARE),
        ("estop_fault", Self::ESTOP_FAULT),
        ("estop_internal", Self::ESTOP_INTERNAL),
        ("estop_other", Self::ESTOP_OTHER),
        ("estop_released", Self::ESTOP_RELEASED),
        ("enabling_switch", Self::ENABLING_SWITCH),
        ("enabled", Self::ENABLED),
        ("ready", Self::READY),
        ("homed", Self::HOMED),
        ("homing_required", Self::HOMING_REQUIRED),
        ("communication_failure", Self::COMMUNICATION_FAILURE),
        ("valid_position_command", Self::VALID_POSITION_COMMAND),
        ("valid_velocity_command", Self::VALID_VELOCITY_COMMAND),
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

    /// The bits that are set in both.
    #[must_use]
    pub const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
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
