//! `armada jog`: joints or a tool at a speed, for a time.

use std::str::FromStr;
use std::time::Duration;

use armada_model::{JointVector, Twist};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{
    ChainTwist, CommandMode, JogCartesianParams, JogFrame, JogJointParams, RobotInfo,
};
use armada_protocol::method::robot::{JogCartesian, JogJoint};
use clap::Args;
use nalgebra::Vector3;
use tokio::time::sleep;
use uuid::Uuid;

use crate::cell_address::CellArgs;
use crate::choice::one_of;
use crate::clock;
use crate::exit::{Exit, UsageError};
use crate::joint_goal::{AngleUnit, JointGoal};
use crate::motion::enter_mode;
use crate::output::note;
use crate::signals::Signals;
use crate::started::{OnSignal, Started};

/// Pause between requests that keep the jog going.
const REPEAT: Duration = Duration::from_millis(50);
/// How long the robot moves without another request.
const DEAD_MAN: Duration = Duration::from_millis(200);
/// Shortest dead-man time of the contract.
const SHORTEST: Duration = Duration::from_millis(20);
/// Longest jog of one command.
const LONGEST_S: f64 = 60.0;

/// Arguments of `armada jog`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada jog left_arm --joint elbow=0.1 --for 2
  armada jog left_arm --joint elbow=10,wrist_1=-5 --degrees --for 1
  armada jog left_arm --tool x=0.02 --frame tool --for 3
  armada jog left_arm --tool z=-0.01,rz=0.1 --chain arm --for 0.5

The robot is brought into mode jog. It moves only as long as this program goes on asking: if that
ends or the network does, it comes to rest within 0.2 s and a ramp. Ctrl-C ends it with a ramp.")]
pub(crate) struct JogArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    #[command(flatten)]
    speed: SpeedArgs,
    /// Speeds of --joint that turn are in degrees per second
    #[arg(long, conflicts_with = "tool")]
    degrees: bool,
    /// Whose axes --tool is in
    #[arg(long, value_name = "FRAME", conflicts_with = "joint",
        value_parser = one_of::<JogFrame>(&["base", "tool", "world"]))]
    frame: Option<JogFrame>,
    /// Chain whose tool moves; not needed if the robot has one only
    #[arg(long, value_name = "CHAIN", conflicts_with = "joint")]
    chain: Option<String>,
    /// How long to move, at most 60
    #[arg(long = "for", value_name = "SECONDS", value_parser = parse_duration)]
    duration: Duration,
    #[command(flatten)]
    cell: CellArgs,
}

/// What moves how fast: exactly one of them.
#[derive(Args, Debug)]
#[group(required = true, multiple = false)]
struct SpeedArgs {
    /// Speeds: NAME=SPEED for some joints, or one value per joint; rad/s, or m/s for joints that
    /// slide
    #[arg(long, value_name = "RAD/S|M/S,…", allow_hyphen_values = true)]
    joint: Option<JointGoal>,
    /// Speed of the tool along x, y, z [m/s] and about them, rx, ry, rz [rad/s]
    #[arg(long, value_name = "AXIS=SPEED,…", allow_hyphen_values = true)]
    tool: Option<ToolSpeed>,
}

/// Speed of a tool as it is typed: `x=0.02,rz=0.1`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ToolSpeed(Twist);

impl FromStr for ToolSpeed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];
        let mut speeds = [None; 6];
        for part in text.split(',') {
            let (axis, value) =
                part.split_once('=').ok_or_else(|| format!("{part:?} is not AXIS=SPEED"))?;
            let place = AXES.iter().zip(&mut speeds).find(|(name, _)| **name == axis.trim());
            let Some((name, speed)) = place else {
                return Err(format!("there is no axis {axis:?}; there are {}", AXES.join(", ")));
            };
            let value = value.trim().parse::<f64>().ok().filter(|value| value.is_finite());
            let value = value.ok_or_else(|| format!("{part:?} is not AXIS=SPEED"))?;
            if speed.replace(value).is_some() {
                return Err(format!("axis {name} is named twice"));
            }
        }
        let [x, y, z, rx, ry, rz] = speeds.map(Option::unwrap_or_default);
        Ok(Self(Twist::new(Vector3::new(x, y, z), Vector3::new(rx, ry, rz))))
    }
}

fn parse_duration(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= LONGEST_S => {
            Ok(Duration::from_secs_f64(seconds))
        }
        _ => Err(format!("must be a number of seconds above 0 and at most {LONGEST_S}")),
    }
}

/// Jogs the robot.
pub(crate) async fn run(args: JogArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let info = client.robot_info(&args.robot).await?;
    let speed = args.speed(&info)?;
    // From here on a signal ends the jog instead of only ending this program.
    let mut signals = Signals::new()?;
    enter_mode(&client, &args.robot, CommandMode::Jog).await?;
    let out = args.cell.output();
    let jog = Jog { client: &client, robot: &args.robot, id: Uuid::now_v7(), speed };
    let end = clock::now() + args.duration;
    let started = jog.start(left(end)).await?;
    while left(end) > DEAD_MAN {
        tokio::select! {
            signal = signals.next() => {
                started.interrupt(&client, signal, &out).await?;
                return Ok(Exit::Interrupted);
            }
            () = sleep(REPEAT) => {}
        }
        if let Err(error) = jog.repeat(left(end)).await {
            note(format_args!("{}: {error}", args.robot));
            break;
        }
    }
    // The last request lasts just to the end.
    started.finish(&client, args.cell.timeout, &out, &mut signals).await
}

