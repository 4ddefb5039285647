//! The failure matrix: hosts with links that go bad, processes that freeze, die and come back.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod network;
