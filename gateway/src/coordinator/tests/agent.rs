//! A model of an agent: what it answers and publishes, without joints or control.

use std::collections::BTreeMap;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    Accepted, ActionStatus, ClockSample, CommandMode, CommitParams, Denial, DenialCode,
    GroupParams, GroupReadiness, LatchedStop, LeaseGrant, ModeAnswer, MotionStatus, PrepareParams,
    Prepared, ResetAnswer, ResetParams, RobotInfo, RobotStatus, SpeedRatioAnswer, StopAck,
    StopLatch, StopRequest, StopStage,
};
use uuid::Uuid;

use crate::coordinator::{AgentAnswer, AgentCall, AskId, Control, Input};

pub(super) const MOTION_DURATION: Duration = Duration::from_secs(2);
const RAMP: Duration = Duration::from_millis(200);
/// Silence of a partner after which it stops.
const LOSS: Duration = Duration::from_millis(60);

/// Samples of the contract, to be changed where a test needs it.
pub(super) fn golden<T: serde::de::DeserializeOwned>(text: &str) -> T {
    serde_json::from_str(text).expect("golden sample")
}

#[derive(Debug)]
pub(super) struct FakeAgent {
    pub(super) robot: RobotName,
    pub(super) boot_id: Uuid,
    /// Its clock minus the gateway's \[ns\].
    pub(super) offset_ns: i64,
    pub(super) status: RobotStatus,
    pub(super) info: RobotInfo,
    /// What the next `prepare` is refused with.
    pub(super) refuse_prepare: Option<Denial>,
    pub(super) refuse_commit: Option<Denial>,
    /// What it answers of a part with partners; `None` if it knows nothing of them.
    pub(super) readiness: Option<GroupReadiness>,
    /// Whether it takes stops without coming to rest below this level.
    pub(super) deaf_below: Option<armada_protocol::messages::StopLevel>,
    /// Its lease, who holds it, and when it runs out.
    pub(super) lease: Option<(Uuid, String, MonoTime)>,
    /// Answers to requests; one that comes again is answered again, not done again.
    pub(super) answered: BTreeMap<AskId, Result<AgentAnswer, Denial>>,
    /// Leases that were granted so far.
    leases: u128,
    motions: Vec<Motion>,
    /// When each stop ends in standstill.
    still_at: Vec<(MonoTime, Uuid)>,
    /// What it published since the last time.
    pub(super) published: Vec<Input>,
}

#[derive(Debug)]
struct Motion {
    status: MotionStatus,
    /// Start in the gateway's clock; `None` while only prepared.
    start: Option<MonoTime>,
    /// When the ramp of an abort is over.
    ramp_end: Option<MonoTime>,
    published_at: MonoTime,
    group: Option<GroupParams>,
    /// Since when a partner has been missing.
    alone_since: Option<MonoTime>,
    /// Whether it stops because of that.
    left_alone: bool,
}

impl FakeAgent {
    pub(super) fn new(robot: &str, boot: u128, offset_ns: i64) -> Self {
        let robot: RobotName = robot.parse().expect("a name");
        let boot_id = Uuid::from_u128(boot);
        let mut status: RobotStatus =
            golden(include_str!("../../../../protocol/golden/robot_status.json"));
        status.robot = robot.clone();
        status.boot_id = boot_id;
        status.command_mode = CommandMode::Halt;
        status.stop = None;
        status.faults.clear();
        status.motion = None;
        let mut info: RobotInfo =
            golden(include_str!("../../../../protocol/golden/robot_info.json"));
        info.robot = robot.clone();
        info.boot_id = boot_id;
        let model_rev = info.model_rev;
        Self {
            robot,
            boot_id,
            offset_ns,
            status,
            info,
            refuse_prepare: None,
            refuse_commit: None,
            readiness: Some(GroupReadiness {
                stop_time_s: 0.2,
                rate_slope_s: 2.0,
                start_travel: 0.001,
                controller_lag_ms: 0.0,
                model_rev,
            }),
            deaf_below: None,
            lease: None,
            answered: BTreeMap::new(),
            leases: 0,
            motions: Vec::new(),
            still_at: Vec::new(),
            published: Vec::new(),
        }
    }

