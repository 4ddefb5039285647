//! The end of a cell: motion first, then the processes, in an order in which each still has what it
//! needs to come to rest.

use std::time::Duration;

use armada_gateway::config::RobotEntry;
use armada_protocol::RobotName;

use super::children::{Children, Kind};
use super::preflight::Cell;
use crate::output::note;
use crate::signals::Signals;
use crate::standstill;

/// Agents ramp their robots to standstill; they need their controllers for it, so they go first.
const ORDER: [(Kind, Duration); 3] = [
    (Kind::Agent, Duration::from_secs(8)),
    (Kind::Emulator, Duration::from_secs(3)),
    (Kind::Gateway, Duration::from_secs(5)),
];

/// Halts the robots, ends the processes; returns whether all went as it should. Another signal
/// kills what is left at once.
pub(super) async fn run(
    cell: &Cell,
    was_ready: bool,
    children: &mut Children,
    signals: &mut Signals,
) -> bool {
    let ended = tokio::select! {
        clean = in_order(cell, was_ready, children) => Some(clean),
        _ = signals.next() => None,
    };
    let clean = ended.unwrap_or_else(|| {
        note("second signal: killing what is left; the controllers' watchdogs stop the robots");
        false
    });
    children.kill().await;
    if clean {
        note("every process has ended");
    }
    clean
}

async fn in_order(cell: &Cell, was_ready: bool, children: &mut Children) -> bool {
    let mut clean = true;
    if was_ready {
        clean &= halt(cell, children).await;
    }
    for (kind, patience) in ORDER {
        let left = children.end(kind, patience).await;
        if !left.is_empty() {
            clean = false;
            let seconds = patience.as_secs();
            note(format_args!("{}: no end within {seconds} s, killed", left.join(", ")));
        }
    }
    clean
}

/// Halts every robot that still has an agent, gateway alive or not.
async fn halt(cell: &Cell, children: &Children) -> bool {
    let running = |robot: &&RobotEntry| children.is_running(robot.name.as_str());
    let (robots, agents): (Vec<RobotName>, Vec<String>) = cell
        .config
        .robots
        .iter()
        .filter(running)
        .map(|robot| (robot.name.clone(), robot.endpoint.clone()))
        .unzip();
    if robots.is_empty() {
        return true;
    }
    match cell.connect(agents).await {
        Ok(client) => standstill::halt_and_report(&client, &robots).await.is_empty(),
        Err(error) => {
            note(format_args!("no halt: {error}; the agents halt their robots as they end"));
            false
        }
    }
}
