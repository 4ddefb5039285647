//! How to search.

use crate::JointVector;

/// How [`InverseKinematics`](crate::InverseKinematics) searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseOptions {
    /// Largest distance from the target that counts as reached \[m\], above zero.
    pub position_tolerance: f64,
    /// Largest angle from the target that counts as reached \[rad\], above zero.
    pub orientation_tolerance: f64,
    /// Most iterations of a warm solution.
    pub warm_iterations: u32,
    /// Most starts of a cold solution.
    pub starts: u32,
    /// Distance \[rad or m\] kept from every joint limit; at most half of a joint's range is used.
    pub limit_margin: f64,
    /// Posture to come near where the target leaves freedom.
    pub preferred: Option<PreferredPosture>,
    /// Number from which the random starts follow.
    pub random_seed: u64,
}

impl Default for InverseOptions {
    fn default() -> Self {
        Self {
            position_tolerance: 1e-6,
            orientation_tolerance: 1e-6,
            warm_iterations: 30,
            starts: 100,
            limit_margin: 0.0,
            preferred: None,
            random_seed: 0x5EED,
        }
    }
}

/// A posture to come near where a target leaves freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreferredPosture {
    /// Position of each variable \[rad or m\]; variables beyond the end count as indifferent.
    pub positions: JointVector,
    /// How much each variable's distance counts, not negative; empty if all count alike.
    pub weights: JointVector,
}

impl PreferredPosture {
    /// The posture `positions`, every variable counting alike.
    #[must_use]
    pub const fn new(positions: JointVector) -> Self {
        Self { positions, weights: JointVector::EMPTY }
    }

    /// Weight of the variable at `index`.
    pub(super) fn weight(&self, index: usize) -> f64 {
        let given = if index < self.positions.len() { 1.0 } else { 0.0 };
        if self.weights.is_empty() {
            return given;
        }
        given * self.weights.get(index).copied().unwrap_or_default().max(0.0)
    }

    /// Weighted square of the distance of `positions`.
    #[must_use]
    pub fn squared_distance(&self, positions: &[f64]) -> f64 {
        let parts = positions.iter().zip(self.positions.iter()).enumerate();
        parts.map(|(index, (q, wanted))| self.weight(index) * (q - wanted) * (q - wanted)).sum()
    }
}
