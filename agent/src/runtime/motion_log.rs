//! The motions of a robot, kept after their end.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use armada_model::MonoTime;
use armada_protocol::messages::{ActionStatus, Denial, MotionStatus};
use tokio::sync::Notify;
use uuid::Uuid;

use crate::control::{MotionReport, Snapshot};

/// Motions that are kept; the oldest ended one is forgotten first.
const KEPT: usize = 1000;

/// Status of every motion that is in progress or ended not long ago.
#[derive(Debug, Default)]
pub(super) struct MotionLog {
    by_id: HashMap<Uuid, MotionStatus>,
    order: VecDeque<Uuid>,
    ended: Arc<Notify>,
}

impl MotionLog {
    /// Begins the log of a motion that is about to be handed to the loop.
    pub(super) fn begin(&mut self, status: MotionStatus) {
        self.order.push_back(status.id);
        self.by_id.insert(status.id, status);
        while self.order.len() > KEPT {
            let Some(position) = self.order.iter().position(|id| self.is_over(id)) else { return };
            if let Some(oldest) = self.order.remove(position) {
                self.by_id.remove(&oldest);
            }
        }
    }

    /// Forgets a motion that the loop refused: it never was.
    pub(super) fn withdraw(&mut self, id: Uuid) {
        self.by_id.remove(&id);
        self.order.retain(|kept| *kept != id);
        self.ended.notify_waiters();
    }

    /// Takes a report of the loop; returns the status to publish. Nothing follows a terminal one.
    pub(super) fn take(
        &mut self,
        stamp: MonoTime,
        report: &MotionReport,
        reason: Option<Denial>,
    ) -> Option<MotionStatus> {
        let status = self.by_id.get_mut(&report.id)?;
        if status.status.is_terminal() {
            return None;
        }
        status.seqno += 1;
        status.stamp_ns = stamp;
        status.status = report.status;
        status.reason = reason;
        status.started_ns = report.started;
        status.elapsed_s = report.progress.elapsed_s;
        status.duration_s = report.progress.duration_s;
        status.waypoint = report.progress.waypoint;
        status.group = report.group.or(status.group);
        let status = status.clone();
        if status.status.is_terminal() {
            self.ended.notify_waiters();
        }
        Some(status)
    }

    /// The motion in progress with its newest numbers, to be published at a rate.
    pub(super) fn progress(&mut self, snapshot: &Snapshot) -> Option<MotionStatus> {
        let progress = snapshot.motion?;
        let status = self.by_id.get_mut(&progress.id)?;
        if status.status.is_terminal() {
            return None;
        }
        status.seqno += 1;
        status.stamp_ns = snapshot.stamp;
        status.elapsed_s = progress.elapsed_s;
        status.waypoint = progress.waypoint;
        let group = snapshot.group.filter(|group| group.id == progress.id);
        status.group = group.map(|group| group.quality).or(status.group);
        Some(status.clone())
    }

    /// The motion in progress, if there is one: `running`, as the loop says, or else the oldest
    /// that is not over.
    pub(super) fn current(&self, running: Option<Uuid>) -> Option<&MotionStatus> {
        let told = running.and_then(|id| self.by_id.get(&id));
        told.filter(|motion| !motion.status.is_terminal()).or_else(|| self.open().next())
    }

    /// The motions that wait for the end of the one in progress, in their order.
    pub(super) fn waiting(&self, running: Option<Uuid>) -> Vec<Uuid> {
        let current = self.current(running).map(|motion| motion.id);
        self.open().map(|motion| motion.id).filter(|id| Some(*id) != current).collect()
    }

    /// The motion that was accepted last, of those that are not over.
    pub(super) fn newest(&self) -> Option<&MotionStatus> {
        self.open().last()
    }

    /// All motions that are not over, oldest first.
    fn open(&self) -> impl Iterator<Item = &MotionStatus> {
        self.all().filter(|motion| !motion.status.is_terminal())
    }

    /// Status of one motion.
    pub(super) fn find(&self, id: Uuid) -> Option<&MotionStatus> {
        self.by_id.get(&id)
    }

    /// Wakes whoever waits each time a motion has ended.
    pub(super) fn ended(&self) -> Arc<Notify> {
        Arc::clone(&self.ended)
    }

    /// Every motion that is kept, oldest first.
    pub(super) fn all(&self) -> impl Iterator<Item = &MotionStatus> {
        self.order.iter().filter_map(|id| self.by_id.get(id))
    }

    fn is_over(&self, id: &Uuid) -> bool {
        self.by_id.get(id).is_none_or(|motion| motion.status.is_terminal())
    }
}

/// The status of a motion before the loop has it.
pub(super) fn queued(base: MotionStatus) -> MotionStatus {
    MotionStatus { status: ActionStatus::Queued, seqno: 0, reason: None, ..base }
}
