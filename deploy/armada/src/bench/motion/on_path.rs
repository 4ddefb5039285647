//! Ticks of a motion on its path. No peer has such a thing.

use std::hint::black_box;

use anyhow::{Context as _, ensure};
use armada_agent::runtime::monotonic;
use armada_model::{
    CompiledTrajectory, JointLimits, MotionLimits, OnPath, RetimeOptions, TrajectoryOptions, retime,
};

use super::random::SplitMix;
use super::retime::Case;
use super::{Bench, clocked, per_call};
use crate::bench::figures::quantiles;
use crate::bench::report::Section;

/// Time between two ticks \[s\].
const TICK_S: f64 = 1e-3;
/// Time between two waypoints at most \[s\].
const SPACING_S: f64 = 0.05;

/// Measures ticks at a constant rate and while stopping.
pub(super) fn measure(bench: &mut Bench<'_>) -> anyhow::Result<Section> {
    let (curve, limits) = curve()?;
    let (mut steady, mut ramps) = (Vec::new(), Vec::new());
    for _ in bench.rounds("on path") {
        steady.push(time_steady(&curve, &limits, bench.args.calls)?);
        ramps.push(time_ramps(&curve, &limits, bench.args.calls / 10)?);
    }
    let title = format!("motion on its path: {} joints, ticks of 1 ms", limits.len());
    Ok(Section::new(title, ["p50, µs", "p99, µs"])
        .row("armada, OnPath::tick, steady (mean)", &steady)
        .row("armada, OnPath::tick, stopping", &ramps))
}

/// A spline through nine postures, as fast as the limits allow.
fn curve() -> anyhow::Result<(CompiledTrajectory, MotionLimits)> {
    let case = Case::new(7, &mut SplitMix::new(7))?;
    let axis = |axis: &armada_model::AxisLimits| JointLimits {
        velocity: axis.velocity,
        acceleration: Some(axis.acceleration),
        jerk: Some(axis.jerk),
        ..JointLimits::default()
    };
    let limits: Vec<_> = case.limits.iter().map(axis).collect();
    let limits = MotionLimits::new(&limits)?;
    let names: Vec<_> = (0..limits.len()).map(|joint| format!("joint_{joint}")).collect();
    let timed = retime(case.path, &case.limits, &RetimeOptions::default())?;
    let asked = timed.to_trajectory(&names, SPACING_S)?.trajectory;
    let options = TrajectoryOptions::default();
    Ok((CompiledTrajectory::compile(&asked, &names, &limits, &options)?, limits))
}

/// Mean of the times of ticks at the full rate \[µs\]: they are too short to be timed one by one.
fn time_steady(
    curve: &CompiledTrajectory,
    limits: &MotionLimits,
    calls: u32,
) -> anyhow::Result<[f64; 1]> {
    let mut motion = OnPath::start(curve, limits)?;
    let begin = monotonic();
    for _ in 0..calls {
        black_box(motion.tick(curve, black_box(TICK_S)));
        if motion.is_finished() {
            motion = OnPath::start(curve, limits)?;
        }
    }
    Ok([1e-3 * per_call(monotonic().saturating_since(begin), calls)])
}

/// Median and 99th percentile of the times of ticks from full rate to rest \[µs\].
fn time_ramps(
    curve: &CompiledTrajectory,
    limits: &MotionLimits,
    calls: u32,
) -> anyhow::Result<[f64; 2]> {
    let mut times = Vec::new();
    for stop in (1..=9_u32).cycle() {
        let mut motion = OnPath::join(curve, limits, 0.1 * f64::from(stop) * curve.duration_s())?;
        motion.stop();
        let before = times.len();
        while !motion.is_at_rest() {
            times.push(clocked(|| motion.tick(curve, black_box(TICK_S))).1);
        }
        ensure!(times.len() > before, "the motion was at rest");
        if times.len() >= calls as usize {
            break;
        }
    }
    let [p50, p99, ..] = quantiles(&mut times).context("no tick")?;
    Ok([p50, p99])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_timed_steady_and_while_stopping() {
        let (curve, limits) = curve().expect("a legal curve");
        assert!(time_steady(&curve, &limits, 1000).expect("measured")[0] > 0.0);
        let [p50, p99] = time_ramps(&curve, &limits, 100).expect("measured");
        assert!(0.0 < p50 && p50 <= p99, "{p50} {p99}");
    }
}
