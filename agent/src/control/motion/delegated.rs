//! Moves that the controller plans and makes itself.
//!
//! ```text
//! queued --the one before ended, standstill measured--> asked
//! asked --report: taken--> running --report: done, standstill measured--> complete
//!   |                         |  ^
//!   |                   pause v  | resume
//!   |                       paused
//!   +-- not taken in time, given up --> failed
//!   +-- cancel --> StopMotion --report: stopped, standstill measured--> cancelled
//!   +-- epoch raised --> cancelled or failed at once; StopMotion until the report says so
//! ```
//!
//! A move may wait behind any other motion of mode `trajectory`, and others behind it. It is handed
//! over when the robot has been seen to stand, since the controller begins where the robot is.
//! What is appended to a move to a pose must be a move too: where the joints will then be only the
//! controller knows, and a trajectory has to begin there.
//!
//! `paused` is said when it is asked for, as of the loop's own motions; the rate is 0 when the
//! controller reports the rest. A controller that does not stop is in `own`.
//!
//! No set-points are sent meanwhile, as while the controller homes: their stream begins anew at
//! the measured position when the controller has shown that it is done. So tracking is not
//! supervised, but faults, standstill and stops are what they always are. Whatever is asked is
//! repeated until the report shows it, since packets may be lost; a move has a number, so the
//! controller takes it once.

use armada_model::{JointVector, MonoTime};
use armada_protocol::messages::{CommandMode, MotionKind, Queue};
use serde::{Deserialize, Serialize};

use super::waiting::{Queued, WaitingMove};
use super::{End, Motion, Source};
use crate::control::io::{DelegateOrder, Refusal};
use crate::control::state::{LoopState, Tick};
use crate::drivers::{
    DelegatedGoal, DelegatedMove, DelegatedReport, DelegatedStatus, DriverRequest, Feedback,
};

/// A move of the controller's own.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct DelegatedMotion {
    kind: MotionKind,
    order: DelegatedMove,
    /// When the controller was first to have it; none while it waits for the robot to stand.
    began: Option<MonoTime>,
    /// Whether it is to be at rest on its path.
    pub(super) wants_pause: bool,
    newest: Option<DelegatedReport>,
}

impl DelegatedMotion {
    /// One that waits for the robot to stand.
    pub(super) const fn new(kind: MotionKind, order: DelegatedMove) -> Self {
        Self { kind, order, began: None, wants_pause: false, newest: None }
    }

    /// Whether the controller has it, or is being asked to take it.
    pub(super) const fn is_handed_over(&self) -> bool {
        self.began.is_some()
    }

    /// Where the joints are at its end, if that is known.
    pub(super) fn end(&self) -> Option<JointVector> {
        end_of(&self.order)
    }

    pub(super) const fn kind(&self) -> MotionKind {
        self.kind
    }

    /// Share of the way that is done, as far as the controller says.
    pub(super) fn progress(&self) -> f64 {
        self.newest.map_or(0.0, |report| report.progress.clamp(0.0, 1.0))
    }

    pub(super) const fn is_paused(&self) -> bool {
        self.wants_pause
    }

    /// How fast it goes on, as far as the controller says: 0 before and while it rests.
    pub(super) fn rate(&self) -> f64 {
        match self.status() {
            None | Some(DelegatedStatus::Waiting | DelegatedStatus::Paused) => 0.0,
            Some(_) => 1.0,
        }
    }

    /// Whether the controller may move the robot in it now.
    pub(super) fn is_moving(&self) -> bool {
        let may_move = matches!(
            self.status(),
            None | Some(
                DelegatedStatus::Waiting | DelegatedStatus::Running | DelegatedStatus::Paused
            )
        );
        self.is_handed_over() && may_move
    }

    /// What the controller is still to be asked for.
    pub(super) fn wants(&self) -> Option<DriverRequest> {
        match (self.status(), self.wants_pause) {
            _ if !self.is_handed_over() => None,
            (None, _) => Some(DriverRequest::Move(self.order)),
            (Some(DelegatedStatus::Running), true) => Some(DriverRequest::PauseMotion),
            (Some(DelegatedStatus::Paused), false) => Some(DriverRequest::ResumeMotion),
            _ => None,
        }
    }

    fn status(&self) -> Option<DelegatedStatus> {
        self.newest.map(|report| report.status)
    }
}

impl LoopState {
    /// Hands a move to the controller, if it can make it and the robot stands, or lets it wait.
    pub(in crate::control) fn delegate(
        &mut self,
        tick: &mut Tick<'_>,
        order: &DelegateOrder,
    ) -> Result<(), Refusal> {
        self.check_motion_mode(CommandMode::Trajectory)?;
        if !matches!(order.queue, Queue::Refuse | Queue::Append) {
            let what = "moves of the controller's own that blend with others or replace them";
            return Err(Refusal::NotSupported(what));
        }
        self.check_delegated(tick, order)?;
        if self.knows(order.id) {
            return Err(Refusal::Busy(order.id));
        }
        if let Some(motion) = &self.motion {
            let id = motion.id;
            return match order.queue {
                Queue::Append if !motion.cancelling => {
                    self.wait_for_end(tick, Queued::Delegated(WaitingMove::new(order)))
                }
                _ => Err(Refusal::Busy(id)),
            };
        }
        self.rest()?;
        self.motion = Some(WaitingMove::new(order).motion(false));
        self.hand_over(tick);
        Ok(())
    }

