//! Single moves.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::{difference, path, pose, speed};
use crate::{ArcOrientation, CartesianMove, CartesianPath, CartesianSegment, Pose};

fn turn(angle: f64, orientation: ArcOrientation) -> CartesianMove {
    let (center, normal) = (Vector3::new(0.5, 0.0, 7.0), Vector3::z() * 3.0);
    CartesianMove {
        segment: CartesianSegment::Turn { center, normal, angle, orientation },
        blend_radius: 0.0,
    }
}

#[test]
fn a_line_goes_straight_and_turns_evenly() {
    let (from, to) = (pose([0.1, 0.2, 0.3], [0.0; 3]), pose([0.4, 0.6, 0.3], [0.0, 0.0, 1.2]));
    let path = CartesianPath::line(&from, &to).expect("a line");
    assert!((path.length() - 0.5_f64.hypot(0.12)).abs() < 1e-15);
    for fraction in [0.0, 0.25, 0.5, 1.0] {
        let at = path.pose_at(fraction * path.length());
        let expected =
            pose([0.1 + 0.3 * fraction, 0.2 + 0.4 * fraction, 0.3], [0.0, 0.0, 1.2 * fraction]);
        let (distance, angle) = at.distance(&expected);
        assert!(distance < 1e-15 && angle < 1e-15, "{fraction}: {distance} {angle}");
        assert!((speed(&path, fraction * path.length()) - 1.0).abs() < 1e-14);
    }
    assert_eq!(path.curvature_at(0.2), 0.0);
}

#[test]
fn a_rotation_on_the_spot_has_the_length_of_its_weighted_angle() {
    let (from, to) = (pose([0.1, 0.2, 0.3], [0.0; 3]), pose([0.1, 0.2, 0.3], [2.0, 0.0, 0.0]));
    let path = CartesianPath::line(&from, &to).expect("a rotation");
    assert!((path.length() - 0.2).abs() < 1e-15);
    let tangent = path.tangent_at(0.1);
    assert_eq!(tangent.linear, Vector3::zeros());
    assert!((tangent.angular - Vector3::x() * 10.0).norm() < 1e-13);
    assert_eq!(path.curvature_at(0.1), 0.0);
}

#[test]
fn the_orientation_goes_the_shorter_way_round() {
    let (from, to) = (pose([0.0; 3], [0.0, 0.0, 3.0]), pose([0.1, 0.0, 0.0], [0.0, 0.0, -3.0]));
    let path = CartesianPath::line(&from, &to).expect("a line");
    let middle = path.pose_at(0.5 * path.length());
    let expected = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI);
    assert!(middle.isometry().rotation.angle_to(&expected) < 1e-14);
    assert!((path.length() - 0.1_f64.hypot(0.1 * (TAU - 6.0))).abs() < 1e-14);
}

#[test]
fn an_arc_through_three_points_takes_the_side_of_the_middle_one() {
    let (from, to) = (pose([1.0, 0.0, 0.5], [0.0; 3]), pose([0.0, 1.0, 0.5], [0.0; 3]));
    let short = Vector3::new(0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.5);
    let long = Vector3::new(-1.0, 0.0, 0.5);
    for (via, angle) in [(short, FRAC_PI_2), (long, 1.5 * PI)] {
        let path = CartesianPath::arc(&from, &via, &to).expect("an arc");
        assert!((path.length() - angle).abs() < 1e-14, "{}", path.length());
        let end = path.pose_at(path.length()).distance(&to).0;
        assert!(end < 1e-15, "{end}");
        assert!((path.curvature_at(0.3) - 1.0).abs() < 1e-14);
        let met = (0..=1000)
            .map(|i| (path.pose_at(f64::from(i) * angle / 1000.0).position() - via).norm())
            .fold(f64::INFINITY, f64::min);
        assert!(met < 3e-3, "{met}");
    }
}

#[test]
fn a_whole_circle_about_an_axis_comes_back() {
    let start = pose([0.8, 0.0, 0.3], [0.1, 0.2, 0.3]);
    let path = path(&start, &[turn(-TAU, ArcOrientation::Fixed)]);
    assert!((path.length() - 0.3 * TAU).abs() < 1e-14);
    let quarter = path.pose_at(0.25 * path.length());
    assert!((quarter.position() - Vector3::new(0.5, -0.3, 0.3)).norm() < 1e-15);
    assert!(path.pose_at(path.length()).distance(&start).0 < 1e-15);
    assert!((path.curvature_at(0.1) - 1.0 / 0.3).abs() < 1e-13);
}

