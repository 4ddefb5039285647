//! A motion of several robots that start at one instant.
//!
//! ```text
//!             every part checked,     no two parts        every commit            every part
//! request --> in mode, prepared --> come too near --> answered before start --> complete
//!    Preparing -----------> Checking -----> Committing ---------> Running --------> Ended
//!        '----------------------'-------------'------ any ----------'---> Ending ----^
//!                     refusal, loss, stop, cancel   every part aborted and settled
//! ```
//! The client is answered when all parts are committed, or with the first refusal. A motion that
//! was not accepted never has a status; an accepted one has exactly one terminal status.
//!
//! Robots with partners watch each other once they are committed: they start only if all are ready,
//! and stop together. The gateway then only looks on. A part whose agent it has lost may be well
//! known to its partners, so the motion goes on as long as one of them is heard; a part that is
//! known to have ended early ends the others, which they do by themselves too. If the gateway ends,
//! what runs goes on without it.

mod clock;
mod control;
mod end;
mod part;
mod start;
mod watch;

use std::collections::BTreeMap;
use std::time::Duration;

use armada_model::{JointTrajectory, MonoTime};
use armada_protocol::RobotName;
use armada_protocol::messages::{
    ActionStatus, CellMotionStatus, Coupling, Denial, DenialCode, LeaseLoss, MotionStatus,
    StopRequest,
};
use uuid::Uuid;

use self::part::Part;
use super::io::{AgentAnswer, AgentCall, Ticket};
use super::outbox::{CallKind, Outbox};
use super::plan;
use super::robot::RobotRecord;
use crate::config::{ClearanceConfig, MotionTimers};

const STATUS_TIMEOUT: Duration = Duration::from_millis(1_000);
const MODE_TIMEOUT: Duration = Duration::from_millis(2_000);
const PREPARE_TIMEOUT: Duration = Duration::from_millis(3_000);
/// From the request to the last commit; the client waits for eight seconds.
const PATIENCE: Duration = Duration::from_millis(6_500);

/// What a group needs of its surroundings.
pub(super) struct Context<'a> {
    pub(super) now: MonoTime,
    pub(super) robots: &'a BTreeMap<RobotName, RobotRecord>,
    pub(super) timers: &'a MotionTimers,
    pub(super) clearance: &'a ClearanceConfig,
    pub(super) outbox: &'a mut Outbox,
}

/// A request for a motion, taken apart.
pub(super) struct Order {
    pub(super) id: Uuid,
    pub(super) client: String,
    pub(super) ticket: Ticket,
    pub(super) parts: BTreeMap<RobotName, JointTrajectory>,
    pub(super) coupling: Coupling,
    pub(super) leases: BTreeMap<RobotName, Uuid>,
    pub(super) on_lease_loss: LeaseLoss,
    pub(super) model_revs: BTreeMap<RobotName, u64>,
}

/// A motion of several robots.
#[derive(Debug)]
pub(super) struct Group {
    id: Uuid,
    client: String,
    /// Until the client is answered.
    ticket: Option<Ticket>,
    phase: Phase,
    /// The decided end.
    outcome: Option<(ActionStatus, Option<Denial>)>,
    parts: BTreeMap<RobotName, Part>,
    coupling: Coupling,
    on_lease_loss: LeaseLoss,
    /// Revisions that the client made the motion for.
    model_revs: BTreeMap<RobotName, u64>,
    duration_s: f64,
    accepted: bool,
    /// Requests to cancel that were not answered yet.
    cancels: Vec<Ticket>,
    seqno: u64,
    changed: bool,
    /// Whether something was published that the cell's status should say as well.
    news: bool,
    next_publish: MonoTime,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Preparing { deadline: MonoTime },
    Checking { deadline: MonoTime },
    Committing { start: MonoTime },
    Running,
    Ending { deadline: MonoTime },
    Ended,
}

