//! A change of a motion that goes on: every robot is asked at once, the client is answered when all
//! have answered.
//!
//! Nothing is taken back if one refuses. The lowest rate that any robot allows is that of all, so a
//! pause or a lower speed counts as soon as one robot has it, and a higher one when all have it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::messages::{Denial, SpeedRatioAnswer};
use uuid::Uuid;

use super::io::{AgentAnswer, AgentCall, CellAnswer, Control, Ticket};
use super::outbox::{Outbox, Purpose, Question};
use super::plan;

const TIMEOUT: Duration = Duration::from_millis(2_000);

/// What is to be changed, and who takes part.
pub(super) struct ControlOrder<'a> {
    pub(super) ticket: Ticket,
    pub(super) client: &'a str,
    pub(super) motion_id: Uuid,
    pub(super) control: Control,
    /// The robots, each with the lease under which it is asked.
    pub(super) robots: BTreeMap<RobotName, Option<Uuid>>,
}

#[derive(Debug)]
pub(super) struct ControlOperation {
    /// Until the client is answered.
    ticket: Option<Ticket>,
    control: Control,
    waiting: BTreeSet<RobotName>,
    done: Vec<RobotName>,
    refused: Vec<(RobotName, Denial)>,
    /// Lowest speed that a robot answered.
    speed_ratio: f64,
}

impl ControlOperation {
    pub(super) fn begin(number: u64, order: ControlOrder<'_>, outbox: &mut Outbox) -> Self {
        let ControlOrder { ticket, client, motion_id, control, robots } = order;
        for (robot, lease) in &robots {
            outbox.ask(Question {
                robot,
                client,
                lease: *lease,
                call: AgentCall::Control(motion_id, control),
                timeout: TIMEOUT,
                purpose: Purpose::Control(number),
            });
        }
        Self {
            ticket: Some(ticket),
            control,
            waiting: robots.into_keys().collect(),
            done: Vec::new(),
            refused: Vec::new(),
            speed_ratio: 1.0,
        }
    }

    pub(super) const fn is_over(&self) -> bool {
        self.ticket.is_none()
    }

    pub(super) fn on_answer(
        &mut self,
        robot: &RobotName,
        result: Result<AgentAnswer, Denial>,
        outbox: &mut Outbox,
    ) {
        if !self.waiting.remove(robot) {
            return;
        }
        match result {
            Ok(answer) => {
                if let AgentAnswer::SpeedRatio(SpeedRatioAnswer { speed_ratio }) = answer {
                    self.speed_ratio = self.speed_ratio.min(speed_ratio);
                }
                self.done.push(robot.clone());
            }
            Err(denial) => self.refused.push((robot.clone(), plan::by(robot, denial))),
        }
        if self.waiting.is_empty()
            && let Some(ticket) = self.ticket.take()
        {
            outbox.answer(ticket, self.result());
        }
    }

    fn result(&self) -> Result<CellAnswer, Denial> {
        let Some((_, first)) = self.refused.first() else {
            let speed_ratio = self.speed_ratio;
            return Ok(match self.control {
                Control::SpeedRatio(_) => CellAnswer::SpeedRatio(SpeedRatioAnswer { speed_ratio }),
                Control::Pause | Control::Resume => CellAnswer::Controlled,
            });
        };
        let message = self.refused.iter().map(|(_, denial)| denial.message.as_str());
        let message = message.collect::<Vec<_>>().join("; ");
        let names = |robots: Vec<&RobotName>| {
            robots.into_iter().map(RobotName::to_string).collect::<Vec<_>>()
        };
        let refused = names(self.refused.iter().map(|(robot, _)| robot).collect());
        Err(Denial { message, ..first.clone() }
            .with("refused", refused)
            .with("done", names(self.done.iter().collect())))
    }
}
