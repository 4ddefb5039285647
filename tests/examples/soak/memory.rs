//! Whether the memory of processes grows.

use std::collections::BTreeMap;

use anyhow::{Context, Result};

/// Time of a process that is left out: it still builds up what it needs \[min\].
const WARM_UP: f64 = 2.0;
/// Least time after it that says something \[min\].
const ENOUGH: f64 = 2.0;

/// Resident memory of processes over time.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// Time \[min\] and memory \[MB\] of each run of each process.
    runs: BTreeMap<(String, u32), Vec<(f64, f64)>>,
}

impl Memory {
    /// Notes how much memory a process has now.
    pub(crate) fn note(&mut self, name: &str, pid: u32, minutes: f64) -> Result<()> {
        let status = std::fs::read_to_string(format!("/proc/{pid}/status"))?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kilobytes: f64 = line
            .and_then(|line| line.trim().strip_suffix(" kB")?.trim().parse().ok())
            .context("VmRSS of a process")?;
        self.runs.entry((name.to_owned(), pid)).or_default().push((minutes, kilobytes / 1024.0));
        Ok(())
    }

    /// The fastest growth of any run that lasted long enough, with its name \[MB/min\].
    pub(crate) fn steepest(&self) -> Option<(&str, f64)> {
        let slopes = self.runs.iter().filter_map(|((name, _), samples)| {
            let begin = samples.first()?.0 + WARM_UP;
            let late = samples.iter().copied().skip_while(|(minutes, _)| *minutes < begin);
            Some((name.as_str(), slope(&late.collect::<Vec<_>>())?))
        });
        slopes.max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// The median of the slopes between all pairs of samples (Theil and Sen): steps, such as of the
/// first fault that is written down, do not count as growth.
fn slope(samples: &[(f64, f64)]) -> Option<f64> {
    let time = samples.last()?.0 - samples.first()?.0;
    let mut slopes: Vec<f64> = Vec::new();
    for (index, (x, y)) in samples.iter().enumerate() {
        let later = samples.iter().skip(index + 1).filter(|(later, _)| later > x);
        slopes.extend(later.map(|(later, value)| (value - y) / (later - x)));
    }
    slopes.sort_unstable_by(f64::total_cmp);
    slopes.get(slopes.len() / 2).copied().filter(|_| time >= ENOUGH)
}
