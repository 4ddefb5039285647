//! `armada up`: a whole cell on this machine.
//!
//! ```text
//! preflight   every file and port is looked at before anything starts
//! children    the processes: started from the main thread, log lines, ends, signals
//! ready       until every robot is online and can be commanded, or it is told which is not and why
//! demo        a motion again and again, until it ends otherwise than complete
//! shutdown    halt, measured standstill, agents, emulators, gateway; what is left is killed
//! ```
//!
//! A process that dies is told at once and not started again: what happened must be looked at, and
//! a robot that moves again by itself is dangerous.

mod children;
mod demo;
mod preflight;
mod ready;
mod shutdown;

use std::path::PathBuf;
use std::time::Duration;

use armada_protocol::client::{Client, ClientError, ClientOptions};
use clap::{Args, ValueHint};

use crate::cell_address::{client_name, parse_seconds};
use crate::exit::Exit;
use crate::logging::LogFormat;
use crate::output::{Output, note};
use crate::run_file::{self, RunFile, RunRobot};
use crate::signals::Signals;
use children::{Children, Ended, Kind};
use preflight::Cell;

/// What `armada up --help` begins with.
pub(crate) const LONG_ABOUT: &str = "Start a whole cell on this machine: one emulator per emulated robot, one agent per \
robot, one gateway, each a process of its own.

Everything is checked before anything starts. Ctrl-C stops motion, waits for measured standstill and \
ends the processes; a second Ctrl-C kills them at once. A process that dies is told at once and not \
started again; the others go on.

Stops of Armada are operational stops over a network, never a rated safety function.";

/// Arguments of `armada up`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada up
  armada up config/cells/dual_arm.yaml --demo config/motions/handover.json
  armada up --log-dir logs")]
pub(crate) struct UpArgs {
    /// Cell file
    #[arg(
        value_name = "CELL.yaml",
        value_hint = ValueHint::FilePath,
        default_value = "config/cells/dual_arm.yaml"
    )]
    cell: PathBuf,
    /// Motion to run again and again once the cell is ready
    #[arg(long, value_name = "MOTION.json", value_hint = ValueHint::FilePath)]
    demo: Option<PathBuf>,
    /// Write each process's log to a file of its own in this folder, instead of here
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    log_dir: Option<PathBuf>,
    /// Longest time to wait for the robots to be ready
    #[arg(long, value_name = "SECONDS", default_value = "30", value_parser = parse_seconds)]
    ready_timeout: Duration,
    /// Allow listening outside this machine without authentication, where anybody on the network
    /// can command the robots
    #[arg(long)]
    insecure_lan: bool,
    /// Folder below which each cell keeps its latched stops
    /// [default: $XDG_STATE_HOME/armada, else ~/.local/state/armada]
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    state_dir: Option<PathBuf>,
}

