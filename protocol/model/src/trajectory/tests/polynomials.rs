//! Polynomials through two points, and that no extreme of them is missed.

use proptest::prelude::*;

use super::super::piece::{Candidates, Extrema, Knot, Piece};
use super::*;

fn knot(position: f64, velocity: f64, acceleration: f64) -> Knot {
    Knot { position, velocity, acceleration }
}

#[test]
fn a_cubic_has_the_positions_and_velocities_it_was_made_from() {
    let cubic = Piece::<4>::hermite(0.5, knot(1.0, -2.0, 0.0), knot(3.0, 4.0, 0.0));
    assert_eq!((cubic.position(0.0), cubic.velocity(0.0)), (1.0, -2.0));
    assert!((cubic.position(0.5) - 3.0).abs() < 1e-14);
    assert!((cubic.velocity(0.5) - 4.0).abs() < 1e-13);
}

#[test]
fn a_quintic_has_the_accelerations_too() {
    let (from, to) = (knot(1.0, -2.0, 3.0), knot(3.0, 4.0, -5.0));
    let quintic = Piece::<6>::hermite(0.5, from, to);
    for (u, knot) in [(0.0, from), (0.5, to)] {
        assert!((quintic.position(u) - knot.position).abs() < 1e-14);
        assert!((quintic.velocity(u) - knot.velocity).abs() < 1e-13);
        assert!((quintic.acceleration(u) - knot.acceleration).abs() < 1e-12);
    }
}

#[test]
fn velocity_acceleration_and_jerk_are_derivatives() {
    let quintic = Piece::<6>::hermite(2.0, knot(1.0, -2.0, 3.0), knot(3.0, 4.0, -5.0));
    let (u, step) = (0.7, 1e-5);
    let slope = |f: &dyn Fn(f64) -> f64| (f(u + step) - f(u - step)) / (2.0 * step);
    assert!((quintic.velocity(u) - slope(&|u| quintic.position(u))).abs() < 1e-8);
    assert!((quintic.acceleration(u) - slope(&|u| quintic.velocity(u))).abs() < 1e-8);
    assert!((quintic.jerk(u) - slope(&|u| quintic.acceleration(u))).abs() < 1e-8);
}

#[test]
fn extremes_of_u_cubed_minus_3u_are_at_its_known_roots() {
    // Position is extreme at 1, velocity and acceleration at the ends of [0, 2].
    let cubic = Piece { length: 2.0, coefficients: [0.0, -3.0, 0.0, 1.0] };
    assert_eq!(cubic.position_extrema().as_slice(), [0.0, 2.0, 1.0]);
    assert_eq!(cubic.velocity_extrema().as_slice(), [0.0, 2.0]);
}

