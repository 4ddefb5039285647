//! What is no path.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{WEIGHT, pose};
use crate::{ArcOrientation, CartesianMove, CartesianPath, CartesianSegment, Pose};

fn refusal(moves: &[CartesianMove]) -> String {
    CartesianPath::new(&Pose::default(), moves, WEIGHT).expect_err("no path").to_string()
}

fn at(position: [f64; 3]) -> Pose {
    pose(position, [0.0; 3])
}

fn turn(center: Vector3<f64>, normal: Vector3<f64>, angle: f64) -> CartesianMove {
    let orientation = ArcOrientation::Fixed;
    CartesianMove {
        segment: CartesianSegment::Turn { center, normal, angle, orientation },
        blend_radius: 0.0,
    }
}

#[test]
fn no_move_and_a_move_to_where_it_is_are_refused() {
    assert_eq!(refusal(&[]), "a path needs at least one move");
    let here = CartesianMove::line(Pose::default());
    assert_eq!(refusal(&[here]), "move 0: length 0 m is below 0.000001 m");
    let there = CartesianMove::line(at([0.1, 0.0, 0.0]));
    assert_eq!(refusal(&[there, there]), "move 1: length 0 m is below 0.000001 m");
}

#[test]
fn a_weight_that_is_not_positive_is_refused() {
    let there = CartesianMove::line(at([0.1, 0.0, 0.0]));
    for (weight, shown) in [(0.0, "0"), (f64::NAN, "NaN"), (-1.0, "-1")] {
        let error = CartesianPath::new(&Pose::default(), &[there], weight).expect_err("refused");
        let expected =
            format!("rotation_weight is {shown} m/rad, expected a finite number above 0");
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused_by_name() {
    let bad = Vector3::new(0.0, f64::NAN, 0.0);
    let there = at([0.1, 0.0, 0.0]);
    let line = CartesianMove::line(at([f64::INFINITY, 0.0, 0.0]));
    assert_eq!(refusal(&[line]), "move 0: end pose is not finite");
    assert_eq!(refusal(&[CartesianMove::arc(bad, there)]), "move 0: via is not finite");
    assert_eq!(refusal(&[turn(bad, Vector3::z(), 1.0)]), "move 0: center is not finite");
    assert_eq!(refusal(&[turn(Vector3::x(), bad, 1.0)]), "move 0: normal is not finite");
    let angle = turn(Vector3::x(), Vector3::z(), f64::INFINITY);
    assert_eq!(refusal(&[angle]), "move 0: angle is not finite");
    let spoilt = UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
    let segment = CartesianSegment::Turn {
        center: Vector3::x(),
        normal: Vector3::z(),
        angle: 1.0,
        orientation: ArcOrientation::To(spoilt),
    };
    let spoilt = CartesianMove { segment, blend_radius: 0.0 };
    assert_eq!(refusal(&[spoilt]), "move 0: orientation is not finite");
    let error = CartesianPath::line(&at([f64::NAN, 0.0, 0.0]), &there).expect_err("refused");
    assert_eq!(error.to_string(), "move 0: start pose is not finite");
    let far = turn(Vector3::x() * 1e300, Vector3::z(), 1e300);
    assert_eq!(refusal(&[far]), "move 0: length is not finite");
}

#[test]
fn points_that_give_no_circle_are_refused() {
    let (x, end) = (Vector3::x(), at([2.0, 0.0, 0.0]));
    assert_eq!(
        refusal(&[CartesianMove::arc(x, end)]),
        "move 0: the points of the arc lie on a line, sine of their angle is 0"
    );
    let twice = "move 0: two points of the arc are 0 m apart, which is one point";
    assert_eq!(refusal(&[CartesianMove::arc(Vector3::zeros(), end)]), twice);
    assert_eq!(refusal(&[CartesianMove::arc(x * 2.0, end)]), twice);
    assert_eq!(refusal(&[CartesianMove::arc(x, Pose::default())]), twice);
    assert_eq!(
        refusal(&[turn(x, Vector3::zeros(), 1.0)]),
        "move 0: the axis of the turn gives no circle, length of normal is 0"
    );
    assert_eq!(
        refusal(&[turn(x, x, 1.0)]),
        "move 0: the axis of the turn gives no circle, radius is 0"
    );
    let nowhere = turn(x, Vector3::z(), 0.0);
    assert_eq!(refusal(&[nowhere]), "move 0: length 0 m is below 0.000001 m");
}

#[test]
fn half_a_turn_of_the_orientation_is_refused() {
    let to = pose([0.1, 0.0, 0.0], [0.0, std::f64::consts::PI, 0.0]);
    let text = refusal(&[CartesianMove::line(to)]);
    assert!(text.starts_with("move 0: orientations are 3.14159265358979"), "{text}");
    assert!(text.ends_with("the way is ambiguous; give an orientation between them"), "{text}");
}

#[test]
fn blend_radii_that_are_none_are_refused() {
    let corner = |radius| {
        let line = CartesianMove::line(at([0.1, 0.0, 0.0])).blended(radius);
        refusal(&[line, CartesianMove::line(at([0.1, 0.1, 0.0]))])
    };
    assert_eq!(corner(-0.1), "move 0: blend_radius -0.1 m is neither 0 nor at least 0.000001 m");
    assert!(corner(f64::NAN).contains("NaN"));
    assert!(corner(f64::INFINITY).contains("inf"));
    assert!(corner(1e-7).contains("0.0000001 m is neither"));
    let end = CartesianMove::line(at([0.1, 0.0, 0.0])).blended(0.05);
    assert_eq!(refusal(&[end]), "move 0 is the last, its blend_radius must be 0, not 0.05 m");
}
