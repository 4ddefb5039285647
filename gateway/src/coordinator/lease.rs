//! Leases of several robots, all or none.
//!
//! ```text
//! acquire:  Acquiring, one robot after the other --> Renewing, all at once --> granted
//!               '------------- refusal, silence -----------'--> Releasing --> refused
//! renew:    Renewing --> answered        release:  Releasing --> answered
//! ```
//! Robots are asked in the order of their names, so that two clients never wait for each other.
//! What is acquired lasts half a second at first: a grant whose answer is lost, and everything that
//! a gateway leaves behind that vanishes meanwhile, runs out by itself. Only when all robots have
//! granted theirs are they renewed to the time that was asked for, and that is what is answered.
//! The leases are the client's; the gateway keeps none of them.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    AcquireLeaseParams, Denial, DenialCode, GroupLease, GroupLeaseReleased, LeaseGrant,
    RenewLeaseParams, Role,
};
use uuid::Uuid;

use super::io::{AgentAnswer, AgentCall, CellAnswer, Ticket};
use super::outbox::{CallKind, Outbox, Purpose, Question};
use super::plan;

/// How long a lease lasts until all robots have granted theirs \[ms\].
const PROVISIONAL_MS: u64 = 500;
/// How long one robot may take; shorter than a provisional lease lasts.
const ACQUIRE_TIMEOUT: Duration = Duration::from_millis(400);
/// The same for renewing and releasing, which are repeated if they are not answered; all together is
/// less than the client waits.
const REPEATED_TIMEOUT: Duration = Duration::from_millis(300);
const ATTEMPTS: u32 = 3;
/// When no further robot is asked; the client waits for four seconds.
const PATIENCE: Duration = Duration::from_millis(1_500);
/// Times that a lease may last \[ms\].
const TTL_MS: std::ops::RangeInclusive<u64> = 200..=60_000;

/// What a client wants.
#[derive(Debug)]
pub(super) enum LeaseOrder {
    Acquire { robots: Vec<RobotName>, ttl_ms: u64, role: Role },
    Renew(BTreeMap<RobotName, Uuid>),
    Release(BTreeMap<RobotName, Uuid>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Acquiring,
    Renewing,
    Releasing,
}

#[derive(Debug)]
pub(super) struct LeaseOperation {
    number: u64,
    client: String,
    /// Until the client is answered.
    ticket: Option<Ticket>,
    begun: MonoTime,
    /// Where it began.
    wanted: Stage,
    stage: Stage,
    /// Time the leases are to last and as what, where they are acquired.
    terms: Option<(u64, Role)>,
    /// Robots whose leases are still to be acquired.
    next: VecDeque<RobotName>,
    /// What is known to be held.
    held: BTreeMap<RobotName, Uuid>,
    /// Robots that are being asked, and how often they were.
    waiting: BTreeMap<RobotName, u32>,
    renewed: BTreeMap<RobotName, LeaseGrant>,
    released: Vec<RobotName>,
    refused: Vec<(RobotName, Denial)>,
    /// Robots that did not take their lease back.
    unreleased: Vec<RobotName>,
}

impl LeaseOperation {
    /// Begins to ask.
    ///
    /// # Errors
    /// A denial if the time that the leases are to last is out of range, or there is nobody to ask.
    pub(super) fn begin(
        number: u64,
        ticket: Ticket,
        client: &str,
        order: LeaseOrder,
        now: MonoTime,
        outbox: &mut Outbox,
    ) -> Result<Self, Denial> {
        let (wanted, terms, next, held) = match order {
            LeaseOrder::Acquire { mut robots, ttl_ms, role } => {
                check_ttl(ttl_ms)?;
                robots.sort();
                robots.dedup();
                (Stage::Acquiring, Some((ttl_ms, role)), robots.into(), BTreeMap::new())
            }
            LeaseOrder::Renew(leases) => (Stage::Renewing, None, VecDeque::new(), leases),
            LeaseOrder::Release(leases) => (Stage::Releasing, None, VecDeque::new(), leases),
        };
        if next.is_empty() && held.is_empty() {
            let message = "leases is empty: name the lease of each robot";
            return Err(Denial::new(DenialCode::InvalidArgument, message).with("field", "leases"));
        }
        let mut operation = Self {
            number,
            client: client.to_owned(),
            ticket: Some(ticket),
            begun: now,
            wanted,
            stage: wanted,
            terms,
            next,
            held,
            waiting: BTreeMap::new(),
            renewed: BTreeMap::new(),
            released: Vec::new(),
            refused: Vec::new(),
            unreleased: Vec::new(),
        };
        match wanted {
            Stage::Acquiring => operation.acquire_next(now, outbox),
            Stage::Renewing | Stage::Releasing => operation.ask_all(outbox),
        }
        Ok(operation)
    }

