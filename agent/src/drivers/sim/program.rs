//! Moves that the emulated controller makes itself.
//!
//! ```text
//! take --> kept --first that does not connect--> ready --begin--> running <--> paused
//!                                                                   |
//!                                         done, stopped, failed <---+
//! ```
//!
//! Moves are kept until one that does not connect to a next; they then run as one batch. A batch
//! that comes while another runs waits for its end. Whatever ends a batch early drops all others.

use std::collections::VecDeque;

use armada_model::{CompiledTrajectory, JointVector, MotionLimits, OnPath};

use super::error_code;
use super::planner::Planner;
use crate::drivers::{DelegatedMove, DelegatedReport, DelegatedStatus};

/// Most moves that are kept.
const MAX_MOVES: usize = 64;

/// Moves kept, and those in progress.
#[derive(Debug)]
pub(super) struct Program {
    kept: VecDeque<DelegatedMove>,
    run: Option<Run>,
    ratio: f64,
    paused: bool,
    limits: MotionLimits,
    report: Option<DelegatedReport>,
}

/// A batch in progress.
#[derive(Debug)]
struct Run {
    pieces: VecDeque<CompiledTrajectory>,
    on_path: OnPath,
    stopping: bool,
    total_s: f64,
    done_s: f64,
    /// Time into the piece in progress, as it was planned.
    phase_s: f64,
    /// What is to be followed.
    reference: JointVector,
}

impl Program {
    /// Nothing to do; `limits` are those that pauses and stops keep.
    pub(super) fn new(limits: MotionLimits) -> Self {
        let kept = VecDeque::with_capacity(MAX_MOVES);
        Self { kept, run: None, ratio: 1.0, paused: false, limits, report: None }
    }

    /// What has become of the newest move.
    pub(super) fn report(&self) -> Option<DelegatedReport> {
        self.report
    }

    /// Nothing is known of moves any more, because the client is another one.
    pub(super) const fn forget_report(&mut self) {
        self.report = None;
    }

    /// Takes a move, or says in the report that it cannot.
    pub(super) fn take(&mut self, wanted: DelegatedMove) {
        let status = if self.kept.len() < MAX_MOVES {
            self.kept.push_back(wanted);
            DelegatedStatus::Waiting
        } else {
            self.end_all();
            DelegatedStatus::Failed { code: error_code::TOO_MANY_MOVES }
        };
        self.report = Some(DelegatedReport { number: wanted.number, status, progress: 0.0 });
    }

    /// Refuses a move; what was kept for it is dropped with it.
    pub(super) fn refuse(&mut self, wanted: &DelegatedMove, code: u32) {
        self.kept.clear();
        let status = DelegatedStatus::Failed { code };
        self.report = Some(DelegatedReport { number: wanted.number, status, progress: 0.0 });
    }

    /// Whether moves can begin.
    pub(super) fn is_ready(&self) -> bool {
        self.run.is_none() && self.kept.iter().any(|kept| !kept.connect)
    }

    pub(super) const fn is_running(&self) -> bool {
        self.run.is_some()
    }

    /// Plans and begins what is ready, from rest at `start`; says whether there is something to do.
    pub(super) fn begin(&mut self, planner: &Planner, start: &JointVector, slow: bool) -> bool {
        let Some(last) = self.kept.iter().position(|kept| !kept.connect) else { return false };
        let batch: Vec<_> = self.kept.drain(..=last).collect();
        let begun = planner
            .plan(start, &batch, slow)
            .and_then(|pieces| Run::new(pieces, &self.limits, start));
        match begun {
            Ok(Some(mut run)) => {
                run.set_rate(self.ratio, self.paused);
                self.run = Some(run);
            }
            Ok(None) => self.finish(DelegatedStatus::Done),
            Err(code) => self.fail(code),
        }
        self.run.is_some()
    }

    /// Moves on by `dt` seconds and gives the reference; `None` if nothing is in progress.
    pub(super) fn advance(&mut self, dt: f64) -> Option<JointVector> {
        let run = self.run.as_mut()?;
        run.advance(dt, &self.limits);
        let status =
            if run.stopping || self.paused { DelegatedStatus::Paused } else { DelegatedStatus::Running };
        let progress = run.progress();
        if let Some(report) = self.report.as_mut().filter(|_| self.kept.is_empty()) {
            (report.status, report.progress) = (status, progress);
        }
        Some(run.reference)
    }

