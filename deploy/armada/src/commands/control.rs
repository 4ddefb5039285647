//! `armada pause`, `resume`, `cancel`, `speed` and `record`: on what goes on already.

use armada_protocol::RobotName;
use armada_protocol::client::Client;
use armada_protocol::messages::{
    CancelParams, Empty, MotionParams, RobotStatus, SpeedRatioAnswer, SpeedRatioParams,
};
use armada_protocol::method::Method;
use armada_protocol::method::robot::{Cancel, Pause, Resume, SaveRecording, SetSpeedRatio};
use clap::Args;
use serde_json::json;
use uuid::Uuid;

use crate::cell_address::CellArgs;
use crate::exit::{Exit, UsageError};

/// Slowest ratio of the contract.
const SLOWEST: f64 = 0.01;

/// Arguments of commands on a motion.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada pause left_arm      come to rest on the path, and wait there
  armada resume left_arm     go on
  armada cancel left_arm     ramp to standstill and end it; what waits behind it comes next
  armada cancel left_arm 0192f0c2-0000-7000-8000-000000000001    one that waits")]
pub(crate) struct MotionArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Which motion; the one in progress if left out
    #[arg(value_name = "MOTION")]
    motion: Option<Uuid>,
    #[command(flatten)]
    cell: CellArgs,
}

/// Arguments of `armada speed`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada speed left_arm 0.25    all motions at a quarter of what they were planned for
  armada speed left_arm 1       as planned

It changes motions in progress too, on their path, and stays until it is changed again.")]
pub(crate) struct SpeedArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Speed of all motions over what they were planned for, 0.01 to 1
    #[arg(value_name = "RATIO", value_parser = parse_ratio)]
    ratio: f64,
    #[command(flatten)]
    cell: CellArgs,
}

/// Arguments of `armada record`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada record left_arm    the last seconds of the control loop, to a file on the agent's machine

An agent writes such a file by itself when a fault latches.")]
pub(crate) struct RecordArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    #[command(flatten)]
    cell: CellArgs,
}

fn parse_ratio(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(ratio) if (SLOWEST..=1.0).contains(&ratio) => Ok(ratio),
        _ => Err(format!("must be a number from {SLOWEST} to 1")),
    }
}

/// Brings a motion to rest on its path.
pub(crate) async fn run_pause(args: MotionArgs) -> anyhow::Result<Exit> {
    run::<Pause>(args, "pausing", |motion_id| MotionParams { motion_id }).await
}

/// Goes on with a paused motion.
pub(crate) async fn run_resume(args: MotionArgs) -> anyhow::Result<Exit> {
    run::<Resume>(args, "going on", |motion_id| MotionParams { motion_id }).await
}

/// Ends a motion with a ramp.
pub(crate) async fn run_cancel(args: MotionArgs) -> anyhow::Result<Exit> {
    run::<Cancel>(args, "cancelled", |motion_id| CancelParams { motion_id }).await
}

async fn run<M: Method<Answer = Empty>>(
    args: MotionArgs,
    done: &str,
    params: impl Fn(Uuid) -> M::Params,
) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let motion = match args.motion {
        Some(motion) => motion,
        None => in_progress(&client, &args.robot).await?,
    };
    client.call::<M>(&args.robot, params(motion)).await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json(&json!({ "motion_id": motion }))?;
    } else {
        out.line(format_args!("{}: {done}, motion {motion}", args.robot))?;
    }
    Ok(Exit::Success)
}

async fn in_progress(client: &Client, robot: &RobotName) -> anyhow::Result<Uuid> {
    let status = client.robot_status(robot).await?;
    Ok(motion_of(&status)
        .ok_or_else(|| UsageError(format!("{robot} has no motion in progress")))?)
}

fn motion_of(status: &RobotStatus) -> Option<Uuid> {
    status.motion.as_ref().filter(|motion| !motion.status.is_terminal()).map(|motion| motion.id)
}

/// Changes the speed of all motions.
pub(crate) async fn run_speed(args: SpeedArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let params = SpeedRatioParams { ratio: args.ratio };
    let answer = client.call::<SetSpeedRatio>(&args.robot, params).await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json(&answer)?;
    } else {
        let SpeedRatioAnswer { speed_ratio } = answer;
        out.line(format_args!("{}: all motions at {speed_ratio} of their speed", args.robot))?;
    }
    Ok(Exit::Success)
}

/// Has the last seconds of a control loop written to a file.
pub(crate) async fn run_record(args: RecordArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let answer = client.call::<SaveRecording>(&args.robot, Empty {}).await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json(&answer)?;
    } else {
        out.line(format_args!("{}: {} ticks in {}", args.robot, answer.ticks, answer.file))?;
    }
    Ok(Exit::Success)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_is_from_a_hundredth_to_one() {
        assert_eq!(parse_ratio("0.01"), Ok(0.01));
        assert_eq!(parse_ratio("1"), Ok(1.0));
        for bad in ["0", "0.009", "1.1", "-1", "NaN", "fast"] {
            assert!(parse_ratio(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn only_a_motion_that_has_not_ended_is_in_progress() {
        let text = include_str!("../../../../protocol/golden/robot_status.json");
        let mut status: RobotStatus = serde_json::from_str(text).expect("the golden sample");
        assert_eq!(motion_of(&status), None, "it failed");
        let motion = status.motion.as_mut().expect("there is one");
        motion.status = armada_protocol::messages::ActionStatus::Paused;
        let id = motion.id;
        assert_eq!(motion_of(&status), Some(id));
    }
}
