//! Durations against those of toppra; see `golden/README.md`.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use armada_model::{
    AxisLimits, ConstraintScheme, Grid, JointPath, RetimeOptions, SplineEnds, retime,
};
use serde::Deserialize;

const GOLDEN: &str = include_str!("golden/retime.json");

/// Largest difference of a duration, relative.
const TOLERANCE: f64 = 1e-5;

/// toppra lowers `x` by 1e-8 at each step from the start, we do not. With collocation that matters
/// near zero-inertia points; the golden file says by how much when it is lowered by 0.3e-8 only.
/// What is left to zero is up to 2.3 times that.
const SENSITIVITY_FACTOR: f64 = 3.0;

#[derive(Deserialize)]
struct Golden {
    grid_points: usize,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    ends: Ends,
    parameter: Parameter,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    waypoints: Vec<Vec<f64>>,
    start: f64,
    end: f64,
    collocation_s: f64,
    interpolation_s: f64,
    collocation_sensitivity_s: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Ends {
    NotAKnot,
    Natural,
    Clamped,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Parameter {
    Chord,
    Uniform,
}

impl Case {
    fn path(&self) -> JointPath {
        let ends = match self.ends {
            Ends::NotAKnot => SplineEnds::NotAKnot,
            Ends::Natural => SplineEnds::Natural,
            Ends::Clamped => SplineEnds::Clamped,
        };
        match self.parameter {
            Parameter::Chord => JointPath::through(&self.waypoints, ends),
            Parameter::Uniform => {
                let last = self.waypoints.len() - 1;
                let parameters: Vec<f64> = (0..=last).map(|i| i as f64 / last as f64).collect();
                JointPath::with_parameters(&parameters, &self.waypoints, ends)
            }
        }
        .expect("a path")
    }

    fn limits(&self) -> Vec<AxisLimits> {
        self.velocity
            .iter()
            .zip(&self.acceleration)
            .map(|(&velocity, &acceleration)| AxisLimits {
                lower: f64::NEG_INFINITY,
                upper: f64::INFINITY,
                velocity,
                acceleration,
                jerk: 20.0 * acceleration,
            })
            .collect()
    }

    fn duration_s(&self, scheme: ConstraintScheme, points: usize) -> f64 {
        let options = RetimeOptions {
            grid: Grid::Uniform(points),
            scheme,
            start_velocity: self.start,
            end_velocity: self.end,
            ..RetimeOptions::default()
        };
        retime(self.path(), &self.limits(), &options).expect("can be retimed").duration_s()
    }
}

#[test]
fn durations_are_those_of_toppra() {
    let golden: Golden = serde_json::from_str(GOLDEN).expect("decodes");
    for (index, case) in golden.cases.iter().enumerate() {
        let sensitivity_s = SENSITIVITY_FACTOR * case.collocation_sensitivity_s;
        for (scheme, expected, tolerance) in [
            (ConstraintScheme::Interpolation, case.interpolation_s, 0.0),
            (ConstraintScheme::Collocation, case.collocation_s, sensitivity_s),
        ] {
            let tolerance = TOLERANCE * expected + tolerance;
            let found = case.duration_s(scheme, golden.grid_points);
            assert!(
                (found - expected).abs() < tolerance,
                "case {index}, {scheme:?}: {found} s, toppra has {expected} s"
            );
        }
    }
    assert_eq!(golden.cases.len(), 200);
}