    pub(super) const fn is_over(&self) -> bool {
        self.ticket.is_none()
    }

    /// Takes the one answer to a question.
    pub(super) fn on_answer(
        &mut self,
        robot: &RobotName,
        call: CallKind,
        result: Result<AgentAnswer, Denial>,
        now: MonoTime,
        outbox: &mut Outbox,
    ) {
        let fits = match self.stage {
            Stage::Acquiring => CallKind::AcquireLease,
            Stage::Renewing => CallKind::RenewLease,
            Stage::Releasing => CallKind::ReleaseLease,
        };
        if call != fits || !self.waiting.contains_key(robot) {
            return;
        }
        match (self.stage, result) {
            (_, Err(denial)) => self.on_refusal(robot, denial, outbox),
            (Stage::Acquiring, Ok(AgentAnswer::Lease(grant))) => {
                self.waiting.remove(robot);
                self.held.insert(robot.clone(), grant.lease);
                self.acquire_next(now, outbox);
            }
            (Stage::Renewing, Ok(AgentAnswer::Lease(grant))) => {
                self.waiting.remove(robot);
                self.renewed.insert(robot.clone(), grant);
            }
            (Stage::Releasing, Ok(_)) => {
                self.waiting.remove(robot);
                self.released.push(robot.clone());
            }
            // Not an answer to this question.
            (Stage::Acquiring | Stage::Renewing, Ok(_)) => {}
        }
        self.conclude(outbox);
    }

    fn on_refusal(&mut self, robot: &RobotName, denial: Denial, outbox: &mut Outbox) {
        let is_unknown = plan::is_unknown(&denial);
        let tries = self.waiting.get(robot).copied().unwrap_or_default();
        // To acquire again could find the lease that the lost answer told of.
        if is_unknown && self.stage != Stage::Acquiring && tries < ATTEMPTS {
            self.waiting.insert(robot.clone(), tries + 1);
            return self.ask(robot, outbox);
        }
        self.waiting.remove(robot);
        let is_gone = denial.code == DenialCode::LeaseStale;
        if self.stage == Stage::Releasing && tries > 1 && is_gone {
            // The answer to the first was lost.
            self.released.push(robot.clone());
        } else if self.stage == Stage::Releasing && self.wanted == Stage::Acquiring {
            // Somebody else's, or run out, is as good as released.
            if is_unknown {
                self.unreleased.push(robot.clone());
            }
        } else {
            self.refused.push((robot.clone(), plan::by(robot, denial)));
        }
    }

    /// Goes on once everybody who was asked has answered.
    fn conclude(&mut self, outbox: &mut Outbox) {
        if !self.waiting.is_empty() {
            return;
        }
        let is_acquiring = self.wanted == Stage::Acquiring;
        match self.stage {
            Stage::Acquiring | Stage::Renewing if is_acquiring && !self.refused.is_empty() => {
                self.next.clear();
                self.stage = Stage::Releasing;
                self.ask_all(outbox);
                // There may be nothing to release.
                if self.waiting.is_empty() {
                    self.answer(outbox);
                }
            }
            Stage::Acquiring => {
                self.stage = Stage::Renewing;
                self.ask_all(outbox);
            }
            Stage::Renewing | Stage::Releasing => self.answer(outbox),
        }
    }

