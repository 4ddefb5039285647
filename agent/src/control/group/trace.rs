//! Where the own robot was of late, to be compared with what a partner said of an earlier time.

use arrayvec::ArrayVec;
use serde::{Deserialize, Serialize};

/// Entries; with [`SPACING_S`] they reach back by more than the longest loss time.
const LEN: usize = 40;
/// Least time between two entries \[s\].
const SPACING_S: f64 = 0.005;

/// Phases at times, oldest first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Trace {
    entries: ArrayVec<(f64, f64), LEN>,
    now: (f64, f64),
}

impl Trace {
    /// Takes the phase \[s\] at a time \[s\], not before the last one, and the rate that led to it.
    pub(super) fn note(&mut self, time_s: f64, phase_s: f64, rate: f64) {
        let stood = self.entries.last().is_some_and(|last| last.1 == self.now.1);
        if stood && phase_s != self.now.1 {
            // Where it began to go, which is between two ticks: from there on it is taken to go evenly.
            let took_s = if rate > 0.0 { (phase_s - self.now.1) / rate } else { 0.0 };
            self.push(((time_s - took_s).clamp(self.now.0, time_s), self.now.1));
        }
        let due = self.entries.last().is_none_or(|(last_s, _)| time_s - last_s >= SPACING_S);
        if due {
            self.push((time_s, phase_s));
        }
        self.now = (time_s, phase_s);
    }

    fn push(&mut self, entry: (f64, f64)) {
        if self.entries.is_full() {
            self.entries.remove(0);
        }
        // There is room.
        self.entries.push(entry);
    }

    /// The phase at `time_s`; none if that is further back than it reaches. Later than now it goes on
    /// at `rate`.
    pub(super) fn phase_at(&self, time_s: f64, rate: f64) -> Option<f64> {
        let (mut later_s, mut later) = self.now;
        if time_s >= later_s {
            return Some(later + rate * (time_s - later_s));
        }
        for &(before_s, before) in self.entries.iter().rev() {
            if before_s <= time_s {
                let span_s = later_s - before_s;
                let share = if span_s > 0.0 { (time_s - before_s) / span_s } else { 0.0 };
                return Some(before + share * (later - before));
            }
            (later_s, later) = (before_s, before);
        }
        None
    }
}
