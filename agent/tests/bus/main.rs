//! Agents over real Zenoh, with emulated controllers over real datagrams. One program, since each
//! links all of Zenoh.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;
mod group;
mod jogging;
mod latch;
mod lease;
mod moves;
mod queueing;
mod reduced;
mod running;
mod several_robots;
mod stop_sources;
mod streaming;