    fn answer(&mut self, outbox: &mut Outbox) {
        let Some(ticket) = self.ticket.take() else { return };
        let result = match self.wanted {
            Stage::Releasing => Ok(CellAnswer::LeaseReleased(GroupLeaseReleased {
                released: std::mem::take(&mut self.released),
                refused: std::mem::take(&mut self.refused),
            })),
            Stage::Acquiring | Stage::Renewing if self.refused.is_empty() => {
                Ok(CellAnswer::Lease(GroupLease { leases: std::mem::take(&mut self.renewed) }))
            }
            Stage::Acquiring | Stage::Renewing => Err(self.denial()),
        };
        outbox.answer(ticket, result);
    }

    fn denial(&self) -> Denial {
        let names = |robots: &mut dyn Iterator<Item = &RobotName>| {
            robots.map(RobotName::to_string).collect::<Vec<_>>()
        };
        let mut denial = match self.refused.first() {
            Some((_, first)) => first.clone(),
            None => Denial::new(DenialCode::Internal, "a lease was not granted"),
        };
        let messages = self.refused.iter().map(|(_, denial)| denial.message.as_str());
        denial.message = messages.collect::<Vec<_>>().join("; ");
        denial = denial.with("refused", names(&mut self.refused.iter().map(|(robot, _)| robot)));
        if self.wanted == Stage::Renewing {
            denial = denial.with("renewed", names(&mut self.renewed.keys()));
        }
        if !self.unreleased.is_empty() {
            let unreleased = names(&mut self.unreleased.iter());
            let message = format!("; not given back, runs out: {}", unreleased.join(", "));
            denial.message.push_str(&message);
            denial = denial.with("unreleased", unreleased);
        }
        denial
    }

    fn acquire_next(&mut self, now: MonoTime, outbox: &mut Outbox) {
        let Some(robot) = self.next.pop_front() else { return };
        if now.saturating_since(self.begun) > PATIENCE {
            let message = format!("the others took more than {} ms", PATIENCE.as_millis());
            self.refused.push((robot.clone(), plan::of(&robot, DenialCode::Timeout, &message)));
            return;
        }
        self.waiting.insert(robot.clone(), 1);
        self.ask(&robot, outbox);
    }

    fn ask_all(&mut self, outbox: &mut Outbox) {
        for robot in self.held.keys().cloned().collect::<Vec<_>>() {
            self.waiting.insert(robot.clone(), 1);
            self.ask(&robot, outbox);
        }
    }

    fn ask(&self, robot: &RobotName, outbox: &mut Outbox) {
        let lease = self.held.get(robot).copied();
        let (call, timeout) = match (self.stage, lease) {
            (Stage::Acquiring, _) => {
                let (ttl_ms, role) = self.terms.unwrap_or_default();
                let ttl_ms = ttl_ms.min(PROVISIONAL_MS);
                (AgentCall::AcquireLease(AcquireLeaseParams { ttl_ms, role }), ACQUIRE_TIMEOUT)
            }
            (Stage::Renewing, Some(lease)) => {
                let ttl_ms = self.terms.map(|(ttl_ms, _)| ttl_ms);
                (AgentCall::RenewLease(RenewLeaseParams { lease, ttl_ms }), REPEATED_TIMEOUT)
            }
            (Stage::Releasing, Some(lease)) => (AgentCall::ReleaseLease(lease), REPEATED_TIMEOUT),
            (Stage::Renewing | Stage::Releasing, None) => return,
        };
        let (client, purpose) = (self.client.as_str(), Purpose::Lease(self.number));
        outbox.ask(Question { robot, client, lease: None, call, timeout, purpose });
    }
}

fn check_ttl(ttl_ms: u64) -> Result<(), Denial> {
    if TTL_MS.contains(&ttl_ms) {
        return Ok(());
    }
    let (least, most) = (TTL_MS.start(), TTL_MS.end());
    let message = format!("ttl_ms is {ttl_ms}, expected {least} to {most}");
    Err(Denial::new(DenialCode::OutOfRange, message).with("field", "ttl_ms").with("value", ttl_ms))
}
