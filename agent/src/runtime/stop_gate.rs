//! The gate that a stop closes: one atomic word, shared by Zenoh's callbacks and the loop.

use std::sync::atomic::{AtomicU64, Ordering};

use armada_protocol::messages::StopLevel;

/// Closed at the highest level asked for since it was last opened.
///
/// The word holds a count of closings and the level; opening names the count it has seen, so a
/// stop that comes in during a reset cannot be lost.
#[derive(Debug, Default)]
pub(super) struct StopGate(AtomicU64);

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

impl StopGate {
    /// Closes the gate at `level`, or higher if it is closed higher already.
    pub(super) fn close(&self, level: StopLevel) -> Closing {
        let asked = encode(level);
        let next =
            |word: u64| (((word >> LEVEL_BITS) + 1) << LEVEL_BITS) | (word & LEVEL_MASK).max(asked);
        let before = self
            .0
            .fetch_update(Ordering::AcqRel, Ordering::Acquire, |word| Some(next(word)))
            .unwrap_or_default();
        Closing { count: next(before) >> LEVEL_BITS, raised: before & LEVEL_MASK < asked }
    }

    /// Opens the gate if nobody has closed it since the closing of this `count`.
    pub(super) fn open(&self, count: u64) -> bool {
        let open = |word: u64| (word >> LEVEL_BITS == count).then_some(count << LEVEL_BITS);
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
        self.0.load(Ordering::Acquire) >> LEVEL_BITS
    }

    /// Level it is closed at.
    pub(super) fn level(&self) -> Option<StopLevel> {
        decode(self.0.load(Ordering::Acquire) & LEVEL_MASK)
    }
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
    fn closing_after_opening_counts_on() {
        let gate = StopGate::default();
        let first = gate.close(StopLevel::L0).count;
        assert!(gate.open(first));
        assert_eq!(gate.close(StopLevel::L2).count, first + 1);
    }
}
