//! Tests of the whole step, on an invented clock and a simulated plant.

mod authority;
mod authority_model;
mod authority_shared;
mod controller;
mod delegated;
mod equipment;
mod faults;
mod flags;
mod home;
mod invariants;
mod jog;
mod jog_cartesian;
mod jog_joint;
mod limiter;
mod mode_model;
mod modes;
mod own_moves;
mod pause;
mod plant;
mod properties;
mod queue;
mod rig;
mod stop;
mod stream;
mod stream_tracking;
mod trajectory;
