//! Blends against closed forms, the sharp moves and finite differences.

#![allow(clippy::panic, reason = "a test fails by panicking")]

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::{BlendError, BlendedPath, JointCorner, blended_legs};
use crate::{GeometricPath, PathRows};

fn one_leg(waypoints: &[Vec<f64>], corners: &[JointCorner]) -> BlendedPath {
    let mut legs = blended_legs(waypoints, corners).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(legs.len(), 1, "{corners:?}");
    legs.remove(0)
}

/// Position and three derivatives of all coordinates.
fn derivatives(path: &BlendedPath, s: f64) -> Vec<[f64; 4]> {
    let n = path.coordinates();
    let (mut scratch, mut third) = (vec![0.0; 3 * n], vec![0.0; n]);
    path.evaluate(s, &mut PathRows::split(&mut scratch));
    path.third_derivative(s, &mut third);
    (0..n).map(|i| [scratch[i], scratch[n + i], scratch[2 * n + i], third[i]]).collect()
}

fn position(path: &BlendedPath, s: f64) -> Vec<f64> {
    derivatives(path, s).iter().map(|row| row[0]).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn square() -> Vec<Vec<f64>> {
    vec![vec![0.0, 0.0], vec![1.0, 0.0], vec![1.0, 1.0], vec![0.0, 1.0]]
}

/// Distance of a point to the straight line between two others.
fn distance_to_line(point: &[f64], from: &[f64], to: &[f64]) -> f64 {
    let along: f64 = (0..point.len()).map(|i| (point[i] - from[i]) * (to[i] - from[i])).sum();
    let fraction = (along / distance(from, to).powi(2)).clamp(0.0, 1.0);
    let foot: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + fraction * (b - a)).collect();
    distance(point, &foot)
}

#[test]
fn a_blend_leaves_and_reaches_the_moves_at_its_radius_and_misses_the_corner() {
    let path = one_leg(&square(), &[JointCorner::Radius(0.2), JointCorner::Radius(0.4)]);
    assert_eq!(path.length(), 3.0);
    assert_eq!(position(&path, 0.5), [0.5, 0.0]);
    for (s, expected) in
        [(0.8, [0.8, 0.0]), (1.2, [1.0, 0.2]), (1.6, [1.0, 0.6]), (3.0, [0.0, 1.0])]
    {
        assert!(distance(&position(&path, s), &expected) < 1e-15, "{s}");
    }
    let missed = 0.2 * 3.0 / 16.0 * 2.0_f64.sqrt();
    assert!((distance(&position(&path, 1.0), &[1.0, 0.0]) - missed).abs() < 1e-15);
    let corner = path.corners()[0];
    assert_eq!((corner.s, corner.radius), (1.0, 0.2));
    assert!((corner.deviation - missed).abs() < 1e-15);
}

#[test]
fn a_radius_is_reduced_to_half_of_the_shorter_move() {
    let path = one_leg(&square(), &[JointCorner::Radius(9.0), JointCorner::Radius(9.0)]);
    assert_eq!(path.corners().map_radius(), [0.5, 0.5]);
    // Where two blends touch the path is at the middle of the move, in its direction.
    let touch = derivatives(&path, 1.5);
    assert!((touch[1][0] - 0.5).abs() < 1e-15 && (touch[1][1] - 1.0).abs() < 1e-15);
    assert!(touch[0][1].abs() < 1e-15);
}

trait Radii {
    fn map_radius(&self) -> Vec<f64>;
}

impl Radii for Vec<super::BlendedCorner> {
    fn map_radius(&self) -> Vec<f64> {
        self.iter().map(|corner| corner.radius).collect()
    }
}

#[test]
fn a_tolerance_of_zero_or_a_radius_of_zero_is_a_stop() {
    for corner in
        [JointCorner::Stop, JointCorner::Radius(0.0), JointCorner::Tolerance(vec![0.0, 1.0])]
    {
        let legs = blended_legs(&square(), &[JointCorner::Radius(0.1), corner]).expect("legs");
        assert_eq!(legs.len(), 2);
        assert_eq!([legs[0].length(), legs[1].length()], [2.0, 1.0]);
        assert_eq!(position(&legs[0], 2.0), position(&legs[1], 0.0));
    }
}

