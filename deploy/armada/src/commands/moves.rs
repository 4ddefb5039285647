//! `armada move`: joints to a position, or a tool to a pose.

use std::time::Duration;

use armada_model::{JointVector, Pose};
use armada_protocol::RobotName;
use armada_protocol::client::Client;
use armada_protocol::messages::{
    Accepted, CommandMode, JogFreespaceParams, MoveExecutor, MoveHomeParams, MoveOptions,
    MovePoseParams, Queue, RobotInfo, RobotState,
};
use armada_protocol::method::Method;
use armada_protocol::method::robot::{JogFreespace, MoveHome, MoveLinear, MovePose};
use clap::Args;
use uuid::Uuid;

use crate::cell_address::CellArgs;
use crate::choice::one_of;
use crate::exit::Exit;
use crate::joint_goal::{AngleUnit, JointGoal};
use crate::motion::{enter_mode, next_state};
use crate::pose_arg;
use crate::signals::Signals;
use crate::started::{OnSignal, Started, WaitArgs};

/// Time for the first state to come.
const STATE_TIMEOUT: Duration = Duration::from_secs(2);

const EXAMPLES: &str = "Examples:
  armada move left_arm --joints 0,-1.57,1.57,0,0,0
  armada move left_arm --joints 0,-90,90,0,0,0 --degrees --speed 0.5
  armada move left_arm --joints elbow=1.2,wrist_1=0
  armada move torso --joints 0.30 --no-wait
  armada move left_arm --pose 0.4,0.1,0.5,180,0,90
  armada move left_arm --linear 0.4,0.1,0.3,180,0,90 --speed 0.1
  armada move left_arm --home

With --joints all joints start and arrive together, in mode jog; Ctrl-C halts the robot.
Otherwise the robot's side plans the way, in mode trajectory; Ctrl-C cancels with a ramp.
`armada info ROBOT` shows the joints, their order and limits, `armada tcp ROBOT` the pose.

";

/// Arguments of `armada move`.
#[derive(Args, Debug)]
#[command(after_help = format!("{EXAMPLES}{}", pose_arg::HELP))]
pub(crate) struct MoveArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    #[command(flatten)]
    goal: GoalArgs,
    /// Angles of --joints are in degrees; joints that slide stay in m
    #[arg(long, conflicts_with_all = ["pose", "linear", "home"])]
    degrees: bool,
    /// Fraction of the joints' speed limits, above 0 and at most 1
    #[arg(long, value_name = "FRACTION", default_value = "0.3", value_parser = parse_fraction)]
    speed: f64,
    /// Chain whose tool moves; not needed if the robot has one only
    #[arg(long, value_name = "CHAIN", conflicts_with_all = ["joints", "home"])]
    chain: Option<String>,
    /// Who plans and executes it; the controller if it can, unless told otherwise
    #[arg(long, value_name = "WHO", conflicts_with = "joints",
        value_parser = one_of::<MoveExecutor>(&["auto", "controller", "agent"]))]
    executor: Option<MoveExecutor>,
    /// Wait for the end of the motion in progress instead of being refused
    #[arg(long, conflicts_with = "joints")]
    append: bool,
    #[command(flatten)]
    wait: WaitArgs,
    #[command(flatten)]
    cell: CellArgs,
}

/// Where to go: exactly one of them.
#[derive(Args, Debug)]
#[group(required = true, multiple = false)]
struct GoalArgs {
    /// One value per joint in the robot's order, or NAME=VALUE for some; rad, or m for joints that
    /// slide
    #[arg(long, value_name = "RAD|M,…", allow_hyphen_values = true)]
    joints: Option<JointGoal>,
    /// Pose of the tool in the chain's base link; the joints move on the straight way
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<String>,
    /// The same, and the tool moves on a straight line
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    linear: Option<String>,
    /// Home positions of the robot file
    #[arg(long)]
    home: bool,
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
    let target = args.target()?;
    let (client, _) = args.cell.connect().await?;
    // From here on a signal ends the motion instead of only ending this program.
    let mut signals = Signals::new()?;
    let started = match target {
        Target::Joints(joints) => {
            let info = client.robot_info(&args.robot).await?;
            let state = next_state(&client, &args.robot, STATE_TIMEOUT).await?;
            let unit = if args.degrees { AngleUnit::Degrees } else { AngleUnit::Radians };
            let goal = joints.resolve(&info.joints, commanded(&state), unit)?;
            start_jog(&client, &info, goal, args.speed).await?
        }
        Target::Pose(pose) => args.to_pose::<MovePose>(&client, pose).await?,
        Target::Linear(pose) => args.to_pose::<MoveLinear>(&client, pose).await?,
        Target::Home => {
            let id = Uuid::now_v7();
            let params = MoveHomeParams { motion_id: Some(id), options: args.options() };
            args.start::<MoveHome>(&client, id, params).await?
        }
    };
    started.conclude(&client, args.wait, &args.cell, &mut signals).await
}

