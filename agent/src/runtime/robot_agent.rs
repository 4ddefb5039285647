//! One robot of an agent: loop, publisher, desk and the keys it answers.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::thread::Thread;
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::{
    CommandMode, EventKind, LatchedStop, RobotFlags, SchedulingPolicy, Severity,
};
use rtrb::Producer;
use serde_json::Map;
use tokio::sync::{Notify, Semaphore, mpsc, watch};
use tokio::task::JoinHandle as Task;
use tracing::{Instrument as _, Span, error, info, info_span, warn};
use uuid::Uuid;
use zenoh::Session;

use super::agent::AgentError;
use super::board::{Board, SharedBoard};
use super::bus::{self, Keys};
use super::clock::monotonic;
use super::desk::{Desk, DroppedCommands, Flapping, Inboxes, Remark};
use super::equipment::SharedEquipment;
use super::groups::Groups;
use super::link::Link;
use super::loop_thread::LoopThread;
use super::mailbox::{LoopEnd, PublisherEnd, StampedEvent, mailbox};
use super::meter::{Meter, MeterReader};
use super::processor::Processor;
use super::publisher::{Publisher, StateClass};
use super::realtime::RealtimeReport;
use super::recordings::{Recorder, Recordings};
use super::requests::{MAX_WAITS, Requests};
use super::robot::Robot;
use super::self_collision::SelfCollision;
use super::stop_file::{Kept, StateError, StopFile};
use super::stop_gate::StopGate;
use super::stop_intake::{self, IncomingStop, StopIntake};
use super::stop_keeper::StopKeeper;
use super::stop_latch::{CONTROLLER, StopRecord, at_start, untold};
use super::stop_sources::StopSourceAsker;
use super::stop_watch::StopWatch;
use super::stream_intake::StreamIntake;
use super::threads::Threads;
use super::wake_log::WakeLog;
use super::words::Vocabulary;
use crate::control::{Input, LoopRequest, LoopState, Params, step};
use crate::recorder::Tape;
use crate::stop_sources::StopSources;

/// How long a robot that is shut down gets to stand still.
const STANDSTILL_PATIENCE: Duration = Duration::from_secs(5);
/// Events between loop, publisher and desk.
const DESK_QUEUE: usize = 4096;
/// Events kept for late joiners.
const KEPT_EVENTS: usize = 256;

/// A running robot of an agent. If it is dropped, its threads end without a ramp, and the
/// controller's watchdog stops the robot.
pub(super) struct RobotAgent {
    name: RobotName,
    requests: Arc<Requests>,
    board: Arc<SharedBoard>,
    remarks: mpsc::Sender<Remark>,
    realtime: RealtimeReport,
    threads: Threads,
    desk: Task<()>,
    span: Span,
    keeper: Arc<StopKeeper>,
    _keys: Keys,
    _streams: StreamIntake,
}

impl RobotAgent {
    /// Starts the loop of a robot and opens its keys.
    ///
    /// # Errors
    /// [`AgentError`]: nothing of this robot runs then.
    pub(super) async fn start(
        session: &Session,
        robot: &Robot,
        state_dir: Option<&Path>,
        wake_log: Option<WakeLog>,
    ) -> Result<Self, AgentError> {
        let shared = Shared::new(session, robot, state_dir).await?;
        let keeper = Arc::clone(&shared.keeper);
        let started = Self::start_latched(session, robot, shared, wake_log).await;
        if started.is_err()
            && let Err(problem) = keeper.end().await
        {
            warn!(problem, "the end of this start is not kept: the next one will latch a stop");
        }
        started
    }

