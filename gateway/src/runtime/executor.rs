//! The task that owns the coordinator and the world.

use std::collections::BTreeMap;
use std::future::Future;
use std::pin::pin;
use std::sync::atomic::Ordering;
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::codec::{CodecError, MAX_MESSAGE_BYTES, WireEncoding};
use armada_protocol::keys;
use armada_protocol::messages::{
    CellFrames, Denial, DenialCode, Event, MotionStatus, RobotInfo, RobotState, RobotStatus,
    StopAck, StopRequest,
};
use serde::de::DeserializeOwned;
use tokio::sync::oneshot;
use tokio::task::{JoinError, JoinSet, spawn_blocking};
use tokio::time::{MissedTickBehavior, interval, sleep_until, timeout};
use tracing::warn;
use uuid::Uuid;
use zenoh::Session;
use zenoh::sample::Sample;

use super::asks::{self, Answer, Ask};
use super::clock::{instant_of, monotonic};
use super::intake::{Intake, Slots};
use super::outlet::Outlet;
use super::requests::{Order, Orders};
use crate::coordinator::{Action, AgentAnswer, CellAnswer, CheckId, Coordinator, Input, Ticket};
use crate::world::{ClearanceReport, ClearanceRequest, World};

/// Period of `cell/frames`, and of taking states: 30 Hz.
const FRAME_PERIOD: Duration = Duration::from_micros(33_333);
/// How long what is in progress may take to end when the gateway ends.
const ENDING_PATIENCE: Duration = Duration::from_millis(1_500);
/// Least time between two warnings of one kind.
const WARNING_PERIOD: Duration = Duration::from_secs(5);

/// What the executor listens to.
pub(super) struct Inboxes {
    pub(super) intake: Intake,
    pub(super) orders: Orders,
}

pub(super) struct Executor {
    session: Session,
    coordinator: Coordinator,
    world: World,
    outlet: Outlet,
    questions: JoinSet<Answer>,
    /// Checks of clearances, each on a thread of its own.
    checks: JoinSet<(CheckId, Result<ClearanceReport, Denial>)>,
    /// Clients that wait for their answer.
    tickets: BTreeMap<Ticket, oneshot::Sender<Result<CellAnswer, Denial>>>,
    next_ticket: u64,
    /// Run and revision of the descriptions in the world.
    models: BTreeMap<RobotName, (Uuid, u64)>,
    frames_seqno: u64,
    /// Samples that were not messages, and when that was last told, by kind.
    malformed: BTreeMap<&'static str, (u64, armada_model::MonoTime)>,
}

impl Executor {
    pub(super) fn new(
        session: Session,
        coordinator: Coordinator,
        world: World,
        outlet: Outlet,
    ) -> Self {
        Self {
            session,
            coordinator,
            world,
            outlet,
            questions: JoinSet::new(),
            checks: JoinSet::new(),
            tickets: BTreeMap::new(),
            next_ticket: 0,
            models: BTreeMap::new(),
            frames_seqno: 0,
            malformed: BTreeMap::new(),
        }
    }

    /// Runs until `shutdown` is done, and then until what is in progress has ended.
    pub(super) async fn run(mut self, mut inboxes: Inboxes, shutdown: impl Future<Output = ()>) {
        let mut shutdown = pin!(shutdown);
        let mut frames = interval(FRAME_PERIOD);
        frames.set_missed_tick_behavior(MissedTickBehavior::Skip);
        self.handle(Input::Timer).await;
        loop {
            let deadline = instant_of(self.coordinator.next_deadline());
            let Inboxes { intake, orders } = &mut inboxes;
            tokio::select! {
                // Stops come first; the end comes before ordinary work.
                biased;
                Some(sample) = intake.stops.recv() => self.take_stop(&sample).await,
                Some(order) = orders.stops.recv() => self.take_order(order).await,
                () = &mut shutdown => break,
                answer = next_of(&mut self.questions) => self.take_answer(answer).await,
                result = next_of(&mut self.checks) => self.take_check(result).await,
                () = intake.slots.wake.notified() => self.take_slots(&intake.slots).await,
                Some(sample) = intake.motions.recv() => self.take_motion(&sample).await,
                Some(order) = orders.others.recv() => self.take_order(order).await,
                Some(sample) = intake.events.recv() => self.take_event(&sample).await,
                _ = frames.tick() => self.take_states(&intake.slots).await,
                () = sleep_until(deadline) => self.handle(Input::Timer).await,
            }
        }
        self.handle(Input::Ending).await;
        if timeout(ENDING_PATIENCE, self.wind_up(&mut inboxes)).await.is_err() {
            warn!("the gateway ends although something is still in progress");
        }
    }

