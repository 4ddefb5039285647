//! `armada status`.

pub(crate) mod advice;
mod gather;
mod text;

use std::collections::BTreeMap;

use armada_protocol::messages::{CellMotionStatus, CellRobotStatus, CellVerdict};
use armada_protocol::{RobotName, messages};
use clap::Args;
use serde::Serialize;

use gather::gather;

use crate::cell_address::CellArgs;
use crate::exit::Exit;

/// Arguments of `armada status`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada status
  armada status --json | jq -r .verdict
  armada status --cell config/cells/dual_arm.yaml

Without the gateway the agents are asked directly, and the first line says so.
Exit code 0: ready or moving. 3: a stop is latched. 4: degraded. 2: nobody answers.")]
pub(crate) struct StatusArgs {
    #[command(flatten)]
    cell: CellArgs,
}

/// Who knows what is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Origin {
    /// The gateway.
    Gateway,
    /// Each agent, for the gateway does not answer.
    Agents,
}

/// Condition of a cell.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Report {
    /// Who told.
    pub(crate) origin: Origin,
    /// Name of the cell; null if only agents were asked.
    pub(crate) cell: Option<String>,
    /// One word on the whole.
    pub(crate) verdict: CellVerdict,
    /// Every robot that is known.
    pub(crate) robots: BTreeMap<RobotName, CellRobotStatus>,
    /// Motions of several robots.
    pub(crate) motions: Vec<CellMotionStatus>,
}

impl From<messages::CellStatus> for Report {
    fn from(status: messages::CellStatus) -> Self {
        Self {
            origin: Origin::Gateway,
            cell: Some(status.cell),
            verdict: status.verdict,
            robots: status.robots,
            motions: status.motions,
        }
    }
}

/// Prints the condition of the cell.
pub(crate) async fn run(args: StatusArgs) -> anyhow::Result<Exit> {
    let (client, address) = args.cell.connect().await?;
    let report = gather(&client, &address).await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json(&report)?;
    } else {
        out.line(text::render(&report))?;
    }
    Ok(exit(report.verdict))
}

const fn exit(verdict: CellVerdict) -> Exit {
    match verdict {
        CellVerdict::Ready | CellVerdict::Moving => Exit::Success,
        CellVerdict::Stopped => Exit::Stopped,
        CellVerdict::Degraded => Exit::Degraded,
    }
}