#[test]
fn extremes_of_a_parabola_and_of_a_line_need_no_third_degree() {
    let parabola = Piece { length: 2.0, coefficients: [0.0, 2.0, -1.0, 0.0] };
    assert_eq!(parabola.position_extrema().as_slice(), [0.0, 2.0, 1.0]);
    let line = Piece { length: 2.0, coefficients: [0.0, 1.0, 0.0, 0.0] };
    assert_eq!(line.position_extrema().as_slice(), [0.0, 2.0]);
    let rest = Piece { length: 2.0, coefficients: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    assert_eq!(rest.velocity_extrema().as_slice(), [0.0, 2.0]);
    assert!(rest.position_extrema().iter().all(|u| (0.0..=2.0).contains(u)));
}

#[test]
fn extremes_of_the_fifth_chebyshev_polynomial_are_at_its_known_places() {
    // T5(x) = 16 x⁵ - 20 x³ + 5 x is ±1 at cos(k π / 5); here x = u - 1 on [0, 2].
    let coefficients = [-1.0, 25.0, -100.0, 140.0, -80.0, 16.0];
    let mut found: Vec<f64> =
        Piece { length: 2.0, coefficients }.position_extrema().into_iter().collect();
    found.sort_by(f64::total_cmp);
    let exact = [5, 4, 3, 2, 1, 0].map(|k| 1.0 + (f64::from(k) * std::f64::consts::PI / 5.0).cos());
    assert_eq!(found.len(), 6);
    for (found, exact) in found.iter().zip(exact) {
        assert!((found - exact).abs() < 1e-13, "{found}, exact {exact}");
    }
}

#[test]
fn a_threefold_zero_of_velocity_is_found_though_it_is_no_extreme_of_it() {
    // Velocity (u - 1)³: position is lowest at 1, where velocity and acceleration are zero too.
    let piece = Piece { length: 3.0, coefficients: [0.25, -1.0, 1.5, -1.0, 0.25, 0.0] };
    let lowest = piece.position_extrema().into_iter().map(|u| piece.position(u));
    assert!(lowest.fold(f64::INFINITY, f64::min).abs() < 1e-15);
}

#[test]
fn no_extreme_is_missed_because_a_square_overflows() {
    for scale in [1e-250, 1e250] {
        let (from, to) = (knot(0.0, scale, -scale), knot(0.0, scale, scale));
        assert_nothing_is_missed(&Piece::<6>::hermite(2.0, from, to));
        assert_nothing_is_missed(&Piece::<4>::hermite(2.0, from, to));
    }
}

/// Lowest and highest value at `candidates`.
fn range(candidates: Candidates, value: impl Fn(f64) -> f64) -> (f64, f64) {
    candidates
        .into_iter()
        .map(value)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// Fails if a dense sample of any derivative lies outside the range at the candidates.
fn assert_nothing_is_missed<const N: usize>(piece: &Piece<N>)
where
    Piece<N>: Extrema,
{
    type Derivative<const N: usize> =
        (fn(&Piece<N>) -> Candidates, fn(&Piece<N>, f64) -> f64, &'static str);
    let derivatives: [Derivative<N>; 4] = [
        (Extrema::position_extrema, Piece::position, "position"),
        (Extrema::velocity_extrema, Piece::velocity, "velocity"),
        (Extrema::acceleration_extrema, Piece::acceleration, "acceleration"),
        (Extrema::jerk_extrema, Piece::jerk, "jerk"),
    ];
    for (candidates, value, what) in derivatives {
        let (low, high) = range(candidates(piece), |u| value(piece, u));
        let rounding = 1e-12 * low.abs().max(high.abs());
        for sample in 0..=2000 {
            let x = value(piece, piece.length * f64::from(sample) / 2000.0);
            assert!(
                low - rounding <= x && x <= high + rounding,
                "{what} {x} at sample {sample} is outside {low} to {high} of {piece:?}"
            );
        }
    }
}

proptest! {
    #![proptest_config(seeded(256))]

    #[test]
    fn no_extreme_of_a_quintic_is_missed(
        from in prop::array::uniform3(-2.0..2.0_f64),
        to in prop::array::uniform3(-2.0..2.0_f64),
        length in (-4.0..2.0_f64).prop_map(|power| 10.0_f64.powf(power)),
    ) {
        // As velocities and accelerations of a motion of this length would be.
        let knot = |[x, v, a]: [f64; 3]| knot(x, v / length, a / length / length);
        assert_nothing_is_missed(&Piece::<6>::hermite(length, knot(from), knot(to)));
        assert_nothing_is_missed(&Piece::<4>::hermite(length, knot(from), knot(to)));
    }

    #[test]
    fn zeros_of_velocity_are_found_however_close_they_are(
        mut zeros in prop::array::uniform4(0.05..0.95_f64),
        closeness in 0..3,
    ) {
        // Two zeros at a distance of 1e-3 and of 1e-6, or all four apart.
        zeros.sort_by(f64::total_cmp);
        match closeness {
            1 => zeros[1] = zeros[0] + 1e-3,
            2 => zeros[3] = zeros[2] + 1e-6,
            _ => (),
        }
        let mut velocity = [1.0, 0.0, 0.0, 0.0, 0.0];
        for zero in zeros {
            let times_u = [0.0, velocity[0], velocity[1], velocity[2], velocity[3]];
            velocity = std::array::from_fn(|power| times_u[power] - zero * velocity[power]);
        }
        let mut coefficients = [0.0; 6];
        for (power, c) in velocity.iter().enumerate() {
            coefficients[power + 1] = c / (power + 1) as f64;
        }
        let piece = Piece { length: 1.0, coefficients };
        assert_nothing_is_missed(&piece);
        let extremes = piece.position_extrema();
        for zero in zeros {
            // Where zeros are close, the value says more than the place.
            let error = extremes.iter().map(|&u| (piece.position(u) - piece.position(zero)).abs());
            prop_assert!(error.fold(f64::INFINITY, f64::min) < 1e-12, "{zero}: {extremes:?}");
        }
    }
}
