//! Point-to-point moves as curves.

use super::curve::{CurveBounds, CurvePoint, TimedCurve};
use crate::{JerkLimitedMove, JointMove};

impl TimedCurve for JerkLimitedMove {
    fn joint_count(&self) -> usize {
        self.axes().len()
    }

    /// When all joints are at rest.
    fn duration_s(&self) -> f64 {
        self.rest_s()
    }

    /// It does.
    fn limits_jerk(&self) -> bool {
        true
    }

    fn point(&self, phase_s: f64, _hint: &mut usize) -> CurvePoint {
        let state = self.at(phase_s);
        CurvePoint { position: state.position, first: state.velocity, second: state.acceleration }
    }

    fn bounds(&self, from_s: f64, to_s: f64, _hint: &mut usize, bounds: &mut CurveBounds) {
        *bounds = CurveBounds::EMPTY;
        for (joint, axis) in self.axes().iter().enumerate() {
            axis.pieces(from_s.max(0.0), to_s, |derivatives, length_s| {
                bounds.include_cubic(joint, derivatives, length_s);
            });
        }
    }
}

impl TimedCurve for JointMove {
    fn joint_count(&self) -> usize {
        self.axes().len()
    }

    fn duration_s(&self) -> f64 {
        Self::duration_s(self)
    }

    /// Not: acceleration jumps between its phases.
    fn limits_jerk(&self) -> bool {
        false
    }

    fn point(&self, phase_s: f64, _hint: &mut usize) -> CurvePoint {
        let state = self.at(phase_s);
        let second = state.velocity.map_indexed(|joint, _| {
            let phases = self.axes()[joint].phases();
            let now = phases.iter().find(|&&(from, to, _)| (from..to).contains(&phase_s));
            now.map_or(0.0, |phase| phase.2)
        });
        CurvePoint { position: state.position, first: state.velocity, second }
    }

    fn bounds(&self, from_s: f64, to_s: f64, _hint: &mut usize, bounds: &mut CurveBounds) {
        *bounds = CurveBounds::EMPTY;
        for (joint, axis) in self.axes().iter().enumerate() {
            for (begin_s, end_s, second) in axis.phases() {
                if begin_s <= to_s && end_s >= from_s {
                    let at_s = from_s.max(begin_s);
                    let first = axis.at(at_s).velocity;
                    bounds.include_cubic(joint, [first, second, 0.0], to_s.min(end_s) - at_s);
                }
            }
            if to_s >= axis.duration_s() {
                bounds.include_cubic(joint, [0.0; 3], 0.0);
            }
        }
    }
}
