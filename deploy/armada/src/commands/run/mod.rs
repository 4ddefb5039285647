//! `armada run`: a trajectory from a file.

mod plan;

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::bail;
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{
    Accepted, ActionStatus, CancelParams, CellExecuteTrajectory, CommandMode, Coupling,
    ExecuteTrajectoryParams, Queue,
};
use armada_protocol::method::{cell, robot};
use clap::{Args, ValueEnum, ValueHint};
use uuid::Uuid;

pub(crate) use plan::{Plan, Terms};

use crate::cell_address::CellArgs;
use crate::choice::one_of;
use crate::commands::moves::{commanded, parse_fraction, start_jog};
use crate::exit::{Exit, UsageError};
use crate::motion::{Follower, MotionView, Mover, Waited, end_line, enter_mode, next_state};
use crate::output::{Output, note};
use crate::signals::Signals;
use crate::standstill;
use crate::started::{WaitArgs, accepted_line, report_end};

/// Speed of the way to the first waypoint, as a fraction of the joints' limits.
pub(crate) const APPROACH_SPEED: f64 = 0.3;
/// Time for the first state to come.
const STATE_TIMEOUT: Duration = Duration::from_secs(2);
/// Time to come to standstill after a motion was cancelled.
const CANCEL_TIMEOUT: Duration = Duration::from_secs(5);

/// Arguments of `armada run`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada run config/motions/handover.json
  armada run config/motions/handover.json --speed 0.5 --repeat 3
  armada run sweep.json --robot left_arm
  armada run next.json --robot left_arm --queue append --no-wait
  armada run lift.json --coupling rigid --leases left_arm=UUID --leases right_arm=UUID

The file holds joint_names, and waypoints with time_from_start_s, joint_position [rad or m] and,
if you like, joint_velocity. Names are ROBOT/JOINT, or JOINT with --robot.
Every part is checked by its robot before any part starts; all start at one instant; when one
fails, all stop. With `independent` each keeps its own pace; with `time_synced`, the default, all
are always at one phase; with `rigid` they also come to rest on one ramp, for what they hold between
them. Ctrl-C cancels with a ramp to standstill.")]
pub(crate) struct RunArgs {
    /// Trajectory
    #[arg(value_name = "FILE.json", value_hint = ValueHint::FilePath)]
    file: PathBuf,
    /// Robot whose joints the file names; it runs without the gateway
    #[arg(long, value_name = "ROBOT")]
    robot: Option<RobotName>,
    /// Speed as a fraction of the file's, above 0 and at most 1: times are divided by it
    #[arg(long, value_name = "FRACTION", default_value = "1", value_parser = parse_fraction)]
    speed: f64,
    /// How often to run it
    #[arg(long, value_name = "TIMES", default_value = "1")]
    repeat: NonZeroU32,
    /// Refuse instead of first moving robots to the first waypoint that are not there
    #[arg(long)]
    no_approach: bool,
    /// What to do if a motion is in progress, instead of refusing; without an approach
    #[arg(long, value_name = "HOW", requires = "robot", value_enum)]
    queue: Option<QueueName>,
    /// How closely several robots are tied together
    #[arg(long, value_name = "HOW", conflicts_with = "robot", default_value = "time_synced",
          value_parser = one_of::<Coupling>(&["independent", "time_synced", "rigid"]))]
    coupling: Coupling,
    /// Lease of one of several robots, as `armada lease hold` prints it; repeat for each
    #[arg(long, value_name = "ROBOT=UUID", conflicts_with = "robot", value_parser = parse_lease)]
    leases: Vec<(RobotName, Uuid)>,
    #[command(flatten)]
    wait: WaitArgs,
    #[command(flatten)]
    cell: CellArgs,
}

fn parse_lease(text: &str) -> Result<(RobotName, Uuid), String> {
    let (robot, lease) = text.split_once('=').ok_or("expected ROBOT=UUID")?;
    let robot = robot.parse().map_err(|error| format!("{error}"))?;
    Ok((robot, lease.parse().map_err(|error| format!("{lease:?}: {error}"))?))
}

