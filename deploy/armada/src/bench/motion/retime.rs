//! Time-optimal motions along splines, against toppra.

use std::hint::black_box;

use anyhow::{Context as _, ensure};
use armada_model::{
    AxisLimits, ConstraintScheme, DEFAULT_JERK_TIME_S, Grid, JointPath, RetimeOptions, SplineEnds,
    retime,
};
use serde::Deserialize;
use serde_json::json;

use super::random::SplitMix;
use super::{Bench, TARGET, clocked};
use crate::bench::Side;
use crate::bench::figures::quantiles;
use crate::bench::report::Section;

/// Library that is the reference.
const PACKAGE: &str = "toppra";
const JOINTS: usize = 7;
/// Points at which limits are held.
const POINTS: usize = 201;
/// Number of paths.
const PATHS: usize = 32;
/// What a call shall cost at most \[µs\].
const TARGET_US: f64 = 200.0;
/// How far the durations of both may differ, relative.
const TOLERANCE: f64 = 1e-4;

/// A path and its limits.
pub(super) struct Case {
    waypoints: Vec<Vec<f64>>,
    pub(super) path: JointPath,
    pub(super) limits: Vec<AxisLimits>,
}

#[derive(Debug, Deserialize)]
struct Answer {
    /// Median and 99th percentile \[µs\].
    us: [f64; 2],
    durations_s: Vec<f64>,
}

/// Measures all paths.
pub(super) async fn measure(bench: &mut Bench<'_>) -> anyhow::Result<Section> {
    let mut random = SplitMix::new(20_180_613);
    let cases: Result<Vec<_>, _> = (0..PATHS).map(|index| Case::new(index, &mut random)).collect();
    let cases = cases?;
    let rounds = (bench.args.calls / 4000).clamp(1, 100);
    let paths: Vec<_> = cases.iter().map(Case::told).collect();
    let ask = json!({ "kind": "retime", "points": POINTS, "rounds": rounds, "paths": paths });
    let (mut ours, mut peers) = (Vec::new(), Vec::new());
    for turn in bench.turns("retime") {
        match turn {
            Side::Ours => ours.push(time(&cases, rounds)?),
            Side::Reference => {
                let Some(answer) = bench.ask::<Answer>(PACKAGE, &ask).await? else { continue };
                peers.push(answer.us);
                agree(&cases, &answer.durations_s)?;
            }
        }
    }
    let title = format!("retiming: {PATHS} paths of {JOINTS} joints, {POINTS} points");
    let section = Section::new(title, ["p50, µs", "p99, µs"]).row("armada, retime", &ours);
    Ok(section.row("toppra, TOPPRA with seidel", &peers).ratio().row(TARGET, &[[TARGET_US]]))
}

impl Case {
    /// 2 to 9 waypoints within a quarter of a turn to either side of rest.
    pub(super) fn new(index: usize, random: &mut SplitMix) -> anyhow::Result<Self> {
        let row = |random: &mut SplitMix| (0..JOINTS).map(|_| random.between(-1.6, 1.6)).collect();
        let waypoints: Vec<Vec<f64>> = (0..2 + index % 8).map(|_| row(random)).collect();
        let limits = (0..JOINTS).map(|_| {
            let (velocity, acceleration) = (random.between(0.8, 3.0), random.between(2.0, 15.0));
            let (lower, upper) = (f64::NEG_INFINITY, f64::INFINITY);
            let jerk = acceleration / DEFAULT_JERK_TIME_S;
            AxisLimits { lower, upper, velocity, acceleration, jerk }
        });
        let limits = limits.collect();
        let path = JointPath::through(&waypoints, SplineEnds::NotAKnot)?;
        Ok(Self { waypoints, path, limits })
    }

    fn told(&self) -> serde_json::Value {
        let of = |value: fn(&AxisLimits) -> f64| self.limits.iter().map(value).collect::<Vec<_>>();
        json!({
            "parameters": self.path.parameters(),
            "waypoints": self.waypoints,
            "velocity": of(|limits| limits.velocity),
            "acceleration": of(|limits| limits.acceleration),
        })
    }
}

fn options() -> RetimeOptions {
    let (grid, scheme) = (Grid::Uniform(POINTS), ConstraintScheme::Interpolation);
    RetimeOptions { grid, scheme, ..RetimeOptions::default() }
}

/// Median and 99th percentile of the times of all paths \[µs\].
fn time(cases: &[Case], rounds: u32) -> anyhow::Result<[f64; 2]> {
    let options = options();
    let mut times = Vec::with_capacity(cases.len() * rounds as usize);
    for _ in 0..rounds {
        for case in cases {
            let path = case.path.clone();
            let (timed, time) = clocked(|| retime(path, black_box(&case.limits), &options));
            timed?;
            times.push(time);
        }
    }
    let [p50, p99, ..] = quantiles(&mut times).context("no path")?;
    Ok([p50, p99])
}

/// Whether the motions of both take as long.
fn agree(cases: &[Case], durations_s: &[f64]) -> anyhow::Result<()> {
    ensure!(durations_s.len() == cases.len(), "the peer answers another number of paths");
    for (index, (case, theirs_s)) in cases.iter().zip(durations_s).enumerate() {
        let ours_s = retime(case.path.clone(), &case.limits, &options())?.duration_s();
        let off = (ours_s / theirs_s - 1.0).abs();
        ensure!(off <= TOLERANCE, "path {index}: both durations differ by {off:e}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peer_that_finds_another_duration_is_noticed() {
        let mut random = SplitMix::new(1);
        let cases: Vec<_> = (0..3).map(|i| Case::new(i, &mut random).expect("a path")).collect();
        let of = |case: &Case| retime(case.path.clone(), &case.limits, &options());
        let duration_s = |case| of(case).expect("can be retimed").duration_s();
        let mut durations_s: Vec<_> = cases.iter().map(duration_s).collect();
        agree(&cases, &durations_s).expect("the same");
        durations_s[2] *= 1.001;
        let error = agree(&cases, &durations_s).expect_err("longer").to_string();
        assert!(error.contains("path 2"), "{error}");
        assert!(agree(&cases, &durations_s[..2]).is_err(), "a path is missing");
    }
}
