//! `armada bench motion`: what kinematics and motion cost, against the libraries that others use.
//!
//! ```text
//! fk          one file for each row        robots   descriptions and configurations
//!   | ask
//!   v
//! peer -----> peer.py, a Python process with pinocchio, toppra and ruckig where installed
//! ```
//!
//! Both sides calculate the same inputs, by turns, on one core, and their answers are compared.

mod fk;
mod peer;
mod robots;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::machine::Machine;
use super::report::Report;
use super::{RepeatArgs, Side, turns};
use crate::output::Progress;
use peer::Peer;

/// Configurations that calls go through, so that no branch or cache knows the next.
const CONFIGURATIONS: usize = 64;
/// Figure of every row.
const COLUMN: &str = "ns a call";

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
    let missing = std::mem::take(&mut bench.missing);
    let versions = bench.peer.as_ref().and_then(|peer| peer.version("pin")).map(str::to_owned);
    drop(bench);
    if let Some(version) = versions {
        report.note(format!(
            "pinocchio {version} is called from Python, which is part of its figures; its poses of \
             the first configuration equal ours"
        ));
    }
    match failure {
        Some(failure) => report.note(failure),
        None => missing.iter().for_each(|package| {
            report.note(format!("{package} is {}", peer::INSTALL));
        }),
    }
    Ok(report)
}

impl Bench<'_> {
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
