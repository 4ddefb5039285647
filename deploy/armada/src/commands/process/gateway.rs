//! `armada gateway`: the gateway of a cell.

use std::path::PathBuf;

use anyhow::Context as _;
use armada_gateway::GatewayOptions;
use armada_gateway::config::CellConfig;
use clap::{Args, ValueHint};
use tokio::sync::oneshot;
use tracing::info;

use super::{ParentArgs, end_or_signal};
use crate::exit::Exit;
use crate::signals::Signals;

/// Arguments of `armada gateway`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada gateway config/cells/dual_arm.yaml

The gateway is the cell's Zenoh router. It knows which robots there are and where they stand, splits
motions of several robots, and resets. When it is not there, agents go on, and `armada stop` still
reaches every one of them.")]
pub(crate) struct GatewayArgs {
    /// Cell file
    #[arg(value_name = "CELL.yaml", value_hint = ValueHint::FilePath)]
    cell: PathBuf,
    /// Allow listening outside this machine without authentication, where anybody on the network
    /// can command the robots
    #[arg(long)]
    insecure_lan: bool,
    #[command(flatten)]
    pub(crate) parent: ParentArgs,
}

/// Runs the gateway until a signal.
pub(crate) async fn run(args: GatewayArgs) -> anyhow::Result<Exit> {
    let mut signals = Signals::new()?;
    let config = CellConfig::load(&args.cell)?;
    let options = GatewayOptions { config, listen: None, insecure_lan: args.insecure_lan };
    let (ready, _) = oneshot::channel();
    let (end, ended) = oneshot::channel::<()>();
    let running = armada_gateway::run(options, ready, async {
        // A sender that is gone means the same.
        ended.await.ok();
    });
    tokio::pin!(running);
    tokio::select! {
        result = &mut running => result.context("the gateway cannot run")?,
        signal = signals.next() => {
            info!(signal, "ending");
            end.send(()).ok();
            end_or_signal(&mut signals, running).await?;
        }
    }
    Ok(Exit::Success)
}
