//! What is known of one partner.

use armada_model::MonoTime;
use armada_protocol::messages::GroupState;
use serde::{Deserialize, Serialize};

use super::words::{Beat, Word};

/// How much slower than it was the quickest way may become without its being noticed, for clocks
/// that drift apart \[s/s\].
const CREEP: f64 = 1e-4;
/// By how much starts may be shifted against each other \[s\]: robots whose controllers are later begin
/// earlier.
const SHIFT_S: f64 = 0.05;

/// What is known of one partner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Partner {
    pub(super) go: bool,
    pub(super) aborted: bool,
    /// Where the common ramp begins that it names \[s\].
    pub(super) ramp_from_s: Option<f64>,
    /// Its newest heartbeat.
    pub(super) beat: Option<Beat>,
    /// When that came in.
    heard: MonoTime,
    /// What a heartbeat's time and its arrival differ by at least \[s\]: shift of the starts, drift of
    /// the clocks.
    pub(super) base_s: f64,
    /// How far the own robot was ahead of it when it was heard last \[s\].
    pub(super) ahead_s: f64,
    /// Whether its newest heartbeat was not compared yet.
    pub(super) is_new: bool,
}

impl Partner {
    /// Takes something it said, which came in `at`, at `at_s` since the common start.
    pub(super) fn hear(&mut self, word: &Word, at: MonoTime, at_s: f64) {
        match *word {
            Word::Go => self.go = true,
            Word::Abort { from_phase_s } => self.abort(from_phase_s),
            Word::Heartbeat(beat) => self.hear_beat(beat, at, at_s),
        }
    }

    fn hear_beat(&mut self, beat: Beat, at: MonoTime, at_s: f64) {
        if self.beat.is_some_and(|newest| beat.seq <= newest.seq) {
            return;
        }
        let passed_s = self.beat.map(|newest| (beat.time_s - newest.time_s).max(0.0));
        let base_s = passed_s.map_or(SHIFT_S, |passed_s| self.base_s + CREEP * passed_s);
        self.base_s = base_s.min(at_s - beat.time_s);
        (self.heard, self.is_new) = (at, true);
        self.beat = Some(beat);
        if beat.state == GroupState::Aborting {
            self.abort(None);
        }
    }

    fn abort(&mut self, from_s: Option<f64>) {
        self.aborted = true;
        self.ramp_from_s = match (self.ramp_from_s, from_s) {
            (Some(known_s), Some(from_s)) => Some(known_s.min(from_s)),
            (known, from) => known.or(from),
        };
    }

    /// How old the newest thing is that is known of it \[s\]; none if it was never heard.
    pub(super) fn silence_s(&self, now: MonoTime, now_s: f64) -> Option<f64> {
        let said_s = now_s - self.beat?.time_s - self.base_s;
        Some(said_s.max(now.saturating_since(self.heard).as_secs_f64()))
    }

    pub(super) fn is_in(&self, state: GroupState) -> bool {
        self.beat.is_some_and(|beat| beat.state == state)
    }

    /// Whether nothing has to be heard of it any more.
    pub(super) fn has_ended(&self) -> bool {
        self.aborted || self.is_in(GroupState::Done)
    }

    /// Whether it rests, as far as is known.
    pub(super) fn rests(&self) -> bool {
        self.beat.is_some_and(|beat| beat.rate == 0.0)
    }
}
