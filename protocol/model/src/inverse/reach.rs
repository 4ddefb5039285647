//! How far a chain can reach.

use super::bounds::Bounds;
use super::target::{Residual, Task};
use crate::Chain;
use crate::kinematics::Extent;

/// How far the TCP can be from the base at most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach(Extent);

impl Reach {
    pub(super) fn new(chain: &Chain, bounds: &Bounds) -> Self {
        Self(chain.extent(|variable| bounds.farthest(variable)))
    }

    /// A length \[m\] that compares to a radian: half of the reach, tool and all.
    pub(super) fn length(&self) -> f64 {
        let reach = self.0.longest + self.0.tool.norm();
        if reach.is_finite() && reach > 0.0 { 0.5 * reach } else { 1.0 }
    }

    /// By how much at least the target is out of reach \[m\]; `None` if it may be reached within
    /// `tolerance`.
    pub(super) fn excess(&self, task: &Task, tolerance: &Residual) -> Option<f64> {
        let Extent { base, tool, longest } = &self.0;
        let position = task.position()?;
        let excess = match task.orientation() {
            // The orientation says where the tool's point on the last axis must be.
            Some(orientation) => (position + orientation * tool - base).norm() - longest,
            None => (position - base).norm() - longest - tool.norm(),
        };
        (excess > tolerance.position + tolerance.orientation * tool.norm()).then_some(excess)
    }
}
