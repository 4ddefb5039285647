//! Moves that are planned together: collected until one does not connect, then one motion.
//!
//! ```text
//! connect ---> collected --move without connect--> parts of that motion --corner passed--> complete
//!                 |                                        +--motion ends early--> as the motion
//!                 +--cancelled, epoch raised--> cancelled
//! ```
//!
//! Every move keeps its own identity with one terminal status: that of a move which connects is
//! `complete` when its corner has been passed, as seen by the next progress of the motion; the
//! moves whose corners were not passed end as the motion does.

use armada_model::{JointVector, MonoTime};
use armada_protocol::messages::{
    ActionStatus, Denial, Executor, MotionKind, MotionProgress, MotionStatus, MoveOptions,
};
use uuid::Uuid;

use super::motion_log::MotionLog;
use crate::control::MotionReport;
use crate::moves::SingleMove;

/// Most moves that are planned together.
pub(super) const MAX_CONNECTED: usize = 32;
/// Ends of motions that are kept, to begin others there.
const KEPT_ENDS: usize = 64;

/// Moves that wait to be planned together, and those that were.
#[derive(Debug, Default)]
pub(super) struct Connected {
    pub(super) collected: Option<Collection>,
    running: Vec<Running>,
    /// Where trajectories end that were accepted, the newest last.
    ends: Vec<(Uuid, JointVector)>,
}

/// Moves that wait for one that does not connect.
#[derive(Clone, Debug)]
pub(super) struct Collection {
    /// Who asked, and under which lease.
    pub(super) owner: (String, Option<Uuid>),
    /// Epoch they belong to.
    pub(super) epoch: u64,
    /// How the first is to be made.
    pub(super) options: MoveOptions,
    pub(super) moves: Vec<(Uuid, MotionKind, SingleMove)>,
    cancelled: bool,
}

/// A motion with the moves that are parts of it and have not ended.
#[derive(Debug)]
struct Running {
    whole: Uuid,
    /// Each with the time at which its corner is passed \[s\].
    parts: Vec<(Uuid, MotionKind, f64)>,
}

/// What a cancel of a move means that is not a motion by itself.
pub(super) enum CancelOf {
    /// It was collected only: all that were are cancelled.
    Collected,
    /// It is part of this motion.
    Part(Uuid),
}

impl Collection {
    pub(super) const fn new(
        owner: (String, Option<Uuid>),
        epoch: u64,
        options: MoveOptions,
    ) -> Self {
        Self { owner, epoch, options, moves: Vec::new(), cancelled: false }
    }
}

impl Connected {
    /// Notes where a trajectory ends.
    pub(super) fn note_end(&mut self, id: Uuid, end: JointVector) {
        if self.ends.len() >= KEPT_ENDS {
            self.ends.remove(0);
        }
        self.ends.push((id, end));
    }

    /// Where a trajectory ends.
    pub(super) fn end_of(&self, id: Uuid) -> Option<JointVector> {
        self.ends.iter().rev().find(|(known, _)| *known == id).map(|(_, end)| *end)
    }

    /// The collected moves have become `whole`; each with the time at which it is passed \[s\].
    pub(super) fn begin(&mut self, whole: Uuid, passed_s: &[f64]) {
        let Some(collected) = self.collected.take() else { return };
        let parts = collected.moves.into_iter().zip(passed_s);
        let parts = parts.map(|((id, kind, _), &passed_s)| (id, kind, passed_s)).collect();
        self.running.push(Running { whole, parts });
    }

    /// Begins to cancel the move `id`, if it is one of these.
    pub(super) fn cancel(&mut self, id: Uuid) -> Option<CancelOf> {
        if let Some(collected) = &mut self.collected
            && collected.moves.iter().any(|(known, ..)| *known == id)
        {
            collected.cancelled = true;
            return Some(CancelOf::Collected);
        }
        let of = |running: &&Running| running.parts.iter().any(|(known, ..)| *known == id);
        self.running.iter().find(of).map(|running| CancelOf::Part(running.whole))
    }

    /// The statuses of collected moves that will never be made: cancelled, or of an epoch that
    /// has passed. `why` gives the reason, by whether somebody cancelled them.
    pub(super) fn forget(
        &mut self,
        log: &mut MotionLog,
        (stamp, epoch): (MonoTime, u64),
        why: impl Fn(bool) -> Denial,
    ) -> Vec<MotionStatus> {
        let over = |collected: &Collection| collected.cancelled || collected.epoch != epoch;
        if !self.collected.as_ref().is_some_and(over) {
            return Vec::new();
        }
        let Some(collected) = self.collected.take() else { return Vec::new() };
        let reason = why(collected.cancelled);
        let moves = collected.moves.into_iter();
        let end = |(id, kind, _)| {
            let report = report_of((id, kind), ActionStatus::Cancelled, (0.0, None));
            log.take(stamp, &report, Some(reason.clone()))
        };
        moves.filter_map(end).collect()
    }

    /// The statuses of moves that follow from one of the motion that they are parts of.
    pub(super) fn follow(
        &mut self,
        log: &mut MotionLog,
        stamp: MonoTime,
        whole: &MotionStatus,
    ) -> Vec<MotionStatus> {
        let Some(at) = self.running.iter().position(|running| running.whole == whole.id) else {
            return Vec::new();
        };
        let Some(running) = self.running.get_mut(at) else { return Vec::new() };
        let mut ended = Vec::new();
        running.parts.retain(|&(id, kind, passed_s)| {
            let passed = whole.started_ns.is_some() && whole.elapsed_s >= passed_s;
            let status = if passed { ActionStatus::Complete } else { whole.status };
            if !status.is_terminal() {
                return true;
            }
            let report = report_of((id, kind), status, (whole.elapsed_s, whole.started_ns));
            let reason = whole.reason.clone().filter(|_| !passed);
            ended.extend(log.take(stamp, &report, reason));
            false
        });
        if whole.status.is_terminal() {
            self.running.remove(at);
        }
        ended
    }
}

fn report_of(
    (id, kind): (Uuid, MotionKind),
    status: ActionStatus,
    (elapsed_s, started): (f64, Option<MonoTime>),
) -> MotionReport {
    let progress = MotionProgress {
        id,
        elapsed_s,
        duration_s: elapsed_s,
        waypoint: 0,
        rate: 1.0,
        paused: false,
        queued: 0,
    };
    let (executor, reason, group) = (Executor::Agent, None, None);
    MotionReport { id, kind, executor, status, reason, started, progress, group }
}