#[test]
fn a_tolerance_is_used_up_by_the_coordinate_that_it_binds() {
    let corner = JointCorner::Tolerance(vec![0.03, 0.01]);
    let path = one_leg(&square()[..3], &[corner]);
    let missed = position(&path, 1.0);
    assert!((missed[0] - (1.0 - 0.01)).abs() < 1e-15 && (missed[1] - 0.01).abs() < 1e-15);
}

#[test]
fn waypoints_on_a_line_are_passed_straight() {
    let line = [vec![0.0, 0.0], vec![0.3, 0.3], vec![1.0, 1.0]];
    for corner in [JointCorner::Radius(0.1), JointCorner::Tolerance(vec![0.1, 0.1])] {
        let path = one_leg(&line, &[corner]);
        for row in derivatives(&path, 0.4) {
            assert!((row[1] - 0.5_f64.sqrt()).abs() < 1e-15 && row[2].abs() < 1e-13);
        }
        assert!(path.corners()[0].deviation < 1e-15);
    }
}

#[test]
fn rounded_waypoints_stay_within_the_tolerance_of_the_path() {
    let path = one_leg(&square(), &[JointCorner::Radius(0.5), JointCorner::Radius(0.3)]);
    for tolerance in [1e-2, 1e-3, 1e-5] {
        let rows = path.waypoints(tolerance);
        assert_eq!(rows[0], [0.0, 0.0]);
        assert_eq!(rows[rows.len() - 1], [0.0, 1.0]);
        let worst = (0..=3000)
            .map(|step| position(&path, f64::from(step) * 1e-3))
            .map(|point| {
                let lines = rows.windows(2);
                lines.map(|ends| distance_to_line(&point, &ends[0], &ends[1])).fold(9.0, f64::min)
            })
            .fold(0.0, f64::max);
        assert!(worst <= tolerance && worst > 0.1 * tolerance, "{worst} {tolerance}");
    }
}

#[test]
fn every_input_that_makes_no_path_is_refused() {
    let text = |waypoints: &[Vec<f64>], corners: &[JointCorner]| {
        blended_legs(waypoints, corners).expect_err("no path").to_string()
    };
    let square = square();
    assert_eq!(text(&square[..1], &[]), "1 waypoints, at least 2 are needed");
    assert_eq!(text(&[vec![], vec![]], &[]), "there is no coordinate to move");
    assert_eq!(
        text(&square, &[JointCorner::Stop]),
        "1 corners, expected one for each of 2 waypoints between the ends"
    );
    assert_eq!(
        text(&[vec![0.0, 0.0], vec![1.0]], &[]),
        "waypoint 1: position has 1 values, expected 2"
    );
    assert_eq!(
        text(&[vec![0.0], vec![f64::NAN]], &[]),
        "waypoint 1: coordinate 0 is NaN, which is out of range"
    );
    assert_eq!(text(&[vec![1.0], vec![1.0]], &[]), "waypoint 1 is equal to waypoint 0");
    assert!(text(&[vec![-1e308], vec![1e308]], &[]).ends_with("which is out of range"));
    let corner = |corner| text(&square[..3], &[corner]);
    assert_eq!(
        corner(JointCorner::Radius(-1.0)),
        "waypoint 1: radius -1 is neither 0 nor at least 0.000001"
    );
    assert!(corner(JointCorner::Radius(f64::NAN)).contains("radius NaN"));
    assert_eq!(
        corner(JointCorner::Tolerance(vec![0.1])),
        "waypoint 1: tolerance has 1 values, expected 2"
    );
    assert_eq!(
        blended_legs(&square[..3], &[JointCorner::Tolerance(vec![0.1, -0.1])]),
        Err(BlendError::Tolerance { waypoint: 1, coordinate: 1, value: -0.1 })
    );
}