    /// Whether a motion moves it.
    pub(super) fn moves(&self) -> bool {
        self.motions.iter().any(|motion| motion.status.status == ActionStatus::Running)
    }

    /// Takes what `client` asks under `lease`.
    pub(super) fn answer(
        &mut self,
        client: &str,
        lease: Option<Uuid>,
        call: &AgentCall,
        now: MonoTime,
    ) -> Result<AgentAnswer, Denial> {
        if matches!(
            call,
            AgentCall::SetMode(_)
                | AgentCall::Prepare(_)
                | AgentCall::Commit(_)
                | AgentCall::Control(..)
        ) {
            self.check_lease(lease, now)?;
        }
        match call {
            AgentCall::Clock => Ok(AgentAnswer::Clock {
                sample: ClockSample {
                    boot_id: self.boot_id,
                    stamp_ns: now.shifted(self.offset_ns),
                    utc_ns: 0,
                },
                sent: now,
                received: now,
            }),
            AgentCall::Info => Ok(AgentAnswer::Info(Box::new(self.info.clone()))),
            AgentCall::Status => Ok(AgentAnswer::Status(Box::new(self.status.clone()))),
            AgentCall::Motion(id) => {
                let found = self.motions.iter().find(|motion| motion.status.id == *id);
                let found = found.filter(|motion| motion.start.is_some());
                found.map_or_else(
                    || Err(not_attached()),
                    |motion| Ok(AgentAnswer::Motion(Box::new(motion.status.clone()))),
                )
            }
            AgentCall::SetMode(mode) => {
                self.refuse_if_stopped()?;
                self.status.command_mode = *mode;
                self.publish_status();
                let (command_mode, epoch) = (*mode, 1);
                Ok(AgentAnswer::Mode(ModeAnswer { command_mode, epoch }))
            }
            AgentCall::Prepare(params) => self.prepare(params, now),
            AgentCall::Commit(params) => self.commit(*params, now),
            AgentCall::Abort(id) => self.abort(*id, now),
            AgentCall::Stop(request) => Ok(AgentAnswer::Stop(self.stop(request, now))),
            AgentCall::Reset(params) => self.reset(params),
            AgentCall::Control(id, control) => self.control(*id, *control, now),
            AgentCall::AcquireLease(params) => self.acquire(client, params.ttl_ms, now),
            AgentCall::RenewLease(params) => self.renew(params.lease, params.ttl_ms, now),
            AgentCall::ReleaseLease(lease) => {
                self.lease.take_if(|(held, ..)| held == lease).ok_or_else(stale)?;
                Ok(AgentAnswer::LeaseReleased)
            }
        }
    }

    /// Who holds a lease that is in force.
    pub(super) fn holder(&self, now: MonoTime) -> Option<&str> {
        let held = self.lease.as_ref().filter(|(_, _, until)| *until > now);
        held.map(|(_, holder, _)| holder.as_str())
    }

    fn check_lease(&self, lease: Option<Uuid>, now: MonoTime) -> Result<(), Denial> {
        let held = self.lease.as_ref().filter(|(_, _, until)| *until > now);
        match held {
            Some((held, holder, _)) if lease != Some(*held) => {
                Err(Denial::new(DenialCode::LeaseRequired, format!("driven by {holder}")))
            }
            None if lease.is_some() => Err(stale()),
            _ => Ok(()),
        }
    }

    fn acquire(&mut self, client: &str, ttl_ms: u64, now: MonoTime) -> Result<AgentAnswer, Denial> {
        if let Some(holder) = self.holder(now) {
            return Err(Denial::new(DenialCode::LeaseRequired, format!("driven by {holder}")));
        }
        self.leases += 1;
        let lease = Uuid::from_u128(self.boot_id.as_u128() * 1_000 + self.leases);
        let until = now + Duration::from_millis(ttl_ms);
        self.lease = Some((lease, client.to_owned(), until));
        Ok(AgentAnswer::Lease(LeaseGrant { lease, epoch: 1, ttl_ms }))
    }