fn left(end: std::time::Instant) -> Duration {
    end.saturating_duration_since(clock::now())
}

/// How long the robot is to move on the request that is sent with `left` to go \[s\].
fn dead_man_s(left: Duration) -> f64 {
    left.clamp(SHORTEST, DEAD_MAN + REPEAT).as_secs_f64()
}

impl JogArgs {
    fn speed(&self, info: &RobotInfo) -> anyhow::Result<Speed> {
        if let Some(joints) = &self.speed.joint {
            let unit = if self.degrees { AngleUnit::Degrees } else { AngleUnit::Radians };
            let at_rest = JointVector::zeros(info.joints.len())?;
            return Ok(Speed::Joints(joints.resolve(&info.joints, &at_rest, unit)?));
        }
        let chain = match (&self.chain, info.chains.as_slice()) {
            (Some(chain), _) => chain.clone(),
            (None, [only]) => only.name.clone(),
            (None, chains) => {
                let names: Vec<_> = chains.iter().map(|chain| chain.name.as_str()).collect();
                let why = format!("choose a chain with --chain: {}", names.join(", "));
                return Err(UsageError(why).into());
            }
        };
        let twist = self.speed.tool.map_or(Twist::ZERO, |tool| tool.0);
        Ok(Speed::Tool(ChainTwist { chain, twist, frame: self.frame.unwrap_or_default() }))
    }
}

/// What moves how fast.
#[derive(Clone, Debug, PartialEq)]
enum Speed {
    Joints(JointVector),
    Tool(ChainTwist),
}

struct Jog<'a> {
    client: &'a Client,
    robot: &'a RobotName,
    id: Uuid,
    speed: Speed,
}

impl Jog<'_> {
    async fn start(&self, left: Duration) -> Result<Started, ClientError> {
        let Self { client, robot, id, speed } = self;
        let on_signal = OnSignal::Cancel;
        match speed {
            Speed::Joints(velocity) => {
                let params = self.joint_params(velocity, left);
                Started::ask::<JogJoint>(client, robot, *id, params, on_signal).await
            }
            Speed::Tool(twist) => {
                let params = self.tool_params(twist, left);
                Started::ask::<JogCartesian>(client, robot, *id, params, on_signal).await
            }
        }
    }

    async fn repeat(&self, left: Duration) -> Result<(), ClientError> {
        let Self { client, robot, speed, .. } = self;
        match speed {
            Speed::Joints(velocity) => {
                client.call::<JogJoint>(robot, self.joint_params(velocity, left)).await?
            }
            Speed::Tool(twist) => {
                client.call::<JogCartesian>(robot, self.tool_params(twist, left)).await?
            }
        };
        Ok(())
    }

    fn joint_params(&self, velocity: &JointVector, left: Duration) -> JogJointParams {
        JogJointParams {
            motion_id: Some(self.id),
            joint_velocity_rad_s: *velocity,
            timeout_s: dead_man_s(left),
            wait: false,
        }
    }

    fn tool_params(&self, twist: &ChainTwist, left: Duration) -> JogCartesianParams {
        JogCartesianParams {
            motion_id: Some(self.id),
            chains: vec![twist.clone()],
            timeout_s: dead_man_s(left),
            wait: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Typed {
        #[command(flatten)]
        _args: JogArgs,
    }

    #[test]
    fn a_speed_of_a_tool_is_along_or_about_axes() {
        let speed: ToolSpeed = "x=0.02, rz=-0.1".parse().expect("two axes");
        assert_eq!(speed.0.linear, Vector3::new(0.02, 0.0, 0.0));
        assert_eq!(speed.0.angular, Vector3::new(0.0, 0.0, -0.1));
    }

    #[test]
    fn what_is_no_speed_of_a_tool_is_refused_with_its_reason() {
        for (text, reason) in [
            ("x", "is not AXIS=SPEED"),
            ("x=fast", "is not AXIS=SPEED"),
            ("x=inf", "is not AXIS=SPEED"),
            ("roll=1", "there are x, y, z, rx, ry, rz"),
            ("x=1,x=2", "named twice"),
        ] {
            let error = text.parse::<ToolSpeed>().expect_err(text);
            assert!(error.contains(reason), "{text}: {error}");
        }
    }

    #[test]
    fn what_is_for_tools_is_refused_with_joints_and_the_other_way_round() {
        for text in ["--joint a=1 --frame tool", "--joint a=1 --chain arm", "--tool x=1 --degrees"]
        {
            let words = ["jog", "left_arm", "--for", "1"].into_iter().chain(text.split(' '));
            let error = Typed::try_parse_from(words).map(|_| ()).expect_err(text).to_string();
            assert!(error.contains("cannot be used with"), "{text}: {error}");
        }
    }

    #[test]
    fn a_jog_lasts_at_most_a_minute() {
        assert_eq!(parse_duration("0.5"), Ok(Duration::from_millis(500)));
        for bad in ["0", "-1", "61", "NaN", "long"] {
            assert!(parse_duration(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_last_request_lasts_to_the_end_and_others_beyond_the_next_one() {
        assert_eq!(dead_man_s(Duration::from_secs(5)), 0.25);
        assert_eq!(dead_man_s(Duration::from_millis(120)), 0.12);
        assert_eq!(dead_man_s(Duration::ZERO), 0.02);
    }
}
