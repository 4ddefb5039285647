//! One robot's agent, put together: loop, publisher, desk and the keys it answers.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{Builder, JoinHandle, Thread};
use std::time::Duration;

use armada_model::MotionLimitsError;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::{CommandMode, EventKind, RobotFlags, SchedulingPolicy, Severity};
use armada_protocol::session::SessionError;
use rtrb::Producer;
use serde_json::Map;
use tokio::sync::{Notify, Semaphore, mpsc, watch};
use tokio::task::JoinHandle as Task;
use tracing::{error, info, warn};
use uuid::Uuid;
use zenoh::Session;

use super::board::{Board, SharedBoard};
use super::bus::{self, Keys};
use super::clock::monotonic;
use super::desk::{Desk, Inboxes, Remark};
use super::link::{Link, LinkError};
use super::loop_thread::LoopThread;
use super::mailbox::{LoopEnd, PublisherEnd, StampedEvent, mailbox};
use super::meter::{Meter, MeterReader};
use super::publisher::Publisher;
use super::realtime::{self, RealtimeReport};
use super::requests::{MAX_WAITS, Requests};
use super::robot::Robot;
use super::stop_gate::StopGate;
use super::stop_intake::StopIntake;
use super::wake_log::WakeLog;
use super::words::Vocabulary;
use crate::config::{ConfigError, RealtimeConfig, RobotConfig};
use crate::control::{Input, LoopRequest, LoopState, Params, ParamsError, step};
use crate::drivers::SetupError;

/// How long an agent that ends waits for its robot to stand still.
const STANDSTILL_PATIENCE: Duration = Duration::from_secs(5);
/// How much less urgent than the loop the publisher is, which hands a fresh state to Zenoh.
const BELOW_LOOP: u8 = 10;
/// Events between loop, publisher and desk.
const DESK_QUEUE: usize = 4096;
/// Events kept for late joiners.
const KEPT_EVENTS: usize = 256;

/// How an agent is started.
#[derive(Clone, Debug)]
pub struct AgentOptions {
    /// The robot file.
    pub robot_file: PathBuf,
    /// Zenoh endpoints to listen on, instead of those of the robot file.
    pub listen: Option<Vec<String>>,
    /// Zenoh endpoints to dial, instead of those of the robot file.
    pub connect: Option<Vec<String>>,
    /// Prefix of every key.
    pub namespace: Option<String>,
    /// Whether listening outside loopback without authentication is allowed.
    pub insecure_lan: bool,
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
    /// The system gives no thread.
    #[error("no thread: {0}")]
    Thread(#[from] std::io::Error),
    /// Another agent answers for the same robot.
    #[error("robot {0} already has an agent on this bus")]
    NameTaken(String),
}

/// A running agent.
pub struct Agent {
    session: Session,
    requests: Arc<Requests>,
    board: Arc<SharedBoard>,
    remarks: mpsc::Sender<Remark>,
    realtime: RealtimeReport,
    shutdown: Arc<AtomicBool>,
    loop_thread: JoinHandle<()>,
    publisher: JoinHandle<()>,
    desk: Task<()>,
    _keys: Keys,
}

impl Agent {
    /// Reads the robot file, starts the loop and joins the bus.
    ///
    /// # Errors
    /// [`AgentError`]: nothing runs then.
    pub async fn start(options: AgentOptions) -> Result<Self, AgentError> {
        Self::start_measured(options, None).await
    }

