//! `armada pause`, `resume`, `cancel`, `speed` and `record`: on what goes on already.

use armada_protocol::RobotName;
use armada_protocol::client::Client;
use armada_protocol::messages::{
    CancelParams, CellMotionStatus, CellSpeedRatioParams, Empty, MotionParams, RobotStatus,
    SpeedRatioAnswer, SpeedRatioParams,
};
use armada_protocol::method::{Method, cell, robot};
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
  armada cancel left_arm 0192f0c2-0000-7000-8000-000000000001    one that waits
  armada pause               the motion of several robots that is in progress, all at one phase
  armada resume 0192f0c2-0000-7000-8000-000000000001    a motion of several robots by its identity")]
pub(crate) struct MotionArgs {
    /// Which robot, or which motion of several robots; that in progress of several if left out
    #[arg(value_name = "ROBOT|MOTION", value_parser = parse_target)]
    target: Option<Target>,
    /// Which motion of the robot; the one in progress if left out
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
  armada speed 0192f0c2-0000-7000-8000-000000000001 0.5    one motion of several robots

It changes motions in progress too, on their path, and stays until it is changed again.")]
pub(crate) struct SpeedArgs {
    /// Which robot, or which motion of several robots
    #[arg(value_name = "ROBOT|MOTION", value_parser = parse_target)]
    target: Target,
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

/// What is to be paused, or to go faster.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Target {
    /// A motion of this robot.
    Robot(RobotName),
    /// This motion of several robots.
    Motion(Uuid),
}

fn parse_target(text: &str) -> Result<Target, String> {
    // No robot's name has a hyphen.
    if text.contains('-') {
        let id = text.parse().map_err(|error| format!("neither robot nor motion: {error}"));
        return id.map(Target::Motion);
    }
    text.parse().map(Target::Robot).map_err(|error| format!("{error}"))
}

fn parse_ratio(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(ratio) if (SLOWEST..=1.0).contains(&ratio) => Ok(ratio),
        _ => Err(format!("must be a number from {SLOWEST} to 1")),
    }
}

/// Brings a motion to rest on its path.
pub(crate) async fn run_pause(args: MotionArgs) -> anyhow::Result<Exit> {
    run::<robot::Pause, cell::Pause>(args, "pausing", |motion_id| MotionParams { motion_id }).await
}

/// Goes on with a paused motion.
pub(crate) async fn run_resume(args: MotionArgs) -> anyhow::Result<Exit> {
    run::<robot::Resume, cell::Resume>(args, "going on", |motion_id| MotionParams { motion_id })
        .await
}

/// Ends a motion with a ramp.
pub(crate) async fn run_cancel(args: MotionArgs) -> anyhow::Result<Exit> {
    run::<robot::Cancel, cell::Cancel>(args, "cancelled", |motion_id| CancelParams { motion_id })
        .await
}

async fn run<R, C>(
    args: MotionArgs,
    done: &str,
    params: impl Fn(Uuid) -> R::Params,
) -> anyhow::Result<Exit>
where
    R: Method<Answer = Empty>,
    C: Method<Params = R::Params, Answer = Empty>,
{
    let MotionArgs { target, motion, cell } = args;
    let (client, _) = cell.connect().await?;
    let (whose, motion) = match target {
        Some(Target::Robot(robot)) => {
            let motion = match motion {
                Some(motion) => motion,
                None => in_progress(&client, &robot).await?,
            };
            client.call::<R>(&robot, params(motion)).await?;
            (robot.to_string(), motion)
        }
        Some(Target::Motion(_)) if motion.is_some() => {
            let why = "one motion at a time: of several robots, or of a robot that is named";
            return Err(UsageError(why.to_owned()).into());
        }
        several => {
            let motion = match several {
                Some(Target::Motion(motion)) => motion,
                _ => only_one(&client.cell_status().await?.motions)?,
            };
            client.call_cell::<C>(params(motion)).await?;
            ("cell".to_owned(), motion)
        }
    };
    let out = cell.output();
    if out.is_json() {
        out.json(&json!({ "motion_id": motion }))?;
    } else {
        out.line(format_args!("{whose}: {done}, motion {motion}"))?;
    }
    Ok(Exit::Success)
}

/// The motion of several robots that is in progress, if there is no other.
fn only_one(motions: &[CellMotionStatus]) -> Result<Uuid, UsageError> {
    let going: Vec<Uuid> =
        motions.iter().filter(|motion| !motion.status.is_terminal()).map(|m| m.id).collect();
    match going.as_slice() {
        [only] => Ok(*only),
        [] => Err(UsageError("no motion of several robots is in progress".to_owned())),
        several => {
            let named = several.iter().map(Uuid::to_string).collect::<Vec<_>>().join(", ");
            Err(UsageError(format!("several are in progress, choose one: {named}")))
        }
    }
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
    let SpeedArgs { target, ratio, cell } = args;
    let (whose, answer) = match target {
        Target::Robot(robot) => {
            let params = SpeedRatioParams { ratio };
            let answer = client.call::<robot::SetSpeedRatio>(&robot, params).await?;
            (format!("{robot}: all motions"), answer)
        }
        Target::Motion(motion_id) => {
            let params = CellSpeedRatioParams { motion_id, ratio };
            let answer = client.call_cell::<cell::SetSpeedRatio>(params).await?;
            (format!("cell: motion {motion_id}"), answer)
        }
    };
    let out = cell.output();
    if out.is_json() {
        out.json(&answer)?;
    } else {
        let SpeedRatioAnswer { speed_ratio } = answer;
        out.line(format_args!("{whose} at {speed_ratio} of their speed"))?;
    }
    Ok(Exit::Success)
}

/// Has the last seconds of a control loop written to a file.
pub(crate) async fn run_record(args: RecordArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let answer = client.call::<robot::SaveRecording>(&args.robot, Empty {}).await?;
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
    fn a_robot_and_a_motion_are_told_apart() {
        let id = "a192f0c2-0000-7000-8000-000000000001";
        assert_eq!(parse_target(id), Ok(Target::Motion(id.parse().expect("an id"))));
        assert_eq!(parse_target("torso"), Ok(Target::Robot("torso".parse().expect("a name"))));
        for bad in ["left-arm", "Torso", ""] {
            assert!(parse_target(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn without_a_name_the_only_motion_of_several_robots_is_meant() {
        use armada_protocol::messages::ActionStatus;
        let text = include_str!("../../../../protocol/golden/cell_motion_status.json");
        let going: CellMotionStatus = serde_json::from_str(text).expect("the golden sample");
        let ended =
            CellMotionStatus { id: Uuid::nil(), status: ActionStatus::Complete, ..going.clone() };
        assert_eq!(only_one(&[ended.clone(), going.clone()]).ok(), Some(going.id));
        assert!(only_one(&[ended]).is_err_and(|error| error.0.contains("no motion")));
        let other = CellMotionStatus { id: Uuid::max(), ..going.clone() };
        let error = only_one(&[going, other]).expect_err("which?");
        assert!(error.0.contains(&Uuid::max().to_string()), "{error}");
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
