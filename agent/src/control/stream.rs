//! Streams of commands: which samples are followed.
//!
//! ```text
//!        first sample                no sample for the timeout
//! none --------------> in progress ---------------------------> starved: decelerates, holds
//!   ^                       ^  |                                   |  |
//!   |                       |  |            another sample         |  |
//!   |                       +--|-----------------------------------+  |
//!   +-- epoch raised, lease lost: a ramp to rest ---------------------+
//! ```
//!
//! A sample is looked at in the tick that takes it, and dropped and counted if, in this order,
//!
//! | reason | it |
//! |---|---|
//! | lease | is not under the lease in force or a sub-lease to move the arm, or while a stream of another of them is in progress; a stream always needs one |
//! | epoch | is not of the epoch in force |
//! | sequence | has a number that is not above all that came under its lease and epoch |
//! | age | was made for a state that is older than the limit, in time, or for one of the future |
//! | link | comes under a lease whose samples come too seldom or unevenly, see [`LinkQuality`] |
//! | mode | commands positions in another mode than `position_command`, or speeds in another than `velocity_command` |
//! | values | is not of this robot's number of joints, not finite, of no joint, or of no chain |
//!
//! Of the good ones of a tick the newest is followed; see [`motion::stream`](super::motion) for
//! how. The mode stays when a stream starves, and a later sample of the same epoch resumes it.

use std::time::Duration;

use armada_model::{JointVector, MonoTime};
use armada_protocol::messages::{CommandMode, StreamHeader};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::checkpoint::copy_by_fields;
use super::io::{
    DroppedSamples, LinkReport, LoopEvent, Params, StreamChange, StreamReport, StreamSample,
    StreamValues,
};
use super::link_quality::{Arrival, LinkQuality};
use super::motion::StreamFollower;
use super::state::{LoopState, Tick};
use crate::drivers::JointSet;

/// Longest ring of past ticks; a state beyond it is too old.
const MAX_RING: usize = 4096;

/// The stream in progress, and what is needed to judge the next sample.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Stream {
    past: Past,
    /// The newest sample that came with the lease and epoch that were in force.
    newest: Option<StreamHeader>,
    dropped: DroppedSamples,
    dropped_in_epoch: u64,
    link: LinkQuality,
    current: Option<Current>,
}

/// A stream in progress.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Current {
    lease: Uuid,
    report: StreamReport,
    follower: StreamFollower,
    /// Whether a sample was followed in the last tick.
    followed: bool,
}

/// When the states of late were made.
#[derive(Debug, Serialize, Deserialize)]
struct Past {
    /// Number and time of a tick, at the place of its number.
    ring: Box<[(u64, MonoTime)]>,
}

/// Why a sample is dropped.
#[derive(Clone, Copy, Debug)]
enum Unfit {
    Lease,
    Epoch,
    Sequence,
    Age,
    Link,
    Mode,
    Values,
}

copy_by_fields! { Stream: past, newest, dropped, dropped_in_epoch, link, current }

copy_by_fields! { Past: ring }

impl Stream {
    pub(super) fn new(params: &Params) -> Self {
        Self {
            past: Past::new(params),
            newest: None,
            dropped: DroppedSamples::default(),
            dropped_in_epoch: 0,
            link: LinkQuality::new(Uuid::nil()),
            current: None,
        }
    }

    /// The stream in progress, for the snapshot; also one of which nothing was taken, because its
    /// link is refused.
    pub(super) fn report(&self, now: MonoTime) -> Option<StreamReport> {
        let (dropped, link) = (self.dropped_in_epoch, self.link.report());
        if let Some(current) = &self.current {
            return Some(StreamReport { dropped, link, ..current.report });
        }
        let newest = self.link.heard(now).filter(|_| dropped > 0 && self.link.is_refused())?;
        Some(StreamReport { taken: 0, dropped, limited: 0, newest, starved: true, link })
    }

