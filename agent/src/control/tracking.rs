//! Does the robot follow? Measured positions against the set-points they answer to.
//!
//! A robot that follows well is where it was told to be a while ago. So a measurement is compared
//! with the set-point of its own time less the lag, looked up in a ring of what was sent, not with
//! the newest: the tolerance then need not hide speed times lag. After late wakes the ring holds
//! when each set-point was really due, so they cannot be taken for a tracking error.
//!
//! Speeds are compared in the same way, where a waypoint asks for it.

use serde::{Deserialize, Serialize};
use std::time::Duration;

use armada_model::{JointVector, MonoTime};
use armada_protocol::messages::FaultCode;

use super::checkpoint::copy_by_fields;
use super::io::Params;
use crate::drivers::Feedback;

/// Longest ring; a lag beyond it is compared with the oldest set-point kept.
const MAX_RING: usize = 4096;

/// The set-points sent of late.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Tracking {
    ring: Box<[Sent]>,
    /// Where the newest is.
    newest: usize,
    /// How many are held, 0 while nothing is sent.
    held: usize,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Sent {
    at: MonoTime,
    position: JointVector,
    /// Difference to the one before, over the period \[1/s\].
    velocity: JointVector,
    /// How near the motion wants the robot, each joint; empty if it is content with the robot's own
    /// tolerance.
    tolerance: JointVector,
    /// The same for speeds; empty if it does not care.
    velocity_tolerance: JointVector,
}

/// A joint that is too far from where it should be, or not as fast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Excess {
    /// Tracking or velocity error.
    pub(super) code: FaultCode,
    pub(super) joint: usize,
    /// Distance \[rad or m\], or difference of speeds \[1/s\].
    pub(super) error: f64,
    /// Its limit.
    pub(super) limit: f64,
}

copy_by_fields! { Tracking: ring, newest, held }

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

    /// Takes what is sent: position, its difference to the one before over the period, and the
    /// tolerances of both.
    pub(super) fn record(
        &mut self,
        at: MonoTime,
        position: JointVector,
        velocity: JointVector,
        (tolerance, velocity_tolerance): (JointVector, JointVector),
    ) {
        self.newest = (self.newest + 1) % self.ring.len();
        self.held = (self.held + 1).min(self.ring.len());
        self.ring[self.newest] = Sent { at, position, velocity, tolerance, velocity_tolerance };
    }

    /// The first joint whose measured position or speed is too far from what it answers to.
    pub(super) fn excess(&self, params: &Params, feedback: &Feedback) -> Option<Excess> {
        let time = feedback.stamp - params.tracking_lag;
        let (sent, later) = self.around(time)?;
        let expected = later.map_or(sent.position, |l| sent.until(l, time, params.period));
        let joints = feedback.joint_position.iter().zip(expected.iter());
        let position = joints.zip(params.tracking_tolerance.iter()).enumerate().find_map(
            |(joint, ((measured, expected), &limit))| {
                let limit = sent.tolerance.get(joint).map_or(limit, |wanted| wanted.min(limit));
                let error = (measured - expected).abs();
                let code = FaultCode::TrackingError;
                (error > limit).then_some(Excess { code, joint, error, limit })
            },
        );
        position.or_else(|| sent.velocity_excess(later, &feedback.joint_velocity))
    }

    /// The largest of all distances of measured from expected positions over their tolerances, at
    /// most 1; 0 while nothing is sent.
    pub(super) fn share(&self, params: &Params, feedback: &Feedback) -> f64 {
        let time = feedback.stamp - params.tracking_lag;
        let Some((sent, later)) = self.around(time) else { return 0.0 };
        let expected = later.map_or(sent.position, |l| sent.until(l, time, params.period));
        let joints = feedback.joint_position.iter().zip(expected.iter());
        let shares = joints.zip(params.tracking_tolerance.iter()).enumerate().map(
            |(joint, ((measured, expected), &limit))| {
                let limit = sent.tolerance.get(joint).map_or(limit, |wanted| wanted.min(limit));
                if limit > 0.0 { (measured - expected).abs() / limit } else { 1.0 }
            },
        );
        shares.fold(0.0, f64::max).min(1.0)
    }

    /// The set-point at `time`, and the one after it. A controller that interpolates goes over from
    /// the one to the other in the last period before the later one is due.
    fn around(&self, time: MonoTime) -> Option<(&Sent, Option<&Sent>)> {
        let mut later: Option<&Sent> = None;
        for back in 0..self.held {
            let sent = &self.ring[(self.newest + self.ring.len() - back) % self.ring.len()];
            if sent.at <= time {
                return Some((sent, later));
            }
            later = Some(sent);
        }
        later.map(|oldest| (oldest, None))
    }
}

impl Sent {
    /// The first joint whose measured speed is too far from all speeds between this set-point's and
    /// the next one's: it may be at any of them at a time in between.
    fn velocity_excess(&self, later: Option<&Self>, measured: &JointVector) -> Option<Excess> {
        let next = later.map_or(&self.velocity, |later| &later.velocity);
        let joints = measured.iter().zip(self.velocity.iter().zip(next.iter()));
        joints.zip(self.velocity_tolerance.iter()).enumerate().find_map(
            |(joint, ((measured, (from, to)), &limit))| {
                let error = (from.min(*to) - measured).max(measured - from.max(*to)).max(0.0);
                let code = FaultCode::VelocityError;
                (error > limit).then_some(Excess { code, joint, error, limit })
            },
        )
    }

    fn until(&self, later: &Self, time: MonoTime, period: Duration) -> JointVector {
        let left_s = later.at.saturating_since(time).as_secs_f64();
        let share = (1.0 - left_s / period.as_secs_f64()).max(0.0);
        self.position.map_indexed(|joint, from| {
            from + share * (later.position.get(joint).copied().unwrap_or(from) - from)
        })
    }
}
