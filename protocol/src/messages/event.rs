//! The audit trail.

use armada_model::MonoTime;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use uuid::Uuid;

use crate::RobotName;

/// Something that happened; numbered without gaps within a run of its sender.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Which robot; null if the gateway speaks of itself.
    pub robot: Option<RobotName>,
    /// Run of the sender.
    pub boot_id: Uuid,
    /// Number of the event in this run, from 0: the next one has the next number.
    pub seqno: u64,
    /// When, sender's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// When by the wall clock, for display only \[ns since 1970 UTC\].
    pub utc_ns: u64,
    /// How grave.
    pub severity: Severity,
    /// What kind.
    pub kind: EventKind,
    /// What happened, for people.
    pub message: String,
    /// The same as data.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub details: Map<String, Value>,
}

/// How grave an [`Event`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Ordinary course of things.
    Info,
    /// Something is degraded.
    Warning,
    /// Somebody must act.
    Error,
}

/// Kind of an [`Event`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// A program came up.
    Started,
    /// A program is about to end.
    Ending,
    /// The command mode changed.
    ModeChanged,
    /// A fault was latched.
    FaultLatched,
    /// Faults were cleared.
    FaultsCleared,
    /// A motion was accepted.
    MotionAccepted,
    /// A motion reached its terminal status.
    MotionEnded,
    /// A stop came in or reached another stage.
    Stop,
    /// A latched stop was reset.
    Reset,
    /// A lease was granted, taken, delegated, released or ran out.
    Lease,
    /// A motion of several robots: ready, aborted, a partner lost.
    Group,
    /// A source of stops was heard, pressed, released or lost.
    StopSource,
    /// A tool or payload was attached or detached.
    EquipmentChanged,
    /// A signal or parameter was set.
    ValueSet,
    /// The operational mode changed: somebody turned the key switch.
    OperationalModeChanged,
    /// A stream of commands began, starved or ended.
    Stream,
    /// A robot appeared in or vanished from the cell.
    PresenceChanged,
    /// A request was refused, or commands that nobody can be answered were dropped.
    Denied,
    /// Events of a robot did not reach the gateway.
    EventsLost,
    /// A robot's description cannot be used; the robot is left out of the world.
    ModelRejected,
}
