//! All joints in proportion: one profile for the joint that moves most, scaled for the others.

use arrayvec::ArrayVec;

use super::axis::{AxisMotion, AxisPoint};
use super::generator::{AxisRequest, OnlineGenerator};
use super::jerk_limited::common_duration;
use super::request::OnlineState;
use crate::{AxisLimits, MAX_JOINTS, MotionLimits};

/// How far from proportional start and target may be, of the largest value of their kind.
const PROPORTION_TOLERANCE: f64 = 1e-12;

/// A straight line in joint space, along which start and target move too.
pub(super) struct Line {
    /// Start of each joint, and its share of the motion of the leading joint.
    joints: ArrayVec<(f64, f64), MAX_JOINTS>,
    /// The leading joint: its own start and target, limits that keep those of all joints.
    request: AxisRequest,
}

impl Line {
    /// The line from `state` to `target`; `None` if they are not in proportion.
    pub(super) fn through(
        state: &OnlineState,
        target: &OnlineState,
        limits: &MotionLimits,
    ) -> Option<Self> {
        // Distance, both velocities and both accelerations of a joint.
        let row = |joint: usize| {
            let (from, to) = (state.axis(joint), target.axis(joint));
            let distance = to.position - from.position;
            [distance, from.velocity, to.velocity, from.acceleration, to.acceleration]
        };
        // The first kind of which there is any decides who leads.
        let (kind, lead) = (0..5).find_map(|kind| {
            let size = |joint: &usize| row(*joint)[kind].abs();
            let lead = (0..limits.len()).max_by(|a, b| size(a).total_cmp(&size(b)))?;
            (size(&lead) > 0.0).then_some((kind, lead))
        })?;
        let leading = row(lead);
        let mut joints = ArrayVec::new();
        let mut least =
            AxisLimits { lower: f64::NEG_INFINITY, upper: f64::INFINITY, ..limits[lead] };
        for (joint, axis) in limits.iter().enumerate() {
            let share = row(joint)[kind] / leading[kind];
            for (value, leading) in row(joint).into_iter().zip(leading) {
                let in_proportion =
                    (value - share * leading).abs() <= PROPORTION_TOLERANCE * leading.abs();
                if !in_proportion {
                    return None;
                }
            }
            least.velocity = least.velocity.min(axis.velocity / share.abs());
            least.acceleration = least.acceleration.min(axis.acceleration / share.abs());
            least.jerk = least.jerk.min(axis.jerk / share.abs());
            joints.push((state.axis(joint).position, share));
        }
        let request = AxisRequest { from: state.axis(lead), to: target.axis(lead), limits: least };
        Some(Self { joints, request })
    }

    /// Makes `axes` the motions of all joints; `None` if the generator finds none, or only one that is not legal
    /// for the line although it may be for each joint.
    pub(super) fn plan(
        &self,
        generator: &mut impl OnlineGenerator,
        least_s: f64,
        axes: &mut ArrayVec<AxisMotion, MAX_JOINTS>,
    ) -> Option<()> {
        let durations = generator.durations(0, &self.request)?;
        let leading = generator.motion(0, common_duration(&[durations], least_s)?)?;
        let AxisPoint { position: origin, .. } = self.request.from;
        axes.clear();
        for &(start, share) in &self.joints {
            axes.push(leading.scaled(origin, start, share));
        }
        Some(())
    }
}