    /// As [`Self::start`]; the control loop writes its wake-ups to `wake_log`.
    ///
    /// # Errors
    /// [`AgentError`]: nothing runs then.
    pub async fn start_measured(
        options: AgentOptions,
        wake_log: Option<WakeLog>,
    ) -> Result<Self, AgentError> {
        let robot = Robot::load(&options)?;
        let session = bus::open_session(&options, &robot.config).await?;
        bus::refuse_taken_name(&session, &robot.config).await?;
        let shared = Shared::new(&robot)?;
        let (loop_end, publisher_end, orders) = mailbox(shared.board.lock().snapshot);
        let (to_desk, loop_events) = mpsc::channel(DESK_QUEUE);
        let publisher = shared.publisher(&session, &robot, publisher_end, to_desk).await?;
        let publisher = spawn_publisher(publisher, &robot.config)?;
        let mut loop_thread = shared.loop_thread(&robot, loop_end, publisher.thread().clone())?;
        loop_thread.wake_log = wake_log;
        let running = loop_thread.start()?;
        info!(robot = %robot.config.robot, period_ms = robot.config.control.period_ms,
            scheduling = %running.realtime, "control loop runs");
        let gate = Arc::clone(&shared.gate);
        let (stop, stops) = StopIntake::open(&session, &robot.config.robot, gate)
            .await
            .map_err(bus::zenoh_error)?;
        let (remarks, remarked) = mpsc::channel(DESK_QUEUE);
        let (cleared, cleared_seen) = watch::channel(0);
        let desk = shared.desk(&session, &robot, running.realtime.policy, cleared).await?;
        let changed = Arc::clone(&shared.changed);
        let desk = start_task(desk.run(Inboxes { loop_events, stops, remarks: remarked, changed }));
        let requests = Arc::new(shared.requests(&robot, orders, cleared_seen, remarks.clone()));
        let keys = bus::open_keys(&session, &robot, &shared.board, &requests, stop).await?;
        let agent = Self {
            session,
            requests,
            board: shared.board,
            remarks,
            realtime: running.realtime,
            shutdown: shared.shutdown,
            loop_thread: running.thread,
            publisher,
            desk,
            _keys: keys,
        };
        agent.remark(EventKind::Started, format!("agent {} started", env!("CARGO_PKG_VERSION")));
        Ok(agent)
    }

    /// How the control loop's thread is scheduled.
    #[must_use]
    pub const fn realtime(&self) -> &RealtimeReport {
        &self.realtime
    }

    /// Ramps the robot to standstill, says goodbye and ends.
    ///
    /// If the robot does not stand still in time, that is logged and the controller's own watchdog
    /// is left to stop it.
    pub async fn shut_down(self) {
        self.come_to_rest().await;
        self.remark(EventKind::Ending, "agent ends".to_owned());
        self.shutdown.store(true, Ordering::Relaxed);
        self.publisher.thread().unpark();
        let threads = [self.loop_thread, self.publisher];
        let joined = tokio::task::spawn_blocking(move || threads.map(JoinHandle::join)).await;
        if !matches!(joined, Ok([Ok(()), Ok(())])) {
            error!("a thread of the agent panicked");
        }
        // The publisher was the only source of loop events, so the desk ends by itself.
        if self.desk.await.is_err() {
            error!("the desk panicked");
        }
        if let Err(error) = self.session.close().await {
            warn!(%error, "the session did not close");
        }
    }

    async fn come_to_rest(&self) {
        if let Err(denial) = self.requests.halt().await {
            info!(%denial, "no halt needed");
        }
        let rest = async {
            while self.is_commanded_to_move() {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        };
        if tokio::time::timeout(STANDSTILL_PATIENCE, rest).await.is_err() {
            warn!("the robot still moves: its controller's watchdog has to stop it");
        }
    }

    fn is_commanded_to_move(&self) -> bool {
        let snapshot = self.board.lock().snapshot;
        let connected = !snapshot.flags.contains(RobotFlags::COMMUNICATION_FAILURE);
        let moves = snapshot.joint_velocity_command.iter().any(|&velocity| velocity != 0.0);
        connected && snapshot.command_mode != CommandMode::InvalidState && moves
    }

    fn remark(&self, kind: EventKind, message: String) {
        let remark = Remark { severity: Severity::Info, kind, message, details: Map::new() };
        if self.remarks.try_send(remark).is_err() {
            warn!("an event was lost: the desk does not keep up");
        }
    }
}

/// What the threads and tasks of an agent share.
struct Shared {
    boot_id: Uuid,
    gate: Arc<StopGate>,
    meter: Arc<Meter>,
    board: Arc<SharedBoard>,
    changed: Arc<Notify>,
    shutdown: Arc<AtomicBool>,
}

impl Shared {
    fn new(robot: &Robot) -> Result<Self, AgentError> {
        let boot_id = Uuid::now_v7();
        let first = first_snapshot(&robot.params)?;
        let vocabulary =
            Vocabulary { robot: robot.config.robot.clone(), joints: robot.joints.clone() };
        Ok(Self {
            boot_id,
            gate: Arc::default(),
            meter: Arc::default(),
            board: Arc::new(SharedBoard::new(Board::new(vocabulary, boot_id, first))),
            changed: Arc::default(),
            shutdown: Arc::default(),
        })
    }

