//! Coordinator and world of one robot cell.

pub mod config;
pub mod coordinator;
