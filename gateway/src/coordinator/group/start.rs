//! From the request to the common start.

use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::messages::{
    Accepted, CommandMode, CommitParams, Coupling, Denial, DenialCode, EventKind, GroupParams,
    PrepareParams, Severity,
};
use serde_json::Map;

use super::part::Step;
use super::{Context, Group, MODE_TIMEOUT, PREPARE_TIMEOUT, Phase};
use crate::coordinator::io::{AgentAnswer, AgentCall, CellAnswer};
use crate::coordinator::outbox::{CheckFor, Happening, Purpose, Question};
use crate::coordinator::plan;
use crate::world::{ClearanceReport, ClearanceRequest};

/// Longest lead that slow round trips can ask for.
const MAX_LEAD: Duration = Duration::from_millis(1_000);
/// Silence of a partner after which all stop \[ms\].
const LOSS_MS: u64 = 60;
/// How far the phases of two robots may be apart \[ms\].
const MAX_DIVERGENCE_MS: f64 = 50.0;
/// The same for robots that hold something between them \[ms\].
const RIGID_DIVERGENCE_MS: f64 = 10.0;

impl Group {
    pub(super) fn ask(
        &self,
        robot: &RobotName,
        call: AgentCall,
        timeout: Duration,
        cx: &mut Context<'_>,
    ) {
        let (client, purpose) = (self.client.as_str(), Purpose::Group(self.id));
        let lease = self.parts.get(robot).and_then(|part| part.lease);
        cx.outbox.ask(Question { robot, client, lease, call, timeout, purpose });
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
                if self.has_partners() {
                    let wanted = self.model_revs.get(robot).copied();
                    let known = cx.robots.get(robot).and_then(|record| record.model_rev);
                    match plan::readiness(robot, &prepared, wanted, known) {
                        Ok(readiness) => self.take_readiness(robot, readiness),
                        Err(denial) => return self.fail(denial, cx),
                    }
                }
                if self.all(Step::Prepared) {
                    self.check(cx);
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

    fn take_readiness(
        &mut self,
        robot: &RobotName,
        readiness: armada_protocol::messages::GroupReadiness,
    ) {
        if let Some(part) = self.parts.get_mut(robot) {
            part.readiness = Some(readiness);
        }
    }

    fn all(&self, step: Step) -> bool {
        self.parts.values().all(|part| part.step == step)
    }

    fn prepare(&mut self, robot: &RobotName, cx: &mut Context<'_>) {
        let group = self.has_partners().then(|| GroupParams {
            partners: self.parts.keys().filter(|partner| *partner != robot).cloned().collect(),
            coupling: self.coupling,
            loss_ms: LOSS_MS,
            max_divergence_ms: self.max_divergence_ms(),
            model_rev: self.model_revs.get(robot).copied(),
        });
        let Some(part) = self.parts.get_mut(robot) else { return };
        part.step = Step::Preparing;
        let params = PrepareParams {
            motion_id: Some(self.id),
            trajectory: part.trajectory.clone(),
            group,
            on_lease_loss: self.on_lease_loss,
        };
        self.ask(robot, AgentCall::Prepare(Box::new(params)), PREPARE_TIMEOUT, cx);
    }

    const fn max_divergence_ms(&self) -> f64 {
        match self.coupling {
            Coupling::Rigid => RIGID_DIVERGENCE_MS,
            Coupling::Independent | Coupling::TimeSynced => MAX_DIVERGENCE_MS,
        }
    }

    /// Has the clearances of the parts checked, if there are any.
    fn check(&mut self, cx: &mut Context<'_>) {
        if !self.has_partners() || !cx.clearance.check {
            return self.commit(cx);
        }
        // Refused before the work, not only after it.
        if let Some(denial) = self.clock_refusal(None, cx) {
            return self.fail(denial, cx);
        }
        let request = ClearanceRequest {
            parts: self
                .parts
                .iter()
                .map(|(r, part)| (r.clone(), part.trajectory.clone()))
                .collect(),
            reduced: plan::reduced(cx.robots),
            offset_s: self.envelope_s(cx),
            required_m: cx.clearance.required_m,
        };
        self.warn_of_others(cx);
        let Phase::Preparing { deadline } = self.phase else { return };
        match cx.outbox.check(request, CheckFor::Group(self.id)) {
            Ok(()) => self.phase = Phase::Checking { deadline },
            Err(denial) => self.fail(denial, cx),
        }
    }

    /// Says of which robots that take no part the clearance holds for where they are now only.
    fn warn_of_others(&self, cx: &mut Context<'_>) {
        let others = cx.robots.iter().filter(|(robot, _)| !self.parts.contains_key(*robot));
        let moving = others.filter(|(_, record)| record.is_moving());
        let names: Vec<&str> = moving.map(|(robot, _)| robot.as_str()).collect();
        if !names.is_empty() {
            let names = names.join(", ");
            let message = format!(
                "{names} moves by itself: its clearance from the others is known for where it is now only"
            );
            self.record(EventKind::Group, Severity::Warning, message, cx);
        }
    }

    /// How far the phases of two robots can get apart \[s\]: by what is allowed, and if one stops at
    /// once, by the time until another notices, by its way to rest, and by what its controller is
    /// behind its set-points.
    fn envelope_s(&self, cx: &Context<'_>) -> f64 {
        let records = self.parts.keys().filter_map(|robot| cx.robots.get(robot));
        let period = records.map(|record| record.period).max().unwrap_or_default();
        let stop_s = self.highest(|part| Some(part.readiness?.stop_time_s)).unwrap_or_default();
        let loss = Duration::from_millis(LOSS_MS);
        let lag = self.parts.values().map(|part| part.lag()).max().unwrap_or_default();
        1e-3 * self.max_divergence_ms() + (loss + period + lag).as_secs_f64() + stop_s
    }

    /// Takes the result of the check.
    pub(in crate::coordinator) fn on_clearance(
        &mut self,
        result: Result<ClearanceReport, Denial>,
        cx: &mut Context<'_>,
    ) {
        if !matches!(self.phase, Phase::Checking { .. }) {
            return;
        }
        match result {
            Ok(ClearanceReport { refusal: Some(denial), .. }) | Err(denial) => {
                self.fail(denial, cx);
            }
            Ok(ClearanceReport { answer, refusal: None, .. }) => {
                if !answer.without_shape.is_empty() {
                    let unknown = answer.without_shape.join(", ");
                    let message = format!(
                        "nothing is known of the clearance of {unknown}: no shape or place"
                    );
                    self.record(EventKind::Group, Severity::Warning, message, cx);
                }
                self.commit(cx);
            }
        }
        self.go_on(cx);
    }

    /// Gives every agent the common start, each in its own clock, and earlier by what its controller
    /// is late.
    fn commit(&mut self, cx: &mut Context<'_>) {
        if let Some(denial) = self.clock_refusal(None, cx) {
            return self.fail(denial, cx);
        }
        let records = || self.parts.keys().filter_map(|robot| cx.robots.get(robot));
        let slowest = records().map(|r| r.clock.slowest_round_trip(cx.now)).max();
        let lead = cx.timers.start_lead.max((slowest.unwrap_or_default() * 5).min(MAX_LEAD));
        let latest_lag = self.parts.values().map(|part| part.lag()).max().unwrap_or_default();
        let first = cx.now + lead;
        let start = first + latest_lag;
        let slopes = self.parts.values().filter_map(|part| Some(part.readiness?.rate_slope_s));
        let rate_slope_s = slopes.reduce(f64::min);
        let mut commits = Vec::new();
        for (robot, part) in &self.parts {
            let record = cx.robots.get(robot).filter(|record| record.run() == part.boot_id);
            let offset = record.and_then(|record| record.clock.best(cx.now));
            let (Some(offset), Some(boot_id)) = (offset, part.boot_id) else {
                let why = "the offset of its clock has not been measured yet, try again";
                return self.fail(plan::of(robot, DenialCode::NotReady, why), cx);
            };
            let start_ns = (start - part.lag()).shifted(offset.offset_ns);
            let motion_id = self.id;
            commits
                .push((robot.clone(), CommitParams { motion_id, boot_id, start_ns, rate_slope_s }));
        }
        self.phase = Phase::Committing { start: first };
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
            let unknown = plan::is_unknown(&denial);
            // Without an answer the agent may hold the trajectory all the same.
            if part.step == Step::Preparing && !unknown {
                part.step = Step::Refused;
            }
        }
        self.fail(plan::by(robot, denial), cx);
    }
}
