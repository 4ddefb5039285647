//! `armada stop`: the shortest path to standstill.

use std::collections::BTreeMap;
use std::time::Duration;

use armada_protocol::client::{Client, ClientError, StopOptions, Subscription};
use armada_protocol::messages::{
    StopAck, StopLevel, StopReport, StopRequest, StopScope, StopVerdict,
};
use armada_protocol::{RobotName, keys};
use clap::{Args, ValueEnum};
use serde::Serialize;
use uuid::Uuid;

use crate::cell_address::{CellAddress, CellArgs, client_name};
use crate::exit::Exit;
use crate::output::Output;
use crate::words;

/// Time for every robot to be measured to stand still.
const TIMEOUT: Duration = Duration::from_secs(5);

/// What `armada stop --help` begins with.
pub(crate) const LONG_ABOUT: &str = "Stop robots and keep them stopped until a reset.

The stop goes to the gateway and to every agent that is known at once, so it works while the gateway \
is dead. It needs no lease and is never refused. It is complete only if every robot in scope was \
measured to stand still.

THIS IS AN OPERATIONAL STOP OVER A NETWORK, NEVER A RATED SAFETY FUNCTION. It does not replace the \
emergency stop of a robot: where people can be hurt, press that.";

/// Arguments of `armada stop`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada stop                                all robots, controlled, drives stay on
  armada stop left_arm --level L1            one robot, controlled, then drives off
  armada stop --level L0 --reason 'smoke'    drives off at once, brakes do the rest
  armada reset                               afterwards, when it is safe

Exit code 0: every robot stands still. 5: not every one is known to: go and look.")]
pub(crate) struct StopArgs {
    /// Robots to stop; every robot of the cell if left out
    #[arg(value_name = "ROBOT")]
    robots: Vec<RobotName>,
    /// How hard
    #[arg(long, value_enum, default_value = "L2", value_name = "LEVEL")]
    level: Level,
    /// Why, for people and the audit trail
    #[arg(long, value_name = "TEXT", default_value = "armada stop")]
    reason: String,
    #[command(flatten)]
    cell: CellArgs,
}

/// How hard to stop.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Level {
    /// Controlled, drives stay on
    #[value(name = "L2", alias = "l2")]
    L2,
    /// Controlled, then drives off
    #[value(name = "L1", alias = "l1")]
    L1,
    /// Drives off at once
    #[value(name = "L0", alias = "l0")]
    L0,
}

impl From<Level> for StopLevel {
    fn from(level: Level) -> Self {
        match level {
            Level::L2 => Self::L2,
            Level::L1 => Self::L1,
            Level::L0 => Self::L0,
        }
    }
}

/// The verdict and every step to it.
#[derive(Debug, Serialize)]
pub(crate) struct Outcome {
    #[serde(flatten)]
    report: StopReport,
    /// Every stage of every robot, in the order of the robots and stages.
    ladder: Vec<StopAck>,
    /// Whether it is known which robots the scope has; else those count that were found.
    scope_is_known: bool,
}

/// Stops, and prints how far each robot has come.
pub(crate) async fn run(args: StopArgs) -> anyhow::Result<Exit> {
    let address = args.cell.address()?;
    let client = address.connect_for_stop().await?;
    let request = request(args.robots, args.level.into(), args.reason);
    let limit = args.cell.timeout_or(TIMEOUT);
    let outcome = stop(&client, &address, request, limit).await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json(&outcome)?;
    } else {
        print(&outcome, &out)?;
    }
    Ok(outcome.exit())
}

/// A stop of these robots, or of the cell if there are none.
pub(crate) fn request(robots: Vec<RobotName>, level: StopLevel, reason: String) -> StopRequest {
    let scope = if robots.is_empty() { StopScope::Cell } else { StopScope::Robots(robots) };
    StopRequest { stop_id: Uuid::now_v7(), source: client_name(), level, scope, reason, seq: 0 }
}

/// Stops by way of everything that is connected.
pub(crate) async fn stop(
    client: &Client,
    address: &CellAddress,
    request: StopRequest,
    limit: Duration,
) -> Result<Outcome, ClientError> {
    let acks = client.subscribe::<StopAck>(&keys::ROBOT_STOP_ACK.any(), 256).await?;
    let stop_id = request.stop_id;
    let is_told = request.scope != StopScope::Cell || !address.robots.is_empty();
    let options = StopOptions { expected: address.robots.clone(), timeout: limit };
    let report = client.stop(request, options).await?;
    let ladder = ladder(stop_id, &acks, &report);
    let scope_is_known = is_told || is_whole_cell(client, &report).await;
    Ok(Outcome { report, ladder, scope_is_known })
}

/// Whether the gateway tells, after the stop, that no robot is configured that was not looked at.
async fn is_whole_cell(client: &Client, report: &StopReport) -> bool {
    let Ok(info) = client.cell_info().await else { return false };
    info.robots.iter().all(|row| {
        let has_answered = report.acks.iter().any(|ack| ack.robot == row.robot);
        has_answered || report.missing.contains(&row.robot)
    })
}

fn ladder(stop_id: Uuid, acks: &Subscription<StopAck>, report: &StopReport) -> Vec<StopAck> {
    let mut steps: BTreeMap<_, StopAck> = BTreeMap::new();
    let mut take = |ack: StopAck| {
        steps.entry((ack.robot.clone(), ack.stage)).or_insert(ack);
    };
    loop {
        match acks.try_next() {
            Ok(Some((_, ack))) if ack.stop_id == stop_id => take(ack),
            Ok(Some(_)) => {}
            // One that cannot be read proves nothing; the next one may.
            Err(ClientError::Codec(_)) => {}
            Ok(None) | Err(_) => break,
        }
    }
    report.acks.iter().cloned().for_each(take);
    steps.into_values().collect()
}

