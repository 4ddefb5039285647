//! Drivers: bytes of a controller to [`Feedback`], set-points to bytes, without any input or output.
//!
//! ```text
//! runtime/link --receive(bytes)--> Driver --feedback()--> control::step
//! runtime/link <--poll_transmit()-- Driver <--command(set-point), request(..)-- control::step
//! ```
//!
//! Every vendor is a folder with the same file names: `config.rs` its table of the robot file,
//! `wire.rs` the controller's packets, `driver.rs` the client's side, `emulator.rs` the
//! controller's side. A vendor comes in by one line of `vendors!` at the end of this file.

mod ability;
mod request;
mod vendors;

use serde::{Deserialize, Serialize};
use std::net::SocketAddr;
use std::num::NonZeroU64;
use std::time::Duration;

use armada_model::{Chain, JointVector, MAX_JOINTS, MonoTime};
use armada_protocol::messages::{JointInfo, OperationalMode, RobotFlags};

pub use ability::{Abilities, MAX_PARAMETERS, MAX_SIGNAL_VALUES};
pub use request::{
    DelegatedGoal, DelegatedMove, DelegatedReport, DelegatedStatus, DriverRequest, JointSet,
    LoadSetting, MAX_REPORTED_TIPS, ReportedTip, TipFrame, Values,
};
use vendors::vendors;

/// Largest packet a driver or emulator sends or takes \[bytes\].
pub const MAX_PACKET: usize = 1500;

/// What a controller reports.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Feedback {
    /// When it arrived, loop's clock.
    pub stamp: MonoTime,
    /// Which run of the controller sent it: another number after each start; 0 if it does not say.
    pub session: u64,
    /// Measured positions \[rad or m\].
    pub joint_position: JointVector,
    /// Measured speeds \[1/s\]; empty if the controller gives none.
    pub joint_velocity: JointVector,
    /// Measured torques \[Nm\] or forces \[N\]; empty if the controller gives none.
    pub joint_effort: JointVector,
    /// Drives are on.
    pub enabled: bool,
    /// The controller takes commands.
    pub ready: bool,
    /// The controller's own emergency stop is in force.
    pub emergency_stop: bool,
    /// The controller's error, in its own numbering; 0 for none.
    pub error_code: u32,
    /// The controller's key switch.
    pub operational_mode: OperationalMode,
    /// A safeguard of the controller is open: it stopped the robot, or limits it to nothing.
    pub guard_stop: bool,
    /// The pendant, or another person at the controller, has control: nobody else may command.
    pub local_control: bool,
    /// Conditions that only the controller knows, of [`Feedback::CONDITIONS`]: which button or
    /// guard, the enabling switch, a fatal error, a released emergency stop.
    pub conditions: RobotFlags,
    /// Joints that know their reference; every joint if the controller needs no homing.
    pub homed: JointSet,
    /// Joints that are searching their reference now.
    pub homing: JointSet,
    /// What has become of the newest delegated move.
    pub delegated: Option<DelegatedReport>,
    /// Values of the signals, in the order of [`Abilities::signals`], each with its size.
    pub signals: Values<MAX_SIGNAL_VALUES>,
    /// Values of the parameters, in the order of [`Abilities::parameters`].
    pub parameters: Values<MAX_PARAMETERS>,
    /// Poses that the controller reports itself; those of chains that are not named are calculated.
    pub tips: [Option<ReportedTip>; MAX_REPORTED_TIPS],
}