#[test]
fn the_orientation_turns_with_an_arc_or_to_a_given_one() {
    let start = pose([0.8, 0.0, 0.3], [0.4, 0.2, 0.3]);
    let to = UnitQuaternion::from_euler_angles(0.7, 0.1, 0.2);
    for (orientation, expected) in [
        (
            ArcOrientation::WithArc,
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.5 * PI)
                * start.isometry().rotation,
        ),
        (ArcOrientation::To(to), to),
        (ArcOrientation::Fixed, start.isometry().rotation),
    ] {
        let path = path(&start, &[turn(1.5 * PI, orientation)]);
        let end = path.pose_at(path.length());
        assert!(end.isometry().rotation.angle_to(&expected) < 1e-14, "{orientation:?}");
        assert!((end.position() - Vector3::new(0.5, -0.3, 0.3)).norm() < 1e-14);
    }
}

#[test]
fn outside_of_the_path_its_ends_are_held() {
    let (from, to) = (Pose::default(), pose([0.4, 0.0, 0.0], [0.0; 3]));
    let path = CartesianPath::line(&from, &to).expect("a line");
    assert_eq!(path.pose_at(-1.0), from);
    assert_eq!(path.pose_at(f64::NAN), from);
    assert_eq!(path.pose_at(9.0), to);
}

fn coordinate() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-1.0..1.0)
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(11), ..ProptestConfig::default() })]

    #[test]
    fn tangents_are_the_derivatives_of_poses_and_of_unit_measure(
        points in prop::array::uniform4(coordinate()),
        rotations in prop::array::uniform3(coordinate()),
        angle in 0.1..7.0,
        fraction in 0.01..0.99,
    ) {
        let [a, b, c] = [0, 1, 2].map(|i| pose(points[i], rotations[i]));
        let orientation = ArcOrientation::WithArc;
        let (center, normal) = (Vector3::from(points[3]), Vector3::from(rotations[0]));
        let circle = CartesianSegment::Turn { center, normal, angle, orientation };
        for path in [
            CartesianPath::line(&a, &b),
            CartesianPath::arc(&a, b.position(), &c),
            CartesianPath::new(&a, &[CartesianMove { segment: circle, blend_radius: 0.0 }], 0.1),
        ] {
            let path = path.expect("random points are in general position");
            let s = fraction * path.length();
            let (linear, angular) = difference(&path, s, 1e-5);
            let tangent = path.tangent_at(s);
            prop_assert!((linear - tangent.linear).norm() < 1e-6);
            prop_assert!((angular - tangent.angular).norm() < 1e-6);
            prop_assert!((speed(&path, s) - 1.0).abs() < 1e-9);
            let next = path.tangent_at(s + 1e-5).linear;
            let bend = tangent.linear.angle(&next) / (1e-5 * tangent.linear.norm());
            prop_assert!((bend - path.curvature_at(s)).abs() < 1e-2 * (1.0 + bend), "{bend}");
        }
    }

    #[test]
    fn an_arc_passes_its_three_points_on_one_circle(
        points in prop::array::uniform3(coordinate()),
    ) {
        let [a, b, c] = points.map(|point| pose(point, [0.0; 3]));
        let path = CartesianPath::arc(&a, b.position(), &c).expect("a circle");
        prop_assert!(path.pose_at(0.0).distance(&a).0 < 1e-9);
        prop_assert!(path.pose_at(path.length()).distance(&c).0 < 1e-9);
        // The via point, at the angle that its chord spans.
        let radius = 1.0 / path.curvature_at(0.0);
        let chord = a.distance(&b).0;
        let s = 2.0 * radius * (0.5 * chord / radius).min(1.0).asin();
        let met = [s, TAU * radius - s].map(|s| path.pose_at(s).distance(&b).0);
        prop_assert!(met[0].min(met[1]) < 1e-6, "{met:?}");
    }
}
