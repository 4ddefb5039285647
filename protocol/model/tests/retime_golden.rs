//! Durations against those of toppra; see `golden/README.md`.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use armada_model::{
    AxisLimits, ConstraintScheme, Grid, JointPath, RetimeOptions, SplineEnds, retime,
};
use serde::Deserialize;

const GOLDEN: &str = include_str!("golden/retime.json");

/// Largest difference of a duration, relative.
const TOLERANCE: f64 = 1e-5;

/// Fewest paths on which that holds with collocation. On the others toppra comes nearly to rest
/// near zero-inertia points, where the highest velocity before forces full braking; we do not, and
/// are faster.
const SAME_WITH_COLLOCATION: usize = 180;

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
    let mut same = 0;
    for (index, case) in golden.cases.iter().enumerate() {
        let found = case.duration_s(ConstraintScheme::Interpolation, golden.grid_points);
        let excess = found / case.interpolation_s - 1.0;
        assert!(excess.abs() < TOLERANCE, "case {index}, interpolation: {excess:e}");
        let found = case.duration_s(ConstraintScheme::Collocation, golden.grid_points);
        let excess = found / case.collocation_s - 1.0;
        assert!(excess < TOLERANCE, "case {index}, collocation: {excess:e}");
        same += usize::from(excess > -TOLERANCE);
    }
    assert!(same >= SAME_WITH_COLLOCATION, "{same} paths");
    assert_eq!(golden.cases.len(), 200);
}
