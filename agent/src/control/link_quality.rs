//! How well the samples of a stream come, and what that allows.
//!
//! A robot may be without word of its client for the stream's timeout `T`; then it decelerates. A
//! link on which that happens again and again does not stop the robot in time, it makes it stutter.
//! So the time that has to be reckoned with until the next sample is estimated from those of the last
//! one to two seconds, as TCP does for its answers (RFC 6298, section 2):
//!
//! ```text
//! need = mean + 3 standard deviations of the times between samples that came and were young enough
//! ```
//!
//! | need | the stream is |
//! |---|---|
//! | up to T | followed as it is |
//! | up to 3 T | **slowed**: the limits of speed are those of the robot times T / need, so in the time for which it is without word it goes no farther than at full speed in T |
//! | above | **refused**: nothing is followed until the samples need 2 T at most |
//!
//! Loss makes times longer, jitter spreads them, and a sample that is too old counts as lost: so one
//! figure judges all three. A time above a second is a pause of the client and says nothing about the
//! link. What was found holds for a lease, whatever becomes of its epochs: nobody gets a bad link
//! back by halting the robot.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::StreamHeader;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::io::{LinkReport, StreamChange};

/// How much of the spread of times is reckoned with.
const DEVIATIONS: f64 = 3.0;
/// Times above count as this many timeouts, lest one silence outweigh a second of samples.
const LONGEST: f64 = 4.0;
/// Need above which a stream is refused, in timeouts.
const REFUSED: f64 = 3.0;
/// Need up to which a refused one is followed again.
const ACCEPTED: f64 = 2.0;
/// Need up to which a slowed one counts as good again; in between nothing is told.
const GOOD: f64 = 0.9;
/// Least share of its speed that a stream is slowed to; below it is refused.
pub(super) const LEAST_ALLOWED: f64 = 1.0 / REFUSED;
/// A silence of a client, not of its link.
const PAUSE: Duration = Duration::from_secs(1);
/// How long samples are collected before they are judged, with those of the time before.
const BUCKET: Duration = Duration::from_secs(1);
/// How many it takes, at least.
const FEWEST: f64 = 4.0;

/// How well the samples under one lease come.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct LinkQuality {
    lease: Uuid,
    /// Epoch and number of the newest sample, young enough or not.
    newest: (u64, u64),
    /// When the newest came.
    heard: Option<MonoTime>,
    /// When one came that was young enough, in this bucket or the one before.
    arrived: Option<MonoTime>,
    before: Bucket,
    filling: Bucket,
    /// When `filling` was begun.
    since: MonoTime,
    standing: Standing,
    report: LinkReport,
}

/// What the link allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Standing {
    Good,
    Slowed,
    Refused,
}

/// Samples of some time.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Bucket {
    /// Samples that came and were young enough, each with the time since the one before.
    came: f64,
    /// Numbers left out, and samples that were too old.
    missing: f64,
    /// Sum of the times between samples \[s\].
    sum_s: f64,
    /// Sum of their squares \[s²\].
    squares_s2: f64,
    /// Sum of the ages of the states that samples were made for \[s\].
    ages_s: f64,
}

/// A sample as the link brought it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    pub(super) header: StreamHeader,
    pub(super) now: MonoTime,
    /// Age of the state that it was made for; none if it is too old to be followed.
    pub(super) age: Option<Duration>,
}

impl LinkQuality {
    /// Nothing is known of the link yet.
    pub(super) fn new(lease: Uuid) -> Self {
        Self {
            lease,
            newest: (0, 0),
            heard: None,
            arrived: None,
            before: Bucket::default(),
            filling: Bucket::default(),
            since: MonoTime::ZERO,
            standing: Standing::Good,
            report: LinkReport::default(),
        }
    }

    /// What is found so far.
    pub(super) const fn report(&self) -> LinkReport {
        self.report
    }

    /// Whether samples are dropped because of the link.
    pub(super) fn is_refused(&self) -> bool {
        self.standing == Standing::Refused
    }

