//! The clocks of this program: for time-outs and for display, never for control.

use std::time::Instant;

/// Now, by the monotonic clock.
#[expect(clippy::disallowed_methods, reason = "a command line is runtime code")]
pub(crate) fn now() -> Instant {
    Instant::now()
}