    /// Goes on, without taking requests, until nothing is in progress.
    async fn wind_up(&mut self, inboxes: &mut Inboxes) {
        while !self.coordinator.is_idle() {
            let deadline = instant_of(self.coordinator.next_deadline());
            let Inboxes { intake, .. } = &mut *inboxes;
            tokio::select! {
                biased;
                Some(sample) = intake.stops.recv() => self.take_stop(&sample).await,
                answer = next_of(&mut self.questions) => self.take_answer(answer).await,
                Some(sample) = intake.motions.recv() => self.take_motion(&sample).await,
                () = sleep_until(deadline) => self.handle(Input::Timer).await,
            }
        }
    }

    async fn handle(&mut self, input: Input) {
        for action in self.coordinator.handle(monotonic(), input) {
            match action {
                Action::PublishStop(request) => self.outlet.publish_stop(&request),
                Action::Ask { ask, robot, client, lease, call, timeout } => {
                    let question = Ask { ask, robot, client, lease, call, timeout };
                    self.questions.spawn(asks::ask(self.session.clone(), question));
                }
                Action::Answer { ticket, result } => {
                    if let Some(answer) = self.tickets.remove(&ticket) {
                        // The client may have stopped waiting.
                        drop(answer.send(result));
                    }
                }
                Action::CheckClearance { check, request } => self.check(check, &request),
                Action::PublishStatus(status) => self.outlet.publish_status(*status).await,
                Action::PublishMotion(status) => self.outlet.publish_motion(*status),
                Action::PublishEvent(event) => self.outlet.publish_event(*event).await,
            }
        }
    }

    /// Works out a clearance on a thread of its own.
    fn check(&mut self, check: CheckId, request: &ClearanceRequest) {
        let problem = self.world.clearance(request);
        self.checks.spawn(async move {
            let result = match problem {
                Ok(problem) => spawn_blocking(move || problem.solve()).await.unwrap_or_else(|_| {
                    let message = "the check of the clearance failed";
                    Err(Denial::new(DenialCode::Internal, message))
                }),
                Err(denial) => Err(denial),
            };
            (check, result)
        });
    }

    async fn take_check(
        &mut self,
        result: Result<(CheckId, Result<ClearanceReport, Denial>), JoinError>,
    ) {
        match result {
            Ok((check, result)) => self.handle(Input::Clearance { check, result }).await,
            // Whoever waits for it has a deadline of its own.
            Err(error) => warn!(%error, "a check of a clearance failed"),
        }
    }

    async fn take_order(&mut self, order: Order) {
        let Order { client, request, answer } = order;
        let ticket = Ticket(self.next_ticket);
        self.next_ticket += 1;
        self.tickets.insert(ticket, answer);
        self.handle(Input::Request { ticket, client, request }).await;
    }

    async fn take_answer(&mut self, answer: Result<Answer, JoinError>) {
        match answer {
            Ok((ask, result)) => {
                if let Ok(AgentAnswer::Info(info)) = &result {
                    self.take_model(info).await;
                }
                self.handle(Input::Answer { ask, result }).await;
            }
            // Its question has a deadline of its own in the coordinator's machines.
            Err(error) => warn!(%error, "a question to an agent failed"),
        }
    }

    async fn take_stop(&mut self, sample: &Sample) {
        if sample.key_expr().as_str() == keys::CELL_STOP.any() {
            if let Some(request) = self.decoded::<StopRequest>("stop", sample) {
                self.handle(Input::CellStop(request)).await;
            }
        } else if let Some(ack) = self.decoded::<StopAck>("stop/ack", sample)
            && self.is_of(&ack.robot, "stop/ack", sample)
        {
            self.handle(Input::StopAck(ack)).await;
        }
    }

    async fn take_motion(&mut self, sample: &Sample) {
        if let Some(status) = self.decoded::<MotionStatus>("motions", sample)
            && self.is_of(&status.robot, "motions", sample)
        {
            self.handle(Input::Motion(Box::new(status))).await;
        }
    }

    async fn take_event(&mut self, sample: &Sample) {
        if let Some(event) = self.decoded::<Event>("events", sample)
            && let Some(robot) = &event.robot
            && self.is_of(robot, "events", sample)
        {
            self.handle(Input::RobotEvent(Box::new(event))).await;
        }
    }

