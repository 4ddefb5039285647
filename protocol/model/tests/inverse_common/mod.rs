//! Chains, postures and errors for tests of inverse kinematics.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
#![allow(dead_code, reason = "each test binary uses a part of this module")]

use armada_model::{Chain, InverseKinematics, InverseOptions, InverseTarget, Residual};

use crate::common;

/// Even pseudo-random numbers from 0 to 1, by Knuth's linear congruence.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn unit(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / 9_007_199_254_740_992.0
    }
}

pub(crate) fn own(file: &str) -> Chain {
    Chain::from_root(&common::own_robot(file), "tool0").expect("a chain")
}

/// A chain of a shared robot, `None` where those are absent.
pub(crate) fn shared(urdf: &str, base: &str, tip: &str) -> Option<Chain> {
    let model = common::load(&common::shared("robots")?.join(urdf));
    Some(Chain::new(&model, base, tip).expect("a chain"))
}

/// A little more precise than the tests ask for, so that rounding does not matter.
pub(crate) fn options() -> InverseOptions {
    InverseOptions {
        position_tolerance: 0.999e-5,
        orientation_tolerance: 0.999e-5,
        ..InverseOptions::default()
    }
}

pub(crate) fn solver(chain: &Chain) -> InverseKinematics {
    InverseKinematics::new(chain, options())
}

/// A random posture within limits, and within half a turn from zero.
pub(crate) fn posture(chain: &Chain, random: &mut Random) -> Vec<f64> {
    let pi = std::f64::consts::PI;
    let variables = chain.variables().iter();
    variables
        .map(|variable| {
            let lower = variable.limits.lower.unwrap_or(-pi).max(-pi);
            let upper = variable.limits.upper.unwrap_or(pi).min(pi);
            lower + (upper - lower) * random.unit()
        })
        .collect()
}

/// How far `positions` leave the TCP from `target`, calculated apart from the solver.
pub(crate) fn off(chain: &Chain, positions: &[f64], target: &InverseTarget) -> Residual {
    let reached = chain.forward(positions).expect("positions fit");
    let from = |position: &nalgebra::Vector3<f64>| (reached.translation.vector - position).norm();
    match target {
        InverseTarget::Pose(pose) => Residual {
            position: from(&pose.translation.vector),
            orientation: reached.rotation.angle_to(&pose.rotation),
        },
        InverseTarget::Position(position) => {
            Residual { position: from(position), orientation: 0.0 }
        }
        InverseTarget::Orientation(orientation) => {
            Residual { position: 0.0, orientation: reached.rotation.angle_to(orientation) }
        }
        InverseTarget::Axis { position, tool_axis, direction } => Residual {
            position: from(position),
            orientation: (reached.rotation * tool_axis.into_inner()).angle(direction),
        },
    }
}
