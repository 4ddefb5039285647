//! The end of the recorder outside the loop's thread.

use std::collections::VecDeque;

use rtrb::{Consumer, Producer};

use super::segment::Segment;
use super::tape::Handed;
use crate::control::LoopState;

/// Keeps the newest segments of a tape.
#[derive(Debug)]
pub struct Shelf {
    empty: LoopState,
    wanted_ticks: usize,
    filled: Consumer<Handed>,
    emptied: Producer<Box<Segment>>,
    kept: VecDeque<Box<Segment>>,
}

impl Shelf {
    pub(super) const fn new(
        empty: LoopState,
        wanted_ticks: usize,
        filled: Consumer<Handed>,
        emptied: Producer<Box<Segment>>,
    ) -> Self {
        Self { empty, wanted_ticks, filled, emptied, kept: VecDeque::new() }
    }

    /// Takes what the tape has handed over and returns what is too old; whether what is kept is to
    /// be saved now.
    pub fn tidy(&mut self) -> bool {
        while let Ok(handed) = self.filled.pop() {
            match handed {
                Handed::Segment(segment) => self.keep(segment),
                Handed::Save => return true,
            }
        }
        false
    }

    /// The segments that are kept, oldest first.
    pub fn segments(&self) -> impl Iterator<Item = &Segment> {
        self.kept.iter().map(|segment| &**segment)
    }

    fn keep(&mut self, segment: Box<Segment>) {
        self.kept.push_back(segment);
        loop {
            let held: usize = self.kept.iter().map(|segment| segment.ticks.len()).sum();
            let oldest = self.kept.front().map_or(0, |segment| segment.ticks.len());
            // Two must be left to the tape: the one it writes and the next.
            let crowded = self.kept.len() + 2 > self.emptied.buffer().capacity();
            if held < self.wanted_ticks + oldest && !crowded {
                return;
            }
            let Some(mut oldest) = self.kept.pop_front() else { return };
            oldest.clear(&self.empty);
            // There is room for all segments that exist.
            drop(self.emptied.push(oldest));
        }
    }
}
