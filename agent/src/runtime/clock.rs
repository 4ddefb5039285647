//! The clocks of this machine.

use std::time::{SystemTime, UNIX_EPOCH};

use armada_model::MonoTime;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// Now, on `CLOCK_MONOTONIC`.
#[must_use]
pub fn monotonic() -> MonoTime {
    let now = clock_gettime(ClockId::Monotonic);
    let seconds = u64::try_from(now.tv_sec).unwrap_or_default();
    let nanos = u64::try_from(now.tv_nsec).unwrap_or_default();
    MonoTime::from_nanos(seconds.saturating_mul(1_000_000_000).saturating_add(nanos))
}

/// The wall clock, for display only \[ns since 1970 UTC\].
#[must_use]
#[expect(clippy::disallowed_methods, reason = "the runtime is where clocks are read")]
pub fn utc_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

/// Sleeps until `deadline`, also across signals; returns at once if it is past.
pub fn sleep_until(deadline: MonoTime) {
    let nanos = deadline.as_nanos();
    let request = Timespec {
        tv_sec: i64::try_from(nanos / 1_000_000_000).unwrap_or(i64::MAX),
        tv_nsec: i64::try_from(nanos % 1_000_000_000).unwrap_or_default(),
    };
    while let Err(error) = clock_nanosleep_absolute(ClockId::Monotonic, &request) {
        if error != rustix::io::Errno::INTR {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_sleep_never_ends_before_its_deadline() {
        let deadline = monotonic() + Duration::from_millis(3);
        sleep_until(deadline);
        assert!(monotonic() >= deadline);
    }
}
