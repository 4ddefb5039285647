//! How near robots come to each other on a motion of several.
//!
//! ```text
//! trajectories, mounts, shapes --World::clearance--> ClearanceProblem --solve--> ClearanceReport
//! ```
//! Every two robots are looked at by themselves, each with what carries it. Robots on one timeline
//! are not always at the same phase of it: one may be ahead of another by the time after which a
//! loss is noticed, and by the way it takes to stop. So a pair is clear only if it is for every
//! phase of the one and every phase of the other that is at most `offset_s` away. A robot that
//! takes no part stands where it was measured last; if it moves meanwhile, nothing is said of it.
//!
//! What a report without refusal guarantees: at every such combination of phases all pairs of
//! shapes of different robots keep `required_m`, but for shapes that at most one moving joint
//! connects. `prove` says how. What has no shape is named, never taken for clear.

mod problem;
mod prove;
mod scene;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use armada_model::JointTrajectory;
use armada_protocol::RobotName;
use armada_protocol::messages::{ClearanceAnswer, Denial};

pub use problem::ClearanceProblem;

/// A motion of several robots whose clearances are to be checked.
#[derive(Clone, Debug, PartialEq)]
pub struct ClearanceRequest {
    /// The trajectory of each robot that takes part.
    pub parts: BTreeMap<RobotName, JointTrajectory>,
    /// Robots whose trajectories are interpolated within their limits at reduced speed.
    pub reduced: BTreeSet<RobotName>,
    /// How far the phases of two robots may be apart \[s\].
    pub offset_s: f64,
    /// The least distance \[m\], above zero.
    pub required_m: f64,
}

/// How near the robots come.
#[derive(Clone, Debug, PartialEq)]
pub struct ClearanceReport {
    /// What was found.
    pub answer: ClearanceAnswer,
    /// Why the motion must not begin; `None` if everything that has a shape keeps the distance.
    pub refusal: Option<Denial>,
    /// Configurations that were looked at.
    pub states: usize,
}
