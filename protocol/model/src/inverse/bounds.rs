//! Where joints may be while a solver searches.

use crate::{Chain, JointType, MAX_JOINTS};

/// Half the width searched around the seed for sliding joints without limits \[m\].
const FREE_SLIDE: f64 = 1.0;

/// Limits of a chain's variables, and which may turn whole turns.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    len: usize,
    lower: [f64; MAX_JOINTS],
    upper: [f64; MAX_JOINTS],
    /// Whether adding whole turns leads to other positions inside the limits.
    wraps: [bool; MAX_JOINTS],
    slides: [bool; MAX_JOINTS],
}

/// What is done about limits while searching.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keep {
    /// Joints stop at their limits: the motion from the seed is continuous.
    Inside,
    /// As well, but joints that turn more than once around go on at the other end.
    Wrapping,
    /// Limits are ignored.
    Ignored,
}

impl Bounds {
    /// The limits of `chain`, each drawn in by `margin`, to the middle at most.
    pub(super) fn new(chain: &Chain, margin: f64) -> Self {
        let mut bounds = Self {
            len: chain.len(),
            lower: [f64::NEG_INFINITY; MAX_JOINTS],
            upper: [f64::INFINITY; MAX_JOINTS],
            wraps: [false; MAX_JOINTS],
            slides: [false; MAX_JOINTS],
        };
        let margin = if margin > 0.0 { margin } else { 0.0 };
        for (k, variable) in chain.variables().iter().enumerate() {
            let (lower, upper) = (variable.limits.lower, variable.limits.upper);
            let middle = lower.zip(upper).map(|(lower, upper)| 0.5 * (lower + upper));
            let inner = |limit: f64| middle.map_or(limit, |middle| limit.max(middle));
            let outer = |limit: f64| middle.map_or(limit, |middle| limit.min(middle));
            bounds.lower[k] = lower.map_or(f64::NEG_INFINITY, |limit| outer(limit + margin));
            bounds.upper[k] = upper.map_or(f64::INFINITY, |limit| inner(limit - margin));
            bounds.slides[k] = variable.joint_type == JointType::Prismatic;
            bounds.wraps[k] =
                variable.periodic && bounds.upper[k] - bounds.lower[k] >= std::f64::consts::TAU;
        }
        bounds
    }

    pub(super) const fn len(&self) -> usize {
        self.len
    }

    pub(super) const fn limits(&self, k: usize) -> (f64, f64) {
        (self.lower[k], self.upper[k])
    }

    /// Largest absolute position \[m\] of a variable that slides; `None` without limits.
    pub(super) fn farthest(&self, k: usize) -> Option<f64> {
        let farthest = self.lower[k].abs().max(self.upper[k].abs());
        farthest.is_finite().then_some(farthest)
    }

    /// Whether position `q` of variable `k` is at a limit and `direction` leads out.
    #[inline]
    pub(super) fn blocks(&self, k: usize, q: f64, direction: f64, keep: Keep) -> bool {
        if keep == Keep::Ignored || (keep == Keep::Wrapping && self.wraps[k]) {
            return false;
        }
        (direction < 0.0 && q <= self.lower[k]) || (direction > 0.0 && q >= self.upper[k])
    }

    /// The position nearest to `q` that `keep` allows to variable `k`.
    #[inline]
    pub(super) fn keep(&self, k: usize, q: f64, keep: Keep) -> f64 {
        let (lower, upper) = (self.lower[k], self.upper[k]);
        if keep == Keep::Ignored || (lower <= q && q <= upper) {
            return q;
        }
        if keep == Keep::Wrapping && self.wraps[k] {
            let turned = lower + (q - lower).rem_euclid(std::f64::consts::TAU);
            return turned.clamp(lower, upper);
        }
        q.max(lower).min(upper)
    }

    /// Every position of `q` moved by whole turns, where that changes nothing, as near to `seed` as
    /// limits allow.
    pub(super) fn bring_near(&self, q: &mut [f64], seed: &[f64]) {
        const TAU: f64 = std::f64::consts::TAU;
        for (k, (q, seed)) in q.iter_mut().zip(seed).enumerate() {
            if self.wraps[k] {
                let mut near = *q + ((seed - *q) / TAU).round() * TAU;
                if near < self.lower[k] {
                    near += ((self.lower[k] - near) / TAU).ceil() * TAU;
                }
                if near > self.upper[k] {
                    near -= ((near - self.upper[k]) / TAU).ceil() * TAU;
                }
                // A rounding error beyond a limit is worse than a turn more.
                if self.lower[k] <= near && near <= self.upper[k] {
                    *q = near;
                }
            }
        }
    }

    /// The positions, moved by whole turns, that are least beyond the limits.
    pub(super) fn bring_inside(&self, q: &mut [f64], chain: &Chain) {
        const TAU: f64 = std::f64::consts::TAU;
        for (k, (q, variable)) in q.iter_mut().zip(chain.variables()).enumerate() {
            let (lower, upper) = (self.lower[k], self.upper[k]);
            if variable.periodic && lower.is_finite() && upper.is_finite() {
                let middle = 0.5 * (lower + upper);
                *q -= ((*q - middle) / TAU).round() * TAU;
            }
        }
    }

    /// Where random starts of variable `k` lie, `unit` going from 0 to 1: at most one turn about the
    /// middle of its range, or about the seed where there is none.
    pub(super) fn at(&self, k: usize, unit: f64, seed: f64) -> f64 {
        let half = if self.slides[k] { FREE_SLIDE } else { std::f64::consts::PI };
        let (lower, upper) = (self.lower[k], self.upper[k]);
        let (from, to) = match (lower.is_finite(), upper.is_finite()) {
            (true, true) if self.slides[k] => (lower, upper),
            (true, true) => {
                let middle = 0.5 * (lower + upper);
                (lower.max(middle - half), upper.min(middle + half))
            }
            (true, false) => (lower, lower + 2.0 * half),
            (false, true) => (upper - 2.0 * half, upper),
            (false, false) => (seed - half, seed + half),
        };
        from + unit * (to - from)
    }
}
