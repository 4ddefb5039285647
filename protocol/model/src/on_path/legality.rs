//! Whether a piece of a motion on a path keeps the limits of all joints, by interval arithmetic.

use super::curve::{CurveBounds, Span, TimedCurve};
use super::rate::{Piece, RATE_TOLERANCE, Rate};
use crate::{LIMIT_TOLERANCE, MotionLimits};

/// Into how many pieces a way back to a constant rate is cut for the check. More make it less
/// conservative and slower.
const RETURN_PIECES: u32 = 6;

/// Into how many pieces a step is cut for the check.
const STEP_PIECES: u32 = 2;

/// Highest curvature of the rate \[1/s²\], for where no joint moves: from 0 to 1 in 20 ms.
const MAX_CURVATURE: f64 = 1e4;

/// Without any limit of a joint.
const FREE: Span = Span { low: -MAX_CURVATURE, high: MAX_CURVATURE };

/// Share of a joint's jerk that the way back to a constant rate takes for itself; the curve's
/// acceleration needs the rest.
const CALM_SHARE: f64 = 0.75;

/// By how much a bound may be exceeded, of the limit: what the curve itself may, and rounding.
const TOLERANCE: f64 = 1.1 * LIMIT_TOLERANCE;

/// A curve with the limits of its joints, and memory for questions about it.
pub(super) struct Legality<'a, C> {
    pub(super) curve: &'a C,
    pub(super) limits: &'a MotionLimits,
    pub(super) hint: usize,
    pub(super) bounds: CurveBounds,
}

impl<C: TimedCurve> Legality<'_, C> {
    /// Loads the bounds of the curve for phases from `from_s` to `to_s` \[s\].
    pub(super) fn load(&mut self, from_s: f64, to_s: f64) {
        self.curve.bounds(from_s, to_s, &mut self.hint, &mut self.bounds);
    }

    /// Whether acceleration `q'' r² + q' ṙ` and jerk `q''' r³ + 3 q'' r ṙ + q' r̈` stay within the
    /// limits all along `piece`; the first term of the jerk counts if the curve promises it.
    pub(super) fn allows(&mut self, piece: &Piece) -> bool {
        let mut rates = piece.rates();
        if rates.low < -RATE_TOLERANCE || rates.high > 1.0 + RATE_TOLERANCE {
            return false;
        }
        rates = Span { low: rates.low.clamp(0.0, 1.0), high: rates.high.clamp(0.0, 1.0) };
        self.load(piece.start.phase_s, piece.end.phase_s);
        let slopes = piece.slopes();
        let squares = Span { low: rates.low * rates.low, high: rates.high * rates.high };
        let cubes = Span { low: squares.low * rates.low, high: squares.high * rates.high };
        let cross = rates.times(slopes).scaled(3.0);
        let promised = self.curve.limits_jerk();
        let CurveBounds { first, second, third } = &self.bounds;
        self.limits.iter().enumerate().all(|(joint, axis)| {
            let (first, second) = (first[joint], second[joint]);
            let acceleration = second.times(squares).plus(first.times(slopes));
            let mut jerk = second.times(cross).plus(first.scaled(piece.curvature));
            if promised {
                jerk = jerk.plus(third[joint].times(cubes));
            }
            acceleration.is_within(axis.acceleration * (1.0 + TOLERANCE))
                && jerk.is_within(axis.jerk * (1.0 + TOLERANCE))
        })
    }

    /// As [`allows`](Self::allows), cut in pieces.
    pub(super) fn allows_cut(&mut self, piece: &Piece) -> bool {
        let mut from = piece.start;
        let length_s = piece.length_s / f64::from(STEP_PIECES);
        (0..STEP_PIECES).all(|_| {
            let part = from.piece(piece.curvature, length_s);
            from = part.end;
            self.allows(&part)
        })
    }

    /// Whether the slope can be brought from that of `start` to zero with `curvature`, an absolute
    /// value.
    pub(super) fn allows_return(&mut self, start: Rate, curvature: f64) -> bool {
        let length_s = start.slope.abs() / curvature / f64::from(RETURN_PIECES);
        let curvature = -curvature.copysign(start.slope);
        let mut from = start;
        (0..RETURN_PIECES).all(|_| {
            let piece = from.piece(curvature, length_s);
            from = piece.end;
            length_s == 0.0 || self.allows(&piece)
        })
    }

    /// What the bounds that are loaded leave from the state `at` on, for `ahead_s` \[s\].
    pub(super) fn local(&self, at: Rate, ahead_s: f64) -> Local {
        let slopes = self.slopes(Span::between(at.rate, at.rate));
        // The room depends on the rate, which will change by as much as that.
        let rates = Span {
            low: (at.rate + ahead_s * slopes.low).clamp(0.0, 1.0),
            high: (at.rate + ahead_s * slopes.high).clamp(0.0, 1.0),
        };
        let rates = if at.slope > 0.0 {
            Span { low: at.rate, ..rates }
        } else {
            Span { high: at.rate, ..rates }
        };
        let mut local = Local { slopes: self.slopes(rates), curvatures: FREE, calm: MAX_CURVATURE };
        let promised = if self.curve.limits_jerk() { at.rate.powi(3) } else { 0.0 };
        for (joint, axis) in self.limits.iter().enumerate() {
            let first = self.bounds.first[joint];
            let cross = self.bounds.second[joint].scaled(3.0 * at.rate * at.slope);
            let used = cross.plus(self.bounds.third[joint].scaled(promised));
            narrow(&mut local.curvatures, first, used, axis.jerk);
            local.calm = local.calm.min(CALM_SHARE * axis.jerk / first.peak());
        }
        local
    }

    /// The slopes that the accelerations of all joints allow at any of `rates`.
    fn slopes(&self, rates: Span) -> Span {
        let squares = Span { low: rates.low * rates.low, high: rates.high * rates.high };
        let mut slopes = FREE;
        for (joint, axis) in self.limits.iter().enumerate() {
            let used = self.bounds.second[joint].times(squares);
            narrow(&mut slopes, self.bounds.first[joint], used, axis.acceleration);
        }
        slopes
    }
}

/// What the joints leave to slope and curvature of the rate at one state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    pub(super) slopes: Span,
    pub(super) curvatures: Span,
    /// An absolute curvature that leaves a share of each joint's jerk to the curve.
    pub(super) calm: f64,
}

/// Narrows `allowed` to the numbers `x` with `used + factor x` within `limit`; zero always stays.
fn narrow(allowed: &mut Span, factor: Span, used: Span, limit: f64) {
    let below = (limit + used.low).max(0.0);
    let above = (limit - used.high).max(0.0);
    if factor.high > 0.0 {
        allowed.low = allowed.low.max(-below / factor.high);
        allowed.high = allowed.high.min(above / factor.high);
    }
    if factor.low < 0.0 {
        allowed.low = allowed.low.max(above / factor.low);
        allowed.high = allowed.high.min(below / -factor.low);
    }
}
