//! One robot's part of a motion of several.

use std::time::Duration;

use armada_model::{JointTrajectory, MonoTime};
use armada_protocol::messages::{
    ActionStatus, Denial, GroupQuality, GroupReadiness, MotionStatus, PartStatus,
};
use uuid::Uuid;

/// How often an abort that was not answered is repeated.
const ABORT_ATTEMPTS: u32 = 3;
/// Silence after which the status of a part is asked for: a published one may have been lost.
pub(super) const POLL_AFTER: Duration = Duration::from_millis(300);

/// How far the agent has been taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Its status is being asked for.
    Checking,
    /// It is changing to mode `trajectory`.
    ChangingMode,
    /// It has been given its trajectory.
    Preparing,
    /// It keeps its trajectory.
    Prepared,
    /// It has been given the start.
    Committing,
    /// It will start.
    Committed,
    /// It refused: it holds nothing of the motion.
    Refused,
}

/// How far the abort of a part has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Abort {
    /// Not asked for.
    #[default]
    No,
    /// Asked for, this many times.
    Asked(u32),
    /// The agent has it.
    Done,
    /// The agent did not answer, again and again.
    Unanswered,
}

#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Until its clearance is checked.
    pub(super) trajectory: JointTrajectory,
    /// The lease under which its agent is asked.
    pub(super) lease: Option<Uuid>,
    /// What its agent says of it, if it has partners.
    pub(super) readiness: Option<GroupReadiness>,
    /// How well it kept together with its partners.
    pub(super) quality: Option<GroupQuality>,
    pub(super) step: Step,
    /// Run of the agent the motion belongs to.
    pub(super) boot_id: Option<Uuid>,
    pub(super) status: ActionStatus,
    pub(super) reason: Option<Denial>,
    pub(super) elapsed_s: f64,
    /// Measured start, gateway's clock.
    pub(super) started: Option<MonoTime>,
    /// Number of the newest status.
    seqno: Option<u64>,
    /// When it was last heard of, or the start if that is later.
    pub(super) heard: MonoTime,
    /// When its status may be asked for next.
    pub(super) next_poll: MonoTime,
    pub(super) abort: Abort,
    /// Whether its agent is gone; its partners watch it, and may know better.
    pub(super) is_lost: bool,
}

impl Part {
    pub(super) const fn new(
        trajectory: JointTrajectory,
        lease: Option<Uuid>,
        now: MonoTime,
    ) -> Self {
        Self {
            trajectory,
            lease,
            readiness: None,
            quality: None,
            is_lost: false,
            step: Step::Checking,
            boot_id: None,
            status: ActionStatus::Queued,
            reason: None,
            elapsed_s: 0.0,
            started: None,
            seqno: None,
            heard: now,
            next_poll: now,
            abort: Abort::No,
        }
    }

    /// Whether the agent may hold something of the motion, so that an abort is due at its end.
    pub(super) const fn is_open(&self) -> bool {
        let holds = matches!(
            self.step,
            Step::Preparing | Step::Prepared | Step::Committing | Step::Committed
        );
        holds && !self.status.is_terminal()
    }

    /// Whether nothing more is expected of an ending part; an accepted one owes its terminal
    /// status, any other only the answer to the abort.
    pub(super) fn is_settled(&self, accepted: bool) -> bool {
        !self.is_open() || (!accepted && self.abort == Abort::Done)
    }

    /// Takes a status of this part; returns whether it changed.
    pub(super) fn take(
        &mut self,
        status: &MotionStatus,
        offset_ns: Option<i64>,
        now: MonoTime,
    ) -> bool {
        let is_of_this_run = self.boot_id == Some(status.boot_id);
        let is_newer = self.seqno.is_none_or(|seqno| status.seqno >= seqno);
        if !is_of_this_run || !is_newer || self.status.is_terminal() {
            return false;
        }
        self.seqno = Some(status.seqno);
        self.heard = self.heard.max(now);
        self.is_lost = false;
        self.quality = status.group.or(self.quality);
        self.elapsed_s = status.elapsed_s;
        if let (None, Some(started), Some(offset_ns)) = (self.started, status.started_ns, offset_ns)
        {
            // Set-points go out earlier the later the controller follows them.
            self.started = Some(started.shifted(offset_ns.saturating_neg()) + self.lag());
        }
        let changed = self.status != status.status;
        self.status = status.status;
        if status.status.is_terminal() {
            self.reason.clone_from(&status.reason);
        }
        changed
    }

    /// How late the controller does what it is sent.
    pub(super) fn lag(&self) -> Duration {
        let lag_ms = self.readiness.map_or(0.0, |readiness| readiness.controller_lag_ms);
        Duration::try_from_secs_f64(1e-3 * lag_ms).unwrap_or_default()
    }

    /// Ends the part without a word of its agent.
    pub(super) fn give_up(&mut self, reason: Denial) {
        if !self.status.is_terminal() {
            self.status = ActionStatus::Failed;
            self.reason = Some(reason);
        }
    }

    /// Notes that an abort goes out.
    pub(super) const fn abort_asked(&mut self) {
        let before = if let Abort::Asked(times) = self.abort { times } else { 0 };
        self.abort = Abort::Asked(before + 1);
    }

    /// Notes that an abort was not answered; returns whether it is to be repeated.
    pub(super) const fn abort_unanswered(&mut self) -> bool {
        match self.abort {
            Abort::Asked(times) if times < ABORT_ATTEMPTS => true,
            Abort::Asked(_) => {
                self.abort = Abort::Unanswered;
                false
            }
            Abort::No | Abort::Done | Abort::Unanswered => false,
        }
    }

    /// When its status is to be asked for if nothing is heard before; `None` if nothing more is
    /// expected.
    pub(super) fn poll_time(&self) -> Option<MonoTime> {
        let is_there = self.is_open() && !self.is_lost;
        is_there.then(|| self.next_poll.max(self.heard + POLL_AFTER))
    }

    /// When it has been silent for `silence`; `None` if nothing more is expected.
    pub(super) fn silence_time(&self, silence: Duration) -> Option<MonoTime> {
        let is_there = self.is_open() && !self.is_lost;
        is_there.then(|| self.heard + silence)
    }

    pub(super) fn report(&self) -> PartStatus {
        PartStatus { status: self.status, elapsed_s: self.elapsed_s, reason: self.reason.clone() }
    }
}