/// What to do with a motion in progress.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum QueueName {
    /// Wait for its end, where this one must begin
    Append,
    /// The same, without coming to rest in between where the limits allow
    Blended,
    /// Take its place, without a halt where the limits allow
    Replace,
}

impl From<QueueName> for Queue {
    fn from(name: QueueName) -> Self {
        match name {
            QueueName::Append => Self::Append,
            QueueName::Blended => Self::AppendBlended,
            QueueName::Replace => Self::Replace,
        }
    }
}

/// Runs the trajectory.
pub(crate) async fn run(args: RunArgs) -> anyhow::Result<Exit> {
    let count = args.leases.len();
    let terms = Terms { coupling: args.coupling, leases: args.leases.into_iter().collect() };
    if terms.leases.len() < count {
        return Err(UsageError("--leases names a robot twice".to_owned()).into());
    }
    let plan = Plan::load(&args.file, args.robot.as_ref())?.at_speed(args.speed).on_terms(terms)?;
    let queue = args.queue.map_or(Queue::Refuse, Queue::from);
    if args.wait.no_wait && args.repeat.get() > 1 {
        let why = "--no-wait runs it once: leave --repeat out, or append with --queue";
        return Err(UsageError(why.to_owned()).into());
    }
    let (client, _) = args.cell.connect().await?;
    let out = args.cell.output();
    // From here on a signal stops the robots instead of only ending this program.
    let mut signals = Signals::new()?;
    for round in 1..=args.repeat.get() {
        if !args.no_approach
            && args.queue.is_none()
            && let Exit::Interrupted = approach_or_halt(&client, &plan, &mut signals).await?
        {
            return Ok(Exit::Interrupted);
        }
        let title = match args.repeat.get() {
            1 => plan.title(),
            rounds => format!("{} {round}/{rounds}", plan.title()),
        };
        let (accepted, follower) = start_queued(&client, &plan, queue).await?;
        if args.wait.no_wait {
            return report_accepted(&title, &accepted, &out);
        }
        let motion = Asked { plan: &plan, title: &title, accepted, follower };
        let round = motion.wait(&client, args.cell.timeout, &mut signals).await?;
        let exit = round.report(&title, &out)?;
        if exit != Exit::Success {
            return Ok(exit);
        }
    }
    Ok(Exit::Success)
}

/// Moves every robot that is not there to its first waypoint, all at once. Signals are for the
/// caller to see; the robots then have to be halted.
///
/// # Errors
/// If a robot refuses, or does not get there.
pub(crate) async fn approach(client: &Client, plan: &Plan) -> anyhow::Result<()> {
    // All are asked before any moves: one that is missing must not leave the others half way.
    let mut away = Vec::new();
    for part in plan.parts() {
        let info = client.robot_info(&part.robot).await?;
        let state = next_state(client, &part.robot, STATE_TIMEOUT).await?;
        let goal = part.first_waypoint(&info)?;
        if !part.is_there(&goal, commanded(&state)) {
            away.push((info, goal));
        }
    }
    let mut jogs = Vec::new();
    for (info, goal) in away {
        note(format_args!("{}: moving to the first waypoint", info.robot));
        let client = plan.client_of(client, &info.robot);
        jogs.push(start_jog(&client, &info, goal, APPROACH_SPEED).await?);
    }
    for jog in &jogs {
        let view = jog.end(client).await?;
        if view.status != ActionStatus::Complete {
            bail!("not at the first waypoint: {}", end_line(jog.robot().as_str(), &view));
        }
    }
    Ok(())
}

/// The approach; when it fails or a signal comes, every robot of the plan is halted.
async fn approach_or_halt(
    client: &Client,
    plan: &Plan,
    signals: &mut Signals,
) -> anyhow::Result<Exit> {
    let result = tokio::select! {
        signal = signals.next() => {
            note(format_args!("{signal}: halting the robots"));
            Ok(Exit::Interrupted)
        }
        done = approach(client, plan) => done.map(|()| Exit::Success),
    };
    if !matches!(result, Ok(Exit::Success)) {
        let robots: Vec<_> = plan.parts().iter().map(|part| part.robot.clone()).collect();
        standstill::halt_and_report(client, &robots).await;
    }
    result
}

