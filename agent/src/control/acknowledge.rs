//! Has somebody at the arm acknowledged? A signal of the controller that goes from off to on.
//!
//! One that was on when it was first seen is no proof of anybody: a button may be jammed.

use armada_model::MonoTime;
use serde::{Deserialize, Serialize};

use super::state::{LoopState, Tick};

/// The signal as it was seen last, and its last rise.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Acknowledgement {
    /// `None` while it is not known.
    on: Option<bool>,
    at: Option<MonoTime>,
}

impl Acknowledgement {
    /// When the signal rose last.
    pub(super) const fn at(&self) -> Option<MonoTime> {
        self.at
    }
}

impl LoopState {
    /// Looks whether the signal has risen.
    pub(super) fn watch_acknowledgement(&mut self, tick: &Tick<'_>) {
        let Some(index) = tick.params.acknowledge else { return };
        let signals = self.condition.feedback().map(|feedback| feedback.signals);
        let value = signals.and_then(|signals| signals.as_slice().get(index).copied());
        let on = value.map(|value| value != 0.0);
        let before = std::mem::replace(&mut self.acknowledgement.on, on);
        if (before, on) == (Some(false), Some(true)) {
            self.acknowledgement.at = Some(tick.now);
        }
    }
}
