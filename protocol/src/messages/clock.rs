//! An agent's clock, for measuring the offset to it.

use armada_model::MonoTime;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Answer to a query of an agent's clock, made as late as possible.
///
/// With the asker's times before and after, offset = `stamp_ns` − (before + after) / 2, wrong by
/// at most half the round trip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClockSample {
    /// Boot of the agent; offsets to different boots have nothing in common.
    pub boot_id: Uuid,
    /// The agent's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// The agent's wall clock, for display only \[ns since 1970 UTC\].
    pub utc_ns: u64,
}
