//! A stop of the cell, from the request to the verdict.
//!
//! The stop is published again and again until every robot in scope has it, and every agent is
//! asked directly as well. The verdict comes from what the agents measured, never from silence.
//!
//! A robot that is not measured to stand in time is stopped harder: what was `L2` becomes `L1` and
//! then `L0`, under the same identity, for the robots that are late and for no others.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    EventKind, Severity, StopAck, StopLevel, StopReport, StopRequest, StopScope, StopStage,
    StopVerdict,
};
use serde_json::{Map, Value};

use super::io::{Action, AgentCall, CellAnswer, Ticket};
use super::outbox::{Happening, Outbox, Purpose, Question};

/// Pause between repetitions at first.
const REPEAT: Duration = Duration::from_millis(10);
/// How long it is repeated that fast.
const FAST_PHASE: Duration = Duration::from_millis(500);
/// Pause between repetitions later, for robots that come back.
const SLOW_REPEAT: Duration = Duration::from_millis(250);
/// When the verdict is given at the latest; shorter than the method's time-out.
const DEADLINE: Duration = Duration::from_millis(4_000);
/// How long robots have to stand still before they are stopped harder, and again before the last
/// level: longer than a robot takes from its full speed.
const RAISE_AFTER: Duration = Duration::from_millis(1_500);
/// How long an agent has to answer before it is asked again.
const ASK_TIMEOUT: Duration = Duration::from_millis(1_000);

#[derive(Debug)]
pub(super) struct StopOperation {
    request: StopRequest,
    /// Configured robots in scope.
    robots: BTreeSet<RobotName>,
    /// Names in scope that no robot of the cell has; they can never stand still.
    strangers: Vec<RobotName>,
    tickets: Vec<Ticket>,
    reached: BTreeMap<RobotName, StopAck>,
    /// Robots whose agents are being asked.
    asked: BTreeSet<RobotName>,
    begun: MonoTime,
    next_repeat: MonoTime,
    /// When robots that are late are stopped harder.
    next_raise: MonoTime,
    /// Level for robots that are late, once it was raised.
    raised: Option<StopLevel>,
    is_over: bool,
}

