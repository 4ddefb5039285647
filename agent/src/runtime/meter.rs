//! Timing of the loop, written by the loop thread and read by the rest.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{LoopStatistics, SchedulingPolicy};

use crate::drivers::{LinkCounters, LinkRefusal};

/// Counters of the loop thread.
#[derive(Debug, Default)]
pub(super) struct Meter {
    pub(super) ticks: AtomicU64,
    pub(super) overruns: AtomicU64,
    pub(super) missed_periods: AtomicU64,
    pub(super) limited_setpoints: AtomicU64,
    /// Ticks whose step panicked.
    pub(super) panics: AtomicU64,
    /// Events that found the queue to the publisher full.
    pub(super) lost_events: AtomicU64,
    /// Latest wake-up after its deadline since it was last read \[ns\].
    worst_wake_ns: AtomicU64,
    /// Packets from the controller that could not be read.
    pub(super) malformed_packets: AtomicU64,
    /// Times the controller refused this client.
    pub(super) refused: AtomicU64,
    /// Why it does, as [`encode`] writes it.
    link_refusal: AtomicU64,
}

impl Meter {
    /// Takes over what the driver has counted.
    pub(super) fn note_link(&self, counters: &LinkCounters) {
        self.malformed_packets.store(counters.malformed, Ordering::Relaxed);
        self.refused.store(counters.refused, Ordering::Relaxed);
        self.link_refusal.store(encode(counters.refusal), Ordering::Relaxed);
    }

    /// Why the controller does not serve this client.
    pub(super) fn link_refusal(&self) -> Option<LinkRefusal> {
        decode(self.link_refusal.load(Ordering::Relaxed))
    }

    /// Counts one tick that woke `late` after its deadline, `missed` periods after the one before.
    pub(super) fn count_tick(&self, late: Duration, missed: u64) {
        self.ticks.fetch_add(1, Ordering::Relaxed);
        self.missed_periods.fetch_add(missed, Ordering::Relaxed);
        let late = u64::try_from(late.as_nanos()).unwrap_or(u64::MAX);
        self.worst_wake_ns.fetch_max(late, Ordering::Relaxed);
    }
}

/// Turns the counters into statistics over about a second.
#[derive(Debug)]
pub(super) struct MeterReader {
    target_rate_hz: f64,
    scheduling: SchedulingPolicy,
    read_at: MonoTime,
    ticks_then: u64,
    statistics: LoopStatistics,
}

impl MeterReader {
    pub(super) fn new(period: Duration, scheduling: SchedulingPolicy, now: MonoTime) -> Self {
        Self {
            target_rate_hz: 1.0 / period.as_secs_f64(),
            scheduling,
            read_at: now,
            ticks_then: 0,
            statistics: LoopStatistics::default(),
        }
    }

    /// The statistics now; rate and worst wake-up are of the last full second.
    #[expect(clippy::cast_precision_loss, reason = "tick counts stay far below 2^52")]
    pub(super) fn read(&mut self, meter: &Meter, now: MonoTime) -> LoopStatistics {
        let ticks = meter.ticks.load(Ordering::Relaxed);
        let elapsed = now.saturating_since(self.read_at).as_secs_f64();
        if elapsed >= 1.0 {
            self.statistics.rate_hz = (ticks - self.ticks_then) as f64 / elapsed;
            let worst = meter.worst_wake_ns.swap(0, Ordering::Relaxed);
            self.statistics.worst_wake_us = worst as f64 / 1e3;
            (self.ticks_then, self.read_at) = (ticks, now);
        }
        LoopStatistics {
            ticks,
            target_rate_hz: self.target_rate_hz,
            overruns: meter.overruns.load(Ordering::Relaxed),
            missed_periods: meter.missed_periods.load(Ordering::Relaxed),
            limited_setpoints: meter.limited_setpoints.load(Ordering::Relaxed),
            scheduling: self.scheduling,
            ..self.statistics
        }
    }
}

/// A refusal in one number, for the loop must not wait for a reader: kind and two values.
fn encode(refusal: Option<LinkRefusal>) -> u64 {
    let bytes = match refusal {
        None => [0, 0, 0],
        Some(LinkRefusal::Busy) => [1, 0, 0],
        Some(LinkRefusal::JointCount { controller, client }) => [2, controller, client],
        Some(LinkRefusal::Version { controller }) => [3, controller, 0],
    };
    let [kind, first, second] = bytes;
    u64::from_le_bytes([kind, first, second, 0, 0, 0, 0, 0])
}

const fn decode(number: u64) -> Option<LinkRefusal> {
    match number.to_le_bytes() {
        [1, ..] => Some(LinkRefusal::Busy),
        [2, controller, client, ..] => Some(LinkRefusal::JointCount { controller, client }),
        [3, controller, ..] => Some(LinkRefusal::Version { controller }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_refusal_of_a_controller_reaches_the_reader() {
        let meter = Meter::default();
        for refusal in [
            Some(LinkRefusal::Busy),
            Some(LinkRefusal::JointCount { controller: 7, client: 6 }),
            Some(LinkRefusal::Version { controller: 255 }),
            None,
        ] {
            meter.note_link(&LinkCounters { refusal, ..LinkCounters::default() });
            assert_eq!(meter.link_refusal(), refusal);
        }
    }
}
