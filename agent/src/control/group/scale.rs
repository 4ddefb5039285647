//! The rate that a robot allows: a step at a place, or at a time while nobody moves.

use serde::{Deserialize, Serialize};

/// The rate that a robot allows the group, before and after a place of the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScaleStep {
    /// Rate before, 0 to 1.
    pub before: f64,
    /// Rate after, 0 to 1.
    pub after: f64,
    /// Phase from which the second counts \[s\].
    pub from_s: f64,
    /// Time since the common start from which it counts as well \[s\]: for robots at rest.
    pub at_s: Option<f64>,
}

impl ScaleStep {
    /// The same rate everywhere.
    #[must_use]
    pub const fn steady(scale: f64) -> Self {
        Self { before: scale, after: scale, from_s: 0.0, at_s: None }
    }

    /// Whether the second rate counts at this phase and time \[s\].
    #[must_use]
    pub fn is_in_force(&self, phase_s: f64, time_s: f64) -> bool {
        phase_s >= self.from_s || self.at_s.is_some_and(|at_s| time_s >= at_s)
    }

    /// The rate that is allowed at this phase and time \[s\].
    #[must_use]
    pub fn at(&self, phase_s: f64, time_s: f64) -> f64 {
        let scale = if self.is_in_force(phase_s, time_s) { self.after } else { self.before };
        scale.clamp(0.0, 1.0)
    }
}