impl Outcome {
    /// Exit code of the verdict.
    pub(crate) const fn exit(&self) -> Exit {
        match self.report.verdict {
            StopVerdict::Complete => Exit::Success,
            StopVerdict::Incomplete => Exit::StopIncomplete,
        }
    }

    /// One line per robot, and the verdict.
    pub(crate) fn lines(&self) -> Vec<String> {
        let mut robots: Vec<&RobotName> = self.ladder.iter().map(|ack| &ack.robot).collect();
        robots.extend(&self.report.missing);
        robots.sort();
        robots.dedup();
        let mut lines: Vec<String> = robots.iter().map(|robot| self.line_of(robot)).collect();
        lines.push(self.verdict());
        lines
    }

    fn line_of(&self, robot: &RobotName) -> String {
        let step =
            |ack: &StopAck| format!("{} {:.1} ms", words::stage(ack.stage), ack.since_received_ms);
        let steps: Vec<String> =
            self.ladder.iter().filter(|ack| &ack.robot == robot).map(step).collect();
        if steps.is_empty() {
            format!("{robot}: NO ANSWER")
        } else if self.report.missing.contains(robot) {
            format!("{robot}: {} -> NOT KNOWN TO STAND STILL", steps.join(" -> "))
        } else {
            format!("{robot}: {}", steps.join(" -> "))
        }
    }

    fn verdict(&self) -> String {
        match self.report.verdict {
            StopVerdict::Complete if !self.scope_is_known => {
                "complete for the robots that were found: they stand still, by measurement; which \
                 others the cell has is not known without its gateway: give --cell FILE"
                    .to_owned()
            }
            StopVerdict::Complete => {
                "complete: every robot in scope stands still, by measurement; `armada reset` when \
                 it is safe to go on"
                    .to_owned()
            }
            StopVerdict::Incomplete if self.report.missing.is_empty() => {
                "INCOMPLETE: no robot is known, none has answered: go and look".to_owned()
            }
            StopVerdict::Incomplete => {
                let missing: Vec<_> = self.report.missing.iter().map(RobotName::as_str).collect();
                format!(
                    "INCOMPLETE: {} not known to stand still: go and look, use the emergency stop",
                    missing.join(", ")
                )
            }
        }
    }
}

fn print(outcome: &Outcome, out: &Output) -> anyhow::Result<()> {
    outcome.lines().iter().try_for_each(|line| out.line(line))
}

#[cfg(test)]
mod tests {
    use armada_model::MonoTime;
    use armada_protocol::messages::StopStage;

    use super::*;

    fn ack(robot: &str, stage: StopStage, since_received_ms: f64) -> StopAck {
        StopAck {
            stop_id: Uuid::nil(),
            robot: robot.parse().expect("a name"),
            boot_id: Uuid::nil(),
            stage,
            stamp_ns: MonoTime::ZERO,
            since_received_ms,
        }
    }

    fn outcome(verdict: StopVerdict, missing: &[&str]) -> Outcome {
        let ladder = vec![
            ack("left_arm", StopStage::Received, 0.0),
            ack("left_arm", StopStage::Commanded, 1.25),
            ack("left_arm", StopStage::Standstill, 240.0),
        ];
        let missing = missing.iter().map(|name| name.parse().expect("a name")).collect();
        let report = StopReport { stop_id: Uuid::nil(), verdict, acks: vec![], missing };
        Outcome { report, ladder, scope_is_known: true }
    }

    #[test]
    fn the_ladder_is_told_with_its_times() {
        let lines = outcome(StopVerdict::Complete, &[]).lines();
        assert_eq!(
            lines[0],
            "left_arm: received 0.0 ms -> commanded 1.2 ms -> standstill 240.0 ms"
        );
        assert!(lines[1].starts_with("complete:"), "{lines:?}");
    }

    #[test]
    fn who_does_not_know_the_cell_does_not_speak_for_all_of_it() {
        let unknown = Outcome { scope_is_known: false, ..outcome(StopVerdict::Complete, &[]) };
        let verdict = unknown.verdict();
        assert!(verdict.starts_with("complete for the robots that were found"), "{verdict}");
        assert!(!verdict.contains("every robot"), "{verdict}");
    }

    #[test]
    fn a_silent_robot_is_named_and_the_verdict_says_go_and_look() {
        let outcome = outcome(StopVerdict::Incomplete, &["torso"]);
        assert_eq!(outcome.lines()[1], "torso: NO ANSWER");
        assert!(outcome.lines()[2].contains("torso not known to stand still: go and look"));
        assert_eq!(outcome.exit(), Exit::StopIncomplete);
    }

    #[test]
    fn a_stop_that_nobody_answers_is_not_complete() {
        let report = StopReport {
            stop_id: Uuid::nil(),
            verdict: StopVerdict::Incomplete,
            acks: vec![],
            missing: vec![],
        };
        let lines = Outcome { report, ladder: vec![], scope_is_known: true }.lines();
        assert_eq!(lines, ["INCOMPLETE: no robot is known, none has answered: go and look"]);
    }

    #[test]
    fn without_names_the_whole_cell_is_in_scope() {
        let all = request(vec![], StopLevel::L1, "x".to_owned());
        assert_eq!(all.scope, StopScope::Cell);
        let one = request(vec!["torso".parse().expect("a name")], StopLevel::L1, "x".to_owned());
        assert!(matches!(one.scope, StopScope::Robots(robots) if robots.len() == 1));
    }
}
