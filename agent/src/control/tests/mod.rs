//! Tests of the whole step, on an invented clock and a simulated plant.

mod controller;
mod faults;
mod jog;
mod limiter;
mod modes;
mod pause;
mod properties;
mod queue;
mod rig;
mod stop;
mod trajectory;
