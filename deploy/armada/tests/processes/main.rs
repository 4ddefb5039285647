//! Programs of a cell as real processes: agents and buttons beside real emulators.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod agent;
mod common;
mod stop_button;
