//! What a motion on a path needs to know of the path.

use crate::{JointVector, MAX_JOINTS};

/// A motion as a function of its own time, the phase: legal when the phase runs as fast as time
/// does, and at rest at its end.
///
/// Every method allocates nothing. `hint` is memory of where the last question was answered; begin
/// with zero.
pub trait TimedCurve {
    /// Number of joints.
    fn joint_count(&self) -> usize;

    /// Phase at the end \[s\].
    fn duration_s(&self) -> f64;

    /// Whether the jerk of the curve itself stays within the limits. If so, that of a motion on it
    /// will; if not, only what the motion adds to it does.
    fn limits_jerk(&self) -> bool;

    /// Position and its derivatives by the phase at `phase_s` \[s\], from the right at a knot; at
    /// rest at the ends outside of the curve.
    fn point(&self, phase_s: f64, hint: &mut usize) -> CurvePoint;

    /// Makes `bounds` hold the derivatives wherever they are between two phases \[s\], from both
    /// sides at a knot. They may be wider than need be; the narrower, the faster the ramps.
    fn bounds(&self, from_s: f64, to_s: f64, hint: &mut usize, bounds: &mut CurveBounds);
}

/// Position of all joints on a curve, and its derivatives by the phase.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurvePoint {
    /// Position \[rad or m\].
    pub position: JointVector,
    /// First derivative \[1/s\].
    pub first: JointVector,
    /// Second derivative \[1/s²\].
    pub second: JointVector,
}

/// Lowest and highest value of the derivatives of each joint on a piece of a curve.
#[derive(Clone, Copy, Debug)]
pub struct CurveBounds {
    /// First derivative \[1/s\].
    pub first: [Span; MAX_JOINTS],
    /// Second derivative \[1/s²\].
    pub second: [Span; MAX_JOINTS],
    /// Third derivative \[1/s³\].
    pub third: [Span; MAX_JOINTS],
}

/// Lowest and highest value of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
}

impl CurveBounds {
    /// Bounds that hold nothing yet.
    pub const EMPTY: Self = Self {
        first: [Span::EMPTY; MAX_JOINTS],
        second: [Span::EMPTY; MAX_JOINTS],
        third: [Span::EMPTY; MAX_JOINTS],
    };

    /// Widens the bounds of `joint` by the cubic whose derivatives at its beginning are
    /// `derivatives`, first to third, over `length_s` \[s\]: exactly.
    #[inline]
    pub fn include_cubic(&mut self, joint: usize, derivatives: [f64; 3], length_s: f64) {
        if joint >= MAX_JOINTS {
            return;
        }
        let [first, second, third] = derivatives;
        let second_end = second + length_s * third;
        let first_end = first + 0.5 * length_s * (second + second_end);
        self.first[joint].include(first);
        self.first[joint].include(first_end);
        if second * second_end < 0.0 {
            self.first[joint].include(first - 0.5 * second * second / third);
        }
        self.second[joint].include(second);
        self.second[joint].include(second_end);
        self.third[joint].include(third);
    }

    /// Widens the bounds of `joint` by the polynomial of fifth degree whose derivatives at its
    /// beginning are `derivatives`, first to fifth, over `length_s` \[s\]. They are those of the
    /// control points of the derivatives in Bernstein form: never too narrow, exact at both ends,
    /// and too wide by the square of the length.
    ///
    /// Source: G. Farin, Curves and Surfaces for CAGD, 5th edition, section 5.1, convex hull.
    pub fn include_quintic(&mut self, joint: usize, derivatives: [f64; 5], length_s: f64) {
        if joint >= MAX_JOINTS {
            return;
        }
        let [first, second, third, fourth, fifth] = derivatives;
        let (h, h2) = (length_s, length_s * length_s);
        let (a1, a2) = (h * second / 4.0, h2 * third / 12.0);
        let (a3, a4) = (h * h2 * fourth / 24.0, h2 * h2 * fifth / 24.0);
        self.first[joint].include_all([
            first,
            first + a1,
            first + 2.0 * a1 + a2,
            first + 3.0 * a1 + 3.0 * a2 + a3,
            first + 4.0 * a1 + 6.0 * a2 + 4.0 * a3 + a4,
        ]);
        let (b1, b2, b3) = (h * third / 3.0, h2 * fourth / 6.0, h * h2 * fifth / 6.0);
        self.second[joint].include_all([
            second,
            second + b1,
            second + 2.0 * b1 + b2,
            second + 3.0 * b1 + 3.0 * b2 + b3,
        ]);
        let (c1, c2) = (h * fourth / 2.0, h2 * fifth / 2.0);
        self.third[joint].include_all([third, third + c1, third + 2.0 * c1 + c2]);
    }
}

impl Span {
    /// Holds nothing.
    pub const EMPTY: Self = Self { low: f64::INFINITY, high: f64::NEG_INFINITY };

    /// Between two values in any order.
    #[must_use]
    pub const fn between(a: f64, b: f64) -> Self {
        Self { low: a.min(b), high: a.max(b) }
    }

    /// Widens it to hold `value`.
    #[inline]
    pub const fn include(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }

    fn include_all<const N: usize>(&mut self, values: [f64; N]) {
        for value in values {
            self.include(value);
        }
    }

    /// All products of a value of each.
    #[inline]
    #[must_use]
    pub const fn times(self, other: Self) -> Self {
        let a = Self::between(self.low * other.low, self.low * other.high);
        let b = Self::between(self.high * other.low, self.high * other.high);
        Self { low: a.low.min(b.low), high: a.high.max(b.high) }
    }

    /// All sums of a value of each.
    #[inline]
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self { low: self.low + other.low, high: self.high + other.high }
    }

    /// All products with one number.
    #[inline]
    #[must_use]
    pub const fn scaled(self, factor: f64) -> Self {
        Self::between(self.low * factor, self.high * factor)
    }

    /// Whether no value is further from zero than `limit`.
    #[inline]
    #[must_use]
    pub const fn is_within(self, limit: f64) -> bool {
        self.low >= -limit && self.high <= limit
    }

    /// Highest absolute value.
    #[inline]
    #[must_use]
    pub const fn peak(self) -> f64 {
        self.high.max(-self.low)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_a_quintic_hold_its_derivatives_and_meet_them_at_the_ends() {
        // Of u^5 - 2 u^4 + u^3 from u = 0.2 on, over 0.5.
        let at = |u: f64| {
            let first = 5.0 * u.powi(4) - 8.0 * u.powi(3) + 3.0 * u * u;
            let second = 20.0 * u.powi(3) - 24.0 * u * u + 6.0 * u;
            [first, second, 60.0 * u * u - 48.0 * u + 6.0, 120.0 * u - 48.0, 120.0]
        };
        let mut bounds = CurveBounds::EMPTY;
        bounds.include_quintic(0, at(0.2), 0.5);
        let spans = [bounds.first[0], bounds.second[0], bounds.third[0]];
        for piece in 0..=1000 {
            let derivatives = at(0.2 + 0.5 * f64::from(piece) / 1000.0);
            for (span, value) in spans.iter().zip(derivatives) {
                assert!(
                    span.low <= value + 1e-12 && value <= span.high + 1e-12,
                    "{value} {span:?}"
                );
            }
        }
        let mut end = CurveBounds::EMPTY;
        end.include_quintic(0, at(0.7), 0.0);
        for (point, value) in [end.first[0], end.second[0], end.third[0]].iter().zip(at(0.7)) {
            assert_eq!((point.low, point.high), (value, value));
        }
    }
}
