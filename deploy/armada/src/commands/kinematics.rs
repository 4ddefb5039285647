//! `armada tcp` and `armada ik`: kinematics of a running robot, with the tool that it carries.

use std::time::Duration;

use armada_model::JointVector;
use armada_protocol::RobotName;
use armada_protocol::messages::{ForwardKinematicsParams, InverseKinematicsParams, JointInfo};
use armada_protocol::method::robot::{ForwardKinematics, InverseKinematics};
use clap::Args;

use super::moves::commanded;
use crate::cell_address::CellArgs;
use crate::exit::Exit;
use crate::joint_goal::{AngleUnit, JointGoal};
use crate::motion::next_state;
use crate::pose_arg;
use crate::words;

/// Time for the first state to come.
const STATE_TIMEOUT: Duration = Duration::from_secs(2);

/// Arguments of `armada tcp`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada tcp left_arm                        where its tool is now
  armada tcp left_arm --joints elbow=1.2     where it would be
  armada tcp left_arm --json | jq .tcp

Poses are in the chain's base link. `armada model fk` answers for a file, without a robot.")]
pub(crate) struct TcpArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Chain; not needed if the robot has one only
    #[arg(long, value_name = "CHAIN")]
    chain: Option<String>,
    /// Positions instead of the measured ones: one value per joint, or NAME=VALUE for some; rad, or
    /// m for joints that slide
    #[arg(long, value_name = "RAD|M,…", allow_hyphen_values = true)]
    joints: Option<JointGoal>,
    /// Angles of --joints are in degrees; joints that slide stay in m
    #[arg(long, requires = "joints")]
    degrees: bool,
    #[command(flatten)]
    cell: CellArgs,
}

const IK_EXAMPLES: &str = "Examples:
  armada ik left_arm --pose 0.4,0.1,0.5,180,0,90
  armada ik left_arm --pose @goal.json --seed 0,-1.57,1.57,0,0,0

The solution is the one near the seed; near the measured positions without one. It can be given to
`armada move ROBOT --joints`. `armada model ik` answers for a file, without a robot.

";

/// Arguments of `armada ik`.
#[derive(Args, Debug)]
#[command(after_help = format!("{IK_EXAMPLES}{}", pose_arg::HELP))]
pub(crate) struct IkArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Wanted pose of the tool in the chain's base link
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: String,
    /// Chain; not needed if the robot has one only
    #[arg(long, value_name = "CHAIN")]
    chain: Option<String>,
    /// Where to begin: one value per joint, or NAME=VALUE for some
    #[arg(long, value_name = "RAD|M,…", allow_hyphen_values = true)]
    seed: Option<JointGoal>,
    #[command(flatten)]
    cell: CellArgs,
}

/// Prints where a tool is.
pub(crate) async fn run_tcp(args: TcpArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let joint_position_rad = match &args.joints {
        None => None,
        Some(joints) => {
            let info = client.robot_info(&args.robot).await?;
            let state = next_state(&client, &args.robot, STATE_TIMEOUT).await?;
            let unit = if args.degrees { AngleUnit::Degrees } else { AngleUnit::Radians };
            Some(joints.resolve(&info.joints, commanded(&state), unit)?)
        }
    };
    let params = ForwardKinematicsParams { chain: args.chain, joint_position_rad };
    let answer = client.call::<ForwardKinematics>(&args.robot, params).await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json(&answer)?;
    } else {
        out.line(format_args!(
            "{} {} tool    {}",
            args.robot,
            answer.chain,
            words::pose(&answer.tcp)
        ))?;
        out.line(format_args!(
            "{} {} flange  {}",
            args.robot,
            answer.chain,
            words::pose(&answer.flange)
        ))?;
    }
    Ok(Exit::Success)
}

/// Prints joint positions for a pose.
pub(crate) async fn run_ik(args: IkArgs) -> anyhow::Result<Exit> {
    let pose = pose_arg::of_argument("--pose", &args.pose)?;
    let (client, _) = args.cell.connect().await?;
    let info = client.robot_info(&args.robot).await?;
    let seed_rad = match &args.seed {
        None => None,
        Some(seed) => {
            let state = next_state(&client, &args.robot, STATE_TIMEOUT).await?;
            Some(seed.resolve(&info.joints, commanded(&state), AngleUnit::Radians)?)
        }
    };
    let params = InverseKinematicsParams { chain: args.chain, pose, seed_rad };
    let answer = client.call::<InverseKinematics>(&args.robot, params).await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json(&answer)?;
    } else {
        out.line(goal(&info.joints, &answer.joint_position_rad))?;
    }
    Ok(Exit::Success)
}

/// Positions as `--joints` takes them.
fn goal(joints: &[JointInfo], positions: &JointVector) -> String {
    let pair =
        |(joint, &value): (&JointInfo, &f64)| format!("{}={}", joint.name, words::tidy(value, 6));
    joints.iter().zip(positions.iter()).map(pair).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::RobotInfo;

    use super::*;

    #[test]
    fn a_solution_is_printed_as_a_goal_that_can_be_typed() {
        let text = include_str!("../../../../protocol/golden/robot_info.json");
        let info: RobotInfo = serde_json::from_str(text).expect("the golden sample");
        let positions = JointVector::from_slice(&[0.5, -1.25]).expect("finite");
        let text = goal(&info.joints, &positions);
        assert_eq!(text, "elbow_joint=0.500000,spin_joint=-1.250000");
        let typed: JointGoal = text.parse().expect("a goal");
        let back = typed.resolve(&info.joints, &positions, AngleUnit::Radians).expect("good");
        assert_eq!(back, positions);
    }
}
