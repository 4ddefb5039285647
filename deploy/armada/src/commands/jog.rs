//! `armada move`: joints to a position.

use std::time::Duration;

use armada_model::JointVector;
use armada_protocol::RobotName;
use armada_protocol::client::Client;
use armada_protocol::messages::{
    Accepted, ActionStatus, CommandMode, Empty, JogFreespaceParams, RobotInfo, RobotState,
};
use armada_protocol::method::robot::{Halt, JogFreespace};
use clap::Args;
use uuid::Uuid;

use crate::cell_address::CellArgs;
use crate::exit::Exit;
use crate::joint_goal::{AngleUnit, JointGoal};
use crate::motion::{Follower, MotionView, Mover, Waited, end_line, enter_mode, next_state};
use crate::output::{Output, note};
use crate::signals::Signals;

/// Time for the first state to come.
const STATE_TIMEOUT: Duration = Duration::from_secs(2);
/// Time to come to standstill after Ctrl-C.
const HALT_TIMEOUT: Duration = Duration::from_secs(5);

/// Arguments of `armada move`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada move left_arm --joints 0,-1.57,1.57,0,0,0
  armada move left_arm --joints 0,-90,90,0,0,0 --degrees --speed 0.5
  armada move left_arm --joints elbow=1.2,wrist_1=0
  armada move torso --joints 0.30 --no-wait

All joints start and arrive together. The robot is brought into mode jog first.
Ctrl-C halts the robot. `armada info ROBOT` shows the joints, their order and limits.")]
pub(crate) struct MoveArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Goal: one value per joint in the robot's order, or NAME=VALUE for some; rad, or m for joints
    /// that slide
    #[arg(long, value_name = "RAD|M,…", allow_hyphen_values = true, required = true)]
    joints: JointGoal,
    /// Angles are in degrees; joints that slide stay in m
    #[arg(long)]
    degrees: bool,
    /// Fraction of the joints' speed limits, above 0 and at most 1
    #[arg(long, value_name = "FRACTION", default_value = "0.3", value_parser = parse_fraction)]
    speed: f64,
    /// Wait for the end of the motion; this is the default
    #[arg(long, overrides_with = "no_wait")]
    wait: bool,
    /// Return as soon as the motion is accepted; Ctrl-C does not halt it any more
    #[arg(long)]
    no_wait: bool,
    #[command(flatten)]
    cell: CellArgs,
}

/// A fraction above 0, at most 1.
pub(crate) fn parse_fraction(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1.0 => Ok(value),
        Ok(_) => Err("must be above 0 and at most 1".to_owned()),
        Err(_) => Err("expected a number above 0 and at most 1".to_owned()),
    }
}

/// Moves the robot.
pub(crate) async fn run(args: MoveArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let info = client.robot_info(&args.robot).await?;
    let state = next_state(&client, &args.robot, STATE_TIMEOUT).await?;
    let unit = if args.degrees { AngleUnit::Degrees } else { AngleUnit::Radians };
    let goal = args.joints.resolve(&info.joints, commanded(&state), unit)?;
    // From here on a signal halts the robot instead of only ending this program.
    let mut signals = Signals::new()?;
    let jog = Jog::start(&client, &info, goal, args.speed).await?;
    let out = args.cell.output();
    if args.no_wait {
        return jog.report_accepted(&out);
    }
    jog.finish(&client, args.cell.timeout, &out, &mut signals).await
}

/// Where the joints are told to be; measured where the controller does not say.
pub(crate) fn commanded(state: &RobotState) -> &JointVector {
    if state.joint_position_command_rad.is_empty() {
        &state.joint_position_rad
    } else {
        &state.joint_position_command_rad
    }
}

/// A move of joints that was accepted.
#[derive(Debug)]
pub(crate) struct Jog {
    robot: RobotName,
    accepted: Accepted,
    follower: Follower,
}

impl Jog {
    /// Brings the robot into mode jog and asks for the move, at `speed` times the joints' limits.
    pub(crate) async fn start(
        client: &Client,
        info: &RobotInfo,
        goal: JointVector,
        speed: f64,
    ) -> anyhow::Result<Self> {
        let robot = info.robot.clone();
        let id = Uuid::now_v7();
        let follower = Follower::subscribe(client, Mover::Robot(robot.clone()), id).await?;
        enter_mode(client, &robot, CommandMode::Jog).await?;
        let velocity: Vec<f64> =
            info.joints.iter().map(|joint| joint.limits.velocity * speed).collect();
        let params = JogFreespaceParams {
            motion_id: Some(id),
            joint_position_rad: goal,
            max_velocity_rad_s: Some(JointVector::from_slice(&velocity)?),
            wait: false,
        };
        let accepted = client.call::<JogFreespace>(&robot, params).await?;
        Ok(Self { robot, accepted, follower })
    }

    /// Whose move it is.
    pub(crate) const fn robot(&self) -> &RobotName {
        &self.robot
    }

    /// Waits for its end, with its progress on standard error; signals are for the caller to see.
    pub(crate) async fn end(&self, client: &Client) -> anyhow::Result<MotionView> {
        self.follower.end(client, self.robot.as_str(), None).await
    }

    fn report_accepted(&self, out: &Output) -> anyhow::Result<Exit> {
        if out.is_json() {
            out.json(&self.accepted)?;
        } else {
            let Accepted { motion_id, duration_s, .. } = &self.accepted;
            out.line(format_args!("{}: motion {motion_id}, {duration_s:.1} s", self.robot))?;
        }
        Ok(Exit::Success)
    }

    async fn finish(
        self,
        client: &Client,
        limit: Option<Duration>,
        out: &Output,
        signals: &mut Signals,
    ) -> anyhow::Result<Exit> {
        match self.follower.wait(client, self.robot.as_str(), limit, signals).await? {
            Waited::Ended(view) => report_end(self.robot.as_str(), &view, out),
            Waited::Interrupted(signal) => {
                note(format_args!("{signal}: halting {}", self.robot));
                self.halt(client, out).await?;
                Ok(Exit::Interrupted)
            }
        }
    }

    /// Halts the robot and tells whether its motion has ended.
    async fn halt(&self, client: &Client, out: &Output) -> anyhow::Result<()> {
        client.call::<Halt>(&self.robot, Empty {}).await?;
        match self.follower.wait_for_end(client, HALT_TIMEOUT).await {
            Some(view) => report_end(self.robot.as_str(), &view, out).map(|_| ()),
            None => {
                note(format_args!("{}: no end of the motion in time: go and look", self.robot));
                Ok(())
            }
        }
    }
}

/// Prints how a motion ended.
pub(crate) fn report_end(title: &str, view: &MotionView, out: &Output) -> anyhow::Result<Exit> {
    if out.is_json() {
        out.json(&view.message)?;
    } else {
        out.line(end_line(title, view))?;
    }
    let complete = view.status == ActionStatus::Complete;
    Ok(if complete { Exit::Success } else { Exit::Failure })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_is_a_fraction_of_the_limits() {
        assert_eq!(parse_fraction("0.25"), Ok(0.25));
        assert_eq!(parse_fraction("1"), Ok(1.0));
        for bad in ["0", "-0.5", "1.01", "NaN", "fast"] {
            assert!(parse_fraction(bad).is_err(), "{bad}");
        }
    }
}
