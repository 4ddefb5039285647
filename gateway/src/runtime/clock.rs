//! The clocks of this machine.

use armada_model::MonoTime;
use rustix::time::{ClockId, clock_gettime};
use tokio::time::Instant;

/// Now, on `CLOCK_MONOTONIC`.
pub(super) fn monotonic() -> MonoTime {
    let now = clock_gettime(ClockId::Monotonic);
    let seconds = u64::try_from(now.tv_sec).unwrap_or_default();
    let nanos = u64::try_from(now.tv_nsec).unwrap_or_default();
    MonoTime::from_nanos(seconds.saturating_mul(1_000_000_000).saturating_add(nanos))
}

/// The same instant for tokio's timers.
#[expect(clippy::disallowed_methods, reason = "the runtime is where clocks are read")]
pub(super) fn instant_of(time: MonoTime) -> Instant {
    Instant::now() + time.saturating_since(monotonic())
}
