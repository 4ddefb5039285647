//! The agent of one robot controller: control loop, drivers, emulators and runtime.
//!
//! ```text
//! controller <-bytes-> runtime/link <-> drivers <-> control::step   (one loop thread)
//!                                                     | events, latest snapshot
//!                          Zenoh <-> runtime/bus <----+
//! ```
//!
//! Invariants: `control` and `drivers` are pure (time is an argument, no socket, thread, lock or
//! log); a tick allocates nothing; everything that leaves `step` has passed the limiter; a stop is
//! never refused; a motion has exactly one terminal status.

pub mod config;
pub mod control;
pub mod drivers;
pub mod equipment;
pub mod moves;
pub mod recorder;
pub mod runtime;
pub mod stop_sources;