    /// Share of the limits of speed that the stream's link allows.
    pub(super) const fn allowed(&self) -> f64 {
        self.link.report().allowed
    }

    /// Samples dropped so far.
    pub(super) const fn dropped(&self) -> DroppedSamples {
        self.dropped
    }

    /// Whether a sample was followed in this tick.
    pub(super) fn is_followed(&self) -> bool {
        self.current.as_ref().is_some_and(|current| current.followed)
    }

    /// What makes set-points of the samples.
    pub(super) fn follower_mut(&mut self) -> Option<&mut StreamFollower> {
        self.current.as_mut().map(|current| &mut current.follower)
    }

    pub(super) fn note_followed(&mut self, followed: bool) {
        if let Some(current) = &mut self.current {
            current.followed = followed;
        }
    }

    const fn count(&mut self, reason: Unfit) {
        self.dropped_in_epoch += 1;
        let dropped = &mut self.dropped;
        let counter = match reason {
            Unfit::Lease => &mut dropped.lease,
            Unfit::Epoch => &mut dropped.epoch,
            Unfit::Sequence => &mut dropped.sequence,
            Unfit::Age => &mut dropped.age,
            Unfit::Link => &mut dropped.link,
            Unfit::Mode => &mut dropped.mode,
            Unfit::Values => &mut dropped.values,
        };
        *counter += 1;
    }
}

impl LoopState {
    /// Looks at the samples of this tick, and at whether the stream is still alive.
    pub(super) fn take_samples(
        &mut self,
        tick: &mut Tick<'_>,
        samples: impl Iterator<Item = StreamSample>,
    ) {
        self.end_unleased_stream(tick);
        let (mut newest, mut taken) = (None, 0);
        for sample in samples {
            match self.judge(tick, &sample) {
                Ok(()) => (newest, taken) = (Some(sample), taken + 1),
                Err(reason) => self.stream.count(reason),
            }
        }
        match newest {
            Some(sample) => self.go_on_with(tick, &sample, taken),
            None => self.watch_stream(tick),
        }
        self.stream.past.note(self.seqno, tick.now);
    }

    /// Ends the stream in progress; whoever ends it sees to the ramp.
    pub(super) fn end_stream(&mut self, tick: &mut Tick<'_>) {
        self.stream.dropped_in_epoch = 0;
        if self.stream.current.take().is_some() {
            tick.event(LoopEvent::Stream(StreamChange::Ended));
        }
    }

    fn judge(&mut self, tick: &mut Tick<'_>, sample: &StreamSample) -> Result<(), Unfit> {
        let header = sample.header;
        let of_other =
            self.stream.current.as_ref().is_some_and(|current| current.lease != header.lease);
        if of_other || !self.lease_in_force(header.lease) {
            return Err(Unfit::Lease);
        }
        if header.epoch != self.epoch {
            return Err(Unfit::Epoch);
        }
        let of_same = |newest: &StreamHeader| (newest.lease, newest.epoch);
        let before = self.stream.newest.filter(|n| of_same(n) == of_same(&header));
        if before.is_some_and(|newest| newest.seq >= header.seq) {
            return Err(Unfit::Sequence);
        }
        self.stream.newest = Some(header);
        let age = self.stream.past.age(header.state_seqno, tick.now);
        let age = age.filter(|age| *age <= tick.params.stream_max_age);
        let arrival = Arrival { header, now: tick.now, age };
        if let Some(change) = self.stream.link.take(arrival, tick.params.stream_timeout) {
            tick.event(LoopEvent::Stream(change));
        }
        if age.is_none() {
            return Err(Unfit::Age);
        }
        if self.stream.link.is_refused() {
            return Err(Unfit::Link);
        }
        if mode_of(&sample.values) != self.mode {
            return Err(Unfit::Mode);
        }
        if self.makes_sense(&sample.values) { Ok(()) } else { Err(Unfit::Values) }
    }

