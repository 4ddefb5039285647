//! The methods under `rpc/`: requests become orders for the loop, its answers become replies.

mod equipment;
mod group;
mod jog;
mod kinematics;
mod lease;
mod modes;
mod prepare;
mod program;
mod recording;
mod reset;
mod trajectory;
mod values;
mod wait;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use armada_model::{JointType, MotionLimits};
use armada_protocol::messages::{
    Accepted, ActionStatus, Denial, DenialCode, EventKind, Executor, MotionKind, MotionStatus,
    Request, Severity,
};
use armada_protocol::method::{Method, robot};
use armada_protocol::serve::{Call, Handler};
use rtrb::Producer;
use serde_json::{Map, Value};
use tokio::sync::{Semaphore, mpsc, watch};
use uuid::Uuid;

use self::prepare::PreparedMotion;
pub(super) use self::wait::MAX_WAITS;
use super::board::{Board, SharedBoard};
use super::clock::monotonic;
use super::desk::Remark;
use super::equipment::SharedEquipment;
use super::groups::Groups;
use super::motion_log::queued;
use super::recordings::Recorder;
use super::self_collision::SelfCollision;
use super::stop_gate::StopGate;
use super::stop_keeper::StopKeeper;
use crate::control::{Granted, LoopRequest, Order, Params};
use crate::drivers::Abilities;

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
    pub(super) chain_names: Vec<String>,
    pub(super) orders: Mutex<Producer<LoopRequest>>,
    pub(super) prepared: Mutex<HashMap<Uuid, PreparedMotion>>,
    /// Places for requests that are answered at the end of their motion.
    pub(super) waits: Semaphore,
    pub(super) cleared: watch::Receiver<u64>,
    pub(super) remarks: mpsc::Sender<Remark>,
    pub(super) equipment: Arc<SharedEquipment>,
    pub(super) abilities: Abilities,
    /// Held while a single move is planned and handed over.
    pub(super) planning: tokio::sync::Mutex<()>,
    pub(super) boot_id: Uuid,
    pub(super) keeper: Arc<StopKeeper>,
    /// Held by a reset.
    pub(super) resetting: tokio::sync::Mutex<()>,
    /// None if nothing is recorded.
    pub(super) recorder: Option<Recorder>,
    /// The keys of motions of several robots.
    pub(super) groups: Arc<Groups>,
    /// The robot's own links, if they have shapes.
    pub(super) own_links: Option<Arc<SelfCollision>>,
}

/// Who asks, and under which lease.
struct Asker {
    client: String,
    lease: Option<Uuid>,
}

impl Asker {
    fn of<P>(request: Request<P>) -> (Self, P) {
        let Request { client, lease, params, .. } = request;
        (Self { client, lease }, params)
    }

    /// The agent itself, when it ends.
    fn agent() -> Self {
        Self { client: "agent".to_owned(), lease: None }
    }
}

/// A motion that is about to be handed to the loop.
struct NewMotion {
    id: Uuid,
    kind: MotionKind,
    executor: Executor,
    duration_s: f64,
    waypoint_count: u32,
}

/// Leads each method to its function.
macro_rules! dispatch {
    ($requests:ident, $call:ident; $($method:ident => $function:ident,)+) => {
        match $call.method() {
            $(robot::$method::NAME => {
                $call
                    .run::<robot::$method, _, _>(async |request| {
                        let (asker, params) = Asker::of(request);
                        $requests.$function(asker, params).await
                    })
                    .await
            })+
            _ => Err($call.unknown_method(&names())),
        }
    };
}