    async fn start_latched(
        session: &Session,
        robot: &Robot,
        shared: Shared,
        wake_log: Option<WakeLog>,
    ) -> Result<Self, AgentError> {
        let name = robot.config.robot.clone();
        let span = info_span!("robot", %name);
        let (loop_end, publisher_end, clients) = mailbox(shared.board.lock().snapshot);
        let (to_desk, loop_events) = mpsc::channel(DESK_QUEUE);
        let words = (Arc::clone(&shared.board), clients.words);
        let groups = Groups::new(session.clone(), name.clone(), shared.boot_id, words);
        let told = (publisher_end, to_desk, Arc::clone(&groups));
        let publisher = shared.publisher(session, robot, told).await?;
        // From here on an error drops the threads, which ends them.
        let mut threads = Threads::new(Arc::clone(&shared.shutdown));
        let runs_on = Arc::clone(&shared.runs_on);
        let publisher = threads.publish(publisher, &robot.config, runs_on, span.clone())?;
        let mut loop_thread = shared.loop_thread(robot, loop_end, publisher)?;
        loop_thread.wake_log = wake_log;
        let recorder = shared.recorder(robot, &mut loop_thread)?;
        shared.note_running().await?;
        let realtime = threads.control(loop_thread)?;
        info!(robot = %name, period_ms = robot.config.control.period_ms, scheduling = %realtime,
            "control loop runs");
        let (to_stops, stops) = mpsc::channel(stop_intake::QUEUE);
        let gate = Arc::clone(&shared.gate);
        let stop = StopIntake::open(session, &name, gate, to_stops.clone()).await;
        let stop = stop.map_err(bus::zenoh_error)?;
        let sources = shared.stop_sources(session, to_stops);
        drop(start_task(sources.run().instrument(span.clone())));
        let (remarks, remarked) = mpsc::channel(DESK_QUEUE);
        let (cleared, cleared_seen) = watch::channel(0);
        let desk = shared.desk(session, robot, realtime.policy, cleared).await?;
        let changed = Arc::clone(&shared.changed);
        let desk = desk.run(Inboxes { loop_events, stops, remarks: remarked, changed });
        let desk = start_task(desk.instrument(span.clone()));
        let requests = Arc::new(shared.requests(
            robot,
            clients.requests,
            cleared_seen,
            remarks.clone(),
            (recorder, groups),
        ));
        let streams = StreamIntake::open(session, robot, clients.samples, &shared.board).await;
        let streams = streams.map_err(bus::zenoh_error)?;
        let keys = bus::open_keys(session, robot, &shared.board, &requests, stop).await?;
        let (board, keeper) = (shared.board, shared.keeper);
        let agent = Self {
            name,
            requests,
            board,
            remarks,
            realtime,
            threads,
            desk,
            span,
            keeper,
            _keys: keys,
            _streams: streams,
        };
        agent.remark(EventKind::Started, format!("agent {} started", env!("CARGO_PKG_VERSION")));
        let latched = agent.board.lock().kept().stops;
        for stop in latched {
            let LatchedStop { source, level, reason, .. } = stop;
            warn!(source, ?level, reason, "stopped from the start");
            let message = format!("stopped from the start, {level:?} by {source}: {reason}");
            agent.remark(EventKind::Stop, message);
        }
        Ok(agent)
    }

    /// Its name.
    pub(super) const fn name(&self) -> &RobotName {
        &self.name
    }

    /// How its loop is scheduled.
    pub(super) const fn realtime(&self) -> &RealtimeReport {
        &self.realtime
    }

    /// Ramps the robot to standstill, says goodbye and ends.
    ///
    /// If the robot does not stand still in time, that is logged and the controller's own watchdog
    /// is left to stop it.
    pub(super) async fn shut_down(self) {
        let span = self.span.clone();
        self.end().instrument(span).await;
    }

