//! Whole cells as real processes over real Zenoh.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod authority;
mod commands;
mod ending;
mod failures;
mod malformed;
mod moving;
mod starting;
mod support;
