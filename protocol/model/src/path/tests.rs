//! Splines as paths.

use super::{GeometricPath, JointPath, PathError, PathRows, SplineEnds};

const ALL_ENDS: [SplineEnds; 3] = [SplineEnds::NotAKnot, SplineEnds::Natural, SplineEnds::Clamped];

fn at(path: &JointPath, s: f64) -> [Vec<f64>; 4] {
    let n = path.coordinates();
    let mut scratch = vec![0.0; 3 * n];
    path.evaluate(s, &mut PathRows::split(&mut scratch));
    let mut third = vec![0.0; n];
    path.third_derivative(s, &mut third);
    [scratch[..n].to_vec(), scratch[n..2 * n].to_vec(), scratch[2 * n..].to_vec(), third]
}

fn zigzag(ends: SplineEnds) -> JointPath {
    let rows = [[0.0, 1.0], [0.5, -0.2], [0.7, 0.3], [-0.4, 0.9], [1.2, 1.0]];
    JointPath::with_parameters(&[-1.0, 0.2, 0.5, 2.0, 2.7], &rows, ends).expect("a path")
}

#[test]
fn every_spline_passes_its_waypoints() {
    for ends in ALL_ENDS {
        let path = zigzag(ends);
        for (s, row) in [(-1.0, [0.0, 1.0]), (0.5, [0.7, 0.3]), (2.7, [1.2, 1.0])] {
            for (found, expected) in at(&path, s)[0].iter().zip(row) {
                assert!((found - expected).abs() < 1e-14, "{ends:?} at {s}: {found}");
            }
        }
    }
}

#[test]
fn derivatives_are_continuous_and_those_of_the_position() {
    for ends in ALL_ENDS {
        let path = zigzag(ends);
        let step = 1e-6;
        for s in [-0.7, 0.2, 0.35, 0.5, 1.1, 2.0, 2.4] {
            let (here, before, after) = (at(&path, s), at(&path, s - step), at(&path, s + step));
            for order in 1..3 {
                for joint in 0..2 {
                    let difference =
                        (after[order - 1][joint] - before[order - 1][joint]) / (2.0 * step);
                    let error = (here[order][joint] - difference).abs();
                    assert!(error < 1e-3, "{ends:?}, derivative {order} at {s}: {error}");
                }
            }
        }
    }
}

#[test]
fn ends_are_as_asked_for() {
    let natural = zigzag(SplineEnds::Natural);
    let clamped = zigzag(SplineEnds::Clamped);
    let free = zigzag(SplineEnds::NotAKnot);
    for joint in 0..2 {
        for s in [-1.0, 2.7] {
            assert!(at(&natural, s)[2][joint].abs() < 1e-13);
            assert!(at(&clamped, s)[1][joint].abs() < 1e-13);
        }
        assert!((at(&free, -0.5)[3][joint] - at(&free, 0.4)[3][joint]).abs() < 1e-11);
        assert!((at(&free, 1.0)[3][joint] - at(&free, 2.5)[3][joint]).abs() < 1e-11);
    }
}

#[test]
fn a_spline_without_knots_at_its_ends_is_the_cubic_its_waypoints_lie_on() {
    let cubic = |s: f64| 1.0 + s * (2.0 + s * (-3.0 + s * 0.5));
    let parameters = [0.0, 0.4, 0.5, 1.3, 2.0, 3.1];
    let rows = parameters.map(|s| [cubic(s)]);
    for count in 4..=6 {
        let path =
            JointPath::with_parameters(&parameters[..count], &rows[..count], SplineEnds::NotAKnot)
                .expect("a path");
        let [position, _, _, third] = at(&path, 0.45);
        assert!((position[0] - cubic(0.45)).abs() < 1e-14);
        assert!((third[0] - 3.0).abs() < 1e-10);
    }
}

#[test]
fn two_waypoints_are_a_line_and_three_a_parabola() {
    let line = JointPath::through(&[[1.0, 2.0], [4.0, 6.0]], SplineEnds::NotAKnot).expect("line");
    assert_eq!(line.range(), (0.0, 5.0));
    let [position, first, second, _] = at(&line, 2.5);
    for (found, expected) in [(&position, [2.5, 4.0]), (&first, [0.6, 0.8]), (&second, [0.0; 2])] {
        assert!((found[0] - expected[0]).abs() < 1e-14, "{found:?}");
        assert!((found[1] - expected[1]).abs() < 1e-14, "{found:?}");
    }
    let rows = [[0.0], [0.25], [4.0]];
    let parabola = JointPath::with_parameters(&[0.0, 0.5, 2.0], &rows, SplineEnds::NotAKnot);
    let [position, first, second, _] = at(&parabola.expect("a path"), 1.0);
    assert!((position[0] - 1.0).abs() < 1e-14);
    assert!((first[0] - 2.0).abs() < 1e-14);
    assert!((second[0] - 2.0).abs() < 1e-13);
}

#[test]
fn a_path_that_gives_no_third_derivative_gets_one_by_differences() {
    struct Sine;
    impl GeometricPath for Sine {
        fn coordinates(&self) -> usize {
            1
        }
        fn range(&self) -> (f64, f64) {
            (0.0, 2.0)
        }
        fn evaluate(&self, s: f64, out: &mut PathRows<'_>) {
            (out.position[0], out.first[0], out.second[0]) = (s.sin(), s.cos(), -s.sin());
        }
    }
    for s in [0.0, 0.7, 2.0_f64] {
        let mut third = [0.0];
        Sine.third_derivative(s, &mut third);
        assert!((third[0] + s.cos()).abs() < 1e-4, "{s}: {third:?}");
    }
}

fn refusal(parameters: &[f64], rows: &[&[f64]]) -> PathError {
    JointPath::with_parameters(parameters, rows, SplineEnds::Natural).expect_err("is wrong")
}

#[test]
fn what_is_no_path_is_refused_with_the_place() {
    let two: &[&[f64]] = &[&[0.0, 1.0], &[1.0, 1.0]];
    assert_eq!(refusal(&[0.0], &[&[0.0]]).to_string(), "1 waypoints, at least 2 are needed");
    assert_eq!(refusal(&[0.0, 1.0], &[&[], &[]]), PathError::NoCoordinates);
    assert_eq!(
        refusal(&[0.0, 1.0], &[&[0.0], &[0.0, 1.0]]).to_string(),
        "waypoint 1 has 2 coordinates, expected 1"
    );
    assert_eq!(
        refusal(&[0.0, 1.0], &[&[0.0], &[f64::INFINITY]]).to_string(),
        "waypoint 1: coordinate 0 is inf, which is not finite"
    );
    assert_eq!(refusal(&[0.0], two), PathError::ParameterCount { parameters: 1, waypoints: 2 });
    assert_eq!(
        refusal(&[0.0, 0.0], two).to_string(),
        "waypoint 1: path parameter 0 is not above 0"
    );
    assert!(matches!(
        refusal(&[0.0, f64::NAN], two),
        PathError::ParameterOrder { waypoint: 1, .. }
    ));
    assert_eq!(
        refusal(&[0.0, 1e-300], two).to_string(),
        "the curve between waypoints 0 and 1 is too steep"
    );
    assert_eq!(
        JointPath::through(&[[0.0], [1.0], [1.0]], SplineEnds::Natural)
            .expect_err("no direction")
            .to_string(),
        "waypoint 2 is equal to waypoint 1"
    );
}
