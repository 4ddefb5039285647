//! The gateway of one robot cell: it knows every robot, and moves and stops them together.
//!
//! ```text
//! cell file --config--> CellConfig
//!                          |
//! agents --samples--> runtime --Input--> coordinator --Action--> runtime --> agents, clients
//!                          '----------> world ------> poses of all links
//! ```
//! `coordinator` and `world` are pure: time and messages are arguments. `runtime` is the only part
//! that touches a clock, a task or Zenoh.
//!
//! Invariants: no stop depends on the gateway; nothing that anybody sends ends it; state goes from
//! agents to clients directly, never through here.

pub mod config;
pub mod coordinator;
mod runtime;
pub mod world;

pub use runtime::{GatewayError, GatewayOptions, run};
