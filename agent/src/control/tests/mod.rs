//! Tests of the whole step, on an invented clock and a simulated plant.

mod controller;
mod delegated;
mod equipment;
mod faults;
mod home;
mod jog;
mod jog_joint;
mod limiter;
mod modes;
mod own_moves;
mod properties;
mod rig;
mod stop;
mod trajectory;