impl Group {
    /// Begins by asking every robot how it is.
    pub(super) fn begin(order: Order, cx: &mut Context<'_>) -> Self {
        let part = |(robot, trajectory)| {
            let lease = order.leases.get(&robot).copied();
            (robot, Part::new(trajectory, lease, cx.now))
        };
        let parts = order.parts.into_iter().map(part).collect();
        let deadline = cx.now + PATIENCE;
        let group = Self {
            id: order.id,
            client: order.client,
            ticket: Some(order.ticket),
            phase: Phase::Preparing { deadline },
            outcome: None,
            parts,
            coupling: order.coupling,
            on_lease_loss: order.on_lease_loss,
            model_revs: order.model_revs,
            duration_s: 0.0,
            accepted: false,
            cancels: Vec::new(),
            seqno: 0,
            changed: false,
            news: false,
            next_publish: cx.now,
        };
        for robot in group.parts.keys() {
            group.ask(robot, AgentCall::Status, STATUS_TIMEOUT, cx);
        }
        group
    }

    /// Whether its robots watch each other.
    pub(super) fn has_partners(&self) -> bool {
        self.parts.len() > 1
    }

    /// Whether it needs no more attention.
    pub(super) fn is_over(&self) -> bool {
        self.phase == Phase::Ended
    }

    pub(super) const fn is_accepted(&self) -> bool {
        self.accepted
    }

    /// Whether something changed since the last call that others should know at once.
    pub(super) const fn take_news(&mut self) -> bool {
        std::mem::replace(&mut self.news, false)
    }

    pub(super) fn has(&self, robot: &RobotName) -> bool {
        self.parts.contains_key(robot)
    }

    /// When [`Self::on_time`] is due.
    pub(super) fn next_deadline(&self, timers: &MotionTimers) -> Option<MonoTime> {
        let poll = || self.parts.values().filter_map(Part::poll_time).min();
        let publish = Some(self.next_publish).filter(|_| self.accepted);
        match self.phase {
            Phase::Preparing { deadline } | Phase::Checking { deadline } => Some(deadline),
            Phase::Committing { start } => Some(start),
            Phase::Running => {
                [self.silence_time(timers), poll(), publish].into_iter().flatten().min()
            }
            Phase::Ending { deadline } => {
                let poll = poll().filter(|_| self.accepted);
                [Some(deadline), poll, publish].into_iter().flatten().min()
            }
            Phase::Ended => None,
        }
    }

    /// Takes an agent's answer. That of [`CallKind::Motion`] goes to [`Self::on_motion`] as well.
    pub(super) fn on_answer(
        &mut self,
        robot: &RobotName,
        call: CallKind,
        result: Result<AgentAnswer, Denial>,
        cx: &mut Context<'_>,
    ) {
        match (call, result) {
            (CallKind::Abort, result) => self.abort_answered(robot, &result, cx),
            (CallKind::Motion, result) => self.poll_answered(robot, result, cx),
            (_, Ok(answer)) if self.outcome.is_none() => self.advance(robot, answer, cx),
            (_, Err(denial)) => self.refused(robot, denial, cx),
            // The end was decided while this was on its way: what the agent took on must go.
            (CallKind::Prepare | CallKind::Commit, Ok(_)) => self.abort(robot, cx),
            (_, Ok(_)) => {}
        }
        self.go_on(cx);
    }

    /// Takes the status of a part from its agent's current run.
    pub(super) fn on_motion(&mut self, status: &MotionStatus, cx: &mut Context<'_>) {
        let Some(part) = self.parts.get_mut(&status.robot) else { return };
        let offset = cx.robots.get(&status.robot).and_then(|record| record.clock.best(cx.now));
        let changed = part.take(status, offset.map(|offset| offset.offset_ns), cx.now);
        self.changed |= changed;
        if changed && matches!(status.status, ActionStatus::Cancelled | ActionStatus::Failed) {
            let reason = status.reason.clone().unwrap_or_else(|| {
                Denial::new(DenialCode::NotReady, "its part was cancelled at its agent")
            });
            self.fail(plan::by(&status.robot, reason), cx);
        }
        self.go_on(cx);
    }