    /// Follows a move of the controller's own by its reports, or hands it over in its time.
    pub(in crate::control) fn follow_delegated(&mut self, tick: &mut Tick<'_>) {
        let (stopping, settled) = (self.is_stopping_own(), self.has_settled(tick));
        let stands = self.ramp.is_none() && self.standstill.is_shown(tick.params);
        let Some(feedback) = self.condition.feedback().copied() else { return };
        let Some(motion) = self.motion.as_mut() else { return };
        let cancelling = motion.cancelling;
        let Source::Delegated(delegated) = &mut motion.source else { return };
        let Some(began) = delegated.began else {
            if stands && !delegated.wants_pause && !cancelling {
                self.hand_over(tick);
            }
            return;
        };
        delegated.newest = report_of(&feedback, delegated.order.number).or(delegated.newest);
        if cancelling {
            if !stopping && settled {
                self.hold = feedback.joint_position;
                self.end_motion(tick, End::Cancelled(Refusal::Cancelled));
            }
            return;
        }
        let late = tick.now.saturating_since(began) > tick.params.request_timeout;
        let status = delegated.status();
        match status {
            None if late => self.end_motion(tick, End::Failed(Refusal::ControllerTimeout)),
            None | Some(DelegatedStatus::Waiting) => {}
            Some(DelegatedStatus::Running | DelegatedStatus::Paused) => {
                motion.announce_running(tick);
            }
            Some(DelegatedStatus::Done) => {
                motion.announce_running(tick);
                if settled {
                    self.hold = feedback.joint_position;
                    self.end_motion(tick, End::Complete);
                }
            }
            // Somebody at the controller stopped it: it has no error of its own for that.
            Some(DelegatedStatus::Stopped) => {
                self.end_motion(tick, End::Failed(Refusal::ControllerRefused { code: 0 }));
            }
            Some(DelegatedStatus::Failed { code }) => {
                self.end_motion(tick, End::Failed(Refusal::ControllerRefused { code }));
            }
        }
    }

    /// Gives the controller the move in progress, under the next number.
    fn hand_over(&mut self, tick: &mut Tick<'_>) {
        // A controller that cannot be slowed down on the way is slow from the start.
        let share = if tick.params.abilities.pause { 1.0 } else { self.speed_ratio };
        self.own_motion.number += 1;
        self.own_motion.is_move = true;
        let number = self.own_motion.number;
        if let Some(Motion { source: Source::Delegated(delegated), .. }) = &mut self.motion {
            let speed = delegated.order.speed * share;
            delegated.order = DelegatedMove { number, speed, ..delegated.order };
            delegated.began = Some(tick.now);
        }
        self.break_off(tick);
    }

    fn check_delegated(&self, tick: &Tick<'_>, order: &DelegateOrder) -> Result<(), Refusal> {
        let abilities = &tick.params.abilities;
        let (can, what, chain) = match order.order.goal {
            DelegatedGoal::Joint(goal) => {
                self.check_goal(&goal)?;
                (abilities.move_joint, "a controller that makes moves of the joints", None)
            }
            DelegatedGoal::Pose { chain, .. } => {
                (abilities.move_pose, "a controller that makes moves to poses", Some(chain))
            }
            DelegatedGoal::Linear { chain, .. } => {
                (abilities.move_linear, "a controller that makes straight moves", Some(chain))
            }
        };
        if !can {
            return Err(Refusal::NotSupported(what));
        }
        let known = |chain: u8| usize::from(chain) < self.equipment.chains.len();
        if let Some(chain) = chain.filter(|&chain| !known(chain)) {
            return Err(Refusal::NoSuchChain { chain });
        }
        self.condition.check_follows()?;
        self.check_homed()
    }

    fn check_goal(&self, goal: &JointVector) -> Result<(), Refusal> {
        let (given, expected) = (goal.len(), self.limits.len());
        if given != expected {
            return Err(Refusal::WrongLength { given, expected });
        }
        for (joint, (&value, axis)) in goal.iter().zip(self.limits.iter()).enumerate() {
            if !axis.contains(value) {
                return Err(Refusal::OutOfRange { joint, value, limit: axis.nearer_limit(value) });
            }
        }
        Ok(())
    }
}

/// Where the joints are at the end of a move, if that is known without the controller.
pub(super) const fn end_of(order: &DelegatedMove) -> Option<JointVector> {
    match order.goal {
        DelegatedGoal::Joint(goal) => Some(goal),
        DelegatedGoal::Pose { .. } | DelegatedGoal::Linear { .. } => None,
    }
}

/// What the controller says of this move, if it speaks of it.
fn report_of(feedback: &Feedback, number: u32) -> Option<DelegatedReport> {
    feedback.delegated.filter(|report| report.number == number)
}

/// Whether the controller makes no move of its own now.
pub(super) fn is_over(feedback: &Feedback) -> bool {
    feedback.delegated.is_none_or(|report| {
        matches!(
            report.status,
            DelegatedStatus::Done | DelegatedStatus::Stopped | DelegatedStatus::Failed { .. }
        )
    })
}
