//! Cubic polynomials through two points, the slopes of a spline, and the extremes between.

use arrayvec::ArrayVec;

/// `c0 + c1 u + c2 u² + c3 u³` for `u` from 0 to `length`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cubic {
    pub(super) length: f64,
    pub(super) coefficients: [f64; 4],
}

/// Position and slope at one end of a [`Cubic`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    pub(super) position: f64,
    pub(super) slope: f64,
}

impl Cubic {
    /// The cubic that has these positions and slopes at its ends.
    pub(super) fn hermite(length: f64, from: Knot, to: Knot) -> Self {
        let chord = (to.position - from.position) / length;
        let c2 = (3.0 * chord - 2.0 * from.slope - to.slope) / length;
        let c3 = (from.slope + to.slope - 2.0 * chord) / (length * length);
        Self { length, coefficients: [from.position, from.slope, c2, c3] }
    }

    pub(super) fn position(&self, u: f64) -> f64 {
        let [c0, c1, c2, c3] = self.coefficients;
        c0 + u * (c1 + u * (c2 + u * c3))
    }

    pub(super) fn velocity(&self, u: f64) -> f64 {
        let [_, c1, c2, c3] = self.coefficients;
        c1 + u * (2.0 * c2 + u * 3.0 * c3)
    }

    pub(super) fn acceleration(&self, u: f64) -> f64 {
        let [_, _, c2, c3] = self.coefficients;
        2.0 * c2 + u * 6.0 * c3
    }

    /// Where position can be extreme: both ends and the roots of the velocity between.
    pub(super) fn position_extrema(&self) -> ArrayVec<f64, 4> {
        let [_, c1, c2, c3] = self.coefficients;
        let mut at: ArrayVec<f64, 4> = [0.0, self.length].into_iter().collect();
        // Roots of 3 c3 u² + 2 c2 u + c1 without cancellation, also where c3 is zero or tiny.
        let discriminant = c2 * c2 - 3.0 * c3 * c1;
        if discriminant >= 0.0 {
            let q = -(c2 + discriminant.sqrt().copysign(c2));
            at.extend([q / (3.0 * c3), c1 / q].into_iter().filter(|&u| self.is_inside(u)));
        }
        at
    }

    /// Where velocity can be extreme: both ends and the vertex of its parabola between.
    pub(super) fn velocity_extrema(&self) -> ArrayVec<f64, 3> {
        let [_, _, c2, c3] = self.coefficients;
        let mut at: ArrayVec<f64, 3> = [0.0, self.length].into_iter().collect();
        at.extend(Some(-c2 / (3.0 * c3)).filter(|&u| self.is_inside(u)));
        at
    }

    /// Where acceleration can be extreme: it is linear.
    pub(super) fn acceleration_extrema(&self) -> ArrayVec<f64, 2> {
        [0.0, self.length].into_iter().collect()
    }

    fn is_inside(&self, u: f64) -> bool {
        u > 0.0 && u < self.length
    }
}

