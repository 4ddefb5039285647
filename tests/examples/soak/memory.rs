//! Whether the memory of processes grows.

use std::collections::BTreeMap;

use anyhow::{Context, Result};

/// Time of a process that is left out: it still builds up what it needs \[min\].
const WARM_UP: f64 = 0.5;
/// Fewest samples that say something.
const ENOUGH: usize = 15;

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

/// Slope of the straight line through the samples, by least squares.
fn slope(samples: &[(f64, f64)]) -> Option<f64> {
    if samples.len() < ENOUGH {
        return None;
    }
    let count = samples.len() as f64;
    let mean = samples.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x, sum.1 + y));
    let mean = (mean.0 / count, mean.1 / count);
    let (mut above, mut below) = (0.0, 0.0);
    for (x, y) in samples {
        above += (x - mean.0) * (y - mean.1);
        below += (x - mean.0) * (x - mean.0);
    }
    (below > 0.0).then(|| above / below)
}
