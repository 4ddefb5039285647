//! The last seconds of the control loop, to be run through it again.
//!
//! ```text
//! loop thread:  Tape -- full segments --> Shelf (runtime) --fault, or asked--> file
//!                ^------ empty ones ------+                                      |
//!                                              differences <-- replay <-- read --+
//! ```
//!
//! A segment begins with a copy of the loop's state and then has what each tick was told and said.
//! Since `step` is pure, the same build says the same again, bit for bit: `replay` shows the first
//! tick that differs. The tape neither takes memory nor gives any back; full segments go to
//! another thread, which keeps the newest and returns the oldest emptied.

mod digest;
mod file;
mod replay;
mod segment;
mod shelf;
mod tape;
#[cfg(test)]
mod tests;

pub use file::{Recording, RecordingError};
pub use replay::{Difference, Replay, replay};
pub use segment::{Said, Segment, Tick};
pub use shelf::Shelf;
pub use tape::Tape;
