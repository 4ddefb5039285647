//! A reset of latched stops: each robot is told to clear what whoever asks was shown.
//!
//! Stops that came since are not cleared: the agent refuses a list that is not complete, or a number
//! that is of the past. The gateway makes no list of its own and has no key.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    CellResetAnswer, CellResetParams, Denial, DenialCode, EventKind, Severity,
};
use serde_json::Map;

use super::io::{AgentAnswer, AgentCall, CellAnswer, Ticket};
use super::outbox::{Happening, Outbox, Purpose, Question};
use super::plan;
use super::robot::RobotRecord;

/// How long an agent may take, which writes to a disk.
const RESET_TIMEOUT: Duration = Duration::from_millis(2_000);

/// A request for a reset.
pub(super) struct ResetOrder {
    pub(super) number: u64,
    pub(super) ticket: Ticket,
    pub(super) client: String,
    pub(super) params: CellResetParams,
}

#[derive(Debug)]
pub(super) struct ResetOperation {
    number: u64,
    client: String,
    ticket: Option<Ticket>,
    /// Robots whose agents have not answered yet.
    waiting: BTreeSet<RobotName>,
    answer: CellResetAnswer,
}

impl ResetOperation {
    /// Begins with every robot that is named.
    pub(super) fn begin(
        order: ResetOrder,
        robots: &BTreeMap<RobotName, RobotRecord>,
        outbox: &mut Outbox,
    ) -> Self {
        let ResetOrder { number, ticket, client, params } = order;
        let answer = CellResetAnswer { reset: Vec::new(), refused: Vec::new() };
        let mut reset =
            Self { number, client, ticket: Some(ticket), waiting: BTreeSet::new(), answer };
        for (robot, params) in params.resets {
            match robots.get(&robot) {
                None => {
                    let text = "the cell has no such robot";
                    let denial = plan::of(&robot, DenialCode::InvalidArgument, text);
                    reset.answer.refused.push((robot, denial));
                }
                Some(record) if !record.is_online() => {
                    let denial = plan::offline(&robot);
                    reset.answer.refused.push((robot, denial));
                }
                Some(_) => {
                    reset.ask(&robot, AgentCall::Reset(Box::new(params)), outbox);
                    reset.waiting.insert(robot);
                }
            }
        }
        reset
    }

    pub(super) const fn is_over(&self) -> bool {
        self.ticket.is_none()
    }

    pub(super) fn on_answer(&mut self, robot: &RobotName, result: Result<AgentAnswer, Denial>) {
        if !self.waiting.contains(robot) {
            return;
        }
        match result {
            Ok(AgentAnswer::Reset(answer)) => {
                self.waiting.remove(robot);
                self.answer.reset.push((robot.clone(), answer.cleared));
            }
            Ok(_) => {}
            Err(denial) => {
                self.waiting.remove(robot);
                self.answer.refused.push((robot.clone(), plan::by(robot, denial)));
            }
        }
    }

    /// Answers the client once every robot has answered.
    pub(super) fn conclude(&mut self, now: MonoTime, outbox: &mut Outbox) {
        if !self.waiting.is_empty() {
            return;
        }
        let Some(ticket) = self.ticket.take() else { return };
        self.answer.reset.sort_by(|a, b| a.0.cmp(&b.0));
        self.answer.refused.sort_by(|a, b| a.0.cmp(&b.0));
        let names = |robots: Vec<&RobotName>| {
            robots.into_iter().map(RobotName::as_str).collect::<Vec<_>>().join(", ")
        };
        let reset = names(self.answer.reset.iter().map(|(robot, _)| robot).collect());
        let refused = names(self.answer.refused.iter().map(|(robot, _)| robot).collect());
        let severity =
            if self.answer.refused.is_empty() { Severity::Info } else { Severity::Warning };
        let message = format!("{} reset [{reset}], refused by [{refused}]", self.client);
        let (kind, details) = (EventKind::Reset, Map::new());
        outbox.record(now, Happening { severity, kind, robot: None, message, details });
        outbox.answer(ticket, Ok(CellAnswer::Reset(self.answer.clone())));
    }

    fn ask(&self, robot: &RobotName, call: AgentCall, outbox: &mut Outbox) {
        let (client, purpose) = (self.client.as_str(), Purpose::Reset(self.number));
        let timeout = RESET_TIMEOUT;
        outbox.ask(Question { robot, client, lease: None, call, timeout, purpose });
    }
}
