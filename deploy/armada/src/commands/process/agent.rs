//! `armada agent`: the agent of one or more robots.

use std::path::PathBuf;

use anyhow::Context as _;
use armada_agent::runtime::{Agent, AgentOptions};
use clap::{Args, ValueHint};
use tracing::info;

use super::{ParentArgs, end_or_signal};
use crate::exit::Exit;
use crate::signals::Signals;
use crate::state_dir;

/// Arguments of `armada agent`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada agent config/robots/left_arm.yaml --listen tcp/127.0.0.1:7451 \\
      --connect tcp/127.0.0.1:7447
  armada agent config/robots/left_arm.yaml config/robots/right_arm.yaml

An agent closes the control loop of a robot's controller and speaks Zenoh for it. Several robots may
share one agent: each has a control loop of its own and none depends on another, but they share the
process and its Zenoh session, whose endpoints are those of all files. Agents of one cell should be linked to each other, each pair by one side only (by custom the smaller name dials),
so that a stop reaches all of them without the gateway; `armada up` does that.
On Ctrl-C or SIGTERM it ramps all its robots to standstill before it ends.
A stop stays latched over a restart. An agent that follows one which died begins stopped.")]
pub(crate) struct AgentArgs {
    /// Robot file; several for robots that share the agent
    #[arg(value_name = "ROBOT.yaml", required = true, value_hint = ValueHint::FilePath)]
    robots: Vec<PathBuf>,
    /// Zenoh endpoint to listen on, instead of those of the robot files; repeat for several
    #[arg(long, value_name = "ENDPOINT")]
    listen: Vec<String>,
    /// Zenoh endpoint to dial, instead of those of the robot files; repeat for several
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// Prefix of every key of the cell
    #[arg(long, value_name = "PREFIX")]
    namespace: Option<String>,
    /// Allow listening outside this machine without authentication, where anybody on the network
    /// can command the robot
    #[arg(long)]
    insecure_lan: bool,
    /// Folder in which latched stops are kept while the agent does not run, so that they outlive it
    /// [default: $XDG_STATE_HOME/armada, else ~/.local/state/armada]
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    state_dir: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) parent: ParentArgs,
}

/// Runs the agent until a signal.
pub(crate) async fn run(args: AgentArgs) -> anyhow::Result<Exit> {
    let mut signals = Signals::new()?;
    let some = |endpoints: Vec<String>| (!endpoints.is_empty()).then_some(endpoints);
    let agent = Agent::start(AgentOptions {
        robot_files: args.robots,
        listen: some(args.listen),
        connect: some(args.connect),
        namespace: args.namespace,
        insecure_lan: args.insecure_lan,
        state_dir: Some(state_dir::or_default(args.state_dir)?),
    })
    .await
    .context("the agent cannot start")?;
    let signal = signals.next().await;
    info!(signal, "ramping to standstill, then ending");
    end_or_signal(&mut signals, agent.shut_down()).await;
    Ok(Exit::Success)
}
