//! The slopes of splines with continuous second derivative.

/// What a spline is like at both ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SplineEnds {
    /// First derivative zero ("complete" or "clamped").
    Clamped,
    /// Second derivative zero ("natural").
    Natural,
}

/// Slopes at the knots of the cubic splines with continuous second derivative. `positions` holds a
/// row of `joints` values per time, of which there are two at least; so does the result.
///
/// The slopes `m` solve, for each inner knot with `h` the spacings and `d` the slopes of the chords
/// before and after it, `m₋/h₋ + 2 (1/h₋ + 1/h₊) m + m₊/h₊ = 3 (d₋/h₋ + d₊/h₊)`; at natural ends
/// the part of this row that lies inside. The matrix is diagonally dominant, so elimination without
/// pivoting is stable, and equal for all joints.
///
/// Source: C. de Boor, A Practical Guide to Splines, revised edition, chapter IV, "cubic spline
/// interpolation", equation (8), with complete or natural boundary conditions.
pub(super) fn spline_slopes(
    times: &[f64],
    positions: &[f64],
    joints: usize,
    ends: SplineEnds,
) -> Vec<f64> {
    let mut slopes = vec![0.0; positions.len()];
    // `upper[i]` is the eliminated coefficient of the next slope in the row of knot i.
    let mut upper = vec![0.0; times.len()];
    let last = times.len() - 1;
    for knot in 0..=last {
        if ends == SplineEnds::Clamped && (knot == 0 || knot == last) {
            continue;
        }
        let before = if knot > 0 { 1.0 / (times[knot] - times[knot - 1]) } else { 0.0 };
        let after = if knot < last { 1.0 / (times[knot + 1] - times[knot]) } else { 0.0 };
        let eliminated = if knot > 0 { before * upper[knot - 1] } else { 0.0 };
        let pivot = 1.0 / (2.0 * (before + after) - eliminated);
        upper[knot] = after * pivot;
        for here in knot * joints..(knot + 1) * joints {
            let (mut right, mut chords) = (0.0, 0.0);
            if knot > 0 {
                chords += (positions[here] - positions[here - joints]) * before * before;
                right = before * slopes[here - joints];
            }
            if knot < last {
                chords += (positions[here + joints] - positions[here]) * after * after;
            }
            slopes[here] = (3.0 * chords - right) * pivot;
        }
    }
    for knot in (0..last).rev() {
        for here in knot * joints..(knot + 1) * joints {
            slopes[here] -= upper[knot] * slopes[here + joints];
        }
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clamped_spline_through_points_of_one_cubic_is_that_cubic() {
        // t² (3 - 2t) rests at 0 and 1, so the clamped spline through any of its points is exact.
        let times = [0.0, 0.1, 0.35, 0.4, 0.8, 1.0];
        let positions: Vec<f64> = times
            .iter()
            .flat_map(|t| [t * t * (3.0 - 2.0 * t), -t * t * (3.0 - 2.0 * t)])
            .collect();
        let slopes = spline_slopes(&times, &positions, 2, SplineEnds::Clamped);
        for (t, slopes) in times.iter().zip(slopes.chunks(2)) {
            let exact = 6.0 * t * (1.0 - t);
            assert!((slopes[0] - exact).abs() < 1e-14, "{t}: {slopes:?}, exact {exact}");
            assert!((slopes[1] + exact).abs() < 1e-14, "{t}: {slopes:?}, exact {exact}");
        }
    }

    #[test]
    fn a_clamped_spline_through_equal_spacings_has_the_textbook_slope() {
        // One inner knot: 4 m = 3 (y2 - y0) / h.
        let slopes = spline_slopes(&[0.0, 0.5, 1.0], &[0.0, 7.0, 1.0], 1, SplineEnds::Clamped);
        assert_eq!(slopes, [0.0, 1.5, 0.0]);
    }

    #[test]
    fn a_natural_spline_through_two_points_is_the_line() {
        let slopes = spline_slopes(&[0.0, 0.5], &[1.0, 2.0], 1, SplineEnds::Natural);
        assert!(slopes.iter().all(|slope| (slope - 2.0).abs() < 1e-15), "{slopes:?}");
    }

    #[test]
    fn a_natural_spline_over_a_tip_has_the_textbook_slopes() {
        // Through (-1, 0), (0, 1), (1, 0): on the left 1 - 3/2 t² - 1/2 t³, so 3/2 at the start.
        let slopes = spline_slopes(&[0.0, 1.0, 2.0], &[0.0, 1.0, 0.0], 1, SplineEnds::Natural);
        for (slope, exact) in slopes.iter().zip([1.5, 0.0, -1.5]) {
            assert!((slope - exact).abs() < 1e-15, "{slopes:?}");
        }
    }
}
