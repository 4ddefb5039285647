//! What the agent knows of its robot, outside the loop thread.
//!
//! Behind one lock that is held for moments only; neither the loop nor the stop's callback takes
//! it. The desk writes it from the loop's events, requests and queries read it.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Mutex, MutexGuard, PoisonError};

use armada_model::MonoTime;
use armada_protocol::messages::{
    ClearBy, Denial, DenialCode, Fault, FaultCode, LoopStatistics, RobotStatus, StopStage,
    StreamStatistics,
};
use uuid::Uuid;

use super::connected::Connected;
use super::leases::Leases;
use super::motion_log::MotionLog;
use super::stop_latch::{ResetRules, StopRecord};
use super::why::{FirstTold, Known, next, why};
use super::words::{Vocabulary, role_name};
use crate::control::{DroppedSamples, Granted, Refusal, Snapshot, StreamReport};
use crate::drivers::LinkRefusal;
use crate::stop_sources::StopSources;
use tokio::sync::oneshot;

/// The board behind its lock.
#[derive(Debug)]
pub(super) struct SharedBoard(Mutex<Board>);

impl SharedBoard {
    pub(super) const fn new(board: Board) -> Self {
        Self(Mutex::new(board))
    }

    /// The board; one that was left by a panic is still the best there is.
    pub(super) fn lock(&self) -> MutexGuard<'_, Board> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What is known of the robot.
#[derive(Debug)]
pub(super) struct Board {
    pub(super) vocabulary: Vocabulary,
    pub(super) boot_id: Uuid,
    pub(super) snapshot: Snapshot,
    pub(super) motions: MotionLog,
    pub(super) connected: Connected,
    pub(super) faults: Vec<Fault>,
    pub(super) leases: Leases,
    /// Since when the pendant has had control.
    pub(super) local_since: Option<MonoTime>,
    /// Since when the other reasons have been told for which the robot is as it is.
    first_told: FirstTold,
    /// Why the controller does not serve this client, if it says so.
    pub(super) link_refusal: Option<LinkRefusal>,
    pub(super) stop: Option<StopRecord>,
    /// Who had which stops cleared, until the loop has seen it.
    pub(super) reset_by: Option<(String, Vec<Uuid>)>,
    pub(super) reset_rules: ResetRules,
    /// Whether the robot is moved under a lease only.
    pub(super) lease_required: bool,
    pub(super) stop_sources: StopSources,
    /// Stages the loop has reported since the gate was closed, with their times.
    pub(super) stages: Vec<(StopStage, MonoTime)>,
    pub(super) statistics: LoopStatistics,
    /// Steps that panicked, which the loop itself may be unable to tell.
    pub(super) panics: u64,
    pub(super) dropped: BTreeMap<String, u64>,
    pub(super) status_seqno: u64,
    /// Askers that wait for an answer of the loop.
    pub(super) tickets: HashMap<u64, oneshot::Sender<Result<Granted, Refusal>>>,
    pub(super) next_ticket: u64,
}

impl Board {
    /// A board on which nothing is known yet.
    pub(super) fn new(vocabulary: Vocabulary, boot_id: Uuid, snapshot: Snapshot) -> Self {
        let robot = vocabulary.robot.clone();
        Self {
            vocabulary,
            boot_id,
            snapshot,
            motions: MotionLog::default(),
            connected: Connected::default(),
            faults: Vec::new(),
            leases: Leases::default(),
            local_since: None,
            first_told: FirstTold::default(),
            link_refusal: None,
            stop: None,
            reset_by: None,
            reset_rules: ResetRules::default(),
            lease_required: false,
            stop_sources: StopSources::new(robot, Vec::new(), MonoTime::ZERO),
            stages: Vec::new(),
            statistics: LoopStatistics::default(),
            panics: 0,
            dropped: BTreeMap::new(),
            status_seqno: 0,
            tickets: HashMap::new(),
            next_ticket: 1,
        }
    }

    /// Counts something that was dropped or refused.
    pub(super) fn count_dropped(&mut self, what: &str) {
        match self.dropped.get_mut(what) {
            Some(count) => *count += 1,
            None => {
                self.dropped.insert(what.to_owned(), 1);
            }
        }
    }

    /// Counts a refused request by its code.
    pub(super) fn count_denied(&mut self, code: DenialCode) {
        self.count_dropped(&format!("denied_{code}"));
    }

    /// The denial that a refusal of the loop means, with the name of who holds the lease.
    pub(super) fn denial(&self, refusal: &Refusal) -> Denial {
        let denial = self.vocabulary.denial(refusal);
        if let (Refusal::LeaseTaken, Some(holder)) = (refusal, self.leases.holder()) {
            // The event of the grant came before that of the motion's end.
            let (robot, who) = (&self.vocabulary.robot, holder.title());
            let message = format!("{robot}: the lease went to {who}");
            return Denial { message, ..denial }.with("holder", holder.name.as_str());
        }
        let Some(held) = self.snapshot.lease else { return denial };
        let (name, role) = (self.leases.name(held.lease), held.role);
        match refusal {
            &Refusal::LeaseRequired { remaining_s } => {
                self.vocabulary.driven_by((name, role), remaining_s)
            }
            Refusal::LeaseStale | Refusal::RoleTooLow { .. } | Refusal::ScopeTooNarrow { .. } => {
                denial.with("holder", name).with("role", role_name(role))
            }
            _ => denial,
        }
    }

