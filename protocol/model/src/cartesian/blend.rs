//! Corners rounded off: from one segment to the next without a kink.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::rotation::angular_velocity;
use super::segment::{PointMotion, Segment};

/// Points on either side of the corner where its deviation is first looked for.
const DEVIATION_SAMPLES: u32 = 32;
/// Golden-section steps to refine it: to 1e-6 of the distance between two of those points.
const DEVIATION_STEPS: u32 = 30;

/// A vector as polynomial of fifth degree in `x = u / span`, which has given values, velocities and
/// accelerations at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Quintic {
    span: f64,
    coefficients: [Vector3<f64>; 6],
}

/// The way round a corner from `radius` before it to `radius` after it.
///
/// Position is a quintic. Orientation is the corner's, times the exponential of a rotation vector
/// that is a quintic: seen from the corner both segments are straight lines of such vectors. Value,
/// velocity and acceleration are those of the segments at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blend {
    pub(super) radius: f64,
    position: Quintic,
    corner: UnitQuaternion<f64>,
    rotation: Quintic,
}

/// How far a blend is from its corner's two segments at most, at equal parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Deviation {
    /// \[m\]
    pub(super) position: f64,
    /// \[rad\]
    pub(super) angle: f64,
}

impl Blend {
    pub(super) fn new(before: &Segment, after: &Segment, radius: f64) -> Self {
        let ends = [before.point(before.length - radius), after.point(radius)];
        let rotations = [(before.turn(), -radius), (after.turn(), radius)].map(|(turn, u)| {
            PointMotion { position: turn * u, first: *turn, second: Vector3::zeros() }
        });
        Self {
            radius,
            position: Quintic::new(2.0 * radius, ends),
            corner: after.rotation(0.0),
            rotation: Quintic::new(2.0 * radius, rotations),
        }
    }

    pub(super) fn pose(&self, u: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(self.rotation.value(u));
        Isometry3::from_parts(self.position.value(u).into(), self.corner * turn)
    }

    pub(super) fn point(&self, u: f64) -> PointMotion {
        self.position.motion(u)
    }

    /// Angular velocity in the path's frame.
    pub(super) fn angular(&self, u: f64) -> Vector3<f64> {
        let rotation = self.rotation.motion(u);
        self.corner * angular_velocity(&rotation.position, &rotation.first)
    }

    /// The deviation from the segments that it was made of.
    pub(super) fn deviation(&self, before: &Segment, after: &Segment) -> Deviation {
        let ideal = |u: f64| {
            if u < self.radius {
                let s = before.length - self.radius + u;
                (before.position(s), before.rotation(s))
            } else {
                (after.position(u - self.radius), after.rotation(u - self.radius))
            }
        };
        let position = |u: f64| (self.position.value(u) - ideal(u).0).norm();
        let angle = |u: f64| self.pose(u).rotation.angle_to(&ideal(u).1);
        Deviation {
            position: maximum(position, 2.0 * self.radius),
            angle: maximum(angle, 2.0 * self.radius),
        }
    }
}

impl Quintic {
    fn new(span: f64, [from, to]: [PointMotion; 2]) -> Self {
        let shift = to.position - from.position;
        let (v0, v1) = (from.first * span, to.first * span);
        let half = 0.5 * span * span;
        let (a0, a1) = (from.second * half, to.second * half);
        Self {
            span,
            coefficients: [
                from.position,
                v0,
                a0,
                shift * 10.0 - v0 * 6.0 - v1 * 4.0 - a0 * 3.0 + a1,
                shift * -15.0 + v0 * 8.0 + v1 * 7.0 + a0 * 3.0 - a1 * 2.0,
                (shift * 2.0 - v0 - v1) * 3.0 - a0 + a1,
            ],
        }
    }

    fn value(&self, u: f64) -> Vector3<f64> {
        let [c0, c1, c2, c3, c4, c5] = &self.coefficients;
        let x = u / self.span;
        c0 + (c1 + (c2 + (c3 + (c4 + c5 * x) * x) * x) * x) * x
    }

    fn motion(&self, u: f64) -> PointMotion {
        let [_, c1, c2, c3, c4, c5] = &self.coefficients;
        let x = u / self.span;
        let first = c1 + (c2 * 2.0 + (c3 * 3.0 + (c4 * 4.0 + c5 * (5.0 * x)) * x) * x) * x;
        let second = c2 * 2.0 + (c3 * 6.0 + (c4 * 12.0 + c5 * (20.0 * x)) * x) * x;
        PointMotion {
            position: self.value(u),
            first: first / self.span,
            second: second / (self.span * self.span),
        }
    }
}

/// The highest value of `f` on `0..=span`, which has a kink in the middle.
fn maximum(f: impl Fn(f64) -> f64, span: f64) -> f64 {
    let step = 0.5 * span / f64::from(DEVIATION_SAMPLES);
    let (mut best, mut at) = (0.0, 0.0);
    for sample in 0..=2 * DEVIATION_SAMPLES {
        let u = step * f64::from(sample);
        let value = f(u);
        if value > best {
            (best, at) = (value, u);
        }
    }
    let (mut low, mut high) = ((at - step).max(0.0), (at + step).min(span));
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..DEVIATION_STEPS {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        let (value_a, value_b) = (f(a), f(b));
        best = value_a.max(value_b).max(best);
        if value_a > value_b {
            high = b;
        } else {
            low = a;
        }
    }
    best
}