    fn makes_sense(&self, values: &StreamValues) -> bool {
        let count = self.limits.len();
        let fits = |vector: &JointVector| vector.len() == count && vector.is_finite();
        let is_some =
            |joints: JointSet| !joints.is_empty() && JointSet::first(count).contains_all(joints);
        match values {
            StreamValues::Position { joints, position, velocity } => {
                is_some(*joints) && fits(position) && (velocity.is_empty() || fits(velocity))
            }
            StreamValues::Velocity { joints, velocity } => is_some(*joints) && fits(velocity),
            StreamValues::Twist(target) => {
                self.equipment.chains.get(usize::from(target.chain)).is_some()
                    && target.twist.is_finite()
            }
        }
    }

    /// Follows `sample`, the newest of the `taken` ones of this tick.
    fn go_on_with(&mut self, tick: &mut Tick<'_>, sample: &StreamSample, taken: u64) {
        let limits = self.limits_in_force(tick.params);
        let begins = self.stream.current.is_none();
        let current = self.stream.current.get_or_insert_with(|| Current {
            lease: sample.header.lease,
            report: StreamReport {
                taken: 0,
                dropped: 0,
                limited: 0,
                newest: tick.now,
                starved: false,
                link: LinkReport::default(),
            },
            follower: StreamFollower::default(),
            followed: false,
        });
        let limited = current.follower.take(sample, &limits, tick.now);
        let report = &mut current.report;
        report.taken += taken;
        report.limited += u64::from(limited);
        report.newest = tick.now;
        let resumes = std::mem::replace(&mut report.starved, false);
        if begins {
            tick.event(LoopEvent::Stream(StreamChange::Began));
        } else if resumes {
            tick.event(LoopEvent::Stream(StreamChange::Resumed));
        }
    }

    /// Says once that samples stay away.
    fn watch_stream(&mut self, tick: &mut Tick<'_>) {
        let Some(Current { report, follower, .. }) = &mut self.stream.current else {
            return;
        };
        let silent = tick.now.saturating_since(report.newest) > tick.params.stream_timeout;
        if silent && !report.starved {
            report.starved = true;
            follower.starve();
            tick.event(LoopEvent::Stream(StreamChange::Starved));
        }
    }

    /// A stream ends with the lease that it is under.
    fn end_unleased_stream(&mut self, tick: &mut Tick<'_>) {
        let lease = self.stream.current.as_ref().map(|current| current.lease);
        if lease.is_some_and(|lease| !self.lease_in_force(lease)) {
            self.end_stream(tick);
            self.decelerate(tick);
        }
    }
}

impl Past {
    fn new(params: &Params) -> Self {
        let ticks = params.stream_max_age.as_nanos() / params.period.as_nanos().max(1) + 2;
        let len = usize::try_from(ticks).unwrap_or(MAX_RING).min(MAX_RING);
        // No tick has this number.
        Self { ring: vec![(u64::MAX, MonoTime::default()); len].into_boxed_slice() }
    }

    fn note(&mut self, seqno: u64, stamp: MonoTime) {
        let place = self.place(seqno);
        if let Some(slot) = self.ring.get_mut(place) {
            *slot = (seqno, stamp);
        }
    }

    /// How old the state `seqno` is; none if it is not known: of long ago or of the future.
    fn age(&self, seqno: u64, now: MonoTime) -> Option<Duration> {
        let slot = self.ring.get(self.place(seqno)).filter(|(number, _)| *number == seqno);
        slot.map(|(_, stamp)| now.saturating_since(*stamp))
    }

    #[expect(clippy::cast_possible_truncation, reason = "the remainder is below the length")]
    const fn place(&self, seqno: u64) -> usize {
        (seqno % self.ring.len() as u64) as usize
    }
}

const fn mode_of(values: &StreamValues) -> CommandMode {
    match values {
        StreamValues::Position { .. } => CommandMode::PositionCommand,
        StreamValues::Velocity { .. } | StreamValues::Twist(_) => CommandMode::VelocityCommand,
    }
}