    async fn take_slots(&mut self, slots: &Slots) {
        let mut taken = Vec::new();
        for (robot, mut slot) in slots.each() {
            taken.push((robot.clone(), slot.online.take(), slot.info.take(), slot.status.take()));
        }
        for (robot, online, info, status) in taken {
            if let Some(online) = online {
                self.handle(Input::Presence { robot, online }).await;
            }
            if let Some(sample) = info
                && let Some(info) = self.decoded::<RobotInfo>("info", &sample)
                && self.is_of(&info.robot, "info", &sample)
            {
                self.take_model(&info).await;
                self.handle(Input::Info(Box::new(info))).await;
            }
            if let Some(sample) = status
                && let Some(status) = self.decoded::<RobotStatus>("status", &sample)
                && self.is_of(&status.robot, "status", &sample)
            {
                self.handle(Input::Status(Box::new(status))).await;
            }
        }
        self.warn_of_losses(slots);
    }

    /// Takes the newest states, and tells where the links are.
    async fn take_states(&mut self, slots: &Slots) {
        let mut taken = Vec::new();
        for (robot, mut slot) in slots.each() {
            if let Some(sample) = slot.state.take() {
                let arrivals = std::mem::take(&mut slot.arrivals);
                taken.push((robot.clone(), sample, slot.arrived, arrivals));
            }
        }
        for (robot, sample, arrived, arrivals) in taken {
            if let Some(state) = self.decoded::<RobotState>("state", &sample) {
                self.world.set_positions(&robot, &state.joint_position_rad);
                let state = Box::new(state);
                self.handle(Input::State { robot, state, arrived, arrivals }).await;
            }
        }
        if self.outlet.wants_frames() {
            self.publish_frames();
        }
    }

    fn publish_frames(&mut self) {
        let now = monotonic();
        let Some(moved) = self.world.frames(now) else { return };
        self.outlet.publish_frames(&CellFrames {
            boot_id: self.outlet.boot_id(),
            seqno: self.frames_seqno,
            stamp_ns: now,
            full: moved.full,
            frames: moved.frames,
        });
        self.frames_seqno += 1;
    }

    /// Takes a description into the world, unless it is there already.
    async fn take_model(&mut self, info: &RobotInfo) {
        let revision = (info.boot_id, info.model_rev);
        if self.models.insert(info.robot.clone(), revision) == Some(revision) {
            return;
        }
        for error in self.world.set_model(info) {
            let (robot, message) = (info.robot.clone(), error.to_string());
            self.handle(Input::ModelRejected { robot, message }).await;
        }
    }

    fn decoded<T: DeserializeOwned>(&mut self, kind: &'static str, sample: &Sample) -> Option<T> {
        let decode = || -> Result<T, CodecError> {
            let encoding = WireEncoding::from_zenoh(sample.encoding())?;
            encoding.decode(&sample.payload().to_bytes(), MAX_MESSAGE_BYTES)
        };
        decode().map_err(|error| self.malformed(kind, sample, &error.to_string())).ok()
    }

    /// Whether a message is of the robot whose key it came on.
    fn is_of(&mut self, robot: &RobotName, kind: &'static str, sample: &Sample) -> bool {
        let fits = keys::robot_of(sample.key_expr().as_str()).as_ref() == Some(robot);
        if !fits {
            self.malformed(kind, sample, "the message is of another robot than its key");
        }
        fits
    }

    fn malformed(&mut self, kind: &'static str, sample: &Sample, error: &str) {
        let now = monotonic();
        let (count, told) = self.malformed.entry(kind).or_insert((0, armada_model::MonoTime::ZERO));
        *count += 1;
        if now.saturating_since(*told) >= WARNING_PERIOD {
            *told = now;
            warn!(key = %sample.key_expr(), count, error, "a sample is not a message, dropped");
        }
    }

    /// Tells of samples that were dropped before they could be looked at.
    fn warn_of_losses(&mut self, slots: &Slots) {
        let lost = [
            ("overflow", &slots.overflow, "samples came faster than they could be taken"),
            ("stranger", &slots.strangers, "samples of robots that the cell file does not have"),
        ];
        let now = monotonic();
        for (kind, counter, what) in lost {
            let total = counter.load(Ordering::Relaxed);
            let (count, told) =
                self.malformed.entry(kind).or_insert((0, armada_model::MonoTime::ZERO));
            if total > *count && now.saturating_since(*told) >= WARNING_PERIOD {
                warn!(total, "{what}, dropped");
                (*count, *told) = (total, now);
            }
        }
    }
}

/// What the next of the tasks says; waits for ever while there is none.
async fn next_of<T: 'static>(tasks: &mut JoinSet<T>) -> Result<T, JoinError> {
    match tasks.join_next().await {
        Some(result) => result,
        None => std::future::pending().await,
    }
}
