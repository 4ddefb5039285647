//! Who may command a robot: the lease.

use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Parameters of `acquire_lease`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AcquireLeaseParams {
    /// How long it lasts without being renewed \[ms\], 200 to 60000.
    #[serde(default = "default_ttl_ms")]
    pub ttl_ms: u64,
}

const fn default_ttl_ms() -> u64 {
    1000
}

impl Default for AcquireLeaseParams {
    fn default() -> Self {
        Self { ttl_ms: default_ttl_ms() }
    }
}

/// Parameters of `renew_lease` and `release_lease`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeaseParams {
    /// Which lease.
    pub lease: Uuid,
}

/// Answer of `acquire_lease` and `renew_lease`.
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
