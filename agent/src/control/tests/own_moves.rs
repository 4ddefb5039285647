//! The part of the rig's controller that makes moves of its own.

use armada_model::JointVector;

use crate::drivers::{DelegatedGoal, DelegatedReport, DelegatedStatus, DriverRequest};

/// How far the fastest joint moves in a tick at full speed \[rad\].
const STEP: f64 = 2e-3;
/// How much the share of the speed changes in a tick.
const CHANGE: f64 = 0.1;

/// A move of the controller's own, on a straight way with ramps.
#[derive(Debug, Default)]
pub(super) struct OwnMoves {
    pub(super) report: Option<DelegatedReport>,
    goal: JointVector,
    whole: f64,
    share: f64,
    stopping: bool,
    pausing: bool,
    /// Whether it does not hear that it is to stop.
    pub(super) deaf: bool,
    /// Whether it does not take moves.
    pub(super) lazy: bool,
    /// The error with which it gives the next move up, half-way.
    pub(super) fails: Option<u32>,
}

impl OwnMoves {
    pub(super) fn take(&mut self, request: &DriverRequest, position: &JointVector) {
        match request {
            DriverRequest::Move(order) if !self.lazy => {
                if self.report.is_some_and(|report| report.number >= order.number) {
                    return;
                }
                let DelegatedGoal::Joint(goal) = order.goal else { return };
                self.goal = goal;
                self.whole = goal.max_abs_difference(position).max(1e-12);
                (self.share, self.stopping, self.pausing) = (0.0, false, false);
                let (number, status) = (order.number, DelegatedStatus::Running);
                self.report = Some(DelegatedReport { number, status, progress: 0.0 });
            }
            DriverRequest::StopMotion if !self.deaf => self.stopping = true,
            DriverRequest::PauseMotion => self.pausing = true,
            DriverRequest::ResumeMotion => self.pausing = false,
            _ => {}
        }
    }

    /// Where the joints are after a tick of it; `None` if it does not move them.
    pub(super) fn step(&mut self, position: &JointVector) -> Option<JointVector> {
        let report = self.report.as_mut()?;
        if !matches!(report.status, DelegatedStatus::Running | DelegatedStatus::Paused) {
            return None;
        }
        let left = self.goal.max_abs_difference(position);
        report.progress = 1.0 - left / self.whole;
        if let Some(code) = self.fails.filter(|_| report.progress > 0.5) {
            report.status = DelegatedStatus::Failed { code };
            self.fails = None;
            return None;
        }
        let wanted = if self.stopping || self.pausing { 0.0 } else { 1.0 };
        self.share += (wanted - self.share).clamp(-CHANGE, CHANGE);
        let rests = self.share <= 1e-9;
        report.status = match rests {
            true if self.stopping => DelegatedStatus::Stopped,
            true if self.pausing => DelegatedStatus::Paused,
            _ => DelegatedStatus::Running,
        };
        let step = self.share * STEP;
        if left <= step.max(1e-9) {
            (report.status, report.progress) = (DelegatedStatus::Done, 1.0);
            return Some(self.goal);
        }
        let goal = self.goal;
        Some(position.map_indexed(|joint, x| x + (goal[joint] - x) * step / left))
    }

    /// It gives a move up, as when its drives go off.
    pub(super) fn drop_move(&mut self) {
        if let Some(report) = &mut self.report
            && matches!(report.status, DelegatedStatus::Running | DelegatedStatus::Paused)
        {
            report.status = DelegatedStatus::Stopped;
        }
    }
}
