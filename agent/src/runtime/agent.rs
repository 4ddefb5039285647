//! An agent: robots that share a process and a Zenoh session, and nothing else.
//!
//! Each robot has its own loop thread, publisher, desk, board and keys, so that one which fails
//! takes no other along. All start or none does; all are shut down at once.

use std::path::{Path, PathBuf};

use armada_model::MotionLimitsError;
use armada_protocol::RobotName;
use armada_protocol::session::SessionError;
use tokio::task::JoinSet;
use tracing::{error, warn};
use zenoh::Session;

use super::bus;
use super::link::LinkError;
use super::realtime::RealtimeReport;
use super::robot::{self, Robot};
use super::robot_agent::RobotAgent;
use super::stop_file::StateError;
use super::wake_log::WakeLog;
use crate::config::ConfigError;
use crate::control::ParamsError;
use crate::drivers::SetupError;

/// How an agent is started.
#[derive(Clone, Debug)]
pub struct AgentOptions {
    /// The robot files, at least one, each of another robot.
    pub robot_files: Vec<PathBuf>,
    /// Zenoh endpoints to listen on; `None`: those of all robot files.
    pub listen: Option<Vec<String>>,
    /// Zenoh endpoints to dial; `None`: those of all robot files, without those listened on, where
    /// robots of one agent would be dialling each other.
    pub connect: Option<Vec<String>>,
    /// Prefix of every key.
    pub namespace: Option<String>,
    /// Whether listening outside loopback without authentication is allowed.
    pub insecure_lan: bool,
    /// Folder in which latched stops are kept while no agent runs, made if it is not there; `None`:
    /// a stop is over when the agent ends.
    pub state_dir: Option<PathBuf>,
}

/// Why an agent could not be started.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// The robot file or the robot description is not usable.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The driver does not fit the robot.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A socket to the controller could not be set up.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The control loop does not take its parameters.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// A joint's limits are not complete or make no sense.
    #[error(transparent)]
    Limits(#[from] MotionLimitsError),
    /// No Zenoh session could be opened.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Zenoh refuses a key.
    #[error("zenoh: {0}")]
    Zenoh(String),
    /// Latched stops cannot be kept.
    #[error(transparent)]
    State(#[from] StateError),
    /// The system gives no thread.
    #[error("no thread: {0}")]
    Thread(#[from] std::io::Error),
    /// Another agent answers for the same robot.
    #[error("robot {0} already has an agent on this bus")]
    NameTaken(String),
    /// An agent without a robot has nothing to do.
    #[error("no robot file is given")]
    NoRobot,
    /// One robot file is given twice.
    #[error("robot file {} is given twice", .0.display())]
    SameFile(PathBuf),
    /// Two robot files are of robots of one name.
    #[error("robot {robot} is in {} and in {}", .files[0].display(), .files[1].display())]
    SameName {
        /// The name.
        robot: RobotName,
        /// The files.
        files: [PathBuf; 2],
    },
    /// One robot cannot be started.
    #[error("robot {robot}: {cause}")]
    Robot {
        /// Its name.
        robot: RobotName,
        /// Why.
        cause: Box<Self>,
    },
}

/// A running agent of one or more robots.
pub struct Agent {
    session: Session,
    robots: Vec<RobotAgent>,
}

impl Agent {
    /// Reads the robot files, joins the bus and starts the control loops.
    ///
    /// # Errors
    /// [`AgentError`]: nothing runs then; a robot that had been started is at rest again.
    pub async fn start(options: AgentOptions) -> Result<Self, AgentError> {
        Self::start_measured(options, Vec::new()).await
    }

    /// As [`Self::start`]; the control loops write their wake-ups to `wake_logs`, in the order of
    /// the robot files. Those beyond have none.
    ///
    /// # Errors
    /// [`AgentError`]: as [`Self::start`].
    pub async fn start_measured(
        options: AgentOptions,
        wake_logs: Vec<WakeLog>,
    ) -> Result<Self, AgentError> {
        let robots = robot::load_all(&options.robot_files)?;
        let session = bus::open_session(&options, &robots).await?;
        let mut agent = Self { session, robots: Vec::new() };
        let folder = options.state_dir.as_deref();
        match agent.start_robots(&robots, folder, wake_logs).await {
            Ok(()) => Ok(agent),
            Err(error) => {
                agent.shut_down().await;
                Err(error)
            }
        }
    }

    /// Name of each robot, with how its control loop is scheduled; in the order of the robot files.
    pub fn realtime(&self) -> impl Iterator<Item = (&RobotName, &RealtimeReport)> {
        self.robots.iter().map(|robot| (robot.name(), robot.realtime()))
    }

    /// Ramps all robots to standstill at once, says goodbye for each and ends.
    ///
    /// If a robot does not stand still in time, that is logged and its controller's own watchdog
    /// is left to stop it.
    pub async fn shut_down(self) {
        let mut ending: JoinSet<()> = self.robots.into_iter().map(RobotAgent::shut_down).collect();
        while let Some(ended) = ending.join_next().await {
            if ended.is_err() {
                error!("shutting down a robot panicked");
            }
        }
        if let Err(error) = self.session.close().await {
            warn!(%error, "the session did not close");
        }
    }

    async fn start_robots(
        &mut self,
        robots: &[Robot],
        state_dir: Option<&Path>,
        wake_logs: Vec<WakeLog>,
    ) -> Result<(), AgentError> {
        bus::refuse_taken_names(&self.session, robots).await?;
        let mut wake_logs = wake_logs.into_iter();
        for robot in robots {
            let started =
                RobotAgent::start(&self.session, robot, state_dir, wake_logs.next()).await;
            self.robots.push(started.map_err(|cause| AgentError::Robot {
                robot: robot.config.robot.clone(),
                cause: Box::new(cause),
            })?);
        }
        Ok(())
    }
}