/// How the cell was left.
enum Left {
    /// By a signal.
    Signal(&'static str),
    /// It never became usable.
    Failed(anyhow::Error),
}

/// Starts the cell and keeps it until a signal.
pub(crate) async fn run(args: UpArgs, log_format: LogFormat) -> anyhow::Result<Exit> {
    let cell = preflight::check(&args)?;
    let _run_file = run_file::write(&run_file::directory(), &cell.run_file())?;
    let mut signals = Signals::new()?;
    let mut children = Children::new(args.log_dir.clone(), log_format)?;
    let started = children.start(&cell, args.insecure_lan);
    let mut client = None;
    let left = match started {
        Ok(()) => keep(&cell, &args, &mut children, &mut signals, &mut client).await,
        Err(error) => Left::Failed(error),
    };
    if let Left::Signal(name) = left {
        note(format_args!("{name}: stopping motion, then the processes; once more kills them"));
    }
    let clean = shutdown::run(&cell, client.is_some(), &mut children, &mut signals).await;
    match left {
        Left::Failed(error) => Err(error),
        Left::Signal(_) if clean => Ok(Exit::Success),
        Left::Signal(_) => Ok(Exit::Failure),
    }
}

/// Waits until the cell is ready, runs the demo, and goes on until a signal.
async fn keep(
    cell: &Cell,
    args: &UpArgs,
    children: &mut Children,
    signals: &mut Signals,
    connected: &mut Option<Client>,
) -> Left {
    let out = Output::new(false);
    let ready = tokio::select! {
        signal = signals.next() => return Left::Signal(signal),
        ended = children.next_end() => Err(too_early(&ended)),
        ready = ready::wait(cell, args.ready_timeout, connected) => ready,
    };
    let is_ready = match ready {
        Ok(missing) => {
            missing.iter().for_each(|line| note(format_args!("NOT READY: {line}")));
            missing.is_empty()
        }
        Err(error) => return Left::Failed(error),
    };
    for line in banner(cell, children, is_ready) {
        if let Err(error) = out.line(line) {
            note(error);
        }
    }
    let demo = demo::run(cell, connected.clone().filter(|_| is_ready));
    tokio::pin!(demo);
    let mut demo_over = false;
    loop {
        tokio::select! {
            signal = signals.next() => return Left::Signal(signal),
            ended = children.next_end() => {
                for line in degraded(&ended) {
                    note(line);
                }
                if children.none_left() {
                    return Left::Failed(anyhow::anyhow!("every process of the cell has ended"));
                }
            }
            why = &mut demo, if !demo_over => {
                demo_over = true;
                note(format_args!("demo ended: {why}"));
                note("the cell goes on; start the motion again with `armada run`");
            }
        }
    }
}

fn too_early(ended: &Ended) -> anyhow::Error {
    anyhow::anyhow!(
        "{} ended before the cell was ready: {}; its log says why",
        ended.name,
        ended.how
    )
}

fn degraded(ended: &Ended) -> Vec<String> {
    let consequence = match ended.kind {
        Kind::Gateway => {
            "motions of several robots fail and stop; `armada stop` still reaches every agent"
        }
        Kind::Agent => "its robot's controller stops it by its own watchdog",
        Kind::Emulator => "its agent reports the loss of communication as a fault",
    };
    vec![
        format!("{} ENDED: {}", ended.name.to_uppercase(), ended.how),
        format!("the cell goes on degraded: {consequence}; it is not started again by itself"),
    ]
}

fn banner(cell: &Cell, children: &Children, is_ready: bool) -> Vec<String> {
    let state = if is_ready { "is ready" } else { "runs, but is not ready" };
    let mut lines = vec![String::new(), format!("cell {} {state}", cell.config.cell)];
    let gateway = cell.config.listen.join(", ");
    lines.push(format!("  gateway    {gateway}  pid {}", children.pid_of("gateway")));
    for robot in &cell.config.robots {
        let pid = children.pid_of(robot.name.as_str());
        let emulated = if robot.emulate { "  emulated controller" } else { "" };
        let name = robot.name.as_str();
        lines.push(format!("  {name:<10} {}  pid {pid}{emulated}", robot.endpoint));
    }
    let first = cell.config.robots.first().map_or("ROBOT", |robot| robot.name.as_str());
    lines.push("in another terminal:".to_owned());
    lines.push("  armada status".to_owned());
    lines.push(format!("  armada watch {first}"));
    lines.push("  armada stop        then, when it is safe: armada reset".to_owned());
    lines.push(
        "Stops are operational stops over a network, never a rated safety function.".to_owned(),
    );
    lines.push("Ctrl-C stops motion, then the processes.".to_owned());
    lines
}

impl Cell {
    async fn connect(&self, endpoints: Vec<String>) -> Result<Client, ClientError> {
        Client::connect(ClientOptions {
            name: client_name(),
            connect: endpoints,
            namespace: self.config.namespace.clone(),
        })
        .await
    }

    fn run_file(&self) -> RunFile {
        let robot = |entry: &armada_gateway::config::RobotEntry| RunRobot {
            robot: entry.name.clone(),
            endpoint: entry.endpoint.clone(),
        };
        RunFile {
            pid: std::process::id(),
            cell: self.config.cell.clone(),
            namespace: self.config.namespace.clone(),
            gateway: self.config.listen.first().cloned().unwrap_or_default(),
            robots: self.config.robots.iter().map(robot).collect(),
        }
    }
}