/// Four waypoints of three coordinates, and two radii.
fn corners() -> impl Strategy<Value = (Vec<Vec<f64>>, [f64; 2])> {
    let waypoints = prop::collection::vec(prop::collection::vec(-2.0..2.0, 3), 4);
    let apart =
        |rows: &Vec<Vec<f64>>| rows.windows(2).all(|pair| distance(&pair[0], &pair[1]) > 0.1);
    (waypoints.prop_filter("waypoints differ", apart), prop::array::uniform2(0.01..2.0))
}

/// Whether a blend begins or ends within `step` of `s`, where the third derivative jumps.
fn on_a_seam(path: &BlendedPath, s: f64, step: f64) -> bool {
    let seams = path.corners().into_iter().map(|corner| (s - corner.s).abs() - corner.radius);
    seams.map(f64::abs).any(|distance| distance <= step)
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(13), ..ProptestConfig::default() })]

    #[test]
    fn blends_are_continuous_to_the_second_derivative((waypoints, radii) in corners()) {
        let path = one_leg(&waypoints, &radii.map(JointCorner::Radius));
        for corner in path.corners() {
            for s in [corner.s - corner.radius, corner.s + corner.radius] {
                let step = 1e-9;
                let (before, after) = (derivatives(&path, s - step), derivatives(&path, s + step));
                for (before, after) in before.iter().zip(&after) {
                    prop_assert!((before[0] - after[0]).abs() < 1e-8);
                    prop_assert!((before[1] - after[1]).abs() < 1e-6);
                    let bend = (before[2] - after[2]).abs() * corner.radius;
                    prop_assert!(bend < 1e-4, "{bend}");
                }
            }
        }
    }

    #[test]
    fn derivatives_equal_finite_differences(
        (waypoints, radii) in corners(),
        fraction in 0.001..0.999,
    ) {
        let path = one_leg(&waypoints, &radii.map(JointCorner::Radius));
        let (s, step) = (fraction * path.length(), 1e-6);
        let radius = path.corners().iter().map(|corner| corner.radius).fold(1.0, f64::min);
        let (before, at, after) =
            (derivatives(&path, s - step), derivatives(&path, s), derivatives(&path, s + step));
        for ((before, at), after) in before.iter().zip(&at).zip(&after) {
            let difference = |order: usize| (after[order] - before[order]) / (2.0 * step);
            prop_assert!((difference(0) - at[1]).abs() < 1e-7);
            prop_assert!((difference(1) - at[2]).abs() < 1e-5 / (radius * radius));
            let bend = (difference(2) - at[3]).abs() * radius * radius;
            prop_assert!(on_a_seam(&path, s, step) || bend < 1e-4, "{bend}");
        }
    }

    #[test]
    fn a_blended_path_stays_within_its_deviation_of_the_moves(
        (waypoints, radii) in corners(),
        fraction in 0.0..1.0,
    ) {
        let path = one_leg(&waypoints, &radii.map(JointCorner::Radius));
        let point = position(&path, fraction * path.length());
        let allowed = path.corners().iter().map(|corner| corner.deviation).fold(0.0, f64::max);
        let off = waypoints
            .windows(2)
            .map(|ends| distance_to_line(&point, &ends[0], &ends[1]))
            .fold(f64::INFINITY, f64::min);
        prop_assert!(off <= allowed + 1e-12, "{off} {allowed}");
    }

    #[test]
    fn a_tolerance_holds_for_every_coordinate(
        (waypoints, tolerance) in corners(),
        fraction in 0.0..1.0,
    ) {
        let tolerance = vec![0.1 * tolerance[0], 0.1 * tolerance[1], 0.05];
        let corner = JointCorner::Tolerance(tolerance.clone());
        let path = one_leg(&waypoints, &[corner.clone(), corner]);
        let sharp = BlendedPath::sharp(&waypoints).expect("legal");
        let s = fraction * path.length();
        let (round, sharp) = (position(&path, s), position(&sharp, s));
        for ((round, sharp), tolerance) in round.iter().zip(&sharp).zip(&tolerance) {
            prop_assert!((round - sharp).abs() <= tolerance + 1e-12);
        }
    }
}
