//! The coordinator against a small model of agents, on an invented clock.

mod agent;
mod bench;
mod denials;
mod groups;
mod presence;
mod random;
mod stops;
