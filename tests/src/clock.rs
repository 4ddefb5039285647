//! The clock that all processes of this machine share.

use armada_model::MonoTime;
use rustix::time::{ClockId, clock_gettime};

/// Now, by the monotonic clock of this machine: the same as the agents' stamps are of.
#[must_use]
pub fn monotonic() -> MonoTime {
    let now = clock_gettime(ClockId::Monotonic);
    let nanos = i128::from(now.tv_sec) * 1_000_000_000 + i128::from(now.tv_nsec);
    MonoTime::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
}
