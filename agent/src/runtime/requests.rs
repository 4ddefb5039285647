//! The methods under `rpc/`: requests become orders for the loop, its answers become replies.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use armada_model::{
    CompiledTrajectory, JointTrajectory, JointType, JointVector, MonoTime, MotionLimits, Tolerance,
    TrajectoryContext, TrajectoryOptions,
};
use armada_protocol::messages::{
    Accepted, ActionStatus, CancelParams, CommandMode, CommitParams, Denial, DenialCode, Empty,
    EventKind, ExecuteTrajectoryParams, HaltAnswer, JogFreespaceParams, ModeAnswer, MotionKind,
    MotionStatus, Prepared, ResetAnswer, ResetParams, Severity,
};
use armada_protocol::method::{Method, robot};
use armada_protocol::serve::{Call, Handler};
use rtrb::Producer;
use serde_json::{Map, Value};
use tokio::sync::{mpsc, watch};
use uuid::Uuid;

use super::board::{Board, SharedBoard};
use super::clock::monotonic;
use super::desk::Remark;
use super::motion_log::queued;
use super::stop_gate::StopGate;
use super::words::{trajectory_denial, velocity_tolerance_denial, wide_tolerance_denial};
use crate::control::{FollowOrder, Granted, JogOrder, LoopRequest, Order, Params, Refusal};

/// How long a prepared motion is kept for its commit.
const PREPARED_TTL: Duration = Duration::from_secs(5);
/// Prepared motions that are kept at once.
const MAX_PREPARED: usize = 8;
/// How long the loop has to answer what it does within a few ticks.
const LOOP_PATIENCE: Duration = Duration::from_millis(1500);

/// Answers the methods of one robot.
pub(super) struct Requests {
    pub(super) board: Arc<SharedBoard>,
    pub(super) gate: Arc<StopGate>,
    pub(super) params: Params,
    pub(super) limits: MotionLimits,
    pub(super) joint_names: Vec<String>,
    pub(super) joint_types: Vec<JointType>,
    pub(super) orders: Mutex<Producer<LoopRequest>>,
    pub(super) prepared: Mutex<HashMap<Uuid, PreparedMotion>>,
    pub(super) cleared: watch::Receiver<u64>,
    pub(super) remarks: mpsc::Sender<Remark>,
    pub(super) boot_id: Uuid,
}

/// A valid trajectory that waits for its commit.
pub(super) struct PreparedMotion {
    trajectory: Arc<CompiledTrajectory>,
    epoch: u64,
    expires: MonoTime,
}

/// A motion that is about to be handed to the loop.
struct NewMotion {
    id: Uuid,
    kind: MotionKind,
    client: String,
    duration_s: f64,
    waypoint_count: u32,
}

impl Handler for Requests {
    /// What ends a motion does not wait behind anything.
    fn is_urgent(&self, method: &str) -> bool {
        [robot::Halt::NAME, robot::Cancel::NAME, robot::Abort::NAME].contains(&method)
    }

    async fn handle(&self, call: Call) -> Result<Value, Denial> {
        let method = call.method().to_owned();
        let result = self.dispatch(call).await;
        if let Err(denial) = &result {
            self.board.lock().count_denied(denial.code);
            self.remark(&method, denial);
        }
        result
    }
}

impl Requests {
    async fn dispatch(&self, call: Call) -> Result<Value, Denial> {
        use robot::{
            Abort, Cancel, Commit, Disable, Enable, ExecuteTrajectory, Halt, JogFreespace, Prepare,
            Reset, ResetErrors, SetMode,
        };
        match call.method() {
            SetMode::NAME => {
                call.run::<SetMode, _, _>(async |request| {
                    self.mode(Order::SetMode(request.params.mode), SetMode::TIMEOUT).await
                })
                .await
            }
            Halt::NAME => call.run::<Halt, _, _>(async |_| self.halt().await).await,
            Enable::NAME => {
                call.run::<Enable, _, _>(async |_| self.mode(Order::Enable, Enable::TIMEOUT).await)
                    .await
            }
            Disable::NAME => {
                call.run::<Disable, _, _>(async |_| {
                    self.mode(Order::Disable, Disable::TIMEOUT).await
                })
                .await
            }
            ResetErrors::NAME => {
                call.run::<ResetErrors, _, _>(async |_| {
                    self.mode(Order::ResetErrors, ResetErrors::TIMEOUT).await
                })
                .await
            }
            Reset::NAME => {
                call.run::<Reset, _, _>(async |request| self.reset(&request.params).await).await
            }
            JogFreespace::NAME => {
                call.run::<JogFreespace, _, _>(async |request| {
                    self.jog(request.client, request.params).await
                })
                .await
            }
            ExecuteTrajectory::NAME => {
                call.run::<ExecuteTrajectory, _, _>(async |request| {
                    self.execute(request.client, request.params).await
                })
                .await
            }
            Cancel::NAME => {
                call.run::<Cancel, _, _>(async |request| self.cancel(&request.params).await).await
            }
            Prepare::NAME => {
                call.run::<Prepare, _, _>(async |request| self.prepare(&request.params)).await
            }
            Commit::NAME => {
                call.run::<Commit, _, _>(async |request| {
                    self.commit(request.client, request.params).await
                })
                .await
            }
            Abort::NAME => {
                call.run::<Abort, _, _>(async |request| self.abort(&request.params).await).await
            }
            _ => Err(call.unknown_method(&names())),
        }
    }

