//! A tick of the control loop touches no heap, in any mode.
//!
//! A global allocator counts what this thread asks of it, and what it gives back: to free memory
//! may block as long as to get it. One program, since it can have one such allocator only.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

mod counting;
mod delegated;
mod group;
mod motions;
mod orders;
mod others;
mod rig;
mod stops;
mod streams;
mod values;
