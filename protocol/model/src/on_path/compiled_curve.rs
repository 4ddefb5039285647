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

    /// Not: acceleration may jump at a waypoint.
    fn limits_jerk(&self) -> bool {
        false
    }

    fn point(&self, phase_s: f64, hint: &mut usize) -> CurvePoint {
        let sample = self.sample(phase_s, hint);
        let zero = sample.position.map_indexed(|_, _| 0.0);
        let mut point =
            CurvePoint { position: sample.position, first: sample.velocity, second: zero };
        if (0.0..self.duration_s()).contains(&phase_s) {
            let (start_s, _, rows) = self.segment(*hint);
            let (u, joints) = (phase_s - start_s, Self::joint_count(self));
            for (joint, second) in point.second.iter_mut().enumerate() {
                *second = 2.0 * rows[2 * joints + joint] + 6.0 * u * rows[3 * joints + joint];
            }
        }
        point
    }

    fn bounds(&self, from_s: f64, to_s: f64, hint: &mut usize, bounds: &mut CurveBounds) {
        *bounds = CurveBounds::EMPTY;
        let joints = Self::joint_count(self);
        let from_s = from_s.clamp(0.0, self.duration_s());
        let mut index = self.segment_at(from_s, *hint).min(self.waypoint_count() - 2);
        *hint = index;
        loop {
            let (start_s, end_s, rows) = self.segment(index);
            let begin = (from_s - start_s).max(0.0);
            let length = to_s.min(end_s) - start_s - begin;
            let (c1, c2, c3) =
                (&rows[joints..2 * joints], &rows[2 * joints..3 * joints], &rows[3 * joints..]);
            for joint in 0..joints {
                let third = 6.0 * c3[joint];
                let second = 2.0 * c2[joint] + begin * third;
                let first = c1[joint] + 0.5 * begin * (2.0 * c2[joint] + second);
                bounds.include_cubic(joint, [first, second, third], length);
            }
            index += 1;
            if end_s > to_s || index > self.waypoint_count() - 2 {
                break;
            }
        }
        // At rest after the end.
        for joint in (0..joints).filter(|_| to_s >= self.duration_s()) {
            bounds.include_cubic(joint, [0.0; 3], 0.0);
        }
    }
}