    /// A place for the loop's answer, with the ticket that leads to it.
    pub(super) fn take_ticket(&mut self) -> (u64, oneshot::Receiver<Result<Granted, Refusal>>) {
        let (answer, answered) = oneshot::channel();
        let ticket = self.next_ticket;
        self.next_ticket += 1;
        self.tickets.insert(ticket, answer);
        (ticket, answered)
    }

    /// The status to publish or to answer with.
    pub(super) fn status(&mut self, now: MonoTime) -> RobotStatus {
        self.status_seqno += 1;
        let snapshot = &self.snapshot;
        let mut status = RobotStatus {
            robot: self.vocabulary.robot.clone(),
            boot_id: self.boot_id,
            seqno: self.status_seqno,
            stamp_ns: now,
            epoch: snapshot.epoch,
            command_mode: snapshot.command_mode,
            operational_mode: snapshot.operational_mode,
            controller_state: snapshot.controller_state,
            flags: snapshot.flags,
            stop: self.latch(now),
            faults: self.all_faults(),
            authority: snapshot.authority,
            lease: snapshot
                .lease
                .map(|report| self.leases.lease(&report, &snapshot.delegates, now)),
            motion: self.motions.current(snapshot.motion.map(|motion| motion.id)).cloned(),
            queued: self.motions.waiting(snapshot.motion.map(|motion| motion.id)),
            speed_ratio: snapshot.speed_ratio,
            stream: snapshot.stream.map(|stream| statistics(&stream, now)),
            control_loop: self.statistics,
            dropped: self.all_dropped(),
            stop_sources: self.stop_sources.status(now),
            why: Vec::new(),
            next: Vec::new(),
        };
        let known = self.known();
        (status.why, status.next) = (why(&status, &known), next(&status, &known));
        self.first_told.date(&mut status.why, now);
        status
    }

    /// What explains a status and is not in it.
    fn known(&self) -> Known {
        let stops = self.stop.iter().flat_map(|record| &record.stops);
        Known {
            stops: stops.map(|stop| (stop.stop.stop_id, stop.received)).collect(),
            lease: self.snapshot.lease.and_then(|report| self.leases.since(report.lease)),
            local: self.local_since,
            lease_required: self.lease_required,
            link: self.link_refusal.map(|refusal| refusal.to_string()),
        }
    }

    /// What was dropped or refused, here and in the loop.
    pub(super) fn all_dropped(&self) -> Vec<(String, u64)> {
        let DroppedSamples { lease, epoch, sequence, age, link, mode, values } =
            self.snapshot.dropped_samples;
        let in_loop = [
            ("stream_lease", lease),
            ("stream_epoch", epoch),
            ("stream_sequence", sequence),
            ("stream_age", age),
            ("stream_link", link),
            ("stream_mode", mode),
            ("stream_values", values),
        ];
        let in_loop = in_loop.into_iter().filter(|(_, count)| *count > 0);
        let mut all = self.dropped.clone();
        all.extend(in_loop.map(|(what, count)| (what.to_owned(), count)));
        all.into_iter().collect()
    }

    fn all_faults(&self) -> Vec<Fault> {
        let mut faults = self.faults.clone();
        let silent = faults.iter_mut().find(|fault| fault.code == FaultCode::CommunicationLost);
        if let (Some(fault), Some(refusal)) = (silent, self.link_refusal) {
            fault.message = format!("{}: {refusal}", fault.message);
        }
        let told = faults.iter().any(|fault| fault.code == FaultCode::LoopError);
        if self.panics > 0 && !told {
            faults.push(Fault {
                code: FaultCode::LoopError,
                message: format!("{} steps of the control loop panicked", self.panics),
                joint: None,
                value: self.panics as f64,
                limit: 0.0,
                clear: ClearBy::ResetErrors,
                remedy: "report the defect; restart the agent if it stays".to_owned(),
                recording: None,
                since_ns: self.snapshot.stamp,
            });
        }
        faults
    }
}

/// The stream in progress, as it is at `now`.
fn statistics(stream: &StreamReport, now: MonoTime) -> StreamStatistics {
    let StreamReport { taken, dropped, limited, newest, starved, link } = *stream;
    StreamStatistics {
        taken,
        dropped,
        limited,
        age_ms: now.saturating_since(newest).as_secs_f64() * 1e3,
        starved,
        jitter_ms: link.jitter_s * 1e3,
        loss: link.loss,
        state_age_ms: link.state_age_s * 1e3,
        allowed: link.allowed,
    }
}
