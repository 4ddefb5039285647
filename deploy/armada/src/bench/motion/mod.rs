//! `armada bench motion`: what kinematics and motion cost, against the libraries that others use.
//!
//! ```text
//! fk jacobian ik retime retarget clearance on_path      one file for each kind of row
//!   | ask                                  robots random   descriptions and configurations
//!   v
//! peer -----> peer.py, a Python process with pinocchio, toppra and ruckig where installed
//! ```
//!
//! Both sides calculate the same inputs, by turns, on one core, and their answers are compared.

mod clearance;
mod fk;
mod ik;
mod jacobian;
mod on_path;
mod peer;
mod random;
mod retarget;
mod retime;
mod robots;

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context as _;
use armada_agent::runtime::monotonic;
use clap::Args;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::machine::Machine;
use super::report::Report;
use super::{RepeatArgs, Side, turns};
use crate::output::Progress;
use peer::Peer;
use robots::Robot;

/// Configurations that calls go through, so that no branch or cache knows the next.
const CONFIGURATIONS: usize = 64;
/// Figure of rows of short calls.
const COLUMN: &str = "ns a call";
/// Name of the row with what shall be reached.
const TARGET: &str = "target, at most";

/// Arguments of `armada bench motion`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  armada bench motion
  armada bench motion --robots robots/pr2 --python ~/peers/bin/python --json

Without a folder the arms of config/robots are used. Peers are called from Python: what a call
costs them there is part of their figures.")]
pub(super) struct MotionArgs {
    /// Folder with robot descriptions, NAME.urdf, searched to its depth
    #[arg(long, value_name = "FOLDER")]
    robots: Option<PathBuf>,
    /// Python that has the peers: pip install pin ruckig toppra [default: .venv/bin/python if it
    /// is there, else python3]
    #[arg(long, value_name = "PROGRAM")]
    python: Option<PathBuf>,
    /// Calls of each side in a pair
    #[arg(long, value_name = "NUMBER", default_value_t = 20_000,
        value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    calls: u32,
    #[command(flatten)]
    repeat: RepeatArgs,
    /// Print JSON, for scripts
    #[arg(long)]
    pub(super) json: bool,
}

/// What every row needs.
struct Bench<'a> {
    args: &'a MotionArgs,
    peer: Option<Peer>,
    /// Libraries that rows asked for and did not find.
    missing: Vec<&'static str>,
    progress: Progress,
}

/// Measures every row for every robot.
pub(super) async fn measure(args: MotionArgs) -> anyhow::Result<Report> {
    let machine = Machine::now();
    let robots = robots::load(args.robots.as_deref())?;
    let (peer, failure) = match Peer::start(args.python.as_deref()).await {
        Ok(peer) => (Some(peer), None),
        Err(error) => (None, Some(format!("no peers: {error:#}; {}", peer::INSTALL))),
    };
    let settings = json!({
        "calls": args.calls,
        "configurations": CONFIGURATIONS,
        "pairs": args.repeat.pairs,
        "peers": peer.as_ref().map(|peer| &peer.installed),
    });
    let mut report = Report::new("motion", settings, machine);
    let progress = Progress::new();
    let mut bench = Bench { args: &args, peer, missing: Vec::new(), progress };
    for robot in &robots {
        report.section(fk::measure(&mut bench, robot).await?);
    }
    rows(&mut bench, &robots, &mut report).await?;
    let missing = std::mem::take(&mut bench.missing);
    let used: Vec<_> = bench.peer.iter().flat_map(Peer::versions).collect();
    drop(bench);
    if !used.is_empty() {
        report.note(format!(
            "{} are called from Python, which is part of their figures; the answers that were \
             compared agree with ours",
            used.join(", ")
        ));
    }
    report.note("inverse kinematics, clearance and motion on a path have no peer");
    match failure {
        Some(failure) => report.note(failure),
        None => missing.iter().for_each(|package| {
            report.note(format!("{package} is {}", peer::INSTALL));
        }),
    }
    Ok(report)
}

/// Measures what needs no robot, or a certain one.
async fn rows(bench: &mut Bench<'_>, robots: &[Robot], report: &mut Report) -> anyhow::Result<()> {
    let own = robots::load(None)?;
    let (own_arms, mut arms) = (robots::arms(&own)?, robots::arms(robots)?);
    if arms.is_empty() {
        arms = robots::arms(&own)?;
    }
    let mut all = arms.iter().chain(&own_arms);
    let seven = all.find(|arm| arm.chain.len() == 7).context("no seven-axis arm")?;
    report.section(jacobian::measure(bench, seven).await?);
    for arm in &arms {
        report.section(ik::measure(bench, arm)?);
    }
    report.section(retime::measure(bench).await?);
    retarget::measure(bench).await?.into_iter().for_each(|section| report.section(section));
    let two = own_arms.iter().find(|arm| arm.chain.len() == 7).context("no seven-axis arm")?;
    report.section(clearance::measure(bench, two.robot)?);
    report.section(on_path::measure(bench)?);
    Ok(())
}

impl Bench<'_> {
    /// Over which pairs rows without a peer are measured; shows the progress.
    fn rounds(&mut self, what: &str) -> std::ops::Range<u32> {
        self.progress.show(what);
        0..self.args.repeat.pairs
    }

    /// Who measures when, over all pairs; shows the progress.
    fn turns(&mut self, what: &str) -> Vec<Side> {
        self.progress.show(what);
        (0..self.args.repeat.pairs).flat_map(turns).collect()
    }

    /// Asks the peer, unless it lacks the library.
    async fn ask<T: DeserializeOwned>(
        &mut self,
        package: &'static str,
        ask: &Value,
    ) -> anyhow::Result<Option<T>> {
        match &mut self.peer {
            Some(peer) if peer.version(package).is_some() => peer.ask(ask).await.map(Some),
            _ => {
                if !self.missing.contains(&package) {
                    self.missing.push(package);
                }
                Ok(None)
            }
        }
    }
}

/// Time of one of `calls` calls \[ns\].
fn per_call(time: Duration, calls: u32) -> f64 {
    time.as_secs_f64() * 1e9 / f64::from(calls)
}

/// What `call` returns, and the time it takes \[µs\].
fn clocked<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let begin = monotonic();
    let result = black_box(call());
    (result, 1e-3 * per_call(monotonic().saturating_since(begin), 1))
}
