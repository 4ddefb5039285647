//! Inverse kinematics in closed form: all postures in which an arm reaches a pose.

#![allow(dead_code, unreachable_pub, reason = "used by the commits that follow")]

mod branch;
mod chain;
mod error;
mod fit;
mod parts;
mod subproblem;

use subproblem::wrapped;
