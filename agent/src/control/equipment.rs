//! The chains of the robot with what they carry.

use armada_model::{Chain, Pose};

/// Most chains of a robot that tools can be moved by.
pub const MAX_CHAINS: usize = 4;

/// The chains of a robot with their tools, made outside the loop and never changed.
#[derive(Clone, Debug, Default)]
pub struct Equipment {
    /// Revision: raised by each change of a tool or payload.
    pub config_seqno: u64,
    /// The chains in the order of the robot file, at most [`MAX_CHAINS`].
    pub chains: Vec<EquippedChain>,
}

/// A chain with its tool.
#[derive(Clone, Debug)]
pub struct EquippedChain {
    /// From its base link to its flange.
    pub chain: Chain,
    /// Tool centre point in the flange.
    pub tcp: Pose,
    /// Pose of the chain's base link in the world at the robot's zero position.
    pub base_in_world: Pose,
    /// For each variable of the chain, the joint of the robot that drives it.
    pub joints: Vec<usize>,
}
