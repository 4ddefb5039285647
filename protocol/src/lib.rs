//! The contract of Armada on Zenoh: keys, messages, encodings, and helpers for both ends.
//!
//! ```text
//! keys, method, messages   what is said and where        (no Zenoh session)
//! codec                    messages <-> bytes
//! session                  a Zenoh session set up for a role
//! generated                KEYS.md and keys.json from the tables
//! publish                  the sending end of published keys
//! serve                    the answering end, for agent and gateway
//! client                   the asking end, for programs
//! signature                keys that resets and check-ins are signed with
//! ```
//!
//! Invariants: no other crate spells a key; a message that decodes is valid in itself, and every
//! number in it finite; a refused
//! request is answered with a [`messages::Denial`] on the reply's error channel; zero replies to a
//! request are a failure, never a success.

pub mod client;
pub mod codec;
mod finite;
pub mod generated;
pub mod keys;
pub mod messages;
pub mod method;
pub mod publish;
pub mod qos;
mod robot_name;
pub mod serve;
pub mod session;
pub mod signature;

pub use robot_name::{RobotName, RobotNameError};