    fn renew(
        &mut self,
        lease: Uuid,
        ttl_ms: Option<u64>,
        now: MonoTime,
    ) -> Result<AgentAnswer, Denial> {
        let held = self.lease.as_mut().filter(|(held, ..)| *held == lease).ok_or_else(stale)?;
        let ttl_ms = ttl_ms.unwrap_or(1_000);
        held.2 = now + Duration::from_millis(ttl_ms);
        Ok(AgentAnswer::Lease(LeaseGrant { lease, epoch: 1, ttl_ms }))
    }

    fn control(
        &mut self,
        id: Uuid,
        control: Control,
        now: MonoTime,
    ) -> Result<AgentAnswer, Denial> {
        let found = self
            .motions
            .iter_mut()
            .find(|motion| motion.status.id == id && !motion.status.status.is_terminal());
        let motion = found.ok_or_else(not_attached)?;
        motion.published_at = now;
        motion.status.seqno += 1;
        let answer = match control {
            Control::Pause => {
                motion.status.status = ActionStatus::Paused;
                AgentAnswer::Controlled
            }
            Control::Resume => {
                motion.status.status = ActionStatus::Running;
                AgentAnswer::Controlled
            }
            Control::SpeedRatio(speed_ratio) => {
                AgentAnswer::SpeedRatio(SpeedRatioAnswer { speed_ratio })
            }
        };
        self.published.push(Input::Motion(Box::new(motion.status.clone())));
        Ok(answer)
    }

    /// Whether it holds a part of the motion with which partners can go on.
    pub(super) fn keeps_up(&self, id: Uuid) -> bool {
        let found = self.motions.iter().find(|motion| motion.status.id == id);
        found.is_some_and(|motion| {
            motion.start.is_some()
                && motion.ramp_end.is_none()
                && !matches!(motion.status.status, ActionStatus::Failed | ActionStatus::Cancelled)
        })
    }

    /// Watches the partners of what moves it: `keeps_up` tells whether one does.
    pub(super) fn watch(&mut self, keeps_up: impl Fn(&RobotName, Uuid) -> bool, now: MonoTime) {
        let mut ended = Vec::new();
        for motion in &mut self.motions {
            let (Some(group), id) = (&motion.group, motion.status.id) else { continue };
            let begun = motion.start.is_some_and(|start| start <= now);
            if !begun || motion.status.status.is_terminal() || motion.ramp_end.is_some() {
                continue;
            }
            if group.partners.iter().all(|partner| keeps_up(partner, id)) {
                motion.alone_since = None;
            } else if now.saturating_since(*motion.alone_since.get_or_insert(now)) >= LOSS {
                if motion.status.status == ActionStatus::Queued {
                    ended.push(id);
                } else {
                    motion.ramp_end = Some(now + RAMP);
                    motion.left_alone = true;
                }
            }
        }
        for id in ended {
            let denial = Denial::new(DenialCode::CommunicationLost, "a partner is missing");
            self.end(id, ActionStatus::Failed, Some(denial), now);
        }
    }

    fn refuse_if_stopped(&self) -> Result<(), Denial> {
        let stopped = || Denial::new(DenialCode::Stopped, "a stop is latched");
        if self.status.stop.is_some() { Err(stopped()) } else { Ok(()) }
    }

    fn prepare(&mut self, params: &PrepareParams, now: MonoTime) -> Result<AgentAnswer, Denial> {
        let id = params.motion_id.expect("given");
        self.refuse_if_stopped()?;
        if let Some(denial) = self.refuse_prepare.take() {
            return Err(denial);
        }
        if self.status.command_mode != CommandMode::Trajectory {
            return Err(Denial::new(DenialCode::WrongMode, "not in mode trajectory"));
        }
        if self.moves() {
            return Err(Denial::new(DenialCode::Busy, "another motion is in progress"));
        }
        let mut status: MotionStatus =
            golden(include_str!("../../../../protocol/golden/motion_status.json"));
        status.id = id;
        status.group = None;
        status.robot = self.robot.clone();
        status.boot_id = self.boot_id;
        status.seqno = 0;
        status.status = ActionStatus::Queued;
        status.reason = None;
        status.started_ns = None;
        status.elapsed_s = 0.0;
        self.motions.retain(|motion| motion.status.id != id);
        let group = params.group.clone();
        let readiness = self.readiness.filter(|_| group.is_some());
        self.motions.push(Motion {
            status,
            start: None,
            ramp_end: None,
            published_at: now,
            group,
            alone_since: None,
            left_alone: false,
        });
        let (duration_s, ttl_ms) = (MOTION_DURATION.as_secs_f64(), 5_000);
        Ok(AgentAnswer::Prepared(Prepared {
            motion_id: id,
            duration_s,
            epoch: 1,
            ttl_ms,
            group: readiness,
        }))
    }