    /// Ends the batch if it is at its end, or at rest after a stop; `settled` says whether the joints
    /// are where the reference is.
    pub(super) fn end_if_over(&mut self, settled: bool) -> bool {
        match &self.run {
            Some(run) if run.stopping && run.on_path.is_at_rest() => {
                self.finish(DelegatedStatus::Stopped);
            }
            Some(run) if run.is_finished() && settled => self.finish(DelegatedStatus::Done),
            _ => return false,
        }
        true
    }

    /// Comes to rest on the path and drops all moves.
    pub(super) fn stop(&mut self) {
        self.kept.clear();
        self.paused = false;
        match &mut self.run {
            Some(run) => {
                run.on_path.stop();
                run.stopping = true;
            }
            None => self.end_waiting(DelegatedStatus::Stopped),
        }
    }

    /// Gives everything up.
    pub(super) fn fail(&mut self, code: u32) {
        if self.run.is_some() {
            self.end_all();
            self.set_status(DelegatedStatus::Failed { code });
        } else {
            self.end_all();
            self.end_waiting(DelegatedStatus::Failed { code });
        }
    }

    pub(super) fn set_paused(&mut self, paused: bool) {
        // Nothing to pause is nothing to remember: the next move would not begin.
        self.paused = paused && self.run.is_some();
        self.apply_rate();
    }

    pub(super) fn set_ratio(&mut self, ratio: f64) {
        self.ratio = ratio;
        self.apply_rate();
    }

    fn apply_rate(&mut self) {
        if let Some(run) = self.run.as_mut().filter(|run| !run.stopping) {
            run.set_rate(self.ratio, self.paused);
        }
    }

    fn end_all(&mut self) {
        self.kept.clear();
        self.run = None;
        self.paused = false;
    }

    /// The batch ends; others that wait stay, and the report is about them.
    fn finish(&mut self, status: DelegatedStatus) {
        self.run = None;
        self.paused = false;
        if self.kept.is_empty() {
            self.set_status(status);
        }
    }

    fn set_status(&mut self, status: DelegatedStatus) {
        if let Some(report) = &mut self.report {
            report.status = status;
            if status == DelegatedStatus::Done {
                report.progress = 1.0;
            }
        }
    }

    fn end_waiting(&mut self, status: DelegatedStatus) {
        let waits = |report: &&mut DelegatedReport| report.status == DelegatedStatus::Waiting;
        if let Some(report) = self.report.as_mut().filter(waits) {
            report.status = status;
        }
    }
}

impl Run {
    /// `None` if there is no way to go.
    fn new(
        pieces: Vec<CompiledTrajectory>,
        limits: &MotionLimits,
        start: &JointVector,
    ) -> Result<Option<Self>, u32> {
        let total_s = pieces.iter().map(CompiledTrajectory::duration_s).sum();
        let Some(first) = pieces.first() else { return Ok(None) };
        let on_path = OnPath::start(first, limits).map_err(|_| error_code::NO_MOTION)?;
        let pieces = pieces.into();
        let (done_s, phase_s) = (0.0, 0.0);
        let reference = *start;
        Ok(Some(Self { pieces, on_path, stopping: false, total_s, done_s, phase_s, reference }))
    }

    fn set_rate(&mut self, ratio: f64, paused: bool) {
        // Only a motion that was stopped refuses, and that keeps its rate.
        let _ = self.on_path.set_speed_ratio(ratio);
        let _ = if paused { self.on_path.pause() } else { self.on_path.resume() };
    }

    fn advance(&mut self, dt: f64, limits: &MotionLimits) {
        if self.on_path.is_finished() && self.pieces.len() > 1 && !self.stopping {
            self.next_piece(limits);
        }
        if let Some(piece) = self.pieces.front() {
            let state = self.on_path.tick(piece, dt);
            self.reference = state.state.position;
            self.phase_s = state.phase_s;
        }
    }

    fn next_piece(&mut self, limits: &MotionLimits) {
        let Some(done) = self.pieces.pop_front() else { return };
        self.done_s += done.duration_s();
        if let Some(next) = self.pieces.front()
            && let Ok(on_path) = OnPath::start(next, limits)
        {
            self.on_path = on_path;
        }
    }

    fn is_finished(&self) -> bool {
        self.on_path.is_finished() && self.pieces.len() <= 1
    }

    fn progress(&self) -> f64 {
        let done_s = self.done_s + self.phase_s;
        if self.total_s > 0.0 { (done_s / self.total_s).clamp(0.0, 1.0) } else { 1.0 }
    }
}