/// Where a move goes.
#[derive(Debug, PartialEq)]
enum Target {
    Joints(JointGoal),
    Pose(Pose),
    Linear(Pose),
    Home,
}

impl MoveArgs {
    fn target(&self) -> anyhow::Result<Target> {
        let GoalArgs { joints, pose, linear, home: _ } = &self.goal;
        Ok(match (joints, pose, linear) {
            (Some(joints), _, _) => Target::Joints(joints.clone()),
            (None, Some(pose), _) => Target::Pose(pose_arg::of_argument("--pose", pose)?),
            (None, None, Some(pose)) => Target::Linear(pose_arg::of_argument("--linear", pose)?),
            (None, None, None) => Target::Home,
        })
    }

    fn options(&self) -> MoveOptions {
        MoveOptions {
            speed: self.speed,
            executor: self.executor.unwrap_or_default(),
            queue: if self.append { Queue::Append } else { Queue::Refuse },
            ..MoveOptions::default()
        }
    }

    async fn to_pose<M: Method<Params = MovePoseParams, Answer = Accepted>>(
        &self,
        client: &Client,
        pose: Pose,
    ) -> anyhow::Result<Started> {
        let id = Uuid::now_v7();
        let chain = self.chain.clone();
        let params = MovePoseParams { motion_id: Some(id), chain, pose, options: self.options() };
        self.start::<M>(client, id, params).await
    }

    async fn start<M: Method<Answer = Accepted>>(
        &self,
        client: &Client,
        id: Uuid,
        params: M::Params,
    ) -> anyhow::Result<Started> {
        enter_mode(client, &self.robot, CommandMode::Trajectory).await?;
        Ok(Started::ask::<M>(client, &self.robot, id, params, OnSignal::Cancel).await?)
    }
}

/// Where the joints are told to be; measured where the controller does not say.
pub(crate) fn commanded(state: &RobotState) -> &JointVector {
    if state.joint_position_command_rad.is_empty() {
        &state.joint_position_rad
    } else {
        &state.joint_position_command_rad
    }
}

/// Brings the robot into mode jog and asks for a move of all joints, at `speed` times their limits.
pub(crate) async fn start_jog(
    client: &Client,
    info: &RobotInfo,
    goal: JointVector,
    speed: f64,
) -> anyhow::Result<Started> {
    let id = Uuid::now_v7();
    enter_mode(client, &info.robot, CommandMode::Jog).await?;
    let velocity: Vec<f64> =
        info.joints.iter().map(|joint| joint.limits.velocity * speed).collect();
    let params = JogFreespaceParams {
        motion_id: Some(id),
        joint_position_rad: goal,
        max_velocity_rad_s: Some(JointVector::from_slice(&velocity)?),
        wait: false,
    };
    Ok(Started::ask::<JogFreespace>(client, &info.robot, id, params, OnSignal::Halt).await?)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Typed {
        #[command(flatten)]
        args: MoveArgs,
    }

    fn typed(text: &str) -> Result<MoveArgs, String> {
        Typed::try_parse_from(["move"].into_iter().chain(text.split(' ')))
            .map(|typed| typed.args)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn a_speed_is_a_fraction_of_the_limits() {
        assert_eq!(parse_fraction("0.25"), Ok(0.25));
        assert_eq!(parse_fraction("1"), Ok(1.0));
        for bad in ["0", "-0.5", "1.01", "NaN", "fast"] {
            assert!(parse_fraction(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_move_has_exactly_one_goal() {
        let target = |text: &str| typed(text).expect(text).target().expect(text);
        assert_eq!(target("torso --joints 1"), Target::Joints(JointGoal::All(vec![1.0])));
        assert_eq!(target("torso --home"), Target::Home);
        let pose = "0,0,1,0,0,0";
        assert!(matches!(target(&format!("torso --pose {pose}")), Target::Pose(_)));
        assert!(matches!(target(&format!("torso --linear {pose}")), Target::Linear(_)));
        for bad in ["torso", "torso --home --joints 1"] {
            assert!(typed(bad).expect_err(bad).contains("--joints"), "{bad}");
        }
    }

    #[test]
    fn what_a_jog_does_not_know_is_refused_with_joints() {
        for bad in ["--chain arm", "--executor agent", "--append"] {
            let error = typed(&format!("torso --joints 1 {bad}")).expect_err(bad);
            assert!(error.contains("cannot be used with"), "{error}");
        }
        assert!(typed("torso --home --degrees").is_err());
    }

    #[test]
    fn options_are_those_that_were_typed() {
        let args = typed("torso --home --speed 0.5 --executor controller --append").expect("good");
        let expected = MoveOptions {
            speed: 0.5,
            executor: MoveExecutor::Controller,
            queue: Queue::Append,
            ..MoveOptions::default()
        };
        assert_eq!(args.options(), expected);
    }
}