    async fn mode(&self, order: Order, patience: Duration) -> Result<ModeAnswer, Denial> {
        let Granted { epoch, command_mode } = self.ask(order, patience).await?;
        Ok(ModeAnswer { command_mode, epoch })
    }

    /// Ramps to standstill and stays in halt.
    pub(super) async fn halt(&self) -> Result<HaltAnswer, Denial> {
        let Granted { epoch, .. } = self.ask(Order::Halt, LOOP_PATIENCE).await?;
        Ok(HaltAnswer { epoch })
    }

    async fn reset(&self, params: &ResetParams) -> Result<ResetAnswer, Denial> {
        let mut cleared_count = self.cleared.clone();
        cleared_count.mark_unchanged();
        let cleared = {
            let mut board = self.board.lock();
            let Some(record) = &board.stop else {
                let epoch = board.snapshot.epoch;
                return Ok(ResetAnswer { cleared: Vec::new(), epoch });
            };
            let latched: Vec<Uuid> = record.stops.iter().map(|s| s.stop.stop_id).collect();
            let missing: Vec<&Uuid> =
                latched.iter().filter(|id| !params.stop_ids.contains(id)).collect();
            if !missing.is_empty() {
                return Err(unlisted(&missing));
            }
            if !self.gate.open(record.gate_count) {
                return Err(board
                    .vocabulary
                    .stopped(record.level)
                    .with("why", "a new stop came in"));
            }
            board.stop = None;
            board.stages.clear();
            latched
        };
        let waited = tokio::time::timeout(LOOP_PATIENCE, cleared_count.changed()).await;
        if !matches!(waited, Ok(Ok(()))) {
            return Err(Denial::new(DenialCode::Timeout, "the control loop does not answer"));
        }
        Ok(ResetAnswer { cleared, epoch: self.board.lock().snapshot.epoch })
    }

    async fn jog(&self, client: String, params: JogFreespaceParams) -> Result<Accepted, Denial> {
        let fastest = self.limits.iter().map(|axis| axis.velocity).collect::<Vec<_>>();
        let fastest = JointVector::from_slice(&fastest).unwrap_or_default();
        let order = JogOrder {
            id: params.motion_id.unwrap_or_else(Uuid::now_v7),
            joint_position: params.joint_position_rad,
            max_velocity: params.max_velocity_rad_s.unwrap_or(fastest),
        };
        let motion = NewMotion {
            id: order.id,
            kind: MotionKind::JogFreespace,
            client,
            duration_s: 0.0,
            waypoint_count: 0,
        };
        self.start(motion, Order::Jog(order)).await
    }

    async fn execute(
        &self,
        client: String,
        params: ExecuteTrajectoryParams,
    ) -> Result<Accepted, Denial> {
        let trajectory = self.compile(&params.trajectory)?;
        let id = params.motion_id.unwrap_or_else(Uuid::now_v7);
        self.follow(client, FollowOrder { id, trajectory, start: None, epoch: None }).await
    }

    async fn follow(&self, client: String, order: FollowOrder) -> Result<Accepted, Denial> {
        let motion = NewMotion {
            id: order.id,
            kind: MotionKind::Trajectory,
            client,
            duration_s: order.trajectory.duration_s(),
            waypoint_count: u32::try_from(order.trajectory.waypoint_count()).unwrap_or(u32::MAX),
        };
        self.start(motion, Order::Follow(order)).await
    }

    async fn cancel(&self, params: &CancelParams) -> Result<Empty, Denial> {
        self.ask(Order::Cancel(params.motion_id), LOOP_PATIENCE).await?;
        Ok(Empty {})
    }

