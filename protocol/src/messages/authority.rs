//! Who may command a robot: the lease.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::Denial;
use super::request::is_default;
use crate::RobotName;

/// Where the right to command a robot is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AuthorityState {
    /// Nobody has it: anybody may command, or acquire it.
    #[default]
    Free,
    /// The holder of a lease has it.
    Held,
    /// The lease has run out: its holder may renew it, anybody may acquire one.
    Stale,
    /// A person at the controller has it, before everybody else.
    Local,
    /// Nobody has it, since a stop is latched.
    Inhibited,
}

/// As what somebody commands; higher ones order after lower ones.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A program.
    #[default]
    Program,
    /// A person who runs the cell.
    Operator,
    /// A person who answers for it.
    Supervisor,
}

/// What a lease gives the right to; each contains those after it.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum LeaseScope {
    /// Everything, motion first of all.
    #[default]
    Arm,
    /// Tools, payloads and end effectors.
    EndEffector,
    /// Signals and parameters.
    Io,
}

/// Parameters of `acquire_lease`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AcquireLeaseParams {
    /// How long it lasts without being renewed \[ms\], 200 to 60000.
    #[serde(default = "default_ttl_ms")]
    pub ttl_ms: u64,
    /// As what the holder commands: nobody of a lower role can take the lease away.
    #[serde(default, skip_serializing_if = "is_default")]
    pub role: Role,
}

const fn default_ttl_ms() -> u64 {
    1000
}

impl Default for AcquireLeaseParams {
    fn default() -> Self {
        Self { ttl_ms: default_ttl_ms(), role: Role::Program }
    }
}

/// Parameters of `take_lease`: a person takes the right to command from whoever has it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TakeLeaseParams {
    /// How long it lasts without being renewed \[ms\], 200 to 60000.
    #[serde(default = "default_ttl_ms")]
    pub ttl_ms: u64,
    /// As what: `operator` or `supervisor`, and not below the holder's role.
    pub role: Role,
    /// Why, for the holder and the audit trail; 1 to 200 characters.
    pub reason: String,
}

/// Parameters of `delegate_lease`: the holder lets somebody else command as well, at most for as
/// long as its own lease is in force.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DelegateLeaseParams {
    /// The holder's lease.
    pub lease: Uuid,
    /// Name of the client that is to command.
    pub to: String,
    /// What it gets the right to.
    #[serde(default, skip_serializing_if = "is_default")]
    pub scope: LeaseScope,
    /// How long it lasts without being renewed \[ms\], 200 to 60000.
    #[serde(default = "default_ttl_ms")]
    pub ttl_ms: u64,
}

/// Parameters of `renew_lease`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenewLeaseParams {
    /// Which lease.
    pub lease: Uuid,
    /// How long it lasts from now \[ms\], 200 to 60000; as before if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ttl_ms: Option<u64>,
}

/// Parameters of `release_lease`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeaseParams {
    /// Which lease; with it go all that its holder delegated.
    pub lease: Uuid,
}

/// Answer of `acquire_lease`, `take_lease`, `delegate_lease` and `renew_lease`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaseGrant {
    /// The lease: whoever knows it may command, so keep it to yourself.
    pub lease: Uuid,
    /// Epoch in force; streams name it.
    pub epoch: u64,
    /// How long it lasts from now without being renewed \[ms\].
    pub ttl_ms: u64,
}

/// Answer of `release_lease`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaseReleased {
    /// Epoch in force.
    pub epoch: u64,
}

/// Parameters of the cell's `acquire_lease`: leases of several robots, all or none.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellAcquireLeaseParams {
    /// Which robots; all if empty.
    #[serde(default)]
    pub robots: Vec<RobotName>,
    /// How long they last without being renewed \[ms\], 200 to 60000.
    #[serde(default = "default_ttl_ms")]
    pub ttl_ms: u64,
    /// As what the holder commands.
    #[serde(default, skip_serializing_if = "is_default")]
    pub role: Role,
}

/// Parameters of the cell's `renew_lease` and `release_lease`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellLeaseParams {
    /// The lease of each robot.
    pub leases: BTreeMap<RobotName, Uuid>,
}

/// Answer of the cell's `acquire_lease` and `renew_lease`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GroupLease {
    /// The lease of each robot; each can be renewed and released at its agent as well.
    pub leases: BTreeMap<RobotName, LeaseGrant>,
}

/// Answer of the cell's `release_lease`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupLeaseReleased {
    /// Robots whose lease was given back.
    pub released: Vec<RobotName>,
    /// Robots that refused or did not answer, and why.
    pub refused: Vec<(RobotName, Denial)>,
}
