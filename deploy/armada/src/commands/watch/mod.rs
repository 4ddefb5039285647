//! `armada watch`: one robot, live.
//!
//! ```text
//! feed    subscriptions -> Model          model   what is shown, with its age
//! render  Model -> frame (pure)           plain   Model -> one line
//! screen  the terminal: keys, drawing, and putting it back as it was
//! ```

mod feed;
mod model;
mod plain;
mod render;
mod screen;

use std::io::IsTerminal as _;
use std::time::Duration;

use armada_protocol::RobotName;
use clap::Args;

use crate::cell_address::{CellArgs, parse_seconds};
use crate::exit::Exit;
use feed::Feed;

/// Arguments of `armada watch`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada watch left_arm                        live in the terminal; ? shows the keys
  armada watch left_arm --interval 0.2 > log   lines, for not being a terminal
  armada watch left_arm --json | jq .state.joint_position_rad

Keys: s stop (latched, all joints), h halt, ? help, q quit.")]
pub(crate) struct WatchArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Pause between lines or JSON objects
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = parse_seconds)]
    interval: Duration,
    #[command(flatten)]
    cell: CellArgs,
}

/// Shows the robot until `q`, Ctrl-C, or nobody reads.
pub(crate) async fn run(args: WatchArgs) -> anyhow::Result<Exit> {
    let (client, address) = args.cell.connect().await?;
    let feed = Feed::subscribe(client, address, args.robot).await?;
    let out = args.cell.output();
    if out.is_json() || !std::io::stdout().is_terminal() {
        plain::run(feed, &out, args.interval).await
    } else {
        screen::run(feed).await
    }
}