impl Feedback {
    /// The flags that a controller may report in [`Feedback::conditions`]; others are not taken.
    pub const CONDITIONS: RobotFlags = RobotFlags::FATAL_ERROR
        .with(RobotFlags::ESTOP_BUTTON1, true)
        .with(RobotFlags::ESTOP_BUTTON2, true)
        .with(RobotFlags::ESTOP_BUTTON3, true)
        .with(RobotFlags::ESTOP_BUTTON4, true)
        .with(RobotFlags::ESTOP_GUARD1, true)
        .with(RobotFlags::ESTOP_GUARD2, true)
        .with(RobotFlags::ESTOP_GUARD3, true)
        .with(RobotFlags::ESTOP_GUARD4, true)
        .with(RobotFlags::ESTOP_FAULT, true)
        .with(RobotFlags::ESTOP_OTHER, true)
        .with(RobotFlags::ESTOP_RELEASED, true)
        .with(RobotFlags::ENABLING_SWITCH, true);

    /// A report of joints at rest, drives off, nothing else known: to be filled in.
    #[must_use]
    pub fn of(stamp: MonoTime, joint_position: JointVector) -> Self {
        Self {
            stamp,
            session: 0,
            joint_position,
            joint_velocity: JointVector::EMPTY,
            joint_effort: JointVector::EMPTY,
            enabled: false,
            ready: false,
            emergency_stop: false,
            error_code: 0,
            operational_mode: OperationalMode::Undefined,
            guard_stop: false,
            local_control: false,
            conditions: RobotFlags::NONE,
            homed: JointSet::first(joint_position.len()),
            homing: JointSet::NONE,
            delegated: None,
            signals: Values::EMPTY,
            parameters: Values::EMPTY,
            tips: [None; MAX_REPORTED_TIPS],
        }
    }
}

/// One set-point of all joints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetPoint {
    /// Positions \[rad or m\].
    pub joint_position: JointVector,
    /// Speeds that go with them \[1/s\].
    pub joint_velocity: JointVector,
}

/// What sets the pace of the control loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pacing {
    /// The loop's own clock, with this period.
    Every(Duration),
}

/// A connection that a driver or an emulator wants the runtime to hold for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Endpoint {
    /// Datagrams to and from `remote`, from a port the system chooses.
    UdpTo {
        /// The controller's address.
        remote: SocketAddr,
    },
    /// Datagrams to `local` from anybody; what is sent goes to the peer that [`Transmit`] names.
    UdpAt {
        /// Own address; port 0 lets the system choose.
        local: SocketAddr,
    },
}

/// A packet to be sent, written into the buffer handed to `poll_transmit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transmit {
    /// Index into `endpoints()`.
    pub endpoint: usize,
    /// Where to, on an endpoint that many may write to; `None` on one with a fixed remote.
    pub peer: Option<SocketAddr>,
    /// Bytes written.
    pub len: usize,
}

/// What a driver or an emulator has counted since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkCounters {
    /// Packets taken.
    pub received: u64,
    /// Packets that were not of the protocol's format.
    pub malformed: u64,
    /// Packets dropped because a newer one was taken, or meant for an earlier run of either side.
    pub out_of_order: u64,
    /// Times the controller refused the client.
    pub refused: u64,
    /// Why it refused last; `None` once it has reported again.
    pub refusal: Option<LinkRefusal>,
}

/// Why a controller does not serve a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LinkRefusal {
    /// Another client holds it.
    #[error("the controller is held by another client")]
    Busy,
    /// It drives another number of joints.
    #[error("the controller drives {controller} joints, the robot file names {client}")]
    JointCount {
        /// Joints of the controller.
        controller: u8,
        /// Joints of the client.
        client: u8,
    },
    /// It speaks another version of its protocol.
    #[error("the controller speaks version {controller} of its protocol")]
    Version {
        /// Version of the controller.
        controller: u8,
    },
}

/// What a driver or an emulator is told of the robot it serves.
#[derive(Clone, Debug)]
pub struct DriverSetup {
    /// The joints in the order of every vector; each with an acceleration limit.
    pub joints: Vec<JointInfo>,
    /// The chains in the order of the robot file; `None` for one that no driven joint moves.
    pub chains: Vec<Option<Chain>>,
    /// Period of the control loop.
    pub period: Duration,
    /// A number that no other run of this or another program has, so that the two sides of a
    /// link see each other restart.
    pub boot_nonce: NonZeroU64,
}

