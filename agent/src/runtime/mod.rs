//! Everything that touches a clock, a socket, a thread or Zenoh.
//!
//! ```text
//!            requests (bounded queue)            datagrams
//! requests -------------------------> loop thread <------> controller
//!   ^ |      stop gate (one atomic)       |
//!   | |  -------------------------------> | latest snapshot, events, trajectories to free
//!   | v                                   v
//!  board <------ desk (tokio) <------ publisher thread ----> state, joint_states
//!                   |
//!                   +----> status, events, motions, stop/ack
//! ```
//!
//! The loop thread allocates nothing, takes no lock, logs nothing and never meets Zenoh; it only
//! writes to wait-free queues and wakes the publisher. A stop closes the gate in Zenoh's callback,
//! before anything else is looked at.
//!
//! All of this is one robot's (`robot_agent`); an agent runs one or more (`agent`), which share the
//! Zenoh session and tokio's threads.

mod agent;
mod board;
mod bus;
mod capabilities;
mod clock;
mod connected;
mod desk;
mod emulation;
mod equipment;
mod group_link;
mod group_names;
mod groups;
mod leases;
mod link;
mod loop_thread;
mod mailbox;
mod meter;
mod motion_log;
mod processor;
mod publisher;
mod realtime;
mod recordings;
mod requests;
mod robot;
mod robot_agent;
mod self_collision;
mod stop_desk;
mod stop_file;
mod stop_gate;
mod stop_intake;
mod stop_keeper;
mod stop_latch;
mod stop_sources;
mod stop_watch;
mod stream_intake;
mod threads;
mod wake_log;
mod why;
mod words;

pub use agent::{Agent, AgentError, AgentOptions};
pub use clock::{monotonic, sleep_until, utc_ns};
pub use emulation::{Emulation, EmulationError};
pub use link::LinkError;
pub use realtime::{RealtimeReport, enter};
pub use stop_file::StateError;
pub use wake_log::{Wake, WakeLog, WakeReader, wake_log};
