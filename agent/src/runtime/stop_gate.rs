//! The gate that a stop closes: one atomic word, shared by Zenoh's callbacks and the loop.

use std::sync::atomic::{AtomicU64, Ordering};

use armada_protocol::messages::StopLevel;

/// Closed at the highest level asked for since it was last opened.
///
/// The word holds a count of closings, one of openings, and the level. Opening names the count of
/// closings it has seen, so a stop that comes in during a reset cannot be lost; the count of openings
/// shows the loop one that was closed again before it looked.
#[derive(Debug, Default)]
pub(super) struct StopGate(AtomicU64);

/// The gate at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GateState {
    /// Level it is closed at.
    pub(super) level: Option<StopLevel>,
    /// How often it has been opened, from 0 again after 65 535.
    pub(super) openings: u16,
}

/// What closing the gate did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Closing {
    /// Names this state of the gate, for [`StopGate::open`].
    pub(super) count: u64,
    /// Whether the level rose by it.
    pub(super) raised: bool,
}

const LEVEL_BITS: u32 = 8;
const LEVEL_MASK: u64 = (1 << LEVEL_BITS) - 1;
/// Bits below the count of closings: level and count of openings.
const LOW_BITS: u32 = LEVEL_BITS + u16::BITS;
const ONE_CLOSING: u64 = 1 << LOW_BITS;

impl StopGate {
    /// Closes the gate at `level`, or higher if it is closed higher already.
    pub(super) fn close(&self, level: StopLevel) -> Closing {
        let asked = encode(level);
        let next = |word: u64| {
            (word & !LEVEL_MASK).wrapping_add(ONE_CLOSING) | (word & LEVEL_MASK).max(asked)
        };
        let before = self
            .0
            .fetch_update(Ordering::AcqRel, Ordering::Acquire, |word| Some(next(word)))
            .unwrap_or_default();
        Closing { count: next(before) >> LOW_BITS, raised: before & LEVEL_MASK < asked }
    }

    /// Opens the gate if nobody has closed it since the closing of this `count`.
    pub(super) fn open(&self, count: u64) -> bool {
        let open = |word: u64| {
            let openings = openings_of(word).wrapping_add(1);
            (word >> LOW_BITS == count)
                .then_some(count << LOW_BITS | u64::from(openings) << LEVEL_BITS)
        };
        self.0.fetch_update(Ordering::AcqRel, Ordering::Acquire, open).is_ok()
    }

    /// Raises the level of a closed gate, since the robot does not come to rest; an open one stays
    /// open. No closing by itself: whoever resets the stop has seen it.
    pub(super) fn raise(&self, level: StopLevel) {
        let asked = encode(level);
        let raise = |word: u64| {
            let before = word & LEVEL_MASK;
            (before != 0).then_some((word & !LEVEL_MASK) | before.max(asked))
        };
        // An open gate is left as it is.
        let _ = self.0.fetch_update(Ordering::AcqRel, Ordering::Acquire, raise);
    }

    /// How often it has been closed.
    pub(super) fn count(&self) -> u64 {
        self.0.load(Ordering::Acquire) >> LOW_BITS
    }

    /// Level and count of openings, of one instant.
    pub(super) fn state(&self) -> GateState {
        let word = self.0.load(Ordering::Acquire);
        GateState { level: decode(word & LEVEL_MASK), openings: openings_of(word) }
    }

    /// Level it is closed at.
    pub(super) fn level(&self) -> Option<StopLevel> {
        self.state().level
    }
}

const fn openings_of(word: u64) -> u16 {
    (word >> LEVEL_BITS) as u16
}

const fn encode(level: StopLevel) -> u64 {
    match level {
        StopLevel::L2 => 1,
        StopLevel::L1 => 2,
        StopLevel::L0 => 3,
    }
}

const fn decode(level: u64) -> Option<StopLevel> {
    match level {
        0 => None,
        1 => Some(StopLevel::L2),
        2 => Some(StopLevel::L1),
        _ => Some(StopLevel::L0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_only_rises_until_it_is_opened() {
        let gate = StopGate::default();
        assert!(gate.close(StopLevel::L1).raised);
        let last = gate.close(StopLevel::L2);
        assert!(!last.raised);
        assert_eq!(gate.level(), Some(StopLevel::L1));
        assert!(gate.open(last.count));
        assert_eq!(gate.level(), None);
    }

    #[test]
    fn a_stop_that_comes_during_a_reset_keeps_the_gate_closed() {
        let gate = StopGate::default();
        let seen = gate.close(StopLevel::L2).count;
        gate.close(StopLevel::L2);
        assert!(!gate.open(seen));
        assert_eq!(gate.level(), Some(StopLevel::L2));
    }

    #[test]
    fn a_raise_closes_nothing_and_keeps_the_count() {
        let gate = StopGate::default();
        gate.raise(StopLevel::L0);
        assert_eq!((gate.level(), gate.count()), (None, 0));
        let closing = gate.close(StopLevel::L2);
        gate.raise(StopLevel::L1);
        assert_eq!((gate.level(), gate.count()), (Some(StopLevel::L1), closing.count));
        gate.raise(StopLevel::L2);
        assert_eq!(gate.level(), Some(StopLevel::L1), "it only rises");
        assert!(gate.open(closing.count));
    }

    #[test]
    fn one_that_was_closed_again_at_once_shows_that_it_was_open() {
        let gate = StopGate::default();
        let mut count = gate.close(StopLevel::L1).count;
        for openings in (0..=u16::MAX).chain([0, 1]) {
            assert_eq!(gate.state(), GateState { level: Some(StopLevel::L1), openings });
            assert!(gate.open(count));
            assert_eq!(gate.level(), None);
            count = gate.close(StopLevel::L1).count;
        }
        assert_eq!(count, gate.count());
    }

    #[test]
    fn closing_after_opening_counts_on() {
        let gate = StopGate::default();
        let first = gate.close(StopLevel::L0).count;
        assert!(gate.open(first));
        assert_eq!(gate.close(StopLevel::L2).count, first + 1);
    }
}