impl StopOperation {
    pub(super) fn begin<'r>(
        request: StopRequest,
        ticket: Ticket,
        configured: impl Iterator<Item = &'r RobotName>,
        now: MonoTime,
        outbox: &mut Outbox,
    ) -> Self {
        let robots: BTreeSet<_> =
            configured.filter(|robot| request.scope.includes(robot)).cloned().collect();
        let strangers = match &request.scope {
            StopScope::Cell => Vec::new(),
            StopScope::Robots(named) => {
                named.iter().filter(|robot| !robots.contains(*robot)).cloned().collect()
            }
        };
        let mut stop = Self {
            request,
            robots,
            strangers,
            tickets: vec![ticket],
            reached: BTreeMap::new(),
            asked: BTreeSet::new(),
            begun: now,
            next_repeat: now + REPEAT,
            next_raise: now + RAISE_AFTER,
            raised: None,
            is_over: false,
        };
        // First of all, before anything is written down.
        outbox.push(Action::PublishStop(stop.request.clone()));
        stop.ask_silent(outbox);
        outbox.record(now, happening(&stop.request, Severity::Warning, "asked for"));
        stop.conclude(now, outbox);
        stop
    }

    pub(super) const fn is_over(&self) -> bool {
        self.is_over
    }

    pub(super) fn concerns(&self, robot: &RobotName) -> bool {
        self.robots.contains(robot)
    }

    /// The same stop was asked for again: one more client waits for the verdict.
    pub(super) fn join(&mut self, ticket: Ticket) {
        self.tickets.push(ticket);
    }

    pub(super) fn next_deadline(&self) -> MonoTime {
        self.next_repeat.min(self.next_raise).min(self.begun + DEADLINE)
    }

    /// Takes a stage; a late lower one takes nothing back.
    pub(super) fn on_ack(&mut self, ack: &StopAck, now: MonoTime, outbox: &mut Outbox) {
        if ack.stop_id != self.request.stop_id || !self.robots.contains(&ack.robot) {
            return;
        }
        if self.reached.get(&ack.robot).is_none_or(|known| known.stage < ack.stage) {
            self.reached.insert(ack.robot.clone(), ack.clone());
        }
        self.conclude(now, outbox);
    }

    /// Notes that the agent of `robot` answered, or that it did not.
    pub(super) fn on_answer(&mut self, robot: &RobotName) {
        self.asked.remove(robot);
    }

    pub(super) fn on_time(&mut self, now: MonoTime, outbox: &mut Outbox) {
        if now >= self.begun + DEADLINE {
            return self.finish(now, outbox);
        }
        if now >= self.next_raise {
            self.next_raise = now + RAISE_AFTER;
            self.raise(now, outbox);
        }
        if now >= self.next_repeat {
            self.repeat_raised(outbox);
            if !self.all_reached(StopStage::Received) {
                self.request.seq += 1;
                outbox.push(Action::PublishStop(self.request.clone()));
                self.ask_silent(outbox);
            }
            let fast = now.saturating_since(self.begun) < FAST_PHASE;
            self.next_repeat = now + if fast { REPEAT } else { SLOW_REPEAT };
        }
    }

    /// Stops robots harder that are late.
    fn raise(&mut self, now: MonoTime, outbox: &mut Outbox) {
        let level = match self.raised.unwrap_or(self.request.level) {
            StopLevel::L2 => StopLevel::L1,
            StopLevel::L1 => StopLevel::L0,
            StopLevel::L0 => return,
        };
        self.raised = Some(level);
        let request = self.repeat_raised(outbox);
        let StopScope::Robots(late) = &request.scope else { return };
        let names: Vec<_> = late.iter().map(RobotName::as_str).collect();
        let what = format!("not known to stand still in time, raised: {}", names.join(", "));
        for robot in late {
            self.asked.insert(robot.clone());
            self.ask(robot, &request, outbox);
        }
        outbox.record(now, happening(&request, Severity::Error, &what));
    }

    /// Publishes the raised stop for robots that are late; returns it.
    fn repeat_raised(&mut self, outbox: &mut Outbox) -> StopRequest {
        let level = self.raised.unwrap_or(self.request.level);
        let late = self.robots.iter().filter(|r| !self.has_reached(r, StopStage::Standstill));
        let scope = StopScope::Robots(late.cloned().collect());
        if self.raised.is_some() {
            self.request.seq += 1;
        }
        let request = StopRequest { level, scope, ..self.request.clone() };
        if self.raised.is_some() {
            outbox.push(Action::PublishStop(request.clone()));
        }
        request
    }

    fn ask(&self, robot: &RobotName, request: &StopRequest, outbox: &mut Outbox) {
        outbox.ask(Question {
            robot,
            client: &self.request.source,
            lease: None,
            call: AgentCall::Stop(request.clone()),
            timeout: ASK_TIMEOUT,
            purpose: Purpose::Stop(self.request.stop_id),
        });
    }

    fn ask_silent(&mut self, outbox: &mut Outbox) {
        let silent: Vec<_> = self
            .robots
            .iter()
            .filter(|robot| !self.reached.contains_key(*robot))
            .cloned()
            .collect();
        for robot in silent {
            if self.asked.insert(robot.clone()) {
                self.ask(&robot, &self.request, outbox);
            }
        }
    }

    fn has_reached(&self, robot: &RobotName, stage: StopStage) -> bool {
        self.reached.get(robot).is_some_and(|ack| ack.stage >= stage)
    }

    fn all_reached(&self, stage: StopStage) -> bool {
        self.robots.iter().all(|robot| self.has_reached(robot, stage))
    }

    fn conclude(&mut self, now: MonoTime, outbox: &mut Outbox) {
        if self.all_reached(StopStage::Standstill) {
            self.finish(now, outbox);
        }
    }

    fn finish(&mut self, now: MonoTime, outbox: &mut Outbox) {
        if self.is_over {
            return;
        }
        self.is_over = true;
        let report = self.report();
        let severity = match report.verdict {
            StopVerdict::Complete => Severity::Info,
            StopVerdict::Incomplete => Severity::Error,
        };
        let what = match report.verdict {
            StopVerdict::Complete => "complete".to_owned(),
            StopVerdict::Incomplete => {
                let missing: Vec<_> = report.missing.iter().map(RobotName::as_str).collect();
                format!("INCOMPLETE, not known to stand still: [{}]", missing.join(", "))
            }
        };
        outbox.record(now, happening(&self.request, severity, &what));
        for ticket in self.tickets.drain(..) {
            outbox.answer(ticket, Ok(CellAnswer::Stopped(report.clone())));
        }
    }

    fn report(&self) -> StopReport {
        let moving = |robot: &&RobotName| !self.has_reached(robot, StopStage::Standstill);
        let missing: Vec<_> =
            self.robots.iter().filter(moving).chain(&self.strangers).cloned().collect();
        // A stop that nobody was to follow proves nothing.
        let complete = missing.is_empty() && !self.robots.is_empty();
        StopReport {
            stop_id: self.request.stop_id,
            verdict: if complete { StopVerdict::Complete } else { StopVerdict::Incomplete },
            acks: self.reached.values().cloned().collect(),
            missing,
        }
    }
}

/// The event of a stop.
pub(super) fn happening(
    request: &StopRequest,
    severity: Severity,
    what: &str,
) -> Happening<'static> {
    let StopRequest { stop_id, source, level, reason, .. } = request;
    let reason = if reason.is_empty() { String::new() } else { format!(" ({reason})") };
    let details = Map::from_iter([("stop_id".to_owned(), Value::from(stop_id.to_string()))]);
    let message = format!("stop {level:?} by {source:?}{reason}: {what}");
    Happening { severity, kind: EventKind::Stop, robot: None, message, details }
}