    fn prepare(&self, params: &ExecuteTrajectoryParams) -> Result<Prepared, Denial> {
        let trajectory = self.compile(&params.trajectory)?;
        let epoch = self.check_ready_to_follow(&trajectory)?;
        let now = monotonic();
        let motion_id = params.motion_id.unwrap_or_else(Uuid::now_v7);
        let duration_s = trajectory.duration_s();
        let mut prepared = self.prepared.lock().unwrap_or_else(PoisonError::into_inner);
        prepared.retain(|_, motion| motion.expires > now);
        if prepared.len() >= MAX_PREPARED {
            return Err(Denial::new(
                DenialCode::Busy,
                format!("{MAX_PREPARED} motions are prepared already: commit or abort one"),
            ));
        }
        check_new(&self.board.lock(), motion_id)?;
        prepared
            .insert(motion_id, PreparedMotion { trajectory, epoch, expires: now + PREPARED_TTL });
        let ttl_ms = u64::try_from(PREPARED_TTL.as_millis()).unwrap_or(u64::MAX);
        Ok(Prepared { motion_id, duration_s, epoch, ttl_ms })
    }

    async fn commit(&self, client: String, params: CommitParams) -> Result<Accepted, Denial> {
        if params.boot_id != self.boot_id {
            return Err(Denial::new(
                DenialCode::InvalidArgument,
                "start_ns is of another run of this agent: measure its clock again",
            )
            .with("boot_id", self.boot_id.to_string()));
        }
        let prepared = self.take_prepared(params.motion_id).ok_or_else(|| {
            Denial::new(
                DenialCode::NotAttached,
                format!("motion {} is not prepared, or its time is over", params.motion_id),
            )
        })?;
        let order = FollowOrder {
            id: params.motion_id,
            trajectory: prepared.trajectory,
            start: Some(params.start_ns),
            epoch: Some(prepared.epoch),
        };
        self.follow(client, order).await
    }

    async fn abort(&self, params: &CancelParams) -> Result<Empty, Denial> {
        if self.take_prepared(params.motion_id).is_some() {
            return Ok(Empty {});
        }
        self.cancel(params).await
    }

    fn take_prepared(&self, id: Uuid) -> Option<PreparedMotion> {
        let mut prepared = self.prepared.lock().unwrap_or_else(PoisonError::into_inner);
        prepared.remove(&id).filter(|motion| motion.expires > monotonic())
    }

    fn compile(&self, trajectory: &JointTrajectory) -> Result<Arc<CompiledTrajectory>, Denial> {
        let context = TrajectoryContext {
            joint_order: &self.joint_names,
            joint_types: Some(&self.joint_types),
            limits: &self.limits,
        };
        let compiled =
            CompiledTrajectory::compile_for(trajectory, &context, &TrajectoryOptions::default())
                .map_err(|error| trajectory_denial(&error))?;
        self.check_tolerances(&compiled)?;
        Ok(Arc::new(compiled))
    }

    /// Refuses tolerances that the loop would not keep: wider than the robot's own, or of velocity.
    fn check_tolerances(&self, trajectory: &CompiledTrajectory) -> Result<(), Denial> {
        let names = &self.joint_names;
        for waypoint in 0..trajectory.waypoint_count() {
            let Tolerance { position, velocity, .. } = trajectory.tolerance(waypoint);
            if !velocity.is_empty() {
                return Err(velocity_tolerance_denial(waypoint));
            }
            let rows = position.iter().zip(self.params.tracking_tolerance.iter()).zip(names);
            for ((&value, &limit), joint) in rows {
                if value > limit {
                    return Err(wide_tolerance_denial(waypoint, joint, value, limit));
                }
            }
        }
        Ok(())
    }

    /// Looks at once whether a trajectory could start now; returns the epoch it could start in.
    /// The loop looks again when it starts.
    fn check_ready_to_follow(&self, trajectory: &CompiledTrajectory) -> Result<u64, Denial> {
        let board = self.board.lock();
        let snapshot = &board.snapshot;
        let refuse = |refusal| Err(board.vocabulary.denial(&refusal));
        if let Some(level) = self.gate.level() {
            return refuse(Refusal::Stopped(level));
        }
        if let Some(fault) = board.faults.first() {
            return refuse(Refusal::Faulted(fault.code));
        }
        let (mode, needed) = (snapshot.command_mode, CommandMode::Trajectory);
        if mode != needed {
            return refuse(Refusal::WrongMode { mode, needed });
        }
        if let Some(motion) = snapshot.motion {
            return refuse(Refusal::Busy(motion.id));
        }
        let (start, measured) = (trajectory.start(), snapshot.joint_position);
        let distances = start.iter().zip(measured.iter()).map(|(a, b)| (a - b).abs());
        for (joint, (value, &limit)) in
            distances.zip(self.params.start_tolerance.iter()).enumerate()
        {
            if value > limit {
                return refuse(Refusal::StartTolerance { joint, value, limit });
            }
        }
        Ok(snapshot.epoch)
    }

