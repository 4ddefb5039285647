//! Some seconds of a loop: its state before them, then tick by tick what it was told and said.

use armada_model::MonoTime;
use armada_protocol::messages::{CommandMode, RobotFlags, StopLevel};
use serde::{Deserialize, Serialize};

use super::digest::digest;
use crate::control::{
    GroupWord, Input, LoopRequest, LoopState, MAX_REQUESTS, MAX_SAMPLES, MAX_WORDS, Output,
    StreamSample,
};
use crate::drivers::{Feedback, SetPoint};

/// Requests that a segment has room for; with more it ends early.
const REQUESTS: usize = 128;

/// Some seconds of a loop.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Segment {
    /// The loop's state before the first tick.
    pub state: LoopState,
    /// The ticks, one after the other without a gap.
    pub ticks: Vec<Tick>,
    /// The requests of all ticks, in their order.
    pub requests: Vec<LoopRequest>,
    /// The samples of streams of all ticks, in their order.
    pub samples: Vec<StreamSample>,
    /// What partners said in all ticks, in its order.
    pub words: Vec<GroupWord>,
}

/// One tick: what the loop was told, and what it said.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tick {
    /// The tick's deadline.
    pub now: MonoTime,
    /// Level of the latched stop.
    pub stop: Option<StopLevel>,
    /// How often it was reset.
    pub resets: u16,
    /// Whether the step before panicked.
    pub loop_error: bool,
    /// Report of the controller.
    pub feedback: Option<Feedback>,
    /// How many of the segment's requests are of this tick.
    pub requests: u8,
    /// How many of the segment's samples are of this tick.
    pub samples: u8,
    /// How many of the segment's words of partners are of this tick.
    pub words: u8,
    /// What the loop said.
    pub said: Said,
}

/// What a tick said.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Said {
    /// The set-point, if one was sent.
    pub command: Option<SetPoint>,
    /// Mode in force after it.
    pub command_mode: CommandMode,
    /// Epoch in force after it.
    pub epoch: u64,
    /// Conditions after it.
    pub flags: RobotFlags,
    /// Stands for the requests to the controller, the events and what partners are told.
    pub digest: u64,
}

impl Said {
    /// What `output` says.
    #[must_use]
    pub fn of(output: &Output) -> Self {
        let snapshot = &output.snapshot;
        Self {
            command: output.command,
            command_mode: snapshot.command_mode,
            epoch: snapshot.epoch,
            flags: snapshot.flags,
            digest: digest(output),
        }
    }
}

impl Segment {
    /// An empty segment with room for `ticks`.
    #[must_use]
    pub fn with_room(state: LoopState, ticks: usize) -> Self {
        Self {
            state,
            ticks: Vec::with_capacity(ticks),
            requests: Vec::with_capacity(REQUESTS),
            samples: Vec::with_capacity(ticks),
            words: Vec::with_capacity(ticks + MAX_WORDS),
        }
    }

    /// Whether another tick of any kind fits without taking memory.
    pub(super) const fn has_room(&self) -> bool {
        self.ticks.len() < self.ticks.capacity()
            && self.requests.len() + MAX_REQUESTS <= self.requests.capacity()
            && self.samples.len() + MAX_SAMPLES <= self.samples.capacity()
            && self.words.len() + MAX_WORDS <= self.words.capacity()
    }

    /// Takes what a tick is about to be told.
    pub(super) fn listen(&mut self, input: &Input) {
        self.requests.extend(input.requests.iter().cloned());
        self.samples.extend(input.stream.iter().copied());
        self.words.extend(input.group.iter().copied());
    }

    /// Takes what it was told and what it said; so many requests, samples and words of it were
    /// listened to.
    pub(super) fn note(&mut self, input: &Input, counts: [usize; 3], output: &Output) {
        let [requests, samples, words] = counts.map(|count| u8::try_from(count).unwrap_or(u8::MAX));
        self.ticks.push(Tick {
            now: input.now,
            stop: input.stop,
            resets: input.resets,
            loop_error: input.loop_error,
            feedback: input.feedback,
            requests,
            samples,
            words,
            said: Said::of(output),
        });
    }

    /// Forgets everything, so that the loop's thread gives nothing back when it writes over it.
    pub(super) fn clear(&mut self, empty: &LoopState) {
        self.state = empty.clone();
        self.ticks.clear();
        self.requests.clear();
        self.samples.clear();
        self.words.clear();
    }
}
