//! Actions on their way out, questions on their way, and the numbered audit trail.

use std::collections::BTreeMap;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{Denial, DenialCode, Event, EventKind, Severity};
use serde_json::{Map, Value};
use uuid::Uuid;

use super::io::{Action, AgentCall, AskId, CellAnswer, CheckId, Ticket};
use crate::world::ClearanceRequest;

/// Checks of clearances under way at once: each keeps a processor busy.
const MAX_CHECKS: usize = 2;

/// Why something was asked: where the answer goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// To keep the robot's record current.
    Record,
    /// For a motion of several robots.
    Group(Uuid),
    /// For a stop.
    Stop(Uuid),
    /// For a reset, by its number.
    Reset(u64),
    /// For a change of a motion that goes on, by its number.
    Control(u64),
    /// For leases of several robots, by its number.
    Lease(u64),
}

/// For whom a clearance is checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum CheckFor {
    /// For a motion of several robots.
    Group(Uuid),
    /// For a client that waits.
    Client(Ticket, String),
}

/// A question that was not answered yet.
#[derive(Clone, Debug)]
pub(super) struct Pending {
    pub(super) robot: RobotName,
    pub(super) purpose: Purpose,
    pub(super) call: CallKind,
}

/// An [`AgentCall`] without what it carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CallKind {
    Clock,
    Info,
    Status,
    Motion,
    SetMode,
    Prepare,
    Commit,
    Abort,
    Stop,
    Reset,
    Control,
    AcquireLease,
    RenewLease,
    ReleaseLease,
}

/// A question before it is asked.
pub(super) struct Question<'a> {
    pub(super) robot: &'a RobotName,
    pub(super) client: &'a str,
    pub(super) lease: Option<Uuid>,
    pub(super) call: AgentCall,
    pub(super) timeout: Duration,
    pub(super) purpose: Purpose,
}

/// An event before it is numbered.
pub(super) struct Happening<'a> {
    pub(super) severity: Severity,
    pub(super) kind: EventKind,
    pub(super) robot: Option<&'a RobotName>,
    pub(super) message: String,
    pub(super) details: Map<String, Value>,
}

/// Everything that leaves the coordinator passes here.
#[derive(Debug)]
pub(super) struct Outbox {
    boot_id: Uuid,
    actions: Vec<Action>,
    pending: BTreeMap<AskId, Pending>,
    next_ask: u64,
    checks: BTreeMap<CheckId, CheckFor>,
    next_check: u64,
    next_event: u64,
}

impl Outbox {
    pub(super) const fn new(boot_id: Uuid) -> Self {
        Self {
            boot_id,
            actions: Vec::new(),
            pending: BTreeMap::new(),
            next_ask: 0,
            checks: BTreeMap::new(),
            next_check: 0,
            next_event: 0,
        }
    }

    pub(super) const fn boot_id(&self) -> Uuid {
        self.boot_id
    }

    pub(super) fn take_actions(&mut self) -> Vec<Action> {
        std::mem::take(&mut self.actions)
    }

    pub(super) fn ask(&mut self, question: Question<'_>) {
        let Question { robot, client, lease, call, timeout, purpose } = question;
        let ask = AskId(self.next_ask);
        self.next_ask += 1;
        let pending = Pending { robot: robot.clone(), purpose, call: kind_of(&call) };
        self.pending.insert(ask, pending);
        self.actions.push(Action::Ask {
            ask,
            robot: robot.clone(),
            client: client.to_owned(),
            lease,
            call,
            timeout,
        });
    }

    /// Has a clearance checked.
    ///
    /// # Errors
    /// A denial if as many checks as there may be are under way.
    pub(super) fn check(
        &mut self,
        request: ClearanceRequest,
        reason: CheckFor,
    ) -> Result<(), Denial> {
        if self.checks.len() >= MAX_CHECKS {
            let message = format!("{MAX_CHECKS} clearances are being checked, try again");
            return Err(Denial::new(DenialCode::Busy, message));
        }
        let is_of_client = |reason: &CheckFor| matches!(reason, CheckFor::Client(..));
        if is_of_client(&reason) && self.checks.values().any(is_of_client) {
            // A place is left for motions, which hold their robots while they wait.
            let message = "the clearance of another request is being checked, try again";
            return Err(Denial::new(DenialCode::Busy, message));
        }
        let check = CheckId(self.next_check);
        self.next_check += 1;
        self.checks.insert(check, reason);
        self.actions.push(Action::CheckClearance { check, request: Box::new(request) });
        Ok(())
    }

    /// Whom the result of `check` is for; `None` if it came before.
    pub(super) fn settle_check(&mut self, check: CheckId) -> Option<CheckFor> {
        self.checks.remove(&check)
    }

    /// What the answer to `ask` is for; `None` if it was answered before.
    pub(super) fn settle(&mut self, ask: AskId) -> Option<Pending> {
        self.pending.remove(&ask)
    }

    pub(super) fn answer(&mut self, ticket: Ticket, result: Result<CellAnswer, Denial>) {
        self.actions.push(Action::Answer { ticket, result });
    }

    pub(super) fn push(&mut self, action: Action) {
        self.actions.push(action);
    }

    /// Publishes an event with the next number.
    pub(super) fn record(&mut self, now: MonoTime, happening: Happening<'_>) {
        let Happening { severity, kind, robot, message, details } = happening;
        self.publish_event(Event {
            robot: robot.cloned(),
            boot_id: self.boot_id,
            seqno: 0,
            stamp_ns: now,
            utc_ns: 0,
            severity,
            kind,
            message,
            details,
        });
    }

    /// Publishes an event as the gateway's next one.
    pub(super) fn publish_event(&mut self, mut event: Event) {
        event.boot_id = self.boot_id;
        event.seqno = self.next_event;
        self.next_event += 1;
        self.actions.push(Action::PublishEvent(Box::new(event)));
    }
}

const fn kind_of(call: &AgentCall) -> CallKind {
    match call {
        AgentCall::Clock => CallKind::Clock,
        AgentCall::Info => CallKind::Info,
        AgentCall::Status => CallKind::Status,
        AgentCall::Motion(_) => CallKind::Motion,
        AgentCall::SetMode(_) => CallKind::SetMode,
        AgentCall::Prepare(_) => CallKind::Prepare,
        AgentCall::Commit(_) => CallKind::Commit,
        AgentCall::Abort(_) => CallKind::Abort,
        AgentCall::Stop(_) => CallKind::Stop,
        AgentCall::Reset(_) => CallKind::Reset,
        AgentCall::Control(..) => CallKind::Control,
        AgentCall::AcquireLease(_) => CallKind::AcquireLease,
        AgentCall::RenewLease(_) => CallKind::RenewLease,
        AgentCall::ReleaseLease(_) => CallKind::ReleaseLease,
    }
}
