//! Limits of the tool's speed, as a joint among the others.

use super::options::CartesianOptions;
use crate::{AxisLimits, Chain, GeometricPath, JointPath, JointVector, PathRows, Twist};

/// Places and weights of the Gauss–Legendre rule of three points on 0 to 1.
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// A joint path with one coordinate more: one that moves as fast as the tool, in shares of the
/// tool's limits. A limit of one on its velocity then holds the tool within its own.
pub(super) struct SpeedLimited<'a> {
    joints: &'a JointPath,
    chain: &'a Chain,
    options: &'a CartesianOptions,
    /// That coordinate at each knot of the joint path.
    knots: Vec<f64>,
}

/// Limits of that coordinate: its velocity alone. It comes to its acceleration, which it never has,
/// in the time that the quickest of the joints takes, for that sets how closely motions are looked
/// at.
pub(super) fn speed_share(joints: &[AxisLimits]) -> AxisLimits {
    const ACCELERATION: f64 = 1e12;
    let times_s = joints.iter().map(|axis| axis.acceleration / axis.jerk);
    AxisLimits {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        velocity: 1.0,
        acceleration: ACCELERATION,
        jerk: ACCELERATION / times_s.fold(f64::INFINITY, f64::min),
    }
}

impl<'a> SpeedLimited<'a> {
    pub(super) fn new(
        joints: &'a JointPath,
        chain: &'a Chain,
        options: &'a CartesianOptions,
    ) -> Self {
        let mut path = Self { joints, chain, options, knots: vec![0.0] };
        let mut sum = 0.0;
        for ends in joints.parameters().windows(2) {
            sum += path.integral(ends[0], ends[1]);
            path.knots.push(sum);
        }
        path
    }

    fn integral(&self, from: f64, to: f64) -> f64 {
        let share = |(place, weight)| weight * self.share(from + place * (to - from));
        GAUSS.into_iter().map(share).sum::<f64>() * (to - from)
    }

    /// Speed of the tool for `ds/dt` = 1, in shares of its limits.
    fn share(&self, s: f64) -> f64 {
        let zeros = JointVector::zeros(self.joints.coordinates()).unwrap_or_default();
        let (mut position, mut first, mut second) = (zeros, zeros, zeros);
        let mut rows = PathRows { position: &mut position, first: &mut first, second: &mut second };
        self.joints.evaluate(s, &mut rows);
        self.share_of(&rows)
    }

    fn share_of(&self, rows: &PathRows<'_>) -> f64 {
        if self.options.max_linear_speed.min(self.options.max_angular_speed) == f64::INFINITY {
            return 0.0;
        }
        // Positions that are not finite are refused by who asks, and told as such.
        let jacobian = self.chain.forward_and_jacobian(rows.position);
        let twist = jacobian.map_or(Twist::ZERO, |(_, jacobian)| jacobian.twist(rows.first));
        let linear = twist.linear.norm() / self.options.max_linear_speed;
        linear.max(twist.angular.norm() / self.options.max_angular_speed)
    }
}

impl GeometricPath for SpeedLimited<'_> {
    fn coordinates(&self) -> usize {
        self.joints.coordinates() + 1
    }

    fn range(&self) -> (f64, f64) {
        self.joints.range()
    }

    fn evaluate(&self, s: f64, out: &mut PathRows<'_>) {
        let (Some((place, position)), Some((rate, first)), Some((bend, second))) = (
            out.position.split_last_mut(),
            out.first.split_last_mut(),
            out.second.split_last_mut(),
        ) else {
            return;
        };
        let mut rows = PathRows { position, first, second };
        self.joints.evaluate(s, &mut rows);
        *rate = self.share_of(&rows);
        let parameters = self.joints.parameters();
        let knot = parameters.partition_point(|&knot| knot <= s).saturating_sub(1);
        if let (Some(&from), Some(sum)) = (parameters.get(knot), self.knots.get(knot)) {
            *place = sum + self.integral(from, s);
        }
        // Only matters to acceleration, which has no limit here.
        *bend = 0.0;
    }

    fn add_breakpoints(&self, out: &mut Vec<f64>) {
        self.joints.add_breakpoints(out);
    }

    fn third_derivative(&self, s: f64, out: &mut [f64]) {
        if let Some((last, joints)) = out.split_last_mut() {
            *last = 0.0;
            self.joints.third_derivative(s, joints);
        }
    }
}
