//! The coordinator against a small model of agents, on an invented clock.

mod agent;
mod bench;
mod controls;
mod denials;
mod events;
mod groups;
mod leases;
mod partners;
mod presence;
mod random;
mod stops;
