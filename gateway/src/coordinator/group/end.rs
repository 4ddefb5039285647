//! From the first trouble, or the goal, to the one terminal status.

use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::messages::{ActionStatus, Denial, DenialCode, EventKind, Severity};

use super::part::{Abort, Part, Step};
use super::{Context, Group, Phase, STATUS_TIMEOUT};
use crate::coordinator::io::{Action, AgentAnswer, AgentCall, CellAnswer};
use crate::coordinator::plan;

const ABORT_TIMEOUT: Duration = Duration::from_millis(1_000);
/// Period of the status while something moves.
const PUBLISH_PERIOD: Duration = Duration::from_millis(100);

impl Group {
    pub(super) fn too_late(&mut self, cx: &mut Context<'_>) {
        let is_late = |part: &&Part| !matches!(part.step, Step::Prepared | Step::Committed);
        let late = self.parts.iter().filter(|(_, part)| is_late(part)).map(|(r, _)| r.as_str());
        let late: Vec<_> = late.collect();
        let denial = if matches!(self.phase, Phase::Checking { .. }) {
            Denial::new(DenialCode::Timeout, "its clearance was not checked in time; nothing moves")
        } else {
            let message = format!("no answer in time from {}; nothing moves", late.join(", "));
            Denial::new(DenialCode::Timeout, message).with("robots", late)
        };
        self.fail(denial, cx);
    }

    pub(super) fn fail(&mut self, reason: Denial, cx: &mut Context<'_>) {
        self.end(ActionStatus::Failed, Some(reason), cx);
    }

    /// Decides the end, if it is not decided yet, and aborts what is open.
    pub(super) fn end(
        &mut self,
        status: ActionStatus,
        reason: Option<Denial>,
        cx: &mut Context<'_>,
    ) {
        if self.outcome.is_some() {
            return;
        }
        self.changed = true;
        if let (Some(ticket), Some(denial)) = (self.ticket.take(), reason.clone()) {
            let message = format!("motion of {} refused: {denial}", self.client);
            self.record(EventKind::Denied, Severity::Warning, message, cx);
            cx.outbox.answer(ticket, Err(denial));
        }
        self.outcome = Some((status, reason));
        self.give_up_lost_parts();
        self.phase = Phase::Ending { deadline: cx.now + cx.timers.ending };
        let open = self.parts.iter().filter(|(_, part)| part.is_open());
        for robot in open.map(|(robot, _)| robot.clone()).collect::<Vec<_>>() {
            self.abort(&robot, cx);
        }
    }

    pub(super) fn abort(&mut self, robot: &RobotName, cx: &mut Context<'_>) {
        let Some(part) = self.parts.get_mut(robot) else { return };
        part.abort_asked();
        self.ask(robot, AgentCall::Abort(self.id), ABORT_TIMEOUT, cx);
    }

    pub(super) fn abort_answered(
        &mut self,
        robot: &RobotName,
        result: &Result<AgentAnswer, Denial>,
        cx: &mut Context<'_>,
    ) {
        let Some(part) = self.parts.get_mut(robot) else { return };
        match result {
            Ok(_) => part.abort = Abort::Done,
            Err(denial) if denial.code == DenialCode::NotAttached => {
                part.abort = Abort::Done;
                // It has ended already; its terminal status may still be on its way.
                if self.accepted && part.is_open() {
                    self.ask(robot, AgentCall::Motion(self.id), STATUS_TIMEOUT, cx);
                }
            }
            Err(_) if part.is_open() && part.abort_unanswered() => self.abort(robot, cx),
            Err(_) => {}
        }
    }

    pub(super) fn give_up_open_parts(&mut self) {
        for (robot, part) in &mut self.parts {
            if part.is_open() {
                let why = "its agent did not say in time that it stands still: go and look";
                part.give_up(plan::of(robot, DenialCode::Timeout, why));
                if part.abort != Abort::Done {
                    part.abort = Abort::Unanswered;
                }
                self.changed = true;
            }
        }
    }

    /// What follows from the parts: the end, answers to cancels, and what is published.
    pub(super) fn go_on(&mut self, cx: &mut Context<'_>) {
        if self.phase == Phase::Ended {
            return;
        }
        let all_complete = || self.parts.values().all(|p| p.status == ActionStatus::Complete);
        if self.phase == Phase::Running && self.outcome.is_none() && all_complete() {
            self.outcome = Some((ActionStatus::Complete, None));
            self.finish(cx);
        }
        if let Phase::Ending { deadline } = self.phase {
            let settled = self.parts.values().all(|part| part.is_settled(self.accepted));
            if settled || (!self.accepted && cx.now >= deadline) {
                self.finish(cx);
            }
            self.answer_cancels(cx);
        }
        let is_due = self.phase != Phase::Ended && cx.now >= self.next_publish;
        if self.accepted && (self.changed || is_due) {
            self.publish(cx);
        }
    }

    fn finish(&mut self, cx: &mut Context<'_>) {
        self.phase = Phase::Ended;
        self.changed = true;
        self.answer_cancels(cx);
        if let (true, Some((status, reason))) = (self.accepted, &self.outcome) {
            let severity =
                if *status == ActionStatus::Failed { Severity::Error } else { Severity::Info };
            let reason = reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
            let message = format!("motion of {} ended {status:?}{reason}", self.client);
            self.record(EventKind::MotionEnded, severity, message, cx);
        }
    }

    /// Answers requests to cancel as soon as every robot that moves has got its abort.
    fn answer_cancels(&mut self, cx: &mut Context<'_>) {
        let reached =
            |part: &Part| !part.is_open() || !matches!(part.abort, Abort::No | Abort::Asked(_));
        if self.cancels.is_empty() || !self.parts.values().all(reached) {
            return;
        }
        let deaf = |part: &Part| part.abort == Abort::Unanswered;
        let deaf = self.parts.iter().filter(|(_, p)| deaf(p)).map(|(r, _)| r.as_str());
        let deaf: Vec<_> = deaf.collect();
        let result = if deaf.is_empty() {
            Ok(CellAnswer::Cancelled)
        } else {
            let message = format!("{} did not answer: stop the cell", deaf.join(", "));
            Err(Denial::new(DenialCode::Timeout, message).with("robots", deaf))
        };
        for ticket in self.cancels.drain(..) {
            cx.outbox.answer(ticket, result.clone());
        }
    }

    fn publish(&mut self, cx: &mut Context<'_>) {
        let report = self.report(cx.outbox.boot_id(), cx.now);
        cx.outbox.push(Action::PublishMotion(Box::new(report)));
        self.seqno += 1;
        self.news |= self.changed;
        self.changed = false;
        self.next_publish = cx.now + PUBLISH_PERIOD;
    }
}
