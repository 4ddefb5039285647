//! Corners.

use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::{difference, path, pose, speed};
use crate::{ArcOrientation, CartesianMove, CartesianPath, CartesianSegment, CornerPassing, Pose};

fn square(radius: f64) -> CartesianPath {
    let moves = [[0.4, 0.0, 0.0], [0.4, 0.3, 0.0], [0.0, 0.3, 0.0]]
        .map(|position| CartesianMove::line(pose(position, [0.0; 3])).blended(radius));
    let last = CartesianMove::line(Pose::default());
    path(&Pose::default(), &[moves[0], moves[1], moves[2], last])
}

#[test]
fn a_blend_leaves_and_reaches_the_moves_at_its_radius() {
    let (sharp, round) = (square(0.0), square(0.1));
    assert_eq!(sharp.length(), round.length());
    for s in [0.0, 0.2, 0.3 - 1e-9, 0.5 + 1e-9, 0.55, 0.6 - 1e-9, 0.8 + 1e-9, 1.4] {
        assert!(sharp.pose_at(s).distance(&round.pose_at(s)).0 < 1e-15, "{s}");
    }
    for s in [0.301, 0.4, 0.499, 0.7] {
        assert!(sharp.pose_at(s).distance(&round.pose_at(s)).0 > 1e-9, "{s}");
    }
    assert_eq!(sharp.stops().collect::<Vec<_>>(), [0.4, 0.7, 1.1]);
    assert_eq!(round.stops().count(), 0);
}

#[test]
fn the_corner_of_two_lines_is_missed_by_the_closed_form() {
    for turning in [0.1_f64, 1.0, 2.0, 3.0] {
        let (sin, cos) = turning.sin_cos();
        let moves = [
            CartesianMove::line(pose([0.5, 0.0, 0.0], [0.0; 3])).blended(0.2),
            CartesianMove::line(pose([0.5 + cos, sin, 0.0], [0.0; 3])),
        ];
        let path = path(&Pose::default(), &moves);
        let CornerPassing::Blend { radius, position_deviation, angle_deviation } =
            path.corners()[0].passing
        else {
            panic!("no blend: {:?}", path.corners());
        };
        assert_eq!(radius, 0.2);
        let expected = 0.375 * 0.2 * (0.5 * turning).sin();
        assert!((position_deviation - expected).abs() < 1e-9, "{position_deviation} {expected}");
        assert_eq!(angle_deviation, 0.0);
        let missed = (path.pose_at(0.5).position() - Vector3::x() * 0.5).norm();
        assert!((missed - expected).abs() < 1e-15);
    }
}

#[test]
fn a_radius_above_half_of_a_neighbour_is_reduced_and_told() {
    let path = square(0.2);
    for corner in path.corners() {
        let CornerPassing::Blend { radius, .. } = corner.passing else {
            panic!("no blend: {corner:?}");
        };
        assert_eq!(radius, 0.15);
    }
    assert!((speed(&path, 0.55) - 1.0).abs() < 1e-12, "between two blends that touch");
}

#[test]
fn a_move_that_goes_on_straight_needs_no_stop() {
    let moves = [0.2, 0.5].map(|x| CartesianMove::line(pose([x, 0.0, 0.0], [0.0; 3])));
    let path = path(&Pose::default(), &moves);
    assert_eq!(path.corners()[0].passing, CornerPassing::Smooth);
    assert_eq!(path.stops().count(), 0);
}

#[test]
fn a_tangential_arc_after_a_line_needs_a_blend() {
    let arc = CartesianMove::arc(Vector3::new(0.9, 0.4, 0.0), pose([0.5, 0.8, 0.0], [0.0; 3]));
    let line = CartesianMove::line(pose([0.5, 0.0, 0.0], [0.0; 3]));
    assert_eq!(path(&Pose::default(), &[line, arc]).stops().count(), 1);
    let round = path(&Pose::default(), &[line.blended(0.1), arc]);
    assert_eq!(round.stops().count(), 0);
    assert!((round.curvature_at(0.9) - 2.5).abs() < 1e-12);
    assert!(round.curvature_at(0.4 + 1e-6) < 1e-3, "curvature begins at that of the line");
    assert!((round.curvature_at(0.6 - 1e-6) - 2.5).abs() < 1e-3, "and ends at that of the arc");
}

