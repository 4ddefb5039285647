//! Running a recording through the loop again.

use std::fmt;

use super::file::Recording;
use super::segment::{Said, Segment, Tick};
use crate::control::{Input, LoopEvent, Params, step};

/// What a replay found.
#[derive(Clone, Debug)]
pub struct Replay {
    /// Ticks that were run.
    pub ticks: usize,
    /// The first tick that says something else than it did, with its events.
    pub first_difference: Option<Difference>,
}

/// A tick that says something else than it did.
#[derive(Clone, Debug)]
pub struct Difference {
    /// Number of the tick in the recording, from 0.
    pub tick: usize,
    /// What it was told, and what it said.
    pub recorded: Tick,
    /// What it says now.
    pub replayed: Said,
    /// Events it says now.
    pub events: Vec<LoopEvent>,
}

/// Runs `recording` through the loop until it says something else than it did.
///
/// Each segment begins with its own state, so that a difference does not hide those after it.
#[must_use]
pub fn replay(recording: &Recording) -> Replay {
    let mut ticks = 0;
    for segment in &recording.segments {
        let difference = replay_segment(&recording.params, segment);
        if let Some(mut difference) = difference {
            difference.tick += ticks;
            return Replay { ticks: difference.tick + 1, first_difference: Some(difference) };
        }
        ticks += segment.ticks.len();
    }
    Replay { ticks, first_difference: None }
}

fn replay_segment(params: &Params, segment: &Segment) -> Option<Difference> {
    let mut state = segment.state.clone();
    let (mut requests, mut samples) = (segment.requests.iter(), segment.samples.iter());
    let mut words = segment.words.iter();
    for (index, tick) in segment.ticks.iter().enumerate() {
        let mut input = Input {
            now: tick.now,
            feedback: tick.feedback,
            stop: tick.stop,
            resets: tick.resets,
            loop_error: tick.loop_error,
            requests: requests.by_ref().take(usize::from(tick.requests)).cloned().collect(),
            stream: samples.by_ref().take(usize::from(tick.samples)).copied().collect(),
            group: words.by_ref().take(usize::from(tick.words)).copied().collect(),
        };
        let output = step(params, &mut state, &mut input);
        let replayed = Said::of(&output);
        if replayed != tick.said {
            let events = output.events.into_iter().collect();
            return Some(Difference { tick: index, recorded: *tick, replayed, events });
        }
    }
    None
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (was, is) = (&self.recorded.said, &self.replayed);
        write!(f, "tick {} at {} ns:", self.tick, self.recorded.now.as_nanos())?;
        if was.command_mode != is.command_mode {
            write!(f, " mode was {:?}, is {:?};", was.command_mode, is.command_mode)?;
        }
        if was.epoch != is.epoch {
            write!(f, " epoch was {}, is {};", was.epoch, is.epoch)?;
        }
        if was.flags != is.flags {
            write!(f, " flags were {:#x}, are {:#x};", was.flags.bits(), is.flags.bits())?;
        }
        match (&was.command, &is.command) {
            (Some(was), Some(is)) => {
                let joints = was.joint_position.iter().zip(is.joint_position.iter()).enumerate();
                for (joint, (was, is)) in joints.filter(|(_, (was, is))| was != is) {
                    write!(f, " joint {joint} was sent to {was:?}, is to {is:?};")?;
                }
            }
            (Some(_), None) => write!(f, " a set-point was sent, none is;")?,
            (None, Some(_)) => write!(f, " no set-point was sent, one is;")?,
            (None, None) => {}
        }
        if was.digest != is.digest {
            write!(f, " other events or requests; now: {:?}", self.events)?;
        }
        Ok(())
    }
}
