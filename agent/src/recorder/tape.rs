//! The end of the recorder that runs in the loop's thread.

use rtrb::{Consumer, Producer, RingBuffer};

use super::Shelf;
use super::segment::Segment;
use crate::control::{Input, LoopState, Output};

/// How long a segment is \[s\].
const SEGMENT_S: f64 = 2.0;

/// What goes from the tape to the shelf.
#[derive(Debug)]
pub(super) enum Handed {
    /// A full segment, or one that was ended to be saved.
    Segment(Box<Segment>),
    /// What came so far is to be saved.
    Save,
}

/// Writes the ticks of a loop down.
#[derive(Debug)]
pub struct Tape {
    current: Option<Box<Segment>>,
    full: Producer<Handed>,
    empty: Consumer<Box<Segment>>,
    /// Requests, samples and words of the tick in progress.
    counts: [usize; 3],
    /// Whether the segment is to be handed over after this tick.
    saving: bool,
}

impl Tape {
    /// A tape and the shelf that keeps at least the last `seconds` of it, in a loop of `period_s`.
    ///
    /// `empty` is a state of the same loop before its first tick.
    #[must_use]
    pub fn new(empty: &LoopState, period_s: f64, seconds: f64) -> (Self, Shelf) {
        let ticks = (SEGMENT_S / period_s).ceil().max(1.0) as usize;
        // Those that are kept, one that is written, one that ends early, one on its way back.
        let count = (seconds / SEGMENT_S).ceil().max(1.0) as usize + 3;
        let (full, filled) = RingBuffer::new(2 * count);
        let (mut emptied, empties) = RingBuffer::new(count);
        for _ in 0..count {
            let segment = Box::new(Segment::with_room(empty.clone(), ticks));
            // There is room for all of them.
            drop(emptied.push(segment));
        }
        let wanted = (seconds / period_s).ceil().max(1.0) as usize;
        let tape = Self { current: None, full, empty: empties, counts: [0; 3], saving: false };
        (tape, Shelf::new(empty.clone(), wanted, filled, emptied))
    }

    /// Before a step: takes what it is told.
    pub fn before(&mut self, state: &LoopState, input: &Input) {
        if self.current.as_ref().is_some_and(|segment| !segment.has_room()) {
            self.hand_over();
        }
        if self.current.is_none() {
            self.current = self.empty.pop().ok();
            if let Some(segment) = &mut self.current {
                segment.state.clone_from(state);
            }
        }
        self.counts = [input.requests.len(), input.stream.len(), input.group.len()];
        if let Some(segment) = &mut self.current {
            segment.listen(input);
        }
    }

    /// After the step: takes what it said.
    pub fn after(&mut self, input: &Input, output: &Output) {
        if let Some(segment) = &mut self.current {
            segment.note(input, self.counts, output);
        }
        if std::mem::take(&mut self.saving) {
            self.hand_over();
            // A full queue holds a request to save already.
            drop(self.full.push(Handed::Save));
        }
    }

    /// A step that panicked said nothing: what follows cannot be replayed from before it.
    pub fn cut(&mut self) {
        self.hand_over();
    }

    /// Has everything up to the tick in progress saved.
    pub const fn save(&mut self) {
        self.saving = true;
    }

    fn hand_over(&mut self) {
        let Some(segment) = self.current.take() else {
            return;
        };
        if let Err(rtrb::PushError::Full(Handed::Segment(segment))) =
            self.full.push(Handed::Segment(segment))
        {
            // Dropping it would give memory back in the loop.
            self.current = Some(segment);
        }
    }
}
