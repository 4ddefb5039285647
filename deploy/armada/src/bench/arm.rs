//! A robot that is measured: emulator and agent, each a process, and a client of the agent.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context as _, bail};
use armada_model::JointVector;
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError, ClientOptions};
use armada_protocol::keys;
use armada_protocol::messages::{
    ActionStatus, CommandMode, DenialCode, Empty, ExecuteTrajectoryParams, RobotFlags, RobotState,
    RobotStatus, SetModeParams,
};
use armada_protocol::method::robot::{Enable, ExecuteTrajectory, ResetErrors, SetMode};
use tokio::time::{sleep, timeout};
use uuid::Uuid;

use super::child::Child;
use super::part::{Ask, Part};
use super::robot_file::{self, Folder, RobotSpec, ready_position};
use super::swing::swing;

/// How long a robot may take for anything.
const PATIENCE: Duration = Duration::from_secs(20);
/// How long a robot is told to stand before it counts as standing; agents want 50 ms of measured
/// rest after the lag.
const STANDING: Duration = Duration::from_millis(150);
/// Pause between two looks at a robot.
const LOOK: Duration = Duration::from_millis(10);

/// An emulated controller, which stays while agents come and go.
pub(super) struct Controller {
    child: Child,
    file: PathBuf,
    name: RobotName,
}

impl Controller {
    /// Starts the controller of a new robot.
    pub(super) async fn start(folder: &Folder, spec: &RobotSpec) -> anyhow::Result<Self> {
        let file = robot_file::write(folder, spec)?;
        let child = Child::start(&Part::Emulator { robots: vec![file.clone()] }).await?;
        Ok(Self { child, file, name: spec.name.clone() })
    }

    /// Processor time so far \[s\].
    pub(super) async fn cpu_time(&mut self) -> anyhow::Result<f64> {
        self.child.ask(Ask::CpuTime).await
    }

    /// Ends it.
    pub(super) async fn end(self) -> anyhow::Result<()> {
        self.child.end().await
    }
}

/// A robot with its agent.
pub(super) struct Arm {
    /// The agent's process.
    pub(super) agent: Child,
    /// Asks the agent.
    pub(super) client: Client,
    /// Name of the robot.
    pub(super) name: RobotName,
    /// Where the agent listens.
    pub(super) endpoint: String,
}

impl Arm {
    /// Starts the agent of a controller; it stands in mode `trajectory`.
    pub(super) async fn start(controller: &Controller) -> anyhow::Result<Self> {
        Self::start_linked(controller, Vec::new()).await
    }

    /// The same, with links to the agents that listen on these endpoints.
    pub(super) async fn start_linked(
        controller: &Controller,
        others: Vec<String>,
    ) -> anyhow::Result<Self> {
        let endpoint = robot_file::free_endpoint()?;
        let robots = vec![controller.file.clone()];
        let part = Part::Agent { robots, endpoint: endpoint.clone(), connect: others };
        let agent = Child::start(&part).await?;
        let client = connect(vec![endpoint.clone()]).await?;
        let arm = Self { agent, client, name: controller.name.clone(), endpoint };
        arm.make_ready().await?;
        Ok(arm)
    }

    /// Brings the robot into mode `trajectory`, out of a fault too.
    pub(super) async fn make_ready(&self) -> anyhow::Result<()> {
        let is_heard =
            |s: &RobotStatus| s.command_mode != CommandMode::InvalidState || !s.faults.is_empty();
        let status = self.status_when("heard", is_heard).await?;
        if !status.faults.is_empty() {
            self.client.call::<ResetErrors>(&self.name, Empty {}).await?;
        }
        if !status.flags.contains(RobotFlags::ENABLED) {
            self.client.call::<Enable>(&self.name, Empty {}).await?;
        }
        if status.command_mode != CommandMode::Trajectory {
            let mode = SetModeParams { mode: CommandMode::Trajectory };
            when_at_rest(async || self.client.call::<SetMode>(&self.name, mode).await).await?;
        }
        Ok(())
    }

