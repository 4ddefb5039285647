//! A stop of the cell, from the request to the verdict.
//!
//! The stop is published again and again until every robot in scope has it, and every agent is
//! asked directly as well. The verdict comes from what the agents measured, never from silence.
//!
//! A robot that is not measured to stand within the time that its agent declares is stopped harder:
//! what was `L2` becomes `L1` and then `L0`, under the same identity, for the robots that are late
//! and for no others.

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
/// How long a robot has at least to stand still before it is stopped harder, and again before the
/// last level; more if it declares that it takes longer.
const RAISE_AFTER: Duration = Duration::from_millis(1_500);
/// What the stop's way to a robot and its acknowledgement's way back may add to what it declares.
const WAYS: Duration = Duration::from_millis(250);
/// How long an agent has to answer before it is asked again.
const ASK_TIMEOUT: Duration = Duration::from_millis(1_000);

#[derive(Debug)]
pub(super) struct StopOperation {
    request: StopRequest,
    /// Configured robots in scope.
    robots: BTreeMap<RobotName, Rung>,
    /// Names in scope that no robot of the cell has; they can never stand still.
    strangers: Vec<RobotName>,
    tickets: Vec<Ticket>,
    reached: BTreeMap<RobotName, StopAck>,
    /// Robots whose agents are being asked.
    asked: BTreeSet<RobotName>,
    begun: MonoTime,
    next_repeat: MonoTime,
    is_over: bool,
}

/// How hard one robot is stopped.
#[derive(Clone, Copy, Debug)]
struct Rung {
    level: StopLevel,
    /// How long it has to stand still at each level.
    time: Duration,
    /// When that is over.
    due: MonoTime,
}

impl StopOperation {
    /// Of robots that are `configured`, each with the stop time that it declares, if it is known.
    pub(super) fn begin<'r>(
        request: StopRequest,
        ticket: Ticket,
        configured: impl Iterator<Item = (&'r RobotName, Option<Duration>)>,
        now: MonoTime,
        outbox: &mut Outbox,
    ) -> Self {
        let rung = |declared: Option<Duration>| {
            let time = declared.map_or(RAISE_AFTER, |time| RAISE_AFTER.max(time + WAYS));
            Rung { level: request.level, time, due: now + time }
        };
        let robots: BTreeMap<_, _> = configured
            .filter(|(robot, _)| request.scope.includes(robot))
            .map(|(robot, declared)| (robot.clone(), rung(declared)))
            .collect();
        let strangers = match &request.scope {
            StopScope::Cell => Vec::new(),
            StopScope::Robots(named) => {
                named.iter().filter(|robot| !robots.contains_key(*robot)).cloned().collect()
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
        self.robots.contains_key(robot)
    }

    /// The same stop was asked for again: one more client waits for the verdict.
    pub(super) fn join(&mut self, ticket: Ticket) {
        self.tickets.push(ticket);
    }

    pub(super) fn next_deadline(&self) -> MonoTime {
        let due = self.robots.iter().filter(|(robot, rung)| {
            rung.level.harder().is_some() && !self.has_reached(robot, StopStage::Standstill)
        });
        let first = due.map(|(_, rung)| rung.due).fold(self.begun + DEADLINE, MonoTime::min);
        self.next_repeat.min(first)
    }

    /// Takes a stage; a late lower one takes nothing back.
    pub(super) fn on_ack(&mut self, ack: &StopAck, now: MonoTime, outbox: &mut Outbox) {
        if ack.stop_id != self.request.stop_id || !self.robots.contains_key(&ack.robot) {
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
        self.raise(now, outbox);
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
        let mut late: BTreeMap<StopLevel, Vec<RobotName>> = BTreeMap::new();
        for (robot, rung) in &mut self.robots {
            let stands = self.reached.get(robot).is_some_and(|a| a.stage >= StopStage::Standstill);
            if let Some(level) = rung.level.harder().filter(|_| now >= rung.due && !stands) {
                (rung.level, rung.due) = (level, now + rung.time);
                late.entry(level).or_default().push(robot.clone());
            }
        }
        for (level, robots) in late {
            let request = self.publish_raised(level, robots.clone(), outbox);
            for robot in &robots {
                self.asked.insert(robot.clone());
                self.ask(robot, &request, outbox);
            }
            let names: Vec<_> = robots.iter().map(RobotName::as_str).collect();
            let what = format!("not known to stand still in time, raised: {}", names.join(", "));
            outbox.record(now, happening(&request, Severity::Error, &what));
        }
    }

    /// Publishes again what was raised for robots that still do not stand.
    fn repeat_raised(&mut self, outbox: &mut Outbox) {
        let mut late: BTreeMap<StopLevel, Vec<RobotName>> = BTreeMap::new();
        for (robot, rung) in &self.robots {
            if rung.level > self.request.level && !self.has_reached(robot, StopStage::Standstill) {
                late.entry(rung.level).or_default().push(robot.clone());
            }
        }
        for (level, robots) in late {
            self.publish_raised(level, robots, outbox);
        }
    }

    fn publish_raised(
        &mut self,
        level: StopLevel,
        robots: Vec<RobotName>,
        outbox: &mut Outbox,
    ) -> StopRequest {
        self.request.seq += 1;
        let scope = StopScope::Robots(robots);
        let request = StopRequest { level, scope, ..self.request.clone() };
        outbox.push(Action::PublishStop(request.clone()));
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
            .keys()
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
        self.robots.keys().all(|robot| self.has_reached(robot, stage))
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
            self.robots.keys().filter(moving).chain(&self.strangers).cloned().collect();
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
