//! An emulated controller: a robot for tests, demonstrations and rehearsal.
//!
//! ```text
//! SimDriver  --hello, command, request-->  SimEmulator -> Controller -> joints
//!            <--status, refused----------             <-             <-
//! ```
//!
//! The two sides speak the datagrams of [`wire`] and share nothing else, so the driver crosses the
//! same sockets as one of a real controller. Faults are injected into the emulator with packets
//! that only it takes ([`encode_inject`]).

mod axis;
mod board;
mod config;
mod controller;
mod driver;
mod dynamics;
mod emulator;
pub mod error_code;
mod fault;
mod homing;
mod noise;
mod planner;
mod program;
mod safety;
mod settings;
#[cfg(test)]
mod tests;
pub mod wire;

pub use config::{Config, EmulatorConfig, GuardStop, ReportsTip};
pub use driver::SimDriver;
pub use emulator::SimEmulator;
pub use fault::{Fault, FaultParseError};
pub use settings::{HomingConfig, ParameterConfig, SignalConfig};
pub use wire::{decode_inject_answer, encode_inject};