    /// When the newest sample came, if that was a moment ago.
    pub(super) fn heard(&self, now: MonoTime) -> Option<MonoTime> {
        self.heard.filter(|heard| now.saturating_since(*heard) <= PAUSE)
    }

    /// Takes a sample whose number is above all before it; returns what it changes.
    pub(super) fn take(&mut self, arrival: Arrival, timeout: Duration) -> Option<StreamChange> {
        let Arrival { header, now, age } = arrival;
        if self.lease != header.lease {
            *self = Self::new(header.lease);
        }
        if self.heard(now).is_none() {
            self.begin(now);
        }
        self.heard = Some(now);
        let (epoch, seq) = std::mem::replace(&mut self.newest, (header.epoch, header.seq));
        if epoch == header.epoch {
            self.filling.missing += header.seq.saturating_sub(seq.saturating_add(1)) as f64;
        }
        let timeout_s = timeout.as_secs_f64();
        if let Some(age) = age {
            if let Some(before) = self.arrived.replace(now) {
                let gap_s = now.saturating_since(before).as_secs_f64();
                self.filling.take(gap_s.min(LONGEST * timeout_s), age.as_secs_f64());
            }
        } else {
            self.filling.missing += 1.0;
        }
        let is_full = now.saturating_since(self.since) >= BUCKET && self.filling.all() >= FEWEST;
        if is_full { self.judge(now, timeout_s) } else { None }
    }

    /// Begins anew after a pause; what was found before holds until more is known.
    fn begin(&mut self, now: MonoTime) {
        (self.before, self.filling) = (Bucket::default(), Bucket::default());
        (self.since, self.arrived, self.newest) = (now, None, (0, u64::MAX));
    }

    fn judge(&mut self, now: MonoTime, timeout_s: f64) -> Option<StreamChange> {
        let all = self.before.with(&self.filling);
        (self.before, self.filling, self.since) = (self.filling, Bucket::default(), now);
        let need = (all.mean_s() + DEVIATIONS * all.deviation_s()) / timeout_s;
        let need = if all.came > 0.0 { need } else { f64::INFINITY };
        let standing = match self.standing {
            _ if need > REFUSED => Standing::Refused,
            Standing::Refused if need > ACCEPTED => Standing::Refused,
            Standing::Good if need <= 1.0 => Standing::Good,
            _ if need <= GOOD => Standing::Good,
            _ => Standing::Slowed,
        };
        let allowed = if standing == Standing::Refused { 0.0 } else { need.recip().min(1.0) };
        let loss = all.missing / all.all();
        self.report = if all.came > 0.0 {
            let (jitter_s, state_age_s) = (all.deviation_s(), all.ages_s / all.came);
            LinkReport { jitter_s, loss, state_age_s, allowed }
        } else {
            LinkReport { loss, allowed, ..self.report }
        };
        let before = std::mem::replace(&mut self.standing, standing);
        (before != standing).then_some(match standing {
            Standing::Good => StreamChange::Restored,
            Standing::Slowed => StreamChange::Slowed,
            Standing::Refused => StreamChange::Refused,
        })
    }
}

impl Bucket {
    fn take(&mut self, gap_s: f64, age_s: f64) {
        self.came += 1.0;
        self.sum_s += gap_s;
        self.squares_s2 += gap_s * gap_s;
        self.ages_s += age_s;
    }

    fn with(&self, other: &Self) -> Self {
        Self {
            came: self.came + other.came,
            missing: self.missing + other.missing,
            sum_s: self.sum_s + other.sum_s,
            squares_s2: self.squares_s2 + other.squares_s2,
            ages_s: self.ages_s + other.ages_s,
        }
    }

    /// How many were sent, as far as it is known here.
    fn all(&self) -> f64 {
        self.came + self.missing
    }

    /// Mean time between samples, if one came.
    fn mean_s(&self) -> f64 {
        self.sum_s / self.came
    }

    fn deviation_s(&self) -> f64 {
        let mean_s = self.mean_s();
        // Rounding may leave a little less than nothing.
        (self.squares_s2 / self.came - mean_s * mean_s).max(0.0).sqrt()
    }
}