/// Slopes at the knots of the cubic splines with continuous second derivative that have slope zero
/// at both ends. `positions` holds a row of `joints` values per time; so does the result.
///
/// The slopes `m` solve, for each inner knot with `h` the spacings and `d` the slopes of the chords
/// before and after it, `m₋/h₋ + 2 (1/h₋ + 1/h₊) m + m₊/h₊ = 3 (d₋/h₋ + d₊/h₊)`. The matrix is
/// diagonally dominant, so elimination without pivoting is stable, and equal for all joints.
///
/// Source: C. de Boor, A Practical Guide to Splines, revised edition, chapter IV, "cubic spline
/// interpolation", equation (8), with complete boundary conditions.
pub(super) fn clamped_spline_slopes(times: &[f64], positions: &[f64], joints: usize) -> Vec<f64> {
    let mut slopes = vec![0.0; positions.len()];
    // `upper[i]` is the eliminated coefficient of the next slope in the row of knot i.
    let mut upper = vec![0.0; times.len()];
    for knot in 1..times.len().saturating_sub(1) {
        let before = 1.0 / (times[knot] - times[knot - 1]);
        let after = 1.0 / (times[knot + 1] - times[knot]);
        let pivot = 1.0 / (2.0 * (before + after) - before * upper[knot - 1]);
        upper[knot] = after * pivot;
        for here in knot * joints..(knot + 1) * joints {
            let chord_before = (positions[here] - positions[here - joints]) * before;
            let chord_after = (positions[here + joints] - positions[here]) * after;
            let right = 3.0 * (chord_before * before + chord_after * after);
            slopes[here] = (right - before * slopes[here - joints]) * pivot;
        }
    }
    for knot in (1..times.len().saturating_sub(1)).rev() {
        for here in knot * joints..(knot + 1) * joints {
            slopes[here] -= upper[knot] * slopes[here + joints];
        }
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knot(position: f64, slope: f64) -> Knot {
        Knot { position, slope }
    }

    #[test]
    fn a_cubic_has_the_positions_and_slopes_it_was_made_from() {
        let cubic = Cubic::hermite(0.5, knot(1.0, -2.0), knot(3.0, 4.0));
        assert_eq!((cubic.position(0.0), cubic.velocity(0.0)), (1.0, -2.0));
        assert!((cubic.position(0.5) - 3.0).abs() < 1e-14);
        assert!((cubic.velocity(0.5) - 4.0).abs() < 1e-13);
        let step = 1e-6;
        let difference = (cubic.velocity(0.2 + step) - cubic.velocity(0.2 - step)) / (2.0 * step);
        assert!((cubic.acceleration(0.2) - difference).abs() < 1e-7);
    }

    #[test]
    fn extremes_of_u_cubed_minus_u_are_at_its_known_roots() {
        // u³ - 3u on [0, 2]: position is extreme at 1, velocity and acceleration at the ends.
        let cubic = Cubic { length: 2.0, coefficients: [0.0, -3.0, 0.0, 1.0] };
        assert_eq!(cubic.position_extrema().as_slice(), [0.0, 2.0, 1.0]);
        assert_eq!(cubic.velocity_extrema().as_slice(), [0.0, 2.0]);
    }

    #[test]
    fn extremes_of_a_parabola_and_of_a_line_need_no_third_degree() {
        let parabola = Cubic { length: 2.0, coefficients: [0.0, 2.0, -1.0, 0.0] };
        assert_eq!(parabola.position_extrema().as_slice(), [0.0, 2.0, 1.0]);
        let line = Cubic { length: 2.0, coefficients: [0.0, 1.0, 0.0, 0.0] };
        assert_eq!(line.position_extrema().as_slice(), [0.0, 2.0]);
        let rest = Cubic { length: 2.0, coefficients: [1.0, 0.0, 0.0, 0.0] };
        assert_eq!(rest.position_extrema().as_slice(), [0.0, 2.0]);
        assert_eq!(rest.velocity_extrema().as_slice(), [0.0, 2.0]);
    }

    #[test]
    fn a_spline_through_points_of_one_cubic_is_that_cubic() {
        // t² (3 - 2t) rests at 0 and 1, so the clamped spline through any of its points is exact.
        let times = [0.0, 0.1, 0.35, 0.4, 0.8, 1.0];
        let positions: Vec<f64> = times
            .iter()
            .flat_map(|t| [t * t * (3.0 - 2.0 * t), -t * t * (3.0 - 2.0 * t)])
            .collect();
        let slopes = clamped_spline_slopes(&times, &positions, 2);
        for (t, slopes) in times.iter().zip(slopes.chunks(2)) {
            let exact = 6.0 * t * (1.0 - t);
            assert!((slopes[0] - exact).abs() < 1e-14, "{t}: {slopes:?}, exact {exact}");
            assert!((slopes[1] + exact).abs() < 1e-14, "{t}: {slopes:?}, exact {exact}");
        }
    }

    #[test]
    fn a_spline_through_equal_spacings_has_the_textbook_slope() {
        // One inner knot: 4 m = 3 (y2 - y0) / h.
        let slopes = clamped_spline_slopes(&[0.0, 0.5, 1.0], &[0.0, 7.0, 1.0], 1);
        assert_eq!(slopes, [0.0, 1.5, 0.0]);
    }
}
