//! A new target in motion, limited in jerk, against ruckig.

use std::hint::black_box;

use anyhow::{Context as _, ensure};
use armada_agent::runtime::monotonic;
use armada_model::{
    JerkLimitedMove, JointLimits, JointVector, MotionLimits, OnlineOptions, OnlineState, Retargeter,
};
use serde::Deserialize;
use serde_json::{Value, json};

use super::random::SplitMix;
use super::{Bench, COLUMN, TARGET, clocked, per_call};
use crate::bench::Side;
use crate::bench::figures::quantiles;
use crate::bench::report::Section;

/// Library that is the reference.
const PACKAGE: &str = "ruckig";
const JOINTS: usize = 7;
/// What a call shall cost at most \[µs\].
const TARGET_US: f64 = 10.0;
/// How far the durations of both may differ, relative.
const TOLERANCE: f64 = 1e-9;
/// Time between two ticks \[s\].
const TICK_S: f64 = 1e-3;

/// A motion from some state to a place of rest.
struct Case {
    from: OnlineState,
    to: OnlineState,
    limits: MotionLimits,
}

#[derive(Debug, Deserialize)]
struct Answer {
    /// Median and 99th percentile \[µs\].
    us: [f64; 2],
    durations_s: Vec<f64>,
}

/// Measures new targets, then ticks.
pub(super) async fn measure(bench: &mut Bench<'_>) -> anyhow::Result<[Section; 2]> {
    let mut random = SplitMix::new(20_220_204);
    let count = (bench.args.calls / 10).clamp(10, 10_000);
    let cases: Result<Vec<_>, _> = (0..count).map(|_| Case::new(&mut random)).collect();
    let cases = cases?;
    let told: Vec<_> = cases.iter().map(Case::told).collect();
    let ask = json!({ "kind": "retarget", "cases": told });
    let (mut ours, mut peers, mut ticks) = (Vec::new(), Vec::new(), Vec::new());
    for turn in bench.turns("retarget") {
        match turn {
            Side::Ours => {
                ours.push(time(&cases)?);
                ticks.push([time_ticks(&cases, bench.args.calls)?]);
            }
            Side::Reference => {
                let Some(answer) = bench.ask::<Answer>(PACKAGE, &ask).await? else { continue };
                peers.push(answer.us);
                agree(&cases, &answer.durations_s)?;
            }
        }
    }
    let title = format!("retargeting in motion: {JOINTS} joints, {count} random states");
    let section = Section::new(title, ["p50, µs", "p99, µs"])
        .row("armada, Retargeter::retarget", &ours)
        .row("ruckig, calculate", &peers)
        .ratio()
        .row(TARGET, &[[TARGET_US]]);
    let tick = Section::new(format!("tick after a retarget: {JOINTS} joints"), [COLUMN]);
    Ok([section, tick.row("armada, Retargeter::tick", &ticks)])
}

impl Case {
    fn new(random: &mut SplitMix) -> anyhow::Result<Self> {
        let mut rows = [const { Vec::new() }; 4];
        let mut limits = Vec::new();
        for _ in 0..JOINTS {
            let velocity = random.between(0.5, 2.5);
            let acceleration = random.between(2.0, 10.0);
            let jerk = random.between(10.0, 200.0);
            let values = [
                random.between(-3.0, 3.0),
                random.between(-velocity, velocity),
                random.between(-acceleration, acceleration),
                random.between(-3.0, 3.0),
            ];
            rows.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
            let (acceleration, jerk) = (Some(acceleration), Some(jerk));
            limits.push(JointLimits { velocity, acceleration, jerk, ..JointLimits::default() });
        }
        let [position, velocity, acceleration, target] =
            rows.map(|row| JointVector::from_slice(&row));
        Ok(Self {
            from: OnlineState {
                position: position?,
                velocity: velocity?,
                acceleration: acceleration?,
            },
            to: OnlineState::at_rest(target?),
            limits: MotionLimits::new(&limits)?,
        })
    }

    fn told(&self) -> Value {
        let mut limits = [const { Vec::new() }; 3];
        for axis in self.limits.iter() {
            let values = [axis.velocity, axis.acceleration, axis.jerk];
            limits.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
        }
        json!({
            "position": self.from.position.to_vec(),
            "velocity": self.from.velocity.to_vec(),
            "acceleration": self.from.acceleration.to_vec(),
            "target": self.to.position.to_vec(),
            "limits": limits,
        })
    }

    fn start(&self) -> anyhow::Result<Retargeter> {
        Ok(Retargeter::new(&self.from, &self.limits, OnlineOptions::default())?)
    }
}

/// Median and 99th percentile of the times of all cases \[µs\].
fn time(cases: &[Case]) -> anyhow::Result<[f64; 2]> {
    let mut times = Vec::with_capacity(cases.len());
    for case in cases {
        let mut joints = case.start()?;
        let (done, time) = clocked(|| joints.retarget(black_box(&case.to)));
        done?;
        times.push(time);
    }
    let [p50, p99, ..] = quantiles(&mut times).context("no case")?;
    Ok([p50, p99])
}

/// Time of one tick \[ns\].
fn time_ticks(cases: &[Case], calls: u32) -> anyhow::Result<f64> {
    let case = cases.first().context("no case")?;
    let (mut ticks, mut time_ns) = (0, 0.0);
    while ticks < calls {
        // In motion all the time: at rest there is less to do.
        let mut joints = case.start()?;
        joints.retarget(&case.to)?;
        let begin = monotonic();
        let mut done = 0;
        while !joints.is_at_rest() && ticks + done < calls {
            black_box(joints.tick(black_box(TICK_S)));
            done += 1;
        }
        let spent = monotonic().saturating_since(begin);
        ensure!(done > 0, "the joints are at their target");
        time_ns += per_call(spent, 1);
        ticks += done;
    }
    Ok(time_ns / f64::from(ticks))
}

/// Whether the motions of both take as long.
fn agree(cases: &[Case], durations_s: &[f64]) -> anyhow::Result<()> {
    ensure!(durations_s.len() == cases.len(), "the peer answers another number of motions");
    for (index, (case, theirs_s)) in cases.iter().zip(durations_s).enumerate() {
        let options = OnlineOptions::default();
        let motion = JerkLimitedMove::plan(&case.from, &case.to, &case.limits, &options)?;
        let off = (motion.duration_s() / theirs_s - 1.0).abs();
        ensure!(off <= TOLERANCE, "motion {index}: both durations differ by {off:e}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peer_that_finds_another_duration_is_noticed() {
        let mut random = SplitMix::new(1);
        let cases: Vec<_> = (0..3).map(|_| Case::new(&mut random).expect("usable")).collect();
        let options = OnlineOptions::default();
        let plan =
            |case: &Case| JerkLimitedMove::plan(&case.from, &case.to, &case.limits, &options);
        let duration_s = |case| plan(case).expect("a motion").duration_s();
        let mut durations_s: Vec<_> = cases.iter().map(duration_s).collect();
        agree(&cases, &durations_s).expect("the same");
        durations_s[1] += 1e-6;
        let error = agree(&cases, &durations_s).expect_err("longer").to_string();
        assert!(error.contains("motion 1"), "{error}");
        assert!(agree(&cases, &durations_s[..2]).is_err(), "a motion is missing");
    }
}
