//! Stops. An operational stop over a network, never a rated safety function.

use armada_model::MonoTime;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::RobotName;

/// How hard to stop; a request, not a safety rating. Higher ones order after lower ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum StopLevel {
    /// Controlled, drives stay on.
    L2,
    /// Controlled, then drives off.
    L1,
    /// Drives off at once.
    L0,
}

impl StopLevel {
    /// The next harder level; none above L0.
    #[must_use]
    pub const fn harder(self) -> Option<Self> {
        match self {
            Self::L2 => Some(Self::L1),
            Self::L1 => Some(Self::L0),
            Self::L0 => None,
        }
    }
}

/// Which robots a stop is for.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopScope {
    /// Every robot that hears it.
    #[default]
    Cell,
    /// These robots only.
    Robots(Vec<RobotName>),
}

impl StopScope {
    /// Whether `robot` is to stop.
    #[must_use]
    pub fn includes(&self, robot: &RobotName) -> bool {
        match self {
            Self::Cell => true,
            Self::Robots(robots) => robots.contains(robot),
        }
    }
}

/// Stop, and stay stopped until a reset. Needs no lease and is never refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StopRequest {
    /// Identity of the stop; the same in every repetition.
    pub stop_id: Uuid,
    /// Who asks.
    pub source: String,
    /// How hard.
    pub level: StopLevel,
    /// Which robots; all of them if left out.
    #[serde(default)]
    pub scope: StopScope,
    /// Why, for people.
    #[serde(default)]
    pub reason: String,
    /// Number of the repetition.
    #[serde(default)]
    pub seq: u64,
}

/// How far a robot has come with a stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopStage {
    /// The agent has it and its gate for motion is closed.
    Received,
    /// The control loop has sent the first decelerating set-point, or drives-off, to the controller.
    Commanded,
    /// Measured speed has been below the threshold for the hold time.
    Standstill,
    /// The controller reports its drives off.
    DrivesOff,
}

/// One step of a robot's answer to a stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StopAck {
    /// Which stop.
    pub stop_id: Uuid,
    /// Which robot.
    pub robot: RobotName,
    /// This run of the agent.
    pub boot_id: Uuid,
    /// How far.
    pub stage: StopStage,
    /// When, agent's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// Time since this agent first received the stop \[ms\].
    pub since_received_ms: f64,
}

/// One stop that keeps a robot stopped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LatchedStop {
    /// Identity, to be listed in the reset.
    pub stop_id: Uuid,
    /// Who asked.
    pub source: String,
    /// How hard.
    pub level: StopLevel,
    /// Why.
    pub reason: String,
}

/// Outcome of a stop of a cell: complete only if every robot in scope was measured to stand still.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StopReport {
    /// Which stop.
    pub stop_id: Uuid,
    /// The verdict.
    pub verdict: StopVerdict,
    /// Highest stage reached by each robot in scope, with its time.
    pub acks: Vec<StopAck>,
    /// Robots in scope that did not reach standstill in time.
    pub missing: Vec<RobotName>,
}

/// Verdict of a [`StopReport`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopVerdict {
    /// Every configured robot in scope stands still, by measurement.
    Complete,
    /// At least one is not known to stand still: go and look.
    Incomplete,
}

/// Who has to see to it before a robot's stop is reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ResetZone {
    /// Nobody has to be at the arm.
    #[default]
    Remote,
    /// Somebody acknowledges at the arm first.
    Manual,
}

/// What a reset of a latched stop needs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResetNeeds {
    /// To be returned in the reset; a new one after every stop and every attempt.
    pub nonce: Uuid,
    /// Whether the reset has to be signed.
    pub signed: bool,
    /// Who has to see to it.
    pub zone: ResetZone,
    /// Whether that was acknowledged at the arm; true if nobody has to.
    pub acknowledged: bool,
}

impl Default for ResetNeeds {
    /// Nothing but the list of stops and a nonce of zeros.
    fn default() -> Self {
        let (nonce, zone) = (Uuid::nil(), ResetZone::Remote);
        Self { nonce, signed: false, zone, acknowledged: true }
    }
}

/// A source of stops elsewhere that has to check in, as a robot knows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StopSourceStatus {
    /// Name of the source.
    pub source: String,
    /// Whether it is pressed; true as well while it is not heard.
    pub pressed: bool,
    /// Time since its last check-in \[ms\]; null if it has never been heard.
    pub age_ms: Option<f64>,
}

/// What an agent asks a source of stops, with a number that nobody can guess.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopChallenge {
    /// Who asks.
    pub robot: RobotName,
    /// To be returned.
    pub nonce: Uuid,
}

/// What a source of stops answers: made from its real input for every challenge, never by a
/// wrapper that knows no input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopCheckIn {
    /// Name of the source.
    pub source: String,
    /// Number of the challenge.
    pub nonce: Uuid,
    /// Whether it is pressed.
    pub pressed: bool,
    /// Signature of the rest with the key of the cell, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signature: Option<String>,
}
