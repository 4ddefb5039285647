//! Tests of the whole step, on an invented clock and a simulated plant.

mod controller;
mod faults;
mod home;
mod jog;
mod jog_joint;
mod limiter;
mod modes;
mod properties;
mod rig;
mod stop;
mod trajectory;
