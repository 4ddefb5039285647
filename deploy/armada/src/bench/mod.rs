//! `armada bench`: how well this machine keeps time, and what Armada adds to what it is built on.
//!
//! ```text
//! measurements  loop_period latency stop group lease accept cpu scale step motion original
//!    |                                                  one file or folder each
//!    | use       arm (emulator + agent + client)   fleet (many arms)   raw (the reference)
//!    | start     child --asks over stdin--> part (this program, another process)
//!    |           python --asks over stdin--> a script of ours with the library of others
//!    v
//! report  <- figures, machine
//! ```
//!
//! Invariants: whatever is compared is measured in pairs, in one run, each in a process of its own;
//! no figure is judged; every process that was started has ended when the command ends, however it
//! ends.

mod accept;
mod allocations;
mod arm;
mod child;
mod cpu;
mod figures;
mod fleet;
mod flood;
mod group;
mod latency;
mod lease;
mod loop_period;
mod machine;
mod motion;
mod original;
mod part;
mod python;
mod raw;
mod report;
mod robot_file;
mod scale;
mod step;
mod stop;
mod swing;
mod wakes;

use std::fmt;
use std::time::Duration;

use anyhow::Context as _;
use clap::{Args, Subcommand, ValueEnum};

use crate::cell_address::parse_seconds;
use crate::exit::Exit;
use crate::output::Output;
use report::Report;

/// Arguments of `armada bench`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada bench loop                    period error of the control loop at 1 kHz
  armada bench loop --load             the same with every core kept busy
  armada bench latency --json          state, from the agent to a subscriber
  armada bench stop --rounds 20        cell/stop to standstill of two moving arms
  armada bench stop --arms 16 --flood 10000    the same of sixteen that are flooded
  armada bench group                   two arms on a common path, and when one is lost
  armada bench lease                   take_lease to the holder's loss
  armada bench scale                   arms in one agent, until half of the periods are missed
  armada bench original                everything beside the original abstract robot
  armada bench motion                  kinematics, against pinocchio where it is installed

Each measurement runs Armada and a reference by turns, in pairs, and reports the median over the
pairs with the smallest and the largest. Figures are of this machine, now: use a release build, and
close what else runs.")]
pub(crate) struct BenchArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Period error of the control loop, against a bare loop that sleeps to absolute deadlines
    Loop(loop_period::LoopArgs),
    /// State from the agent to a subscriber, against a bare Zenoh put of equal size
    Latency(latency::LatencyArgs),
    /// A stop of two moving arms, against a bare Zenoh query and reply
    Stop(stop::StopArgs),
    /// Arms on a common path: how close they keep, and how soon one stops when another is lost
    Group(group::GroupArgs),
    /// A robot that is taken from its holder, against a bare Zenoh query and reply
    Lease(lease::LeaseArgs),
    /// One step of the control loop, with its allocations
    Step(step::StepArgs),
    /// Acceptance of a long trajectory, against a bare Zenoh query of equal size
    Accept(accept::AcceptArgs),
    /// Processor time of an agent and its emulator
    Cpu(cpu::CpuArgs),
    /// How many arms one agent process can run, against as many bare loops
    Scale(scale::ScaleArgs),
    /// Kinematics and motion, against the libraries that others use
    Motion(motion::MotionArgs),
    /// The original abstract robot of Robot Raconteur, beside ours
    Original(original::OriginalArgs),
    /// One process of a measurement
    #[command(hide = true)]
    Part {
        /// What it is, as JSON
        part: part::Part,
    },
}

/// How often a measurement is repeated.
#[derive(Args, Clone, Debug)]
struct RepeatArgs {
    /// Pairs of measurements: ours and the reference
    #[arg(long, value_name = "NUMBER", default_value_t = 5,
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    pairs: u32,
}

/// Arguments of every measurement of processes.
#[derive(Args, Clone, Debug)]
struct CommonArgs {
    /// Scheduling of the loops; fifo falls back to other where the system does not permit it
    #[arg(long, value_enum, default_value = "fifo")]
    policy: Policy,
    /// Print JSON, for scripts
    #[arg(long)]
    json: bool,
}

/// How control loops are scheduled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Policy {
    /// SCHED_FIFO, as an agent has it by default.
    Fifo,
    /// The ordinary scheduler.
    Other,
}

/// How long a measurement takes.
#[derive(Args, Clone, Debug)]
struct TimeArgs {
    /// Time of each measurement, of which there are two a pair
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = parse_seconds)]
    seconds: Duration,
}

/// Priority of control loops under SCHED_FIFO, as in a robot file.
const LOOP_PRIORITY: u8 = 80;

impl Policy {
    /// Priority of a control loop under it.
    const fn priority(self) -> Option<u8> {
        match self {
            Self::Fifo => Some(LOOP_PRIORITY),
            Self::Other => None,
        }
    }
}

/// Measures, until done or Ctrl-C.
pub(crate) async fn run(args: BenchArgs) -> anyhow::Result<Exit> {
    let (json, measured) = match args.what {
        What::Part { part } => {
            part::run(part).await?;
            return Ok(Exit::Success);
        }
        What::Loop(args) => (args.common.json, or_signal(loop_period::measure(args)).await?),
        What::Latency(args) => (args.common.json, or_signal(latency::measure(args)).await?),
        What::Stop(args) => (args.common.json, or_signal(stop::measure(args)).await?),
        What::Group(args) => (args.common.json, or_signal(group::measure(args)).await?),
        What::Lease(args) => (args.common.json, or_signal(lease::measure(args)).await?),
        What::Step(args) => (args.json, Some(step::measure(&args)?)),
        What::Accept(args) => (args.common.json, or_signal(accept::measure(args)).await?),
        What::Motion(args) => (args.json, or_signal(motion::measure(args)).await?),
        What::Original(args) => (args.common.json, or_signal(original::measure(args)).await?),
        What::Scale(args) => (args.common.json, or_signal(scale::measure(args)).await?),
        What::Cpu(args) => (args.common.json, or_signal(cpu::measure(args)).await?),
    };
    let Some(report) = measured else { return Ok(Exit::Interrupted) };
    let output = Output::new(json);
    if json {
        output.json(&report)?
    } else {
        output.line(report)?
    }
    Ok(Exit::Success)
}

/// The report, or `None` after Ctrl-C; either way everything that was started has been dropped.
async fn or_signal(
    measurement: impl Future<Output = anyhow::Result<Report>>,
) -> anyhow::Result<Option<Report>> {
    tokio::select! {
        report = measurement => report.map(Some),
        signal = tokio::signal::ctrl_c() => {
            signal.context("cannot wait for Ctrl-C")?;
            Ok(None)
        }
    }
}

/// In which order pair `pair` is measured: by turns, so that a drift of the machine cancels out.
fn turns(pair: u32) -> [Side; 2] {
    if pair.is_multiple_of(2) {
        [Side::Ours, Side::Reference]
    } else {
        [Side::Reference, Side::Ours]
    }
}

/// One side of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Ours,
    Reference,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ours => "armada",
            Self::Reference => "reference",
        })
    }
}