    /// Moves the robot to and fro at least as long as `time`, and waits until it moves.
    pub(super) async fn swing(&self, time: Duration) -> anyhow::Result<Uuid> {
        let trajectory = swing(self.position().await?, ready_position()?, time);
        let params = ExecuteTrajectoryParams::at_once(None, trajectory);
        let motion = self.client.call::<ExecuteTrajectory>(&self.name, params).await?.motion_id;
        self.status_when("moving", |status| {
            status.motion.as_ref().is_some_and(|m| m.id == motion && m.started_ns.is_some())
        })
        .await?;
        Ok(motion)
    }

    /// Why a motion does not go on; `None` if it does.
    pub(super) async fn why_ended(&self, motion: Uuid) -> anyhow::Result<Option<String>> {
        let status = self.client.motion(&self.name, motion).await?;
        if status.status == ActionStatus::Running {
            return Ok(None);
        }
        let reason = status.reason.map_or_else(String::new, |denial| format!(": {denial}"));
        Ok(Some(format!("motion {:?}{reason}", status.status)))
    }

    /// Where the robot is.
    pub(super) async fn position(&self) -> anyhow::Result<JointVector> {
        let key = keys::ROBOT_STATE.of(&self.name);
        let states = self.client.subscribe::<RobotState>(&key, 1).await?;
        let next = timeout(PATIENCE, states.next()).await.context("no state is published")?;
        Ok(next?.1.joint_position_rad)
    }

    /// Waits until the robot has been told to stand for as long as its agent wants to see that.
    pub(super) async fn at_rest(&self) -> anyhow::Result<()> {
        let key = keys::ROBOT_STATE.of(&self.name);
        let states = self.client.subscribe::<RobotState>(&key, 1).await?;
        let standing = async {
            let mut since = None;
            loop {
                let (_, state) = states.next().await?;
                let moves = state.joint_velocity_command_rad_s.iter().any(|speed| *speed != 0.0);
                let begin = *since.get_or_insert(state.stamp_ns);
                if moves {
                    since = None;
                } else if state.stamp_ns.saturating_since(begin) >= STANDING {
                    return Ok::<_, anyhow::Error>(());
                }
            }
        };
        timeout(PATIENCE, standing).await.context("the robot does not come to rest")?
    }

    /// The status as soon as it satisfies `condition`.
    pub(super) async fn status_when(
        &self,
        what: &str,
        condition: impl Fn(&RobotStatus) -> bool,
    ) -> anyhow::Result<RobotStatus> {
        let found = timeout(PATIENCE, async {
            loop {
                let status = self.client.robot_status(&self.name).await?;
                if condition(&status) {
                    return Ok::<_, anyhow::Error>(status);
                }
                sleep(LOOK).await;
            }
        });
        match found.await {
            Ok(status) => status,
            Err(_) => bail!("{} is not {what} after {PATIENCE:?}", self.name),
        }
    }

    /// Ends the agent, which brings the robot to rest first.
    pub(super) async fn end(self) -> anyhow::Result<()> {
        self.client.close();
        self.agent.end().await
    }
}

/// The answer as soon as it is not that the robot still decelerates.
pub(super) async fn when_at_rest<T>(
    ask: impl AsyncFn() -> Result<T, ClientError>,
) -> anyhow::Result<T> {
    let asking = async {
        loop {
            match ask().await {
                Err(ClientError::Denied(denial)) if denial.code == DenialCode::Busy => {
                    sleep(LOOK).await;
                }
                other => return other,
            }
        }
    };
    Ok(timeout(PATIENCE, asking).await.context("the robot does not come to rest")??)
}

/// A client of several endpoints.
pub(super) async fn connect(endpoints: Vec<String>) -> anyhow::Result<Client> {
    let options = ClientOptions { name: "bench".to_owned(), connect: endpoints, namespace: None };
    Ok(Client::connect(options).await?)
}
