//! Polynomials of one joint on one segment, and where they and their derivatives are extreme.

use arrayvec::ArrayVec;

use super::roots::{linear_root, quadratic_roots, roots_between};

/// `c0 + c1 u + c2 u² + …` with `N` coefficients, for `u` from 0 to `length`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece<const N: usize> {
    pub(super) length: f64,
    pub(super) coefficients: [f64; N],
}

/// Position and its derivatives at one end of a [`Piece`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    pub(super) position: f64,
    pub(super) velocity: f64,
    /// Not used by a cubic.
    pub(super) acceleration: f64,
}

/// Both ends, and up to four points between.
pub(super) type Candidates = ArrayVec<f64, 6>;

/// Where a piece can be extreme. The ends come first.
pub(super) trait Extrema {
    /// Where position can be extreme.
    fn position_extrema(&self) -> Candidates;
    /// Where velocity can be extreme.
    fn velocity_extrema(&self) -> Candidates;
    /// Where acceleration can be extreme.
    fn acceleration_extrema(&self) -> Candidates;
    /// Where jerk can be extreme.
    fn jerk_extrema(&self) -> Candidates;
}

impl Piece<4> {
    /// The cubic that has these positions and velocities at its ends.
    pub(super) fn hermite(length: f64, from: Knot, to: Knot) -> Self {
        let chord = (to.position - from.position) / length;
        let c2 = (3.0 * chord - 2.0 * from.velocity - to.velocity) / length;
        let c3 = (from.velocity + to.velocity - 2.0 * chord) / (length * length);
        Self { length, coefficients: [from.position, from.velocity, c2, c3] }
    }
}

impl Piece<6> {
    /// The polynomial of fifth degree that has these positions, velocities and accelerations at
    /// its ends.
    ///
    /// Source: J. Craig, Introduction to Robotics, third edition, section 7.3, equation (7.18),
    /// with the position's difference taken out first, so that it does not lose digits.
    pub(super) fn hermite(length: f64, from: Knot, to: Knot) -> Self {
        let h = length;
        // What is missing at the end if the start's acceleration goes on.
        let chord = (to.position - from.position) / h;
        let (v0, v1) = (from.velocity, to.velocity);
        let (a0, a1) = (from.acceleration * h, to.acceleration * h);
        let c3 = (20.0 * chord - 8.0 * v1 - 12.0 * v0 - 3.0 * a0 + a1) / (2.0 * h * h);
        let c4 = (-30.0 * chord + 14.0 * v1 + 16.0 * v0 + 3.0 * a0 - 2.0 * a1) / (2.0 * h * h * h);
        let c5 = (12.0 * chord - 6.0 * (v1 + v0) + a1 - a0) / (2.0 * h * h * h * h);
        let c2 = 0.5 * from.acceleration;
        Self { length, coefficients: [from.position, v0, c2, c3, c4, c5] }
    }
}

impl<const N: usize> Piece<N> {
    pub(super) fn position(&self, u: f64) -> f64 {
        self.coefficients.iter().rev().fold(0.0, |sum, c| sum * u + c)
    }

    pub(super) fn velocity(&self, u: f64) -> f64 {
        self.derivative(1, u)
    }

    pub(super) fn acceleration(&self, u: f64) -> f64 {
        self.derivative(2, u)
    }

    pub(super) fn jerk(&self, u: f64) -> f64 {
        self.derivative(3, u)
    }

    #[inline]
    fn derivative(&self, order: usize, u: f64) -> f64 {
        let terms = self.coefficients.iter().enumerate().skip(order).rev();
        terms.fold(0.0, |sum, (power, c)| sum * u + falling(power, order) * c)
    }

    /// Coefficients of a derivative, `M` of them; `M` is `N` less the order.
    fn differentiated<const M: usize>(&self) -> [f64; M] {
        let order = N - M;
        std::array::from_fn(|power| {
            falling(power + order, order) * self.coefficients[power + order]
        })
    }

    fn with_ends(&self, between: impl IntoIterator<Item = f64>) -> Candidates {
        let inside = between.into_iter().filter(|&u| u > 0.0 && u < self.length);
        // Not more than four, since no derivative of a piece has more roots.
        [0.0, self.length].into_iter().chain(inside.take(4)).collect()
    }
}

impl Extrema for Piece<4> {
    fn position_extrema(&self) -> Candidates {
        self.with_ends(quadratic_roots(&self.differentiated()))
    }

    fn velocity_extrema(&self) -> Candidates {
        self.with_ends(linear_root(&self.differentiated()))
    }

    fn acceleration_extrema(&self) -> Candidates {
        self.with_ends([])
    }

    fn jerk_extrema(&self) -> Candidates {
        self.with_ends([])
    }
}

impl Extrema for Piece<6> {
    fn position_extrema(&self) -> Candidates {
        let velocity: [f64; 5] = self.differentiated();
        self.with_ends(roots_between(&velocity, &self.velocity_extrema()))
    }

    fn velocity_extrema(&self) -> Candidates {
        let acceleration: [f64; 4] = self.differentiated();
        self.with_ends(roots_between(&acceleration, &self.acceleration_extrema()))
    }

    fn acceleration_extrema(&self) -> Candidates {
        self.with_ends(quadratic_roots(&self.differentiated()))
    }

    fn jerk_extrema(&self) -> Candidates {
        self.with_ends(linear_root(&self.differentiated()))
    }
}

/// `power (power - 1) …`, `order` factors.
#[inline]
const fn falling(power: usize, order: usize) -> f64 {
    let mut product = 1;
    let mut factor = 0;
    while factor < order {
        product *= power - factor;
        factor += 1;
    }
    product as f64
}