    /// Begins the log of a motion, hands it to the loop, and takes the log back if it refuses.
    async fn start(&self, motion: NewMotion, order: Order) -> Result<Accepted, Denial> {
        let (id, duration_s) = (motion.id, motion.duration_s);
        self.begin(motion)?;
        match self.ask(order, LOOP_PATIENCE).await {
            Ok(Granted { epoch, .. }) => {
                // Only the loop knows how long a jog takes; its snapshot came before its answer.
                let known = self.board.lock().snapshot.motion.filter(|motion| motion.id == id);
                let duration_s = known.map_or(duration_s, |motion| motion.duration_s);
                Ok(Accepted { motion_id: id, duration_s, epoch })
            }
            Err(denial) => {
                // A loop that is late may have begun it all the same: then it is ended, and its
                // status stays on record.
                let late = denial.code == DenialCode::Timeout;
                if !(late && self.ask(Order::Cancel(id), LOOP_PATIENCE).await.is_ok()) {
                    self.board.lock().motions.withdraw(id);
                }
                Err(denial)
            }
        }
    }

    /// Begins the log of a motion, under one lock with the look whether its id is new.
    fn begin(&self, motion: NewMotion) -> Result<(), Denial> {
        let mut board = self.board.lock();
        check_new(&board, motion.id)?;
        let status = MotionStatus {
            id: motion.id,
            robot: board.vocabulary.robot.clone(),
            boot_id: self.boot_id,
            seqno: 0,
            stamp_ns: monotonic(),
            kind: motion.kind,
            status: ActionStatus::Queued,
            reason: None,
            client: motion.client,
            epoch: board.snapshot.epoch,
            started_ns: None,
            elapsed_s: 0.0,
            duration_s: motion.duration_s,
            waypoint: 0,
            waypoint_count: motion.waypoint_count,
        };
        board.motions.begin(queued(status));
        Ok(())
    }

    /// Hands an order to the loop and waits for its answer.
    async fn ask(&self, order: Order, patience: Duration) -> Result<Granted, Denial> {
        let (ticket, answered) = self.board.lock().take_ticket();
        let pushed = {
            let mut orders = self.orders.lock().unwrap_or_else(PoisonError::into_inner);
            orders.push(LoopRequest { ticket, order }).is_ok()
        };
        if !pushed {
            self.board.lock().tickets.remove(&ticket);
            return Err(Denial::new(DenialCode::Busy, "too many requests wait for the loop"));
        }
        match tokio::time::timeout(patience, answered).await {
            Ok(Ok(Ok(granted))) => Ok(granted),
            Ok(Ok(Err(refusal))) => Err(self.board.lock().vocabulary.denial(&refusal)),
            Ok(Err(_)) | Err(_) => {
                self.board.lock().tickets.remove(&ticket);
                Err(Denial::new(DenialCode::Timeout, "the control loop does not answer"))
            }
        }
    }

    fn remark(&self, method: &str, denial: &Denial) {
        let remark = Remark {
            severity: Severity::Info,
            kind: EventKind::Denied,
            message: format!("{method}: {}", denial.message),
            details: Map::from_iter([("code".to_owned(), Value::from(denial.code.as_str()))]),
        };
        // Denials may come in floods; those beyond the queue are only counted.
        drop(self.remarks.try_send(remark));
    }
}

/// Refuses an id that another motion has.
fn check_new(board: &Board, id: Uuid) -> Result<(), Denial> {
    if board.motions.find(id).is_none() {
        return Ok(());
    }
    Err(Denial::new(
        DenialCode::InvalidArgument,
        format!("motion_id {id} was used for another motion"),
    )
    .with("field", "motion_id"))
}

/// Names of the methods of an agent.
pub(super) fn names() -> Vec<&'static str> {
    robot::ALL.iter().map(|row| row.name).collect()
}

fn unlisted(missing: &[&Uuid]) -> Denial {
    let ids: Vec<String> = missing.iter().map(ToString::to_string).collect();
    Denial::new(
        DenialCode::InvalidArgument,
        format!("the reset must list every latched stop, it lacks {}", ids.join(", ")),
    )
    .with("field", "stop_ids")
    .with("missing", ids)
}