    async fn end(self) {
        self.come_to_rest().await;
        self.remark(EventKind::Ending, "agent ends".to_owned());
        let mut threads = self.threads;
        let ended = tokio::task::spawn_blocking(move || threads.end()).await;
        if !ended.unwrap_or(false) {
            error!("a thread of the agent panicked");
        }
        // The publisher was the only source of loop events, so the desk ends by itself.
        if self.desk.await.is_err() {
            error!("the desk panicked");
        }
        keep_untold_stop(&self.requests, &self.board, &self.keeper);
        if let Err(problem) = self.keeper.end().await {
            warn!(problem, "this end is not kept: the next agent will latch a stop");
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

/// What the threads and tasks of one robot share.
struct Shared {
    boot_id: Uuid,
    gate: Arc<StopGate>,
    watch: Arc<StopWatch>,
    keeper: Arc<StopKeeper>,
    meter: Arc<Meter>,
    /// Where the loop runs.
    runs_on: Arc<Processor>,
    board: Arc<SharedBoard>,
    equipment: Arc<SharedEquipment>,
    changed: Arc<Notify>,
    shutdown: Arc<AtomicBool>,
}

impl Shared {
    async fn new(
        session: &Session,
        robot: &Robot,
        state_dir: Option<&Path>,
    ) -> Result<Self, AgentError> {
        let (keeper, kept) = open_kept(robot, state_dir)?;
        let boot_id = Uuid::now_v7();
        let first = first_snapshot(&robot.params)?;
        let vocabulary = Vocabulary::new(robot.config.robot.clone(), robot.joints.clone());
        let info = robot.info(boot_id);
        let publisher = bus::declare_cached(session, robot, &keys::ROBOT_INFO, 1).await?;
        let gate = Arc::<StopGate>::default();
        let closing = kept.level.map(|level| gate.close(level).count);
        let name = robot.config.robot.clone();
        let now = monotonic();
        let mut board = Board::new(vocabulary, boot_id, first);
        board.stop = StopRecord::from_kept(&kept, closing.unwrap_or_default(), now);
        board.reset_rules = robot.reset_rules.clone();
        board.lease_required = robot.params.lease_required;
        board.stop_sources = StopSources::new(name, robot.stop_sources.clone(), now);
        let watch = Arc::new(StopWatch::new(&board.stop_sources));
        Ok(Self {
            boot_id,
            gate,
            watch,
            keeper: Arc::new(keeper),
            meter: Arc::default(),
            runs_on: Arc::default(),
            board: Arc::new(SharedBoard::new(board)),
            equipment: Arc::new(SharedEquipment::new(robot.book.clone(), info, publisher)),
            changed: Arc::default(),
            shutdown: Arc::default(),
        })
    }

    async fn publisher(
        &self,
        session: &Session,
        robot: &Robot,
        (mailbox, desk, groups): (PublisherEnd, mpsc::Sender<StampedEvent>, Arc<Groups>),
    ) -> Result<Publisher, AgentError> {
        let encoding = robot.config.publish.encoding;
        let (state, joint_states) = (&keys::ROBOT_STATE, &keys::ROBOT_JOINT_STATES);
        let mut classes = Vec::new();
        for (rate_hz, ticks_per_sample) in robot.state_classes() {
            let sender = bus::declare_class(session, robot, rate_hz).await?;
            classes.push(StateClass::new(sender, ticks_per_sample));
        }
        Ok(Publisher {
            mailbox,
            groups,
            board: Arc::clone(&self.board),
            desk,
            state: bus::declare_latest(session, robot, state, encoding).await?,
            joint_states: bus::declare_latest(session, robot, joint_states, encoding).await?,
            classes,
            boot_id: self.boot_id,
            joint_names: robot.joint_names(),
            chains: robot.chain_names(),
            in_force: Arc::clone(&robot.params.equipment),
            equipment: Arc::clone(&self.equipment),
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
        // A press that is latched already is none that is new.
        let kept = self.board.lock().kept();
        let emergency_stop = kept.stops.iter().any(|stop| stop.source == CONTROLLER);
        Ok(LoopThread {
            name: robot.config.robot.to_string(),
            params: robot.params.clone(),
            state: LoopState::new(&robot.params)?,
            link: Link::open(driver.endpoints())?,
            driver,
            mailbox,
            gate: Arc::clone(&self.gate),
            watch: Arc::clone(&self.watch),
            meter: Arc::clone(&self.meter),
            runs_on: Arc::clone(&self.runs_on),
            realtime: robot.config.control.realtime,
            ticks_per_sample: robot.ticks_per_sample(),
            ticks_per_class: robot.state_classes().into_iter().map(|(_, ticks)| ticks).collect(),
            publisher,
            shutdown: Arc::clone(&self.shutdown),
            tape: None,
            save: Arc::default(),
            wake_log: None,
            emergency_stop,
        })
    }

    /// Has the loop recorded, unless the robot file says otherwise.
    fn recorder(
        &self,
        robot: &Robot,
        loop_thread: &mut LoopThread,
    ) -> Result<Option<Recorder>, AgentError> {
        let config = &robot.config.recorder;
        if config.seconds <= 0.0 {
            return Ok(None);
        }
        let (name, params) = (robot.config.robot.clone(), robot.params.clone());
        let empty = LoopState::new(&params)?;
        let (tape, shelf) = Tape::new(&empty, params.period.as_secs_f64(), config.seconds);
        let told = (Arc::clone(&self.board), Arc::clone(&self.changed));
        let (recorder, recordings) = Recordings::new(name, config, params, shelf, told);
        loop_thread.tape = Some(tape);
        loop_thread.save = Arc::clone(&recorder.save);
        // Ends when nobody can ask any more.
        drop(start_task(recordings.run()));
        Ok(Some(recorder))
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
            flapping: Flapping::default(),
            dropped_commands: DroppedCommands::default(),
            cleared,
            gate: Arc::clone(&self.gate),
            keeper: Arc::clone(&self.keeper),
            estop_stops_cell: robot.config.stop.estop_stops_cell,
            untold: None,
        })
    }

    fn requests(
        &self,
        robot: &Robot,
        orders: Producer<LoopRequest>,
        cleared: watch::Receiver<u64>,
        remarks: mpsc::Sender<Remark>,
        (recorder, groups): (Option<Recorder>, Arc<Groups>),
    ) -> Requests {
        Requests {
            board: Arc::clone(&self.board),
            gate: Arc::clone(&self.gate),
            recorder,
            groups,
            own_links: own_links(robot),
            params: robot.params.clone(),
            limits: robot.limits,
            joint_names: robot.joint_names(),
            joint_types: robot.joint_types(),
            orders: Mutex::new(orders),
            prepared: Mutex::default(),
            cleared,
            remarks,
            equipment: Arc::clone(&self.equipment),
            abilities: robot.abilities.clone(),
            planning: tokio::sync::Mutex::default(),
            chain_names: robot.chain_names(),
            waits: Semaphore::new(MAX_WAITS),
            boot_id: self.boot_id,
            keeper: Arc::clone(&self.keeper),
            resetting: tokio::sync::Mutex::default(),
        }
    }

    /// What asks the robot's sources of stops.
    fn stop_sources(&self, session: &Session, desk: mpsc::Sender<IncomingStop>) -> StopSourceAsker {
        StopSourceAsker {
            session: session.clone(),
            board: Arc::clone(&self.board),
            gate: Arc::clone(&self.gate),
            watch: Arc::clone(&self.watch),
            desk,
            changed: Arc::clone(&self.changed),
        }
    }

    /// Has it kept that the loop runs, with what is latched: from here on an end that is not in order
    /// is a stop of the next agent.
    async fn note_running(&self) -> Result<(), AgentError> {
        let number = self.keeper.keep(self.board.lock().kept());
        self.keeper.durable(number).await.map_err(|problem| StateError::NotKept(problem).into())
    }
}

/// Opens the file of the robot's latched stops, with what was latched before.
fn open_kept(robot: &Robot, folder: Option<&Path>) -> Result<(StopKeeper, Kept), AgentError> {
    let name = &robot.config.robot;
    let Some(folder) = folder else {
        info!(robot = %name, "no state folder: a latched stop is over when this agent ends");
        return Ok((StopKeeper::none(), Kept::default()));
    };
    let (file, found) = StopFile::open(folder, name)?;
    let kept = at_start(found);
    Ok((StopKeeper::start(file, kept.clone()), kept))
}

/// Keeps what is latched when nobody writes stops down any more: also a stop that came in since, and
/// one whose reset was under way, which opens the gate no more.
fn keep_untold_stop(requests: &Requests, board: &SharedBoard, keeper: &StopKeeper) {
    let gate = &requests.gate;
    let board = board.lock();
    let told = board.stop.as_ref().map(|stop| stop.gate_count);
    let kept = board.kept();
    keeper.keep(match gate.level().filter(|_| told < Some(gate.count())) {
        Some(level) => untold(kept, level, "a stop came in while the agent ended"),
        None => kept,
    });
}

/// The robot's own links, if they have shapes that can be used.
fn own_links(robot: &Robot) -> Option<Arc<SelfCollision>> {
    match SelfCollision::of(&robot.model, &robot.joint_names()) {
        Ok(own) => own.map(Arc::new),
        Err(error) => {
            warn!(%error, "the robot's own links are not checked: a shape cannot be used");
            None
        }
    }
}

/// The snapshot before the first tick: what a step says that knows nothing.
fn first_snapshot(params: &Params) -> Result<crate::control::Snapshot, AgentError> {
    let mut state = LoopState::new(params)?;
    let mut input = Input::at(monotonic());
    Ok(step(params, &mut state, &mut input).snapshot)
}

#[expect(clippy::disallowed_methods, reason = "the runtime is where tasks are started")]
fn start_task(task: impl Future<Output = ()> + Send + 'static) -> Task<()> {
    tokio::spawn(task)
}
