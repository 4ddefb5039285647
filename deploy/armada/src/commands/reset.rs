//! `armada reset`.

use std::collections::BTreeMap;
use std::io::{BufRead as _, IsTerminal as _};
use std::path::PathBuf;

use anyhow::Context as _;
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{
    CellResetAnswer, CellResetParams, Denial, DenialCode, LatchedStop, ResetParams, ResetZone,
    StopLatch,
};
use armada_protocol::method::{cell, robot};
use armada_protocol::signature::SigningKey;
use clap::{Args, ValueHint};

use crate::cell_address::{CellAddress, CellArgs};
use crate::commands::modes::robots_or_all;
use crate::exit::Exit;
use crate::output::{Output, note};
use crate::words;

/// Arguments of `armada reset`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada reset                  clear the stops of all robots, after a question
  armada reset left_arm --yes   one robot, without a question
  armada reset --key-file cell.key    with the key that robots ask their resets to be signed with

Nothing moves and nothing is enabled by it. Without the gateway the agents are asked directly.
On a terminal it asks first; a script that is sure need not say --yes.")]
pub(crate) struct ResetArgs {
    /// Robots to reset; every stopped robot if left out
    #[arg(value_name = "ROBOT")]
    robots: Vec<RobotName>,
    /// Do not ask
    #[arg(long, short)]
    yes: bool,
    /// File with the key for robots that ask for a signature
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    key_file: Option<PathBuf>,
    #[command(flatten)]
    cell: CellArgs,
}

/// What is latched, and who told.
struct Latched {
    robots: Vec<(RobotName, StopLatch)>,
    by_gateway: bool,
}

/// Lists what is latched, asks, and clears it.
pub(crate) async fn run(args: ResetArgs) -> anyhow::Result<Exit> {
    let key = args.key_file.as_deref().map(SigningKey::read).transpose();
    let key = key.context("--key-file")?;
    let (client, address) = args.cell.connect().await?;
    let out = args.cell.output();
    let latched = latched(&client, &address, args.robots).await?;
    for (robot, latch) in &latched.robots {
        latch.stops.iter().for_each(|stop| note(format_args!("{robot}: {}", in_words(stop))));
        if let Some(needed) = still_needed(latch, key.is_some()) {
            note(format_args!("{robot}: {needed}"));
        }
    }
    if latched.robots.is_empty() {
        return report(&CellResetAnswer { reset: vec![], refused: vec![] }, &out);
    }
    if !args.yes && std::io::stdin().is_terminal() && !confirmed()? {
        note("nothing was reset");
        return Ok(Exit::Failure);
    }
    let answer = if latched.by_gateway {
        reset_by_gateway(&client, latched.robots, key.as_ref()).await?
    } else {
        reset_at_agents(&client, latched.robots, key.as_ref()).await
    };
    report(&answer, &out)
}

/// What is to be done before the reset of this stop can succeed, as far as it is known.
fn still_needed(latch: &StopLatch, has_key: bool) -> Option<&'static str> {
    let needs = &latch.reset;
    if needs.zone == ResetZone::Manual && !needs.acknowledged {
        Some("somebody has to acknowledge it at the arm first")
    } else if needs.signed && !has_key {
        Some("its reset has to be signed: --key-file FILE")
    } else {
        None
    }
}

/// The reset of the stops that were shown, signed if the robot asks for it and there is a key.
async fn params(
    client: &Client,
    robot: &RobotName,
    latch: &StopLatch,
    key: Option<&SigningKey>,
) -> Result<ResetParams, ClientError> {
    let params = latch.reset_params();
    match key {
        Some(key) if latch.reset.signed => {
            let boot_id = client.robot_status(robot).await?.boot_id;
            Ok(key.sign_reset(robot, boot_id, params))
        }
        _ => Ok(params),
    }
}

async fn reset_by_gateway(
    client: &Client,
    latched: Vec<(RobotName, StopLatch)>,
    key: Option<&SigningKey>,
) -> anyhow::Result<CellResetAnswer> {
    let (mut resets, mut refused) = (BTreeMap::new(), Vec::new());
    for (robot, latch) in latched {
        match params(client, &robot, &latch, key).await {
            Ok(params) => drop(resets.insert(robot, params)),
            // The others are reset all the same.
            Err(error) => refused.push((robot, denial_of(error))),
        }
    }
    let mut answer = client.call_cell::<cell::Reset>(CellResetParams { resets }).await?;
    answer.refused.extend(refused);
    Ok(answer)
}