/// How one run of the trajectory ended.
struct Round {
    /// Its terminal status; `None` if it did not come in time.
    view: Option<MotionView>,
    /// Whether a signal ended it.
    interrupted: bool,
}

impl Round {
    fn report(&self, title: &str, out: &Output) -> anyhow::Result<Exit> {
        let exit = match &self.view {
            Some(view) => report_end(title, view, out)?,
            None => {
                note(format_args!("{title}: no end of the motion in time: go and look"));
                Exit::Failure
            }
        };
        Ok(if self.interrupted { Exit::Interrupted } else { exit })
    }
}

/// A run that was accepted.
struct Asked<'a> {
    plan: &'a Plan,
    title: &'a str,
    accepted: Accepted,
    follower: Follower,
}

impl Asked<'_> {
    async fn wait(
        self,
        client: &Client,
        limit: Option<Duration>,
        signals: &mut Signals,
    ) -> anyhow::Result<Round> {
        let Self { plan, title, accepted, follower } = self;
        match follower.wait(client, title, limit, signals).await? {
            Waited::Ended(view) => Ok(Round { view: Some(*view), interrupted: false }),
            Waited::Interrupted(signal) => {
                note(format_args!("{signal}: cancelling {title}"));
                cancel(client, plan, accepted.motion_id).await?;
                let view = follower.wait_for_end(client, CANCEL_TIMEOUT).await;
                Ok(Round { view, interrupted: true })
            }
        }
    }
}

fn report_accepted(title: &str, accepted: &Accepted, out: &Output) -> anyhow::Result<Exit> {
    if out.is_json() {
        out.json(accepted)?;
    } else {
        out.line(accepted_line(title, accepted))?;
    }
    Ok(Exit::Success)
}

/// Brings the robots into mode trajectory and asks for the motion.
pub(crate) async fn start(client: &Client, plan: &Plan) -> anyhow::Result<(Accepted, Follower)> {
    start_queued(client, plan, Queue::Refuse).await
}

/// The same, with what is to become of a motion in progress.
async fn start_queued(
    client: &Client,
    plan: &Plan,
    queue: Queue,
) -> anyhow::Result<(Accepted, Follower)> {
    for part in plan.parts() {
        let client = plan.client_of(client, &part.robot);
        enter_mode(&client, &part.robot, CommandMode::Trajectory).await?;
    }
    let id = Uuid::now_v7();
    let follower = Follower::subscribe(client, plan.mover(), id).await?;
    let accepted = execute(client, plan, id, queue).await?;
    Ok((accepted, follower))
}

async fn execute(
    client: &Client,
    plan: &Plan,
    id: Uuid,
    queue: Queue,
) -> Result<Accepted, ClientError> {
    let trajectory = plan.trajectory().clone();
    match plan.mover() {
        Mover::Robot(robot) => {
            let at_once = ExecuteTrajectoryParams::at_once(Some(id), trajectory);
            let params = ExecuteTrajectoryParams { queue, ..at_once };
            client.call::<robot::ExecuteTrajectory>(&robot, params).await
        }
        Mover::Cell => {
            let Terms { coupling, leases } = plan.terms().clone();
            let new = CellExecuteTrajectory::new(Some(id), trajectory);
            let params = CellExecuteTrajectory { coupling, leases, ..new };
            client.call_cell::<cell::ExecuteTrajectory>(params).await
        }
    }
}

/// Ends the motion with a ramp to standstill.
pub(crate) async fn cancel(client: &Client, plan: &Plan, id: Uuid) -> Result<(), ClientError> {
    let params = CancelParams { motion_id: id };
    match plan.mover() {
        Mover::Robot(robot) => client.call::<robot::Cancel>(&robot, params).await?,
        Mover::Cell => client.call_cell::<cell::Cancel>(params).await?,
    };
    Ok(())
}
