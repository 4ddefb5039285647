//! `armada bench original`: the abstract robot of Robot Raconteur, beside ours in the same run.
//!
//! ```text
//! ours   emulator -datagrams- agent -Zenoh- this process
//! theirs server (AbstractRobot, simulated arm) -TCP- client        two runs of robot.py
//!    | Figures of each pair                         arms: both sides by number of arms
//!    v
//! table: ours, original, ratio, aim
//! ```
//!
//! Both sides are asked for the same by one definition, by turns. Where the definitions cannot be
//! the same to the microsecond, the difference is to the advantage of the original; notes say so.

mod arms;
mod figures;
mod ours;
mod robot;
mod table;
mod theirs;
mod venv;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::child::Child;
use super::machine::Machine;
use super::part::Part;
use super::report::Report;
use super::{CommonArgs, Side, turns};
use crate::cell_address::parse_seconds;
use crate::output::Progress;
use figures::Figures;

/// The process of the original, as text, so that it needs no file beside this program.
const SCRIPT: &str = include_str!("robot.py");
/// Rates at which one arm is measured \[Hz\].
const RATES_HZ: [u32; 2] = [100, 1000];
/// Numbers of waypoints of the trajectories that are accepted.
const WAYPOINTS: [u32; 2] = [101, 1001];
/// Waypoints of the motion whose beginning is measured: there and back in 2 s.
const MOTION_WAYPOINTS: u32 = 41;
/// Time for caches and connections before a measurement.
const WARM_UP: Duration = Duration::from_secs(1);

/// Arguments of `armada bench original`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  armada bench original
  armada bench original --python ~/original/bin/python --json
  armada bench original --pairs 1 --seconds 2 --most 64

The original is AbstractRobot of the Python package robotraconteur-abstract-robot 0.2.2. Without
--python it is installed once, over the network, into a virtual environment in the user's cache
folder ($XDG_CACHE_HOME or ~/.cache). A simulated seven-axis arm on it serves a client in another
process over TCP on this machine; ours is an agent with an emulated controller in a process of its
own. The default takes about five minutes. Nothing else should run, and the last part uses all of
the machine.")]
pub(super) struct OriginalArgs {
    /// Python that has the original [default: one in the user's cache, installed when needed]
    #[arg(long, value_name = "PROGRAM")]
    python: Option<PathBuf>,
    /// Pairs of measurements: ours and the original
    #[arg(long, value_name = "NUMBER", default_value_t = 3,
        value_parser = clap::value_parser!(u32).range(1..=100))]
    pairs: u32,
    /// Time of each measurement of loops, of which there are four a side in a pair
    #[arg(long, value_name = "SECONDS", default_value = "4", value_parser = parse_seconds)]
    seconds: Duration,
    /// Requests of a kind, and motions, of each side in a pair
    #[arg(long, value_name = "NUMBER", default_value_t = 20,
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Numbers of arms to run at 100 Hz; the last is doubled until half of the periods are missed
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', default_value = "16,32,64,100",
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    arms: Vec<u32>,
    /// Largest number of arms to try
    #[arg(long, value_name = "NUMBER", default_value_t = 200,
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    most: u32,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

/// Measures one arm pair by pair, and then many.
pub(super) async fn measure(args: OriginalArgs) -> anyhow::Result<Report> {
    let mut machine = Machine::now();
    let mut progress = Progress::new();
    let (python, versions) = venv::find(args.python.as_deref(), &mut progress).await?;
    let (mut ours, mut original): (Vec<Figures>, Vec<Figures>) = (Vec::new(), Vec::new());
    for pair in 0..args.pairs {
        for side in turns(pair) {
            progress.show(&format!("pair {} of {}: {side}", pair + 1, args.pairs));
            match side {
                Side::Ours => ours.push(ours::measure(&args, &mut machine).await?),
                Side::Reference => original.push(theirs::measure(&args, &python).await?),
            }
        }
    }
    let many = arms::measure(&args, &python, &mut progress).await?;
    drop(progress);
    machine.scheduled("original", "SCHED_OTHER: it has no setting for it");
    Ok(table::report(&args, machine, &versions, [&ours, &original], &many))
}

/// Threads of ordinary priority that keep every core busy.
async fn keep_busy() -> anyhow::Result<Child> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    Child::start(&Part::Busy { threads }).await
}
