//! How the common rate changes.
//!
//! It falls as `r² = r0² - 2 a (s - s0)` with the phase `s`, from where the step is: a function of the
//! place alone, so robots that are not quite level have the same rate at the same place, and rest at
//! the same place. It rises by `a` each second.

use serde::{Deserialize, Serialize};

/// The common rate as it is to be now.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Pace {
    rate: f64,
    target: f64,
    /// Phase \[s\] and rate at which the fall in progress began.
    fall: Option<(f64, f64)>,
}

impl Pace {
    pub(super) const fn at(rate: f64) -> Self {
        Self { rate, target: rate, fall: None }
    }

    pub(super) const fn rate(&self) -> f64 {
        self.rate
    }

    pub(super) const fn target(&self) -> f64 {
        self.target
    }

    /// A fall that is in progress is to have begun at the phase `from_s`, if that is before where it did.
    pub(super) fn fall_from(&mut self, from_s: f64) {
        if let Some((start_s, _)) = &mut self.fall {
            *start_s = start_s.min(from_s);
        }
    }

    /// Goes on for a tick of `period_s` that ends at `phase_s`, toward a `target` that counts from
    /// the phase `from_s` on.
    pub(super) fn follow(
        &mut self,
        target: f64,
        from_s: f64,
        phase_s: f64,
        (slope, period_s): (f64, f64),
    ) {
        if target != self.target {
            self.target = target;
            self.fall = (target < self.rate).then_some((from_s.min(phase_s), self.rate));
        }
        let step = slope * period_s;
        if step <= 0.0 || (self.rate - target).abs() <= step {
            self.rate = target;
            self.fall = None;
        } else if let Some((start_s, start)) = self.fall {
            let square = start * start - 2.0 * slope * (phase_s - start_s).max(0.0);
            self.rate = square.max(target * target).sqrt().min(self.rate);
        } else {
            self.rate += step;
        }
    }
}