    async fn publisher(
        &self,
        session: &Session,
        robot: &Robot,
        mailbox: PublisherEnd,
        desk: mpsc::Sender<StampedEvent>,
    ) -> Result<Publisher, AgentError> {
        let encoding = robot.config.publish.encoding;
        let (state, joint_states) = (&keys::ROBOT_STATE, &keys::ROBOT_JOINT_STATES);
        Ok(Publisher {
            mailbox,
            board: Arc::clone(&self.board),
            desk,
            state: bus::declare_latest(session, robot, state, encoding).await?,
            joint_states: bus::declare_latest(session, robot, joint_states, encoding).await?,
            boot_id: self.boot_id,
            joint_names: robot.joint_names(),
            variables: robot.variables(),
            chains: robot.chain_links(),
            model: robot.model.clone(),
            changed: Arc::clone(&self.changed),
            shutdown: Arc::clone(&self.shutdown),
        })
    }

    fn loop_thread(
        &self,
        robot: &Robot,
        mailbox: LoopEnd,
        publisher: Thread,
    ) -> Result<LoopThread, AgentError> {
        let driver = robot.driver(self.boot_id)?;
        Ok(LoopThread {
            name: robot.config.robot.to_string(),
            params: robot.params.clone(),
            state: LoopState::new(&robot.params)?,
            link: Link::open(driver.endpoints())?,
            driver,
            mailbox,
            gate: Arc::clone(&self.gate),
            meter: Arc::clone(&self.meter),
            realtime: robot.config.control.realtime,
            ticks_per_sample: robot.ticks_per_sample(),
            publisher,
            shutdown: Arc::clone(&self.shutdown),
            wake_log: None,
        })
    }

    async fn desk(
        &self,
        session: &Session,
        robot: &Robot,
        policy: SchedulingPolicy,
        cleared: watch::Sender<u64>,
    ) -> Result<Desk, AgentError> {
        let stop_acks = &keys::ROBOT_STOP_ACK;
        Ok(Desk {
            reader: MeterReader::new(robot.params.period, policy, monotonic()),
            status: bus::declare_cached(session, robot, &keys::ROBOT_STATUS, 1).await?,
            events: bus::declare_cached(session, robot, &keys::ROBOT_EVENTS, KEPT_EVENTS).await?,
            stop_acks: bus::declare_latest(session, robot, stop_acks, WireEncoding::Json).await?,
            session: session.clone(),
            board: Arc::clone(&self.board),
            meter: Arc::clone(&self.meter),
            boot_id: self.boot_id,
            event_seqno: 0,
            cleared,
        })
    }

    fn requests(
        &self,
        robot: &Robot,
        orders: Producer<LoopRequest>,
        cleared: watch::Receiver<u64>,
        remarks: mpsc::Sender<Remark>,
    ) -> Requests {
        Requests {
            board: Arc::clone(&self.board),
            gate: Arc::clone(&self.gate),
            params: robot.params.clone(),
            limits: robot.limits,
            joint_names: robot.joint_names(),
            joint_types: robot.joint_types(),
            orders: Mutex::new(orders),
            prepared: Mutex::default(),
            waits: Semaphore::new(MAX_WAITS),
            cleared,
            remarks,
            boot_id: self.boot_id,
        }
    }
}

/// The snapshot before the first tick: what a step says that knows nothing.
fn first_snapshot(params: &Params) -> Result<crate::control::Snapshot, AgentError> {
    let mut state = LoopState::new(params)?;
    let mut input = Input::at(monotonic());
    Ok(step(params, &mut state, &mut input).snapshot)
}

fn spawn_publisher(
    publisher: Publisher,
    config: &RobotConfig,
) -> Result<JoinHandle<()>, AgentError> {
    let name = format!("publish-{}", config.robot);
    let priority = config.control.realtime.priority;
    let priority = priority.map(|priority| priority.saturating_sub(BELOW_LOOP).max(1));
    let scheduling = RealtimeConfig { priority, cpu: None, lock_memory: false };
    let run = move || {
        // Refused where it is refused to the loop, which says so.
        realtime::enter(&scheduling);
        publisher.run();
    };
    Ok(Builder::new().name(name).spawn(run)?)
}

#[expect(clippy::disallowed_methods, reason = "the runtime is where tasks are started")]
fn start_task(task: impl Future<Output = ()> + Send + 'static) -> Task<()> {
    tokio::spawn(task)
}
