//! `armada halt`, `enable`, `disable`, `reset-errors` and `mode`.

use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{CommandMode, Empty};
use armada_protocol::method::Method;
use armada_protocol::method::robot::SetMode;
use clap::{Args, ValueEnum};
use serde_json::{Map, Value};

use crate::cell_address::{CellAddress, CellArgs};
use crate::exit::{Exit, UsageError};
use crate::output::{Output, note};
use crate::words;

/// Arguments of commands on some robots or all.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada halt                     every robot comes to standstill, and stays ready
  armada enable left_arm          drives on; the answer comes when they are
  armada disable left_arm torso   standstill, then drives off")]
pub(crate) struct RobotsArgs {
    /// Robots; every robot of the cell if left out
    #[arg(value_name = "ROBOT")]
    robots: Vec<RobotName>,
    #[command(flatten)]
    cell: CellArgs,
}

/// Arguments of commands on one robot.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada reset-errors left_arm    clear faults whose cause is gone, here and at the controller")]
pub(crate) struct RobotArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    #[command(flatten)]
    cell: CellArgs,
}

/// Arguments of `armada mode`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada mode left_arm jog           moves of joints to positions
  armada mode left_arm trajectory    timed trajectories

Every mode but halt is entered from halt; `armada move` and `armada run` do it by themselves.")]
pub(crate) struct ModeArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Mode to enter
    #[arg(value_name = "MODE", value_enum)]
    mode: ModeName,
    #[command(flatten)]
    cell: CellArgs,
}

/// A mode that can be asked for.
#[derive(Clone, Copy, Debug, ValueEnum)]
#[value(rename_all = "snake_case")]
enum ModeName {
    /// Standing still; every other mode is entered from here
    Halt,
    /// Moves of joints to positions
    Jog,
    /// Timed trajectories
    Trajectory,
    /// Streamed joint positions
    PositionCommand,
    /// Streamed joint velocities
    VelocityCommand,
    /// Searching the joints' reference positions
    Homing,
}

impl From<ModeName> for CommandMode {
    fn from(name: ModeName) -> Self {
        match name {
            ModeName::Halt => Self::Halt,
            ModeName::Jog => Self::Jog,
            ModeName::Trajectory => Self::Trajectory,
            ModeName::PositionCommand => Self::PositionCommand,
            ModeName::VelocityCommand => Self::VelocityCommand,
            ModeName::Homing => Self::Homing,
        }
    }
}

/// Calls `M` on each robot; goes on with the next one if a robot refuses.
pub(crate) async fn run_on_robots<M: Method<Params = Empty>>(
    args: RobotsArgs,
) -> anyhow::Result<Exit> {
    let (client, address) = args.cell.connect().await?;
    let robots = robots_or_all(&client, &address, args.robots).await?;
    call_each::<M>(&client, &robots, || Empty {}, &args.cell.output()).await
}

/// Calls `M` on one robot.
pub(crate) async fn run_on_robot<M: Method<Params = Empty>>(
    args: RobotArgs,
) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    call_each::<M>(&client, &[args.robot], || Empty {}, &args.cell.output()).await
}

/// Changes the mode of a robot.
pub(crate) async fn run_mode(args: ModeArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let params = || armada_protocol::messages::SetModeParams { mode: args.mode.into() };
    call_each::<SetMode>(&client, &[args.robot], params, &args.cell.output()).await
}

/// The robots that were named, or else every robot that is known or on the bus.
pub(crate) async fn robots_or_all(
    client: &Client,
    address: &CellAddress,
    named: Vec<RobotName>,
) -> anyhow::Result<Vec<RobotName>> {
    if !named.is_empty() {
        return Ok(named);
    }
    let mut robots = address.robots.clone();
    robots.extend(client.robots_alive().await?);
    if let Ok(status) = client.cell_status().await {
        robots.extend(status.robots.into_keys());
    }
    robots.sort();
    robots.dedup();
    if robots.is_empty() {
        return Err(UsageError("no robot is known or on the bus".to_owned()).into());
    }
    Ok(robots)
}

async fn call_each<M: Method>(
    client: &Client,
    robots: &[RobotName],
    params: impl Fn() -> M::Params,
    out: &Output,
) -> anyhow::Result<Exit> {
    let mut answers = Map::new();
    let mut exit = Exit::Success;
    for robot in robots {
        match client.call::<M>(robot, params()).await {
            Ok(answer) => {
                let answer = serde_json::to_value(answer)?;
                if !out.is_json() {
                    out.line(format_args!("{robot}: {}", in_words(M::NAME, &answer)))?;
                }
                answers.insert(robot.to_string(), answer);
            }
            Err(error) => {
                exit = failure(robots.len(), &error);
                note(format_args!("{robot}: {}", words_of(&error)));
                answers.insert(robot.to_string(), error_value(&error));
            }
        }
    }
    if out.is_json() {
        out.json(&Value::Object(answers))?;
    }
    Ok(exit)
}

/// A single robot that does not exist is a wrong argument; one of several is a failure.
const fn failure(robots: usize, error: &ClientError) -> Exit {
    match error {
        ClientError::NoReply { .. } if robots == 1 => Exit::NobodyThere,
        _ => Exit::Failure,
    }
}

/// Why a call failed, for people.
pub(crate) fn words_of(error: &ClientError) -> String {
    match error {
        ClientError::Denied(denial) => words::denial(denial),
        other => other.to_string(),
    }
}

/// Why a call failed, for `--json`.
pub(crate) fn error_value(error: &ClientError) -> Value {
    match error {
        ClientError::Denied(denial) => serde_json::json!({ "denied": denial }),
        other => serde_json::json!({ "error": other.to_string() }),
    }
}

fn in_words(method: &str, answer: &Value) -> String {
    match answer.get("command_mode").and_then(Value::as_str) {
        Some(mode) => format!("{}, mode {mode}", method.replace('_', " ")),
        None => "halting".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_name_is_the_one_on_the_wire() {
        for name in ModeName::value_variants() {
            let typed = name.to_possible_value().expect("has a name");
            assert_eq!(typed.get_name(), words::mode((*name).into()));
            let wire = serde_json::to_value(CommandMode::from(*name)).expect("a name");
            assert_eq!(wire, typed.get_name());
        }
    }

    #[test]
    fn answers_are_told_in_words() {
        let answer = serde_json::json!({ "command_mode": "halt", "epoch": 3 });
        assert_eq!(in_words("reset_errors", &answer), "reset errors, mode halt");
        assert_eq!(in_words("halt", &serde_json::json!({ "epoch": 3 })), "halting");
    }
}