#[test]
fn a_path_may_turn_back_on_itself_short_of_the_corner() {
    let moves = [
        CartesianMove::line(pose([0.5, 0.0, 0.0], [0.0; 3])).blended(0.1),
        CartesianMove::line(Pose::default()),
    ];
    let path = path(&Pose::default(), &moves);
    assert!((path.pose_at(0.5).position().x - (0.5 - 0.0375)).abs() < 1e-15);
    assert!(speed(&path, 0.5) < 1e-12);
}

/// A corner of any two kinds of moves, which both turn the tool: reached, and rounded off.
fn corners() -> impl Strategy<Value = [CartesianPath; 2]> {
    let numbers = || prop::array::uniform3(-1.0..1.0);
    let inputs = (prop::array::uniform4(numbers()), prop::array::uniform3(numbers()));
    (inputs, 0.01..0.2, 0..4_u8, 0.5..3.0).prop_map(|((points, rotations), radius, kind, angle)| {
        let [a, b, c] = [0, 1, 2].map(|i| pose(points[i], rotations[i]));
        let via = Vector3::from(points[3]);
        let first = match kind {
            0 | 1 => CartesianMove::line(b),
            _ => CartesianMove::arc(via, b),
        };
        let second = match kind {
            0 | 2 => CartesianMove::line(c),
            _ => CartesianMove {
                segment: CartesianSegment::Turn {
                    center: via,
                    normal: Vector3::from(rotations[2]),
                    angle,
                    orientation: ArcOrientation::WithArc,
                },
                blend_radius: 0.0,
            },
        };
        [0.0, radius].map(|radius| path(&a, &[first.blended(radius), second]))
    })
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(12), ..ProptestConfig::default() })]

    #[test]
    fn a_blended_path_is_continuous_to_its_second_derivative([_, path] in corners()) {
        let at = path.corners()[0].s;
        let CornerPassing::Blend { radius, .. } = path.corners()[0].passing else {
            panic!("no blend");
        };
        // Not beyond the ends of the path, and small against the bend of the blend.
        let step = 1e-4 * radius;
        for s in [at - radius, at + radius] {
            let (before, after) = (path.tangent_at(s - step), path.tangent_at(s + step));
            let here = path.tangent_at(s);
            // Second derivatives from either side, times the radius to be without unit.
            let linear = (after.linear - here.linear) - (here.linear - before.linear);
            let angular = (after.angular - here.angular) - (here.angular - before.angular);
            let bend = radius / step;
            prop_assert!(linear.norm() * bend < 5e-3, "{}", linear.norm() * bend);
            let scale = 1.0 / super::WEIGHT;
            prop_assert!(angular.norm() * bend < 5e-3 * scale, "{}", angular.norm() * bend);
        }
    }

    #[test]
    fn tangents_in_a_blend_are_the_derivatives_of_poses([_, path] in corners(), fraction in -0.99..0.99) {
        let CornerPassing::Blend { radius, .. } = path.corners()[0].passing else {
            panic!("no blend");
        };
        let s = path.corners()[0].s + fraction * radius;
        let (linear, angular) = difference(&path, s, 1e-6);
        let tangent = path.tangent_at(s);
        prop_assert!((linear - tangent.linear).norm() < 1e-5);
        prop_assert!((angular - tangent.angular).norm() < 1e-5 / super::WEIGHT);
        prop_assert!(speed(&path, s) < 1.5);
    }

    #[test]
    fn a_blend_stays_within_the_deviation_that_it_states(
        [sharp, round] in corners(),
        fraction in -1.0..1.0,
    ) {
        let CornerPassing::Blend { radius, position_deviation, angle_deviation } =
            round.corners()[0].passing
        else {
            panic!("no blend");
        };
        let s = round.corners()[0].s + fraction * radius;
        let (distance, angle) = round.pose_at(s).distance(&sharp.pose_at(s));
        prop_assert!(distance <= position_deviation + 1e-12, "{distance} {position_deviation}");
        prop_assert!(angle <= angle_deviation + 1e-12, "{angle} {angle_deviation}");
        prop_assert!(position_deviation <= radius && position_deviation > 0.0);
    }
}
