//! How far a chain can reach.

use nalgebra::Vector3;

use super::bounds::Bounds;
use super::target::Task;
use crate::Chain;

/// Distances that bound how far the origin of the last joint's frame is from that of the first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// Origin of the first joint's frame in the base.
    first: Vector3<f64>,
    /// Longest distance from there to the origin of the last joint's frame \[m\]; infinite if a
    /// joint that slides has no limits.
    longest: f64,
    /// Origin of the TCP in the last joint's frame, seen from the TCP: fixed in the TCP's axes.
    tool: Vector3<f64>,
}

impl Reach {
    pub(super) fn new(chain: &Chain, bounds: &Bounds) -> Self {
        let (first, longest, tool) = chain.extent(|variable| bounds.farthest(variable));
        Self { first, longest, tool }
    }

    /// A length \[m\] that compares to a radian: half of the reach, tool and all.
    pub(super) fn length(&self) -> f64 {
        let reach = self.longest + self.tool.norm();
        if reach.is_finite() && reach > 0.0 { 0.5 * reach } else { 1.0 }
    }

    /// By how much at least the target is out of reach \[m\]; `None` if it may be reached.
    pub(super) fn excess(&self, task: &Task) -> Option<f64> {
        let position = task.position()?;
        let excess = match task.orientation() {
            // The tool's orientation says where the last joint must be.
            Some(orientation) => {
                (position - orientation * self.tool - self.first).norm() - self.longest
            }
            None => (position - self.first).norm() - self.longest - self.tool.norm(),
        };
        (excess > 0.0).then_some(excess)
    }
}