    /// Ends the motion because of a stop. Robots in scope stop by themselves; the abort that they
    /// get as well costs nothing and reaches one that has not heard the stop.
    pub(super) fn on_stop(&mut self, request: &StopRequest, cx: &mut Context<'_>) {
        if self.parts.keys().any(|robot| request.scope.includes(robot)) {
            let message = format!("stopped by {:?} (level {:?})", request.source, request.level);
            let denial = Denial::new(DenialCode::Stopped, message)
                .with("stop_id", request.stop_id.to_string());
            self.fail(denial, cx);
            self.go_on(cx);
        }
    }

    /// Ends the motion because a client wants it.
    pub(super) fn cancel(&mut self, ticket: Ticket, cx: &mut Context<'_>) {
        self.cancels.push(ticket);
        let reason = (!self.accepted)
            .then(|| Denial::new(DenialCode::NotReady, "cancelled before it was accepted"));
        self.end(ActionStatus::Cancelled, reason, cx);
        self.go_on(cx);
    }

    /// Looks at the clock.
    pub(super) fn on_time(&mut self, cx: &mut Context<'_>) {
        match self.phase {
            Phase::Preparing { deadline } | Phase::Checking { deadline } if cx.now >= deadline => {
                self.too_late(cx);
            }
            Phase::Committing { start } if cx.now >= start => self.too_late(cx),
            Phase::Running => self.listen(cx),
            Phase::Ending { deadline } => {
                if cx.now >= deadline {
                    self.give_up_open_parts();
                }
                if self.accepted {
                    self.poll(cx);
                }
            }
            Phase::Preparing { .. }
            | Phase::Checking { .. }
            | Phase::Committing { .. }
            | Phase::Ended => {}
        }
        self.go_on(cx);
    }

    /// The whole as it is published.
    pub(super) fn report(&self, boot_id: Uuid, now: MonoTime) -> CellMotionStatus {
        let started = || self.parts.values().map(|part| part.started);
        let ends = started()
            .collect::<Option<Vec<_>>>()
            .and_then(|all| Some((all.iter().copied().min()?, all.iter().copied().max()?)));
        let has_begun = || self.parts.values().any(|part| part.status != ActionStatus::Queued);
        let status = match (&self.outcome, self.phase) {
            (Some((status, _)), Phase::Ended) => *status,
            _ if self.is_paused() => ActionStatus::Paused,
            _ if has_begun() => ActionStatus::Running,
            _ => ActionStatus::Queued,
        };
        CellMotionStatus {
            id: self.id,
            boot_id,
            seqno: self.seqno,
            stamp_ns: now,
            status,
            reason: self.outcome.as_ref().and_then(|(_, reason)| reason.clone()),
            client: self.client.clone(),
            duration_s: self.duration_s,
            parts: self.parts.iter().map(|(r, part)| (r.clone(), part.report())).collect(),
            start_skew_ms: ends
                .map(|(first, last)| last.saturating_since(first).as_secs_f64() * 1e3),
            coupling: self.coupling,
            max_divergence_ms: self.highest(|part| Some(part.quality?.max_divergence_ms)),
            start_travel: self.highest(|part| Some(part.readiness?.start_travel)),
        }
    }

    /// Whether everything that has not ended is at rest until it is resumed.
    fn is_paused(&self) -> bool {
        let mut open = self.parts.values().filter(|part| !part.status.is_terminal()).peekable();
        open.peek().is_some() && open.all(|part| part.status == ActionStatus::Paused)
    }

    fn highest(&self, of: impl Fn(&Part) -> Option<f64>) -> Option<f64> {
        self.parts.values().filter_map(of).reduce(f64::max)
    }
}
