//! Does the robot stand still? By measurement, over a hold time.
//!
//! Evidence counts from when no set-point moves any more: a robot that has not begun to follow is
//! not one that stands. Without measured speeds the positions must stay where they are: none may
//! leave its place by more than the threshold speed would carry it in the hold time. Without
//! feedback nothing is known, so nothing stands.

use serde::{Deserialize, Serialize};
use std::time::Duration;

use armada_model::{JointVector, MonoTime};

use super::io::Params;
use crate::drivers::Feedback;

/// How much longer than the hold time it may take until standstill is shown: the robot's lag, and
/// some swinging.
const PATIENCE: Duration = Duration::from_millis(500);

/// What was measured since the set-points came to rest.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Standstill {
    /// When the set-points came to rest.
    quiet_since: Option<MonoTime>,
    /// Stamps of the first and the newest report in which the robot stood.
    slow: Option<(MonoTime, MonoTime)>,
    /// Where it stood at the first.
    anchor: JointVector,
}

impl Standstill {
    /// Forgets all evidence: what comes now has to be shown anew.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }

    /// Takes what was measured; `moving` tells whether the set-points move.
    pub(super) fn update(
        &mut self,
        params: &Params,
        now: MonoTime,
        feedback: Option<&Feedback>,
        moving: bool,
    ) {
        if moving {
            return self.restart();
        }
        let quiet_since = *self.quiet_since.get_or_insert(now);
        let Some(feedback) = feedback else {
            self.slow = None;
            return;
        };
        let newest = self.slow.map(|(_, newest)| newest);
        if feedback.stamp < quiet_since || newest.is_some_and(|newest| feedback.stamp <= newest) {
            return;
        }
        self.slow = match self.slow {
            Some((since, _)) if self.is_slow(params, feedback) => Some((since, feedback.stamp)),
            _ => {
                self.anchor = feedback.joint_position;
                (feedback.joint_velocity.is_empty() || self.is_slow(params, feedback))
                    .then_some((feedback.stamp, feedback.stamp))
            }
        };
    }

    /// Whether the robot has stood still for the hold time.
    pub(super) fn is_shown(&self, params: &Params) -> bool {
        self.slow
            .is_some_and(|(since, newest)| newest.saturating_since(since) >= params.standstill_hold)
    }

    /// Whether it should have been shown long ago.
    pub(super) fn is_overdue(&self, params: &Params, now: MonoTime) -> bool {
        let longest = params.standstill_hold + PATIENCE;
        self.quiet_since.is_some_and(|since| now.saturating_since(since) > longest)
    }

    fn is_slow(&self, params: &Params, feedback: &Feedback) -> bool {
        let limits = params.standstill_velocity.iter();
        if feedback.joint_velocity.is_empty() {
            let hold_s = params.standstill_hold.as_secs_f64();
            let moved = feedback.joint_position.iter().zip(self.anchor.iter());
            moved.zip(limits).all(|((now, then), limit)| (now - then).abs() <= limit * hold_s)
        } else {
            feedback.joint_velocity.iter().zip(limits).all(|(speed, limit)| speed.abs() < *limit)
        }
    }
}
