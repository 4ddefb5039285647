//! The failure matrix: hosts with links that go bad, processes that freeze, die and come back.
//!
//! One function for each row, named after it; rows that leave a calm cell behind share one. Every
//! row asserts the bound, the reaction, whether it is latched, and the way back to work.
//!
//! | rows | file | what fails |
//! |---|---|---|
//! | 1 2 3 16 17 | `clients` | clients that die, quarrel, flood, replay and forge |
//! | 4 5 6 7 12 | `partitions` | gateways, agents and links while arms move together |
//! | 8 9 13 14 15 | `robots` | controllers, tools and joints |
//! | 10 11 18 | `stops` | stop buttons, silent arms, restarts while a stop is latched |
//! | | `network` | the network of the tests, and streams on a bad link |
//!
//! Processes of one machine share its monotonic clock, whatever host they are on, so stamps of
//! agents are compared with each other and with when a test did something. Bounds are taken between
//! stamps of control loops, which a busy machine hardly delays.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod clients;
mod network;
mod partitions;
mod robots;
mod stops;
mod support;