impl Handler for Requests {
    /// What ends a motion does not wait behind anything.
    fn is_urgent(&self, method: &str) -> bool {
        [robot::Halt::NAME, robot::Cancel::NAME, robot::Abort::NAME, robot::Pause::NAME]
            .contains(&method)
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
        dispatch! { self, call;
            AcquireLease => acquire_lease,
            RenewLease => renew_lease,
            ReleaseLease => release_lease,
            TakeLease => take_lease,
            DelegateLease => delegate_lease,
            SetMode => set_mode,
            Halt => halt_by,
            Enable => enable,
            Disable => disable,
            ResetErrors => reset_errors,
            Reset => reset,
            Home => home,
            JogFreespace => jog_freespace,
            JogJoint => jog_joint,
            JogCartesian => jog_cartesian,
            ExecuteTrajectory => execute_trajectory,
            MoveJoint => move_joint,
            MovePose => move_pose,
            MoveLinear => move_linear,
            MoveHome => move_home,
            Cancel => cancel,
            Pause => pause,
            Resume => resume,
            SetSpeedRatio => set_speed_ratio,
            AttachTool => attach_tool,
            DetachTool => detach_tool,
            AttachPayload => attach_payload,
            DetachPayload => detach_payload,
            GetParam => get_param,
            SetParam => set_param,
            GetSignal => get_signal,
            SetSignal => set_signal,
            ForwardKinematics => forward_kinematics,
            InverseKinematics => inverse_kinematics,
            Prepare => prepare,
            Commit => commit,
            Abort => abort,
            SaveRecording => save_recording,
        }
    }

    /// Begins the log of a motion, hands it to the loop, and takes the log back if it refuses.
    async fn start(
        &self,
        asker: &Asker,
        motion: NewMotion,
        order: Order,
    ) -> Result<Accepted, Denial> {
        let (id, duration_s) = (motion.id, motion.duration_s);
        let end = match &order {
            Order::Follow(order) => Some(order.trajectory.end()),
            _ => None,
        };
        self.begin(asker, motion)?;
        match self.ask(asker, order, LOOP_PATIENCE).await {
            Ok(Granted { epoch, .. }) => {
                if let Some(end) = end {
                    self.board.lock().connected.note_end(id, end);
                }
                // Only the loop knows how long a jog takes; its snapshot came before its answer.
                let known = self.board.lock().snapshot.motion.filter(|motion| motion.id == id);
                let duration_s = known.map_or(duration_s, |motion| motion.duration_s);
                Ok(Accepted { motion_id: id, duration_s, epoch, status: None })
            }
            Err(denial) => {
                // A loop that is late may have begun it all the same: then it is ended, and its
                // status stays on record.
                let late = denial.code == DenialCode::Timeout;
                if !(late && self.ask(asker, Order::Cancel(id), LOOP_PATIENCE).await.is_ok()) {
                    self.board.lock().motions.withdraw(id);
                }
                Err(denial)
            }
        }
    }

    /// Begins the log of a motion, under one lock with the look whether its id is new.
    fn begin(&self, asker: &Asker, motion: NewMotion) -> Result<(), Denial> {
        let mut board = self.board.lock();
        check_new(&board, motion.id)?;
        let status = MotionStatus {
            id: motion.id,
            robot: board.vocabulary.robot.clone(),
            boot_id: self.boot_id,
            seqno: 0,
            stamp_ns: monotonic(),
            kind: motion.kind,
            executor: motion.executor,
            status: ActionStatus::Queued,
            reason: None,
            client: asker.client.clone(),
            epoch: board.snapshot.epoch,
            started_ns: None,
            elapsed_s: 0.0,
            duration_s: motion.duration_s,
            waypoint: 0,
            waypoint_count: motion.waypoint_count,
            group: None,
        };
        board.motions.begin(queued(status));
        Ok(())
    }

    /// Hands an order to the loop and waits for its answer.
    async fn ask(
        &self,
        asker: &Asker,
        order: Order,
        patience: Duration,
    ) -> Result<Granted, Denial> {
        let (ticket, answered) = self.board.lock().take_ticket();
        let until = Some(monotonic() + patience);
        let pushed = {
            let mut orders = self.orders.lock().unwrap_or_else(PoisonError::into_inner);
            orders.push(LoopRequest { ticket, lease: asker.lease, until, order }).is_ok()
        };
        if !pushed {
            self.board.lock().tickets.remove(&ticket);
            return Err(Denial::new(DenialCode::Busy, "too many requests wait for the loop"));
        }
        match tokio::time::timeout(patience, answered).await {
            Ok(Ok(Ok(granted))) => Ok(granted),
            Ok(Ok(Err(refusal))) => Err(self.board.lock().denial(&refusal)),
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
        self.tell(remark);
    }

    /// Hands something to the desk to be recorded as an event.
    fn tell(&self, remark: Remark) {
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
