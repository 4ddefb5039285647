//! From the request to the common start.

use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::messages::{
    Accepted, CommandMode, CommitParams, Denial, DenialCode, EventKind, LeaseLoss, PrepareParams,
    Severity,
};
use serde_json::Map;

use super::part::Step;
use super::{Context, Group, MODE_TIMEOUT, PREPARE_TIMEOUT, Phase};
use crate::coordinator::io::{AgentAnswer, AgentCall, CellAnswer};
use crate::coordinator::outbox::{Happening, Purpose, Question};
use crate::coordinator::plan;

/// Longest lead that slow round trips can ask for.
const MAX_LEAD: Duration = Duration::from_millis(1_000);

impl Group {
    pub(super) fn ask(
        &self,
        robot: &RobotName,
        call: AgentCall,
        timeout: Duration,
        cx: &mut Context<'_>,
    ) {
        let (client, purpose) = (self.client.as_str(), Purpose::Group(self.id));
        cx.outbox.ask(Question { robot, client, call, timeout, purpose });
    }

    /// One step further with a robot that answered well.
    pub(super) fn advance(&mut self, robot: &RobotName, answer: AgentAnswer, cx: &mut Context<'_>) {
        let Some(part) = self.parts.get_mut(robot) else { return };
        match (part.step, answer) {
            (Step::Checking, AgentAnswer::Status(status)) => {
                part.boot_id = Some(status.boot_id);
                match plan::must_change_mode(robot, &status) {
                    Ok(true) => {
                        part.step = Step::ChangingMode;
                        let call = AgentCall::SetMode(CommandMode::Trajectory);
                        self.ask(robot, call, MODE_TIMEOUT, cx);
                    }
                    Ok(false) => self.prepare(robot, cx),
                    Err(denial) => {
                        part.step = Step::Refused;
                        self.fail(denial, cx);
                    }
                }
            }
            (Step::ChangingMode, AgentAnswer::Mode(_)) => self.prepare(robot, cx),
            (Step::Preparing, AgentAnswer::Prepared(prepared)) => {
                part.step = Step::Prepared;
                self.duration_s = self.duration_s.max(prepared.duration_s);
                if self.all(Step::Prepared) {
                    self.commit(cx);
                }
            }
            (Step::Committing, AgentAnswer::Committed(_)) => {
                part.step = Step::Committed;
                if self.all(Step::Committed) {
                    self.accept(cx);
                }
            }
            // Nothing that was asked for in this step.
            _ => {}
        }
    }

    fn all(&self, step: Step) -> bool {
        self.parts.values().all(|part| part.step == step)
    }

    fn prepare(&mut self, robot: &RobotName, cx: &mut Context<'_>) {
        let Some(part) = self.parts.get_mut(robot) else { return };
        let Some(trajectory) = part.trajectory.take() else { return };
        part.step = Step::Preparing;
        let params = PrepareParams {
            motion_id: Some(self.id),
            trajectory,
            group: None,
            on_lease_loss: LeaseLoss::StopOnPath,
        };
        self.ask(robot, AgentCall::Prepare(Box::new(params)), PREPARE_TIMEOUT, cx);
    }

    /// Gives every agent the common start, each in its own clock.
    fn commit(&mut self, cx: &mut Context<'_>) {
        let records = || self.parts.keys().filter_map(|robot| cx.robots.get(robot));
        let slowest = records().map(|r| r.clock.slowest_round_trip(cx.now)).max();
        let lead = cx.timers.start_lead.max((slowest.unwrap_or_default() * 5).min(MAX_LEAD));
        let start = cx.now + lead;
        let mut commits = Vec::new();
        for (robot, part) in &self.parts {
            let record = cx.robots.get(robot).filter(|record| record.run() == part.boot_id);
            let offset = record.and_then(|record| record.clock.best(cx.now));
            let (Some(offset), Some(boot_id)) = (offset, part.boot_id) else {
                let why = "the offset of its clock has not been measured yet, try again";
                return self.fail(plan::of(robot, DenialCode::NotReady, why), cx);
            };
            let start_ns = start.shifted(offset.offset_ns);
            commits.push((
                robot.clone(),
                CommitParams { motion_id: self.id, boot_id, start_ns, rate_slope_s: None },
            ));
        }
        self.phase = Phase::Committing { start };
        for (robot, params) in commits {
            if let Some(part) = self.parts.get_mut(&robot) {
                part.step = Step::Committing;
                part.heard = start;
            }
            self.ask(&robot, AgentCall::Commit(params), lead, cx);
        }
    }

    fn accept(&mut self, cx: &mut Context<'_>) {
        // Answers that come after the start are too late, even if the timer has not fired yet.
        if matches!(self.phase, Phase::Committing { start } if cx.now >= start) {
            return self.too_late(cx);
        }
        self.phase = Phase::Running;
        self.accepted = true;
        self.changed = true;
        if let Some(ticket) = self.ticket.take() {
            let (motion_id, duration_s) = (self.id, self.duration_s);
            let accepted = Accepted { motion_id, duration_s, epoch: 0, status: None };
            cx.outbox.answer(ticket, Ok(CellAnswer::Accepted(accepted)));
        }
        let robots = self.parts.keys().map(RobotName::as_str).collect::<Vec<_>>().join(", ");
        let message = format!("{} moves {robots} for {:.3} s", self.client, self.duration_s);
        self.record(EventKind::MotionAccepted, Severity::Info, message, cx);
    }

    pub(super) fn record(
        &self,
        kind: EventKind,
        severity: Severity,
        message: String,
        cx: &mut Context<'_>,
    ) {
        let details = Map::from_iter([("motion_id".to_owned(), self.id.to_string().into())]);
        cx.outbox.record(cx.now, Happening { severity, kind, robot: None, message, details });
    }

    pub(super) fn refused(&mut self, robot: &RobotName, denial: Denial, cx: &mut Context<'_>) {
        if let Some(part) = self.parts.get_mut(robot) {
            let unknown = matches!(
                denial.code,
                DenialCode::Timeout | DenialCode::Unreachable | DenialCode::CommunicationLost
            );
            // Without an answer the agent may hold the trajectory all the same.
            if part.step == Step::Preparing && !unknown {
                part.step = Step::Refused;
            }
        }
        self.fail(plan::by(robot, denial), cx);
    }
}
