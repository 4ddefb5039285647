//! `armada why`: why a robot does not move, or for whom it does.

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{RobotStatus, Why, WhyCode};
use clap::Args;
use serde_json::{Map, Value, json};

use crate::cell_address::CellArgs;
use crate::commands::modes::{error_value, robots_or_all, words_of};
use crate::exit::Exit;
use crate::words;

/// Arguments of `armada why`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada why left_arm        why it does not move, since when, and what to do
  armada why                 the same for every robot of the cell
  armada why left_arm --json | jq -r '.left_arm.why[0].code'

Exit code 0: nothing keeps them from following a command of anybody's. 1: something does.")]
pub(crate) struct WhyArgs {
    /// Robots; every robot of the cell if left out
    #[arg(value_name = "ROBOT")]
    robots: Vec<RobotName>,
    #[command(flatten)]
    cell: CellArgs,
}

/// Tells why robots are as they are.
pub(crate) async fn run(args: WhyArgs) -> anyhow::Result<Exit> {
    let (client, address) = args.cell.connect().await?;
    let robots = robots_or_all(&client, &address, args.robots).await?;
    let out = args.cell.output();
    let mut exit = Exit::Success;
    let mut answers = Map::new();
    for robot in robots {
        let status = client.robot_status(&robot).await;
        if !status.as_ref().is_ok_and(|status| is_free_to_move(&status.why)) {
            exit = Exit::Failure;
        }
        if !out.is_json() {
            out.line(match &status {
                Ok(status) => told(status),
                Err(error) => format!("{robot} does not move: {}", words_of(error)),
            })?;
        }
        answers.insert(robot.to_string(), status.map_or_else(|e| error_value(&e), |s| value(&s)));
    }
    if out.is_json() {
        out.json(&Value::Object(answers))?;
    }
    Ok(exit)
}

fn value(status: &RobotStatus) -> Value {
    json!({ "authority": status.authority, "why": status.why, "next": status.next })
}

/// Whether nothing keeps the robot from following a command of anybody's.
fn is_free_to_move(why: &[Why]) -> bool {
    !why.iter().any(|why| keeps_from_moving(why.code))
}

const fn keeps_from_moving(code: WhyCode) -> bool {
    match code {
        WhyCode::NotConnected
        | WhyCode::Stopped
        | WhyCode::StopSource
        | WhyCode::Faulted
        | WhyCode::Local
        | WhyCode::DrivesOff
        | WhyCode::DrivenBy
        | WhyCode::Waiting
        | WhyCode::DegradedLink => true,
        WhyCode::LeaseStale | WhyCode::Moving | WhyCode::Halted | WhyCode::Ready => false,
    }
}

/// The reasons of one robot, its sources of stops, and what to do.
fn told(status: &RobotStatus) -> String {
    let robot = &status.robot;
    let mut lines = Vec::new();
    for (index, why) in status.why.iter().enumerate() {
        let begin = if index == 0 { headline(robot, &status.why) } else { "  also:".to_owned() };
        let since = since(status.stamp_ns, why.since_ns);
        lines.push(format!("{begin} {}{since}", why.message));
    }
    lines.extend(status.stop_sources.iter().map(|s| format!("  {}", words::stop_source(s))));
    lines.extend(status.next.iter().map(|next| format!("  next: {next}")));
    lines.join("\n")
}

fn headline(robot: &RobotName, why: &[Why]) -> String {
    if why.iter().any(|why| is_in_motion(why.code)) {
        format!("{robot} moves:")
    } else if is_free_to_move(why) {
        format!("{robot} is ready:")
    } else {
        format!("{robot} does not move:")
    }
}

const fn is_in_motion(code: WhyCode) -> bool {
    matches!(code, WhyCode::Moving)
}

/// How long it has been so, by the agent's own clock: `, since 12 s`.
fn since(now: MonoTime, then: Option<MonoTime>) -> String {
    let Some(then) = then else { return String::new() };
    let seconds = now.saturating_since(then).as_secs_f64();
    let decimals = usize::from(seconds < 10.0);
    format!(", since {seconds:.decimals$} s")
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::AuthorityState;

    use super::*;

    fn status() -> RobotStatus {
        let text = include_str!("../../../../protocol/golden/robot_status.json");
        serde_json::from_str(text).expect("the golden sample")
    }

    fn why(code: WhyCode, message: &str, since_ns: Option<u64>) -> Why {
        let since_ns = since_ns.map(MonoTime::from_nanos);
        Why { code, message: message.to_owned(), who: None, since_ns }
    }

    #[test]
    fn a_robot_that_is_stopped_tells_by_whom_since_when_and_what_a_reset_needs() {
        let status = RobotStatus {
            stamp_ns: MonoTime::from_nanos(22_000_000_000),
            why: vec![
                why(WhyCode::Stopped, "stop L1 by door_1: door opened", Some(10_000_000_000)),
                why(WhyCode::Faulted, "elbow is behind", Some(19_500_000_000)),
            ],
            next: vec!["release door_1".to_owned()],
            ..status()
        };
        let expected = "\
left_arm does not move: stop L1 by door_1: door opened, since 12 s
  also: elbow is behind, since 2.5 s
  door_1 PRESSED or silent, heard 42 ms ago
  next: release door_1";
        assert_eq!(told(&status), expected);
    }

    #[test]
    fn a_robot_that_somebody_drives_moves_or_stands_for_its_holder() {
        let driven =
            why(WhyCode::DrivenBy, "driven by planner-2 (program) for another 3.2 s", None);
        let moving = why(WhyCode::Moving, "it moves for planner-2", None);
        let status = |why| RobotStatus {
            authority: AuthorityState::Held,
            stop: None,
            stop_sources: vec![],
            next: vec![],
            why,
            ..status()
        };
        assert_eq!(
            told(&status(vec![driven.clone()])),
            "left_arm does not move: driven by planner-2 (program) for another 3.2 s"
        );
        assert_eq!(
            told(&status(vec![driven, moving])),
            "left_arm moves: driven by planner-2 (program) for another 3.2 s\n  \
             also: it moves for planner-2"
        );
    }

    #[test]
    fn only_what_anybody_may_command_is_free_to_move() {
        use WhyCode::{DrivenBy, Halted, LeaseStale, Local, Ready, Stopped};
        let free = |code| is_free_to_move(&[why(code, "", None)]);
        assert!(free(Ready) && free(Halted) && free(LeaseStale));
        assert!(!free(Stopped) && !free(Local) && !free(DrivenBy));
        assert!(!is_free_to_move(&[why(Halted, "", None), why(Stopped, "", None)]));
    }
}