    fn commit(&mut self, params: CommitParams, now: MonoTime) -> Result<AgentAnswer, Denial> {
        self.refuse_if_stopped()?;
        if let Some(denial) = self.refuse_commit.take() {
            return Err(denial);
        }
        if params.boot_id != self.boot_id {
            return Err(Denial::new(DenialCode::LeaseStale, "another run"));
        }
        let start = params.start_ns.shifted(-self.offset_ns);
        if start < now {
            return Err(Denial::new(DenialCode::OutOfRange, "the start has passed"));
        }
        let found = self.motions.iter_mut().find(|motion| {
            motion.status.id == params.motion_id && !motion.status.status.is_terminal()
        });
        let motion = found.ok_or_else(not_attached)?;
        motion.start = Some(start);
        let (motion_id, duration_s) = (params.motion_id, MOTION_DURATION.as_secs_f64());
        Ok(AgentAnswer::Committed(Accepted { motion_id, duration_s, epoch: 1, status: None }))
    }

    fn abort(&mut self, id: Uuid, now: MonoTime) -> Result<AgentAnswer, Denial> {
        let found = self.motions.iter_mut().find(|motion| motion.status.id == id);
        let motion = found.ok_or_else(not_attached)?;
        if matches!(motion.status.status, ActionStatus::Running | ActionStatus::Paused) {
            motion.ramp_end.get_or_insert(now + RAMP);
        } else {
            self.end(id, ActionStatus::Cancelled, None, now);
        }
        Ok(AgentAnswer::Aborted)
    }

    /// Takes a stop as it comes by query or publication.
    pub(super) fn stop(&mut self, request: &StopRequest, now: MonoTime) -> StopAck {
        let stops = self.status.stop.as_ref().map(|latch| latch.stops.clone()).unwrap_or_default();
        let is_new = stops.iter().all(|stop| stop.stop_id != request.stop_id);
        if is_new {
            let StopRequest { stop_id, source, level, reason, .. } = request.clone();
            let mut stops = stops;
            stops.push(LatchedStop { stop_id, source, level, reason });
            self.status.stop = Some(StopLatch {
                level,
                stops,
                stage: StopStage::Commanded,
                reset: Default::default(),
            });
            self.status.command_mode = CommandMode::Halt;
            let ids: Vec<_> = self.motions.iter().map(|motion| motion.status.id).collect();
            for id in ids {
                let denial = Denial::new(DenialCode::Stopped, "stopped");
                self.end(id, ActionStatus::Failed, Some(denial), now);
            }
            self.publish_status();
        }
        let deaf = self.deaf_below.is_some_and(|level| request.level < level);
        let waits = self.still_at.iter().any(|(_, id)| *id == request.stop_id);
        if !deaf && !waits && (is_new || self.deaf_below.is_some()) {
            self.still_at.push((now + RAMP, request.stop_id));
        }
        let ack = self.ack(request.stop_id, StopStage::Received, now);
        self.published.push(Input::StopAck(ack.clone()));
        ack
    }

    fn ack(&self, stop_id: Uuid, stage: StopStage, now: MonoTime) -> StopAck {
        let (robot, boot_id) = (self.robot.clone(), self.boot_id);
        let stamp_ns = now.shifted(self.offset_ns);
        StopAck { stop_id, robot, boot_id, stage, stamp_ns, since_received_ms: 0.0 }
    }

