//! What lies between the loop thread and the rest: wait-free queues and the latest snapshot.

use armada_model::MonoTime;
use rtrb::{Consumer, Producer, RingBuffer};

use crate::control::{
    GroupSay, GroupWord, LoopEvent, LoopRequest, Retired, Snapshot, StreamSample,
};

/// Requests on their way to the loop; more are refused as busy.
const REQUESTS: usize = 256;
/// Samples of streams on their way to the loop: eight ticks' worth; more are dropped.
const SAMPLES: usize = 64;
/// Events on their way from the loop: some seconds of the busiest loop.
const EVENTS: usize = 4096;
/// Words of partners on their way to the loop; more are dropped.
const WORDS: usize = 256;
/// Words to partners on their way from the loop.
const SAYS: usize = 256;
/// Trajectories and tools on their way to be freed.
const RETIRED: usize = 256;

/// An event with the time the loop said it, after its set-point had gone out.
pub(super) type StampedEvent = (MonoTime, LoopEvent);

/// The latest snapshot, and how many samples of the state have fallen due.
#[derive(Clone, Copy, Debug)]
pub(super) struct Latest {
    pub(super) snapshot: Snapshot,
    pub(super) due: u64,
}

/// The loop's end.
pub(super) struct LoopEnd {
    pub(super) requests: Consumer<LoopRequest>,
    pub(super) samples: Consumer<StreamSample>,
    pub(super) words: Consumer<GroupWord>,
    pub(super) says: Producer<GroupSay>,
    pub(super) events: Producer<StampedEvent>,
    pub(super) retired: Producer<Retired>,
    pub(super) latest: triple_buffer::Input<Latest>,
}

/// The publisher's end.
pub(super) struct PublisherEnd {
    pub(super) events: Consumer<StampedEvent>,
    pub(super) retired: Consumer<Retired>,
    pub(super) says: Consumer<GroupSay>,
    pub(super) latest: triple_buffer::Output<Latest>,
}

/// The end of those who ask and stream.
pub(super) struct ClientEnd {
    pub(super) requests: Producer<LoopRequest>,
    pub(super) samples: Producer<StreamSample>,
    pub(super) words: Producer<GroupWord>,
}

/// Makes all ends; `first` is seen before the first tick.
pub(super) fn mailbox(first: Snapshot) -> (LoopEnd, PublisherEnd, ClientEnd) {
    let (request_in, requests) = RingBuffer::new(REQUESTS);
    let (sample_in, samples) = RingBuffer::new(SAMPLES);
    let (word_in, words) = RingBuffer::new(WORDS);
    let (says, say_out) = RingBuffer::new(SAYS);
    let (events, event_out) = RingBuffer::new(EVENTS);
    let (retired, retired_out) = RingBuffer::new(RETIRED);
    let (latest, latest_out) = triple_buffer::triple_buffer(&Latest { snapshot: first, due: 0 });
    (
        LoopEnd { requests, samples, words, says, events, retired, latest },
        PublisherEnd { events: event_out, retired: retired_out, says: say_out, latest: latest_out },
        ClientEnd { requests: request_in, samples: sample_in, words: word_in },
    )
}
