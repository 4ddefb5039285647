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
