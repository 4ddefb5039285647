//! Commands that were dropped, in the audit trail.
//!
//! A sample that is replayed, forged or made for somebody else's lease is dropped in the loop and
//! counted; nobody can be answered. So the first is told soon after, and what follows once in
//! [`WINDOW`], with how many of each kind there were since. What a bad link does is told by its
//! stream.

use std::collections::BTreeMap;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{EventKind, Severity};
use serde_json::json;
use tracing::warn;

use super::{Desk, map};

/// In which time it is told at most once.
const WINDOW: Duration = Duration::from_secs(10);
/// How often it is looked at.
const LOOK: Duration = Duration::from_millis(200);
/// What tells of somebody who may not command, or does not know how to.
const TOLD: [&str; 9] = [
    "stream_lease",
    "stream_epoch",
    "stream_sequence",
    "stream_mode",
    "stream_values",
    "stream_malformed",
    "unreadable_stop",
    "unreadable_check_in",
    "group_malformed",
];

/// What of it has been told.
#[derive(Debug, Default)]
pub(in crate::runtime) struct DroppedCommands {
    told: BTreeMap<&'static str, u64>,
    /// When it is looked at next.
    next: Option<MonoTime>,
}

impl DroppedCommands {
    fn is_due(&self, now: MonoTime) -> bool {
        self.next.is_none_or(|next| now >= next)
    }

    /// How many more there are of each kind, if it is to be told now.
    fn take(&mut self, now: MonoTime, all: &[(String, u64)]) -> BTreeMap<&'static str, u64> {
        let counted = |what: &str| all.iter().find(|(name, _)| name == what).map(|(_, n)| *n);
        let mut more = BTreeMap::new();
        for what in TOLD {
            let count = counted(what).unwrap_or_default();
            let before = self.told.insert(what, count).unwrap_or_default();
            if count > before {
                more.insert(what, count - before);
            }
        }
        self.next = Some(now + if more.is_empty() { LOOK } else { WINDOW });
        more
    }
}

impl Desk {
    /// Tells of commands that were dropped, in its time.
    pub(super) async fn settle_dropped(&mut self, now: MonoTime) {
        if !self.dropped_commands.is_due(now) {
            return;
        }
        let all = self.board.lock().all_dropped();
        let more = self.dropped_commands.take(now, &all);
        if more.is_empty() {
            return;
        }
        let words: Vec<_> = more.iter().map(|(what, count)| format!("{count} {what}")).collect();
        let holder = self.board.lock().leases.holder().map(|holder| holder.name.clone());
        let driven = holder.as_ref().map_or_else(String::new, |name| format!("; {name} drives"));
        let message = format!("commands were dropped: {}{driven}", words.join(", "));
        warn!(?more, "commands were dropped");
        let details = map(json!({ "dropped": more, "holder": holder }));
        self.event(now, Severity::Warning, EventKind::Denied, message, details).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> MonoTime {
        MonoTime::from_nanos(1_000_000_000 + ms * 1_000_000)
    }

    #[test]
    fn the_first_is_told_soon_and_a_flood_once_in_a_while_with_none_left_out() {
        let mut dropped = DroppedCommands::default();
        let (mut sent, mut told, mut events) = (0, 0, Vec::new());
        for ms in 0..60_000 {
            sent += u64::from(ms >= 1_000);
            let now = at(ms);
            if dropped.is_due(now) {
                let all = [("stream_age".to_owned(), 7), ("stream_lease".to_owned(), sent)];
                let more = dropped.take(now, &all);
                assert!(more.keys().all(|what| *what == "stream_lease"), "{more:?}");
                told += more.values().sum::<u64>();
                events.extend(more.first_key_value().map(|_| ms));
            }
        }
        assert!(events[0] <= 1_200, "{events:?}");
        assert!(events.windows(2).all(|pair| pair[1] - pair[0] >= 10_000), "{events:?}");
        assert_eq!(events.len(), 6);
        assert!(sent - told <= 10_000, "told with the next");
    }
}
