//! A model of an agent: what it answers and publishes, without joints or control.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    Accepted, ActionStatus, ClockSample, CommandMode, CommitParams, Denial, DenialCode,
    LatchedStop, ModeAnswer, MotionStatus, Prepared, ResetAnswer, RobotInfo, RobotStatus, StopAck,
    StopLatch, StopRequest, StopStage,
};
use uuid::Uuid;

use crate::coordinator::{AgentAnswer, AgentCall, Input};

pub(super) const MOTION_DURATION: Duration = Duration::from_secs(2);
const RAMP: Duration = Duration::from_millis(200);

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
        Self {
            robot,
            boot_id,
            offset_ns,
            status,
            info,
            refuse_prepare: None,
            refuse_commit: None,
            motions: Vec::new(),
            still_at: Vec::new(),
            published: Vec::new(),
        }
    }

    /// Whether a motion moves it.
    pub(super) fn moves(&self) -> bool {
        self.motions.iter().any(|motion| motion.status.status == ActionStatus::Running)
    }

    pub(super) fn answer(
        &mut self,
        call: &AgentCall,
        now: MonoTime,
    ) -> Result<AgentAnswer, Denial> {
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
            AgentCall::Prepare(params) => self.prepare(params.motion_id.expect("given"), now),
            AgentCall::Commit(params) => self.commit(*params, now),
            AgentCall::Abort(id) => self.abort(*id, now),
            AgentCall::Stop(request) => Ok(AgentAnswer::Stop(self.stop(request, now))),
            AgentCall::Reset(params) => self.reset(&params.stop_ids),
        }
    }

    fn refuse_if_stopped(&self) -> Result<(), Denial> {
        let stopped = || Denial::new(DenialCode::Stopped, "a stop is latched");
        if self.status.stop.is_some() { Err(stopped()) } else { Ok(()) }
    }

    fn prepare(&mut self, id: Uuid, now: MonoTime) -> Result<AgentAnswer, Denial> {
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
        status.robot = self.robot.clone();
        status.boot_id = self.boot_id;
        status.seqno = 0;
        status.status = ActionStatus::Queued;
        status.reason = None;
        status.started_ns = None;
        status.elapsed_s = 0.0;
        self.motions.retain(|motion| motion.status.id != id);
        self.motions.push(Motion { status, start: None, ramp_end: None, published_at: now });
        let (duration_s, ttl_ms) = (MOTION_DURATION.as_secs_f64(), 5_000);
        Ok(AgentAnswer::Prepared(Prepared {
            motion_id: id,
            duration_s,
            epoch: 1,
            ttl_ms,
            group: None,
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
        if motion.status.status == ActionStatus::Running {
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
            self.still_at.push((now + RAMP, request.stop_id));
            self.publish_status();
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

    fn reset(&mut self, ids: &[Uuid]) -> Result<AgentAnswer, Denial> {
        let latched =
            self.status.stop.as_ref().map(|latch| latch.stops.clone()).unwrap_or_default();
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

    fn publish_status(&mut self) {
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
            if motion.status.status != ActionStatus::Running {
                continue;
            }
            let elapsed = now.saturating_since(start);
            motion.status.elapsed_s = elapsed.as_secs_f64();
            if motion.ramp_end.is_some_and(|end| end <= now) {
                ended.push((motion.status.id, ActionStatus::Cancelled));
            } else if elapsed >= MOTION_DURATION && motion.ramp_end.is_none() {
                ended.push((motion.status.id, ActionStatus::Complete));
            } else if now.saturating_since(motion.published_at) >= Duration::from_millis(100) {
                motion.published_at = now;
                motion.status.seqno += 1;
                self.published.push(Input::Motion(Box::new(motion.status.clone())));
            }
        }
        for (id, end) in ended {
            self.end(id, end, None, now);
        }
        for (_, stop_id) in self.still_at.extract_if(.., |(at, _)| *at <= now).collect::<Vec<_>>() {
            let ack = self.ack(stop_id, StopStage::Standstill, now);
            self.published.push(Input::StopAck(ack));
        }
    }
}

fn not_attached() -> Denial {
    Denial::new(DenialCode::NotAttached, "there is no such motion")
}