    fn reset(&mut self, params: &ResetParams) -> Result<AgentAnswer, Denial> {
        let ids = &params.stop_ids;
        let latch = self.status.stop.clone();
        let needs = latch.as_ref().map(|latch| latch.reset.clone()).unwrap_or_default();
        if params.nonce != needs.nonce || (needs.signed && params.signature.is_none()) {
            return Err(Denial::new(DenialCode::StaleSequence, "another nonce or signature"));
        }
        let latched = latch.map(|latch| latch.stops).unwrap_or_default();
        if latched.iter().any(|stop| !ids.contains(&stop.stop_id)) {
            return Err(Denial::new(DenialCode::Stopped, "the list is not complete"));
        }
        self.status.stop = None;
        self.publish_status();
        Ok(AgentAnswer::Reset(ResetAnswer { cleared: ids.to_vec(), epoch: 2 }))
    }

    /// Ends a motion at once, as a fault would.
    pub(super) fn end(
        &mut self,
        id: Uuid,
        end: ActionStatus,
        reason: Option<Denial>,
        now: MonoTime,
    ) {
        let found = self.motions.iter_mut().find(|motion| motion.status.id == id);
        let Some(motion) = found.filter(|m| !m.status.status.is_terminal()) else { return };
        motion.status.status = end;
        motion.status.reason = reason;
        motion.status.seqno += 1;
        motion.published_at = now;
        self.published.push(Input::Motion(Box::new(motion.status.clone())));
    }

    /// Fails whatever it moves with.
    pub(super) fn fault(&mut self, now: MonoTime) {
        let ids: Vec<_> = self.motions.iter().map(|motion| motion.status.id).collect();
        for id in ids {
            let denial = Denial::new(DenialCode::Tolerance, "elbow_joint left its path");
            self.end(id, ActionStatus::Failed, Some(denial), now);
        }
    }

    /// Tells its status as it is.
    pub(super) fn publish_status(&mut self) {
        self.status.seqno += 1;
        self.published.push(Input::Status(Box::new(self.status.clone())));
    }

    /// Lets time pass: motions start, go on and end.
    pub(super) fn advance(&mut self, now: MonoTime) {
        let mut ended = Vec::new();
        for motion in &mut self.motions {
            let Some(start) = motion.start.filter(|start| *start <= now) else { continue };
            if motion.status.status == ActionStatus::Queued {
                motion.status.status = ActionStatus::Running;
                motion.status.started_ns = Some(start.shifted(self.offset_ns));
                motion.published_at = MonoTime::ZERO;
            }
            let is_running = motion.status.status == ActionStatus::Running;
            if !is_running && motion.ramp_end.is_none() {
                continue;
            }
            let elapsed = now.saturating_since(start);
            motion.status.elapsed_s = elapsed.as_secs_f64();
            if motion.ramp_end.is_some_and(|end| end <= now) {
                let end =
                    if motion.left_alone { ActionStatus::Failed } else { ActionStatus::Cancelled };
                ended.push((motion.status.id, end));
            } else if elapsed >= MOTION_DURATION && motion.ramp_end.is_none() {
                ended.push((motion.status.id, ActionStatus::Complete));
            } else if now.saturating_since(motion.published_at) >= Duration::from_millis(100) {
                motion.published_at = now;
                motion.status.seqno += 1;
                self.published.push(Input::Motion(Box::new(motion.status.clone())));
            }
        }
        for (id, end) in ended {
            let alone = || Denial::new(DenialCode::CommunicationLost, "a partner is missing");
            let reason = (end == ActionStatus::Failed).then(alone);
            self.end(id, end, reason, now);
        }
        for (_, stop_id) in self.still_at.extract_if(.., |(at, _)| *at <= now).collect::<Vec<_>>() {
            let ack = self.ack(stop_id, StopStage::Standstill, now);
            self.published.push(Input::StopAck(ack));
        }
    }
}

fn stale() -> Denial {
    Denial::new(DenialCode::LeaseStale, "the lease is over")
}

fn not_attached() -> Denial {
    Denial::new(DenialCode::NotAttached, "there is no such motion")
}
