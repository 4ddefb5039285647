//! The phase, how fast it runs, and how that changes.

use super::curve::Span;
use serde::{Deserialize, Serialize};

/// How near a rate is to another to be taken for it.
pub(super) const RATE_TOLERANCE: f64 = 1e-9;

/// Where a motion is on its path and how fast the phase runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Rate {
    /// Phase \[s\].
    pub(super) phase_s: f64,
    /// Its rate, from 0 to 1.
    pub(super) rate: f64,
    /// Change of the rate \[1/s\].
    pub(super) slope: f64,
}

/// A piece of time with constant curvature of the rate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) start: Rate,
    pub(super) end: Rate,
    /// Second derivative of the rate \[1/s²\].
    pub(super) curvature: f64,
    pub(super) length_s: f64,
}

impl Rate {
    /// The piece of `length_s` \[s\] from here.
    pub(super) fn piece(self, curvature: f64, length_s: f64) -> Piece {
        Piece { start: self, end: self.after(curvature, length_s), curvature, length_s }
    }

    fn after(self, curvature: f64, t_s: f64) -> Self {
        let Self { phase_s, rate, slope } = self;
        Self {
            phase_s: phase_s + t_s * (rate + t_s * (0.5 * slope + t_s * curvature / 6.0)),
            rate: rate + t_s * (slope + 0.5 * t_s * curvature),
            slope: slope + t_s * curvature,
        }
    }

    /// The rate that remains when the slope has been brought to zero with `curvature` \[1/s²\], an
    /// absolute value.
    pub(super) fn settled(self, curvature: f64) -> f64 {
        if self.slope == 0.0 {
            return self.rate;
        }
        self.rate + 0.5 * self.slope * self.slope.abs() / curvature
    }
}

impl Piece {
    /// All rates of the piece; of a parabola, so its vertex counts if it is inside.
    pub(super) fn rates(&self) -> Span {
        let mut span = Span::between(self.start.rate, self.end.rate);
        if self.start.slope * self.end.slope < 0.0 {
            let vertex = self.start.rate - 0.5 * self.start.slope.powi(2) / self.curvature;
            span.include(vertex);
        }
        span
    }

    pub(super) const fn slopes(&self) -> Span {
        Span::between(self.start.slope, self.end.slope)
    }
}
