//! Offset between the gateway's clock and an agent's, from round trips.

use std::collections::VecDeque;
use std::time::Duration;

use armada_model::MonoTime;
use uuid::Uuid;

/// Round trips that are kept.
const KEPT: usize = 16;
/// Longest time a round trip is used.
const WINDOW: Duration = Duration::from_secs(30);
/// How far two clocks may drift apart in a second \[ns\]: 100 parts per million.
const DRIFT_NS_PER_S: u64 = 100_000;

/// An agent's clock minus the gateway's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Offset {
    /// Agent's clock minus the gateway's \[ns\].
    pub(super) offset_ns: i64,
    /// How wrong that may be \[ns\]: half the round trip, and the drift since.
    pub(super) bound_ns: u64,
}

impl Offset {
    /// Whether both cannot be true.
    const fn excludes(&self, offset_ns: i64, bound_ns: u64) -> bool {
        self.offset_ns.abs_diff(offset_ns) > self.bound_ns.saturating_add(bound_ns)
    }
}

/// The last round trips to one run of an agent.
#[derive(Clone, Debug, Default)]
pub(super) struct ClockOffset {
    boot_id: Option<Uuid>,
    trips: VecDeque<Trip>,
}

#[derive(Clone, Copy, Debug)]
struct Trip {
    received: MonoTime,
    offset_ns: i64,
    round_trip: Duration,
}

impl ClockOffset {
    /// Takes a round trip to the run `boot_id`; a new run begins anew.
    pub(super) fn add(
        &mut self,
        boot_id: Uuid,
        stamp: MonoTime,
        sent: MonoTime,
        received: MonoTime,
    ) {
        if self.boot_id != Some(boot_id) {
            *self = Self { boot_id: Some(boot_id), trips: VecDeque::new() };
        }
        let round_trip = received.saturating_since(sent);
        let middle = sent + round_trip / 2;
        let offset = i128::from(stamp.as_nanos()) - i128::from(middle.as_nanos());
        let Ok(offset_ns) = i64::try_from(offset) else { return };
        let bound_ns = nanos(round_trip / 2);
        if self.best(received).is_some_and(|best| best.excludes(offset_ns, bound_ns)) {
            // One of the clocks has stepped: what was measured before is of another time.
            self.trips.clear();
        }
        if self.trips.len() == KEPT {
            self.trips.pop_front();
        }
        self.trips.push_back(Trip { received, offset_ns, round_trip });
    }

    /// The offset with the smallest bound, if one was measured lately.
    pub(super) fn best(&self, now: MonoTime) -> Option<Offset> {
        let bounded = |trip: &Trip| Offset {
            offset_ns: trip.offset_ns,
            bound_ns: nanos(trip.round_trip / 2) + drift_ns(now.saturating_since(trip.received)),
        };
        self.recent(now).map(bounded).min_by_key(|offset| offset.bound_ns)
    }

    /// When the last round trip ended.
    pub(super) fn measured(&self) -> Option<MonoTime> {
        self.trips.back().map(|trip| trip.received)
    }

    /// The slowest of the last round trips.
    pub(super) fn slowest_round_trip(&self, now: MonoTime) -> Duration {
        self.recent(now).map(|trip| trip.round_trip).max().unwrap_or_default()
    }

    /// How many round trips are in use.
    pub(super) fn count(&self) -> usize {
        self.trips.len()
    }

    fn recent(&self, now: MonoTime) -> impl Iterator<Item = &Trip> {
        self.trips.iter().filter(move |trip| now.saturating_since(trip.received) <= WINDOW)
    }
}

fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

fn drift_ns(age: Duration) -> u64 {
    nanos(age).saturating_mul(DRIFT_NS_PER_S) / 1_000_000_000
}

#[cfg(test)]
mod tests {
    use super::*;

    const RUN: Uuid = Uuid::from_u128(1);

    fn ms(ms: u64) -> MonoTime {
        MonoTime::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn the_offset_is_the_stamp_minus_the_middle_of_the_round_trip() {
        let mut clock = ClockOffset::default();
        clock.add(RUN, ms(5_011), ms(10), ms(12));
        let best = clock.best(ms(12)).expect("measured");
        assert_eq!(best, Offset { offset_ns: 5_000_000_000, bound_ns: 1_000_000 });
    }

    #[test]
    fn a_clock_that_is_behind_has_a_negative_offset() {
        let mut clock = ClockOffset::default();
        clock.add(RUN, ms(1), ms(100), ms(102));
        assert_eq!(clock.best(ms(102)).expect("measured").offset_ns, -100_000_000);
    }

    #[test]
    fn the_fastest_round_trip_counts_until_drift_makes_it_worse() {
        let mut clock = ClockOffset::default();
        clock.add(RUN, ms(1_000), ms(0), ms(1));
        clock.add(RUN, ms(2_003), ms(1_000), ms(1_004));
        assert_eq!(clock.best(ms(1_004)).expect("measured").bound_ns, 600_300);
        assert_eq!(clock.best(ms(17_000)).expect("measured").bound_ns, 2_199_900);
        clock.add(RUN, ms(17_003), ms(17_000), ms(17_004));
        assert_eq!(clock.best(ms(17_004)).expect("measured").bound_ns, 2_000_000);
        assert_eq!(clock.slowest_round_trip(ms(17_004)), Duration::from_millis(4));
    }

    #[test]
    fn a_clock_that_stepped_is_measured_anew() {
        let mut clock = ClockOffset::default();
        clock.add(RUN, ms(1_000), ms(0), ms(1));
        clock.add(RUN, ms(1_600), ms(100), ms(104));
        let best = clock.best(ms(104)).expect("measured");
        assert_eq!(best, Offset { offset_ns: 1_498_000_000, bound_ns: 2_000_000 });
    }

    #[test]
    fn what_was_measured_long_ago_or_in_another_run_is_forgotten() {
        let mut clock = ClockOffset::default();
        clock.add(RUN, ms(1_000), ms(0), ms(1));
        assert_eq!(clock.best(ms(31_000)), None);
        clock.add(Uuid::from_u128(2), ms(7), ms(100), ms(900));
        assert_eq!(clock.best(ms(900)).expect("measured").bound_ns, 400_000_000);
    }
}
