//! Does the robot follow? Measured positions against the set-points they answer to.
//!
//! A robot that follows well is where it was told to be a while ago. So a measurement is compared
//! with the set-point of its own time less the lag, looked up in a ring of what was sent, not with
//! the newest: the tolerance then need not hide speed times lag. After late wakes the ring holds
//! when each set-point was really due, so they cannot be taken for a tracking error.

use std::time::Duration;

use armada_model::{JointVector, MonoTime};

use super::io::Params;
use crate::drivers::Feedback;

/// Longest ring; a lag beyond it is compared with the oldest set-point kept.
const MAX_RING: usize = 4096;

/// The set-points sent of late.
#[derive(Debug)]
pub(super) struct Tracking {
    ring: Box<[Sent]>,
    /// Where the newest is.
    newest: usize,
    /// How many are held, 0 while nothing is sent.
    held: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sent {
    at: MonoTime,
    position: JointVector,
    /// How near the motion wants the robot, each joint; empty if it is content with the robot's own
    /// tolerance.
    tolerance: JointVector,
}

/// A joint that is too far from where it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Excess {
    pub(super) joint: usize,
    /// Distance \[rad or m\].
    pub(super) error: f64,
    /// Its limit.
    pub(super) limit: f64,
}

impl Tracking {
    /// A ring long enough for the oldest feedback that is still gone by.
    pub(super) fn new(params: &Params) -> Self {
        let span = params.communication_timeout + params.tracking_lag;
        let ticks = span.as_nanos() / params.period.as_nanos().max(1) + 2;
        let len = usize::try_from(ticks).unwrap_or(MAX_RING).min(MAX_RING);
        Self { ring: vec![Sent::default(); len].into_boxed_slice(), newest: 0, held: 0 }
    }

    pub(super) const fn forget(&mut self) {
        self.held = 0;
    }

    pub(super) fn record(&mut self, at: MonoTime, position: JointVector, tolerance: JointVector) {
        self.newest = (self.newest + 1) % self.ring.len();
        self.held = (self.held + 1).min(self.ring.len());
        self.ring[self.newest] = Sent { at, position, tolerance };
    }

    /// The first joint whose measured position is too far from what it answers to.
    pub(super) fn excess(&self, params: &Params, feedback: &Feedback) -> Option<Excess> {
        let (expected, tolerance) =
            self.expected(feedback.stamp - params.tracking_lag, params.period)?;
        let joints = feedback.joint_position.iter().zip(expected.iter());
        joints.zip(params.tracking_tolerance.iter()).enumerate().find_map(
            |(joint, ((measured, expected), &limit))| {
                let limit = tolerance.get(joint).map_or(limit, |wanted| wanted.min(limit));
                let error = (measured - expected).abs();
                (error > limit).then_some(Excess { joint, error, limit })
            },
        )
    }

    /// The set-point at `time`: the one before it, going over to the next in the last period
    /// before that one is due, as a controller does that interpolates; and its tolerance.
    fn expected(&self, time: MonoTime, period: Duration) -> Option<(JointVector, JointVector)> {
        let mut later: Option<&Sent> = None;
        for back in 0..self.held {
            let sent = &self.ring[(self.newest + self.ring.len() - back) % self.ring.len()];
            if sent.at <= time {
                let position = later.map_or(sent.position, |later| sent.until(later, time, period));
                return Some((position, sent.tolerance));
            }
            later = Some(sent);
        }
        later.map(|oldest| (oldest.position, oldest.tolerance))
    }
}

impl Sent {
    fn until(&self, later: &Self, time: MonoTime, period: Duration) -> JointVector {
        let left_s = later.at.saturating_since(time).as_secs_f64();
        let share = (1.0 - left_s / period.as_secs_f64()).max(0.0);
        self.position.map_indexed(|joint, from| {
            from + share * (later.position.get(joint).copied().unwrap_or(from) - from)
        })
    }
}
