//! A compiled trajectory as a curve.

use super::curve::{CurveBounds, CurvePoint, TimedCurve};
use crate::CompiledTrajectory;

impl TimedCurve for CompiledTrajectory {
    fn joint_count(&self) -> usize {
        Self::joint_count(self)
    }

    fn duration_s(&self) -> f64 {
        Self::duration_s(self)
    }

    /// Only if it was compiled so; otherwise acceleration may jump at a waypoint.
    fn limits_jerk(&self) -> bool {
        Self::limits_jerk(self)
    }

    fn point(&self, phase_s: f64, hint: &mut usize) -> CurvePoint {
        let state = self.state_at(phase_s, hint);
        CurvePoint { position: state.position, first: state.velocity, second: state.acceleration }
    }

    fn bounds(&self, from_s: f64, to_s: f64, hint: &mut usize, bounds: &mut CurveBounds) {
        *bounds = CurveBounds::EMPTY;
        let joints = Self::joint_count(self);
        let from_s = from_s.clamp(0.0, self.duration_s());
        let mut index = self.segment_index(from_s, hint);
        loop {
            let (start_s, length_s) = self.segment_span(index);
            let begin = (from_s - start_s).max(0.0);
            let length = (to_s - start_s).min(length_s) - begin;
            for joint in 0..joints {
                match self.derivatives(index, begin, joint) {
                    [first, second, third, 0.0, 0.0] => {
                        bounds.include_cubic(joint, [first, second, third], length);
                    }
                    derivatives => bounds.include_quintic(joint, derivatives, length),
                }
            }
            index += 1;
            if start_s + length_s > to_s || index >= self.segment_count() {
                break;
            }
        }
        // At rest after the end.
        for joint in (0..joints).filter(|_| to_s >= self.duration_s()) {
            bounds.include_cubic(joint, [0.0; 3], 0.0);
        }
    }
}