/// Why a driver or an emulator cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// No joints, or more than a robot may have.
    #[error("{count} joints, but a robot has 1 to {MAX_JOINTS}")]
    JointCount {
        /// Number given.
        count: usize,
    },
    /// A joint has no acceleration limit.
    #[error("joint {joint}: no acceleration limit")]
    NoAcceleration {
        /// Name of the joint.
        joint: String,
    },
    /// The vendor's table of the robot file does not fit the robot.
    #[error("driver.{vendor}.{field}: {problem}")]
    Config {
        /// Name of the vendor.
        vendor: &'static str,
        /// Path of the field in the vendor's table.
        field: String,
        /// What is wrong with it.
        problem: String,
    },
}

impl DriverSetup {
    /// Number of joints, if a robot may have so many and all have an acceleration limit.
    ///
    /// # Errors
    /// [`SetupError::JointCount`] if there is none or more than [`MAX_JOINTS`],
    /// [`SetupError::NoAcceleration`] if a joint has no acceleration limit.
    pub fn joint_count(&self) -> Result<usize, SetupError> {
        let count = self.joints.len();
        if count == 0 || count > MAX_JOINTS {
            return Err(SetupError::JointCount { count });
        }
        match self.joints.iter().find(|joint| joint.limits.acceleration.is_none()) {
            Some(joint) => Err(SetupError::NoAcceleration { joint: joint.name.clone() }),
            None => Ok(count),
        }
    }
}

/// The client's side of a controller's protocol. No call blocks or allocates.
pub trait Driver: Send {
    /// Connections it needs, always the same.
    fn endpoints(&self) -> &[Endpoint];

    /// What sets the pace of the loop.
    fn pacing(&self) -> Pacing;

    /// What the controller can do besides following set-points, always the same.
    fn abilities(&self) -> Abilities;

    /// Takes one packet from the controller; one that is malformed is counted and dropped.
    fn receive(&mut self, now: MonoTime, endpoint: usize, bytes: &[u8]);

    /// Newest report, or `None` before the first.
    fn feedback(&self) -> Option<&Feedback>;

    /// Asks the controller for something; whether it happened shows in the feedback.
    fn request(&mut self, now: MonoTime, request: DriverRequest);

    /// Sends one set-point; the control loop calls it at most once a tick.
    fn command(&mut self, now: MonoTime, set_point: &SetPoint);

    /// Writes the next packet to send into `buffer` (of [`MAX_PACKET`] bytes), or says there is none.
    fn poll_transmit(&mut self, now: MonoTime, buffer: &mut [u8]) -> Option<Transmit>;

    /// What has been counted.
    fn counters(&self) -> LinkCounters;
}

/// The controller's side of a protocol: an emulated controller with the robot behind it.
pub trait Emulator: Send {
    /// Connections it needs, always the same.
    fn endpoints(&self) -> &[Endpoint];

    /// Takes one packet from the client at `peer`; one that is malformed is counted and dropped.
    ///
    /// Who sends matters: a second client, or a person who injects a fault, must neither take
    /// the robot over nor draw the status stream to itself.
    fn receive(&mut self, now: MonoTime, endpoint: usize, peer: SocketAddr, bytes: &[u8]);

    /// Advances the emulated robot to `now`.
    fn advance(&mut self, now: MonoTime);

    /// Writes the next packet to send into `buffer` (of [`MAX_PACKET`] bytes), or says there is none.
    fn poll_transmit(&mut self, now: MonoTime, buffer: &mut [u8]) -> Option<Transmit>;

    /// When `advance`, and after it `poll_transmit`, must be called next.
    fn next_deadline(&self) -> MonoTime;

    /// What has been counted.
    fn counters(&self) -> LinkCounters;
}

vendors! {
    /// An emulated controller with its own datagram protocol.
    sim: Sim,
}
