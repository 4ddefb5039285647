//! Whole cells as real processes over real Zenoh.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod authority;
mod commands;
mod delegating;
mod ending;
mod equipment;
mod failures;
mod malformed;
mod moving;
mod on_the_way;
mod python;
mod starting;
mod support;
mod together;
