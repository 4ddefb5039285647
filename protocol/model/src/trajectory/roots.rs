//! Real roots of polynomials, given by their coefficients from the constant upwards.

use arrayvec::ArrayVec;

/// How often a root is improved at most. An interval that is only halved is then narrower than its
/// rounding.
const MAX_STEPS: u32 = 100;

/// The root of a line; none if it is constant.
pub(super) fn linear_root(&[c0, c1]: &[f64; 2]) -> Option<f64> {
    Some(-c0 / c1).filter(|root| root.is_finite())
}

/// The roots of a parabola in ascending order, without cancellation, also where it is almost a
/// line. A double root may be missed: the parabola does not change its sign there.
pub(super) fn quadratic_roots(&[c, b, a]: &[f64; 3]) -> ArrayVec<f64, 2> {
    // So that no square overflows; of all zeros comes not a number, which is no root.
    let scale = 1.0 / a.abs().max(b.abs()).max(c.abs());
    let (a, half, c) = (a * scale, 0.5 * b * scale, c * scale);
    let discriminant = half * half - a * c;
    let mut roots = ArrayVec::new();
    if discriminant >= 0.0 {
        let q = -(half + discriminant.sqrt().copysign(half));
        roots.extend([q / a, c / q].into_iter().filter(|root| root.is_finite()));
        roots.sort_unstable_by(f64::total_cmp);
    }
    roots
}

/// The roots of a polynomial of degree four at most between the smallest and the largest of
/// `candidates`, which are the ends of an interval and all points between where it can be extreme.
///
/// Between two of them it is monotone, so that it has one root there if its sign changes, else
/// none. So no change of sign is missed. Where the polynomial only touches zero a root may be
/// missed, and a candidate may be given that only is almost a root.
pub(super) fn roots_between<const N: usize>(
    polynomial: &[f64; N],
    candidates: &ArrayVec<f64, 6>,
) -> ArrayVec<f64, 6> {
    let mut points = candidates.clone();
    points.sort_unstable_by(f64::total_cmp);
    let mut roots = ArrayVec::new();
    let mut low: Option<(f64, f64)> = None;
    for high in points.into_iter().map(|u| (u, value_and_slope(polynomial, u).0)) {
        if high.1 == 0.0 {
            roots.push(high.0);
        } else if let Some(low) = low.filter(|low| low.1 * high.1.signum() < 0.0) {
            roots.push(bracketed_root(polynomial, low, high));
        }
        low = Some(high);
    }
    roots
}

/// The root between two points of opposite sign, by Newton's method where it converges and by
/// halving where it does not.
fn bracketed_root<const N: usize>(
    polynomial: &[f64; N],
    (mut low, low_value): (f64, f64),
    (mut high, _): (f64, f64),
) -> f64 {
    let mut u = 0.5 * (low + high);
    let mut last_step = high - low;
    for _ in 0..MAX_STEPS {
        let (value, slope) = value_and_slope(polynomial, u);
        if value == 0.0 {
            return u;
        }
        if value * low_value.signum() > 0.0 {
            low = u;
        } else {
            high = u;
        }
        let newton = u - value / slope;
        let converges = newton > low && newton < high && 2.0 * (newton - u).abs() < last_step;
        let next = if converges { newton } else { 0.5 * (low + high) };
        last_step = (next - u).abs();
        u = next;
        if last_step <= 2.0 * f64::EPSILON * u.abs() {
            break;
        }
    }
    u
}

fn value_and_slope<const N: usize>(polynomial: &[f64; N], u: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for c in polynomial.iter().rev() {
        slope = slope * u + value;
        value = value * u + c;
    }
    (value, slope)
}
