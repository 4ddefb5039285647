//! Streams in the audit trail.
//!
//! A stream whose samples come just too late starves and goes on many times a second. Each is worth
//! knowing while they are few; a thousand of them would push everything else out of whoever keeps
//! the trail. So in [`WINDOW`] at most [`MOST`] of them are told one by one. The others are counted,
//! and told as one event when the window is over, with the count and what was last.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{EventKind, Severity};
use serde_json::json;
use tracing::{debug, info};

use super::{Desk, map};
use crate::control::StreamChange;

/// In which time only so many changes are told.
const WINDOW: Duration = Duration::from_secs(10);
/// How many.
const MOST: u32 = 6;

/// How often a stream has starved and gone on, or was slowed and not, of late.
#[derive(Debug, Default)]
pub(in crate::runtime) struct Flapping {
    /// When the window began; none if nothing was told.
    since: Option<MonoTime>,
    told: u32,
    untold: u64,
    last: Option<StreamChange>,
}

impl Flapping {
    /// Whether this change is to be told by itself; else it is counted.
    fn take(&mut self, now: MonoTime, change: StreamChange) -> bool {
        if matches!(change, StreamChange::Began | StreamChange::Ended) {
            // As often as somebody changes the mode, which is told as well.
            return true;
        }
        let over = |since: MonoTime| now.saturating_since(since) >= WINDOW;
        if self.untold == 0 && self.since.is_none_or(over) {
            (self.since, self.told) = (Some(now), 0);
        }
        if self.told < MOST {
            self.told += 1;
            return true;
        }
        self.untold += 1;
        self.last = Some(change);
        false
    }

    /// How many were counted and the last of them, if the window is over.
    fn settle(&mut self, now: MonoTime) -> Option<(u64, StreamChange)> {
        let since = self.since.filter(|&since| now.saturating_since(since) >= WINDOW)?;
        let last = self.last.take()?;
        debug_assert!(since <= now && self.untold > 0, "what is last was counted");
        // What is told now is the first of the next window.
        (self.since, self.told) = (Some(now), 1);
        Some((std::mem::take(&mut self.untold), last))
    }
}

impl Desk {
    pub(super) async fn take_stream(&mut self, stamp: MonoTime, change: StreamChange) {
        if !self.flapping.take(stamp, change) {
            debug!(?change, "stream of commands");
            return;
        }
        let (severity, what, message) = words(change);
        info!(change = what, "stream of commands");
        let details = map(json!({ "change": what }));
        self.event(stamp, severity, EventKind::Stream, message.to_owned(), details).await;
    }

    /// Tells what was only counted, in its time.
    pub(super) async fn settle_streams(&mut self, now: MonoTime) {
        let Some((count, last)) = self.flapping.settle(now) else { return };
        let (_, what, message) = words(last);
        info!(change = what, count, "stream of commands");
        let window_s = WINDOW.as_secs();
        let message = format!("{message}; it changed {count} times more within {window_s} s");
        let details = map(json!({ "change": what, "count": count }));
        self.event(now, Severity::Warning, EventKind::Stream, message, details).await;
    }
}

const fn words(change: StreamChange) -> (Severity, &'static str, &'static str) {
    match change {
        StreamChange::Began => (Severity::Info, "began", "a stream of commands began"),
        StreamChange::Starved => {
            (Severity::Warning, "starved", "the stream of commands starved: decelerating")
        }
        StreamChange::Resumed => (Severity::Info, "resumed", "the stream of commands goes on"),
        StreamChange::Slowed => (
            Severity::Warning,
            "slowed",
            "samples come seldom or unevenly: the stream is followed at lower speeds",
        ),
        StreamChange::Refused => (
            Severity::Warning,
            "refused",
            "samples come too seldom, late or unevenly: the stream is not followed",
        ),
        StreamChange::Restored => (
            Severity::Info,
            "restored",
            "samples come evenly again: the stream is followed at full speed",
        ),
        StreamChange::Ended => (Severity::Info, "ended", "the stream of commands ended"),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use armada_model::MonoTime;

    use super::{Flapping, MOST, WINDOW};
    use crate::control::StreamChange::{Began, Ended, Resumed, Starved};

    #[test]
    fn a_stream_that_flaps_is_told_a_few_times_and_then_counted() {
        let mut flapping = Flapping::default();
        let (mut now, mut told, mut counted) = (MonoTime::from_nanos(5), 0, Vec::new());
        let pairs = 1000;
        for _ in 0..pairs {
            for change in [Starved, Resumed] {
                now = now + Duration::from_millis(30);
                told += u64::from(flapping.take(now, change));
                counted.extend(flapping.settle(now));
            }
        }
        counted.extend(flapping.settle(now + WINDOW));
        // A minute of it: six windows and the beginning of a seventh.
        assert!(counted.len() >= 6 && counted.len() <= 7, "{counted:?}");
        assert!(told <= u64::from(MOST) * 7, "{told}");
        let all = counted.iter().map(|(count, _)| count).sum::<u64>() + told;
        assert_eq!(all, 2 * pairs, "each is told or counted");
        assert_eq!(counted.last().map(|(_, last)| *last), Some(Resumed));
    }

    #[test]
    fn what_happens_now_and_then_and_every_beginning_and_end_is_told_at_once() {
        let mut flapping = Flapping::default();
        let mut now = MonoTime::from_nanos(5);
        for _ in 0..100 {
            now = now + Duration::from_secs(4);
            assert!(flapping.take(now, Starved) && flapping.take(now, Resumed));
            assert_eq!(flapping.settle(now), None);
        }
        for _ in 0..100 {
            assert!(flapping.take(now, Began) && flapping.take(now, Ended));
        }
    }
}