async fn latched(
    client: &Client,
    address: &CellAddress,
    named: Vec<RobotName>,
) -> anyhow::Result<Latched> {
    match client.cell_status().await {
        Ok(status) => {
            let in_scope = |robot: &RobotName| named.is_empty() || named.contains(robot);
            let robots = status.robots.into_iter().filter(|(robot, _)| in_scope(robot));
            let robots = robots
                .filter_map(|(robot, status)| status.stop.map(|stop| (robot, stop)))
                .collect();
            Ok(Latched { robots, by_gateway: true })
        }
        Err(ClientError::NoReply { .. } | ClientError::Timeout { .. }) => {
            note("the gateway does not answer: asking the agents directly");
            let mut robots = Vec::new();
            for robot in robots_or_all(client, address, named).await? {
                match client.robot_status(&robot).await {
                    Ok(status) => robots.extend(status.stop.map(|stop| (robot, stop))),
                    Err(error) => note(format_args!("{robot}: {error}")),
                }
            }
            Ok(Latched { robots, by_gateway: false })
        }
        Err(error) => Err(error.into()),
    }
}

/// Why a robot is not reset.
fn denial_of(error: ClientError) -> Denial {
    match error {
        ClientError::Denied(denial) => denial,
        error => Denial::new(DenialCode::CommunicationLost, error.to_string()),
    }
}

async fn reset_at_agents(
    client: &Client,
    robots: Vec<(RobotName, StopLatch)>,
    key: Option<&SigningKey>,
) -> CellResetAnswer {
    let mut answer = CellResetAnswer { reset: vec![], refused: vec![] };
    for (robot, latch) in robots {
        let asked = async {
            let params = params(client, &robot, &latch, key).await?;
            client.call::<robot::Reset>(&robot, params).await
        };
        match asked.await {
            Ok(done) => answer.reset.push((robot, done.cleared)),
            Err(error) => answer.refused.push((robot, denial_of(error))),
        }
    }
    answer
}

fn in_words(stop: &LatchedStop) -> String {
    let reason = if stop.reason.is_empty() { "no reason given" } else { &stop.reason };
    format!("stop {:?} by {}: {reason}", stop.level, stop.source)
}

fn confirmed() -> anyhow::Result<bool> {
    note("Is it safe to go on? Nothing moves by a reset, but the next command may. Reset? [y/N]");
    let mut answer = String::new();
    std::io::stdin().lock().read_line(&mut answer)?;
    Ok(is_yes(&answer))
}

fn is_yes(answer: &str) -> bool {
    matches!(answer.trim().to_ascii_lowercase().as_str(), "y" | "yes")
}

fn report(answer: &CellResetAnswer, out: &Output) -> anyhow::Result<Exit> {
    if out.is_json() {
        out.json(answer)?;
    } else {
        for (robot, stops) in &answer.reset {
            let cleared = if stops.len() == 1 { "stop" } else { "stops" };
            out.line(format_args!("{robot}: reset, {} {cleared} cleared", stops.len()))?;
        }
        if answer.reset.is_empty() && answer.refused.is_empty() {
            out.line("no stop is latched")?;
        }
    }
    for (robot, denial) in &answer.refused {
        note(format_args!("{robot}: not reset: {}", words::denial(denial)));
    }
    Ok(if answer.refused.is_empty() { Exit::Success } else { Exit::Failure })
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::{ResetNeeds, StopLevel, StopStage};
    use uuid::Uuid;

    use super::*;

    #[test]
    fn only_a_clear_yes_resets() {
        assert!(is_yes("Y\n") && is_yes("yes\n"));
        assert!(!is_yes("\n") && !is_yes("no\n") && !is_yes("yep, maybe\n"));
    }

    #[test]
    fn what_a_reset_needs_is_told_before_anything_is_asked() {
        let latch = |zone, acknowledged, signed| StopLatch {
            level: StopLevel::L1,
            stops: vec![],
            stage: StopStage::Standstill,
            reset: ResetNeeds { nonce: Uuid::nil(), signed, zone, acknowledged },
        };
        let remote = latch(ResetZone::Remote, true, false);
        assert_eq!(still_needed(&remote, false), None);
        let signed = latch(ResetZone::Remote, true, true);
        assert!(still_needed(&signed, false).is_some_and(|text| text.contains("--key-file")));
        assert_eq!(still_needed(&signed, true), None);
        let at_arm = latch(ResetZone::Manual, false, true);
        assert!(still_needed(&at_arm, true).is_some_and(|text| text.contains("at the arm")));
    }

    #[test]
    fn a_stop_is_told_with_who_and_why() {
        let mut stop = LatchedStop {
            stop_id: Uuid::nil(),
            source: "planner-2".to_owned(),
            level: StopLevel::L1,
            reason: "person in the cell".to_owned(),
        };
        assert_eq!(in_words(&stop), "stop L1 by planner-2: person in the cell");
        stop.reason.clear();
        assert_eq!(in_words(&stop), "stop L1 by planner-2: no reason given");
    }
}
