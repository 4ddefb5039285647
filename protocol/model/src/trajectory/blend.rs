//! Straight lines in joint space with parabolic blends.
//!
//! ```text
//!            ___ waypoint k          s, e: start and end of a blend
//!          s/   \e
//! line k-1 /     \ line k            passed at |v_k - v_(k-1)| (e - s) / 8
//! ```
//!
//! Source: J. Craig, Introduction to Robotics, third edition, section 7.3, "linear function with
//! parabolic blends", equations (7.24) to (7.28). There each joint blends as long as it needs;
//! here all blend as long as the one that needs longest, so that lines stay straight.

use super::curve::Curve;
use super::error::TrajectoryError;
use super::motion_limits::MotionLimits;
use super::validate::{Knots, name};

/// Shortest blend of [`Interpolation::JointLinear`](super::Interpolation::JointLinear) \[s\], also
/// where less would do.
pub const MIN_BLEND_S: f64 = 1e-5;

/// Share of the time between two waypoints by which blends may overlap: rounding.
const ROUNDING: f64 = 1e-12;

/// The lines through the waypoints and the blends between them, from rest to rest.
pub(super) fn curve(
    knots: &Knots,
    names: &[&str],
    limits: &MotionLimits,
) -> Result<Curve, TrajectoryError> {
    let plan = Plan::new(knots, names, limits)?;
    plan.check_overlap(names)?;
    plan.check_tolerances(names)?;
    Ok(plan.into_curve())
}

struct Plan<'a> {
    knots: &'a Knots,
    joints: usize,
    /// A row of velocities for each line.
    velocities: Vec<f64>,
    /// For each waypoint.
    blends: Vec<Blend>,
}

#[derive(Clone, Copy)]
struct Blend {
    length_s: f64,
    /// The joint that needs so long.
    joint: usize,
}

impl<'a> Plan<'a> {
    fn new(
        knots: &'a Knots,
        names: &[&str],
        limits: &MotionLimits,
    ) -> Result<Self, TrajectoryError> {
        let joints = limits.len();
        let last = knots.times.len() - 1;
        let mut plan = Self {
            knots,
            joints,
            velocities: Vec::with_capacity(joints * last),
            blends: vec![Blend { length_s: MIN_BLEND_S, joint: 0 }; last + 1],
        };
        for line in 0..last {
            // Blends of an end that lie in this line as a whole: they take time without way.
            let ends = f64::from(u8::from(line == 0) + u8::from(line + 1 == last));
            let mut moving_s = plan.line_s(line);
            if ends > 0.0 {
                let blend = plan.end_blend(line, ends, limits).map_err(|(joint, needed_s)| {
                    let (joint, available_s) = (name(names, joint), moving_s);
                    TrajectoryError::BlendsOverlap { waypoint: line, joint, needed_s, available_s }
                })?;
                moving_s -= 0.5 * ends * blend.length_s;
                if line == 0 {
                    plan.blends[0] = blend;
                }
                if line + 1 == last {
                    plan.blends[last] = blend;
                }
            }
            for joint in 0..joints {
                plan.velocities.push(plan.distance(line, joint) / moving_s);
            }
        }
        for waypoint in 1..last {
            plan.blends[waypoint] = plan.inner_blend(waypoint, limits);
        }
        Ok(plan)
    }

    /// The blend between rest and the line, where `ends` of it lie in the line: the shortest `t`
    /// with `a t (T - ends t / 2)` at least the distance. If there is none: which joint needs how
    /// long a line.
    fn end_blend(
        &self,
        line: usize,
        ends: f64,
        limits: &MotionLimits,
    ) -> Result<Blend, (usize, f64)> {
        let line_s = self.line_s(line);
        let mut longest = Blend { length_s: MIN_BLEND_S, joint: 0 };
        for (joint, axis) in limits.iter().enumerate() {
            let twice = 2.0 * self.distance(line, joint).abs() / axis.acceleration;
            let discriminant = line_s * line_s - ends * twice;
            // Written so that what overflowed is refused as well.
            let possible = discriminant >= -ROUNDING * line_s * line_s;
            if !possible {
                return Err((joint, (ends * twice).sqrt()));
            }
            let length_s = twice / (line_s + discriminant.max(0.0).sqrt());
            if length_s > longest.length_s {
                longest = Blend { length_s, joint };
            }
        }
        Ok(longest)
    }

    fn inner_blend(&self, waypoint: usize, limits: &MotionLimits) -> Blend {
        let mut longest = Blend { length_s: MIN_BLEND_S, joint: 0 };
        for (joint, axis) in limits.iter().enumerate() {
            let length_s = self.change(waypoint, joint).abs() / axis.acceleration;
            if length_s > longest.length_s {
                longest = Blend { length_s, joint };
            }
        }
        longest
    }

    fn check_overlap(&self, names: &[&str]) -> Result<(), TrajectoryError> {
        for line in 0..self.blends.len() - 1 {
            let (from, to) = (self.part(line), self.part(line + 1));
            let (needed_s, available_s) = (from + to, self.line_s(line));
            if needed_s > available_s * (1.0 + ROUNDING) {
                let joint = self.blends[if from > to { line } else { line + 1 }].joint;
                let joint = name(names, joint);
                return Err(TrajectoryError::BlendsOverlap {
                    waypoint: line,
                    joint,
                    needed_s,
                    available_s,
                });
            }
        }
        Ok(())
    }

    fn check_tolerances(&self, names: &[&str]) -> Result<(), TrajectoryError> {
        for waypoint in 1..self.blends.len() - 1 {
            let tolerance = self.knots.tolerances.at(waypoint).position;
            for (joint, &available) in tolerance.iter().enumerate() {
                let length_s = self.blends[waypoint].length_s;
                let needed = self.change(waypoint, joint).abs() * length_s / 8.0;
                if needed > available {
                    let joint = name(names, joint);
                    return Err(TrajectoryError::BlendTolerance {
                        waypoint,
                        joint,
                        needed,
                        available,
                    });
                }
            }
        }
        Ok(())
    }

    fn into_curve(self) -> Curve {
        let last = self.blends.len() - 1;
        let duration_s = self.knots.times[last];
        let mut curve = Curve::with_capacity(self.joints, 3 * last);
        let speed_up_s = self.blends[0].length_s;
        curve.push(0.0, 0, |joint| {
            let velocity = self.velocity(0, joint);
            [self.position(0, joint), 0.0, 0.5 * velocity / speed_up_s, 0.0]
        });
        let mut ended_s = speed_up_s;
        for waypoint in 1..last {
            let start_s = self.push_line(&mut curve, waypoint, ended_s);
            ended_s = self.push_blend(&mut curve, waypoint, start_s);
        }
        let start_s = self.push_line(&mut curve, last, ended_s);
        let brake_s = duration_s - start_s;
        curve.push(start_s, last - 1, |joint| {
            let (end, velocity) = (self.position(last, joint), self.velocity(last - 1, joint));
            [end - 0.5 * velocity * brake_s, velocity, -0.5 * velocity / brake_s, 0.0]
        });
        curve.finish(duration_s)
    }

    /// Adds the line that ends at `waypoint`, from `start_s` on; returns when its blend starts.
    fn push_line(&self, curve: &mut Curve, waypoint: usize, start_s: f64) -> f64 {
        let line = waypoint - 1;
        let since_s = start_s - self.knots.times[line];
        // The first line starts where the blend from rest ends.
        let share = if line == 0 { 0.5 } else { 1.0 };
        let end_s = self.knots.times[waypoint] - self.part(waypoint);
        if end_s <= start_s {
            return start_s;
        }
        curve.push(start_s, line, |joint| {
            let velocity = self.velocity(line, joint);
            [self.position(line, joint) + share * velocity * since_s, velocity, 0.0, 0.0]
        });
        end_s
    }

    /// Adds both halves of the blend at an inner waypoint; returns when it ends.
    fn push_blend(&self, curve: &mut Curve, waypoint: usize, start_s: f64) -> f64 {
        let time_s = self.knots.times[waypoint];
        let end_s = time_s + self.part(waypoint);
        let before_s = time_s - start_s;
        let motion = |joint| {
            let acceleration = self.change(waypoint, joint) / (end_s - start_s);
            (self.position(waypoint, joint), self.velocity(waypoint - 1, joint), acceleration)
        };
        curve.push(start_s, waypoint - 1, |joint| {
            let (position, velocity, acceleration) = motion(joint);
            [position - velocity * before_s, velocity, 0.5 * acceleration, 0.0]
        });
        curve.push(time_s, waypoint, |joint| {
            let (position, velocity, acceleration) = motion(joint);
            let half = 0.5 * acceleration;
            [position + half * before_s * before_s, velocity + acceleration * before_s, half, 0.0]
        });
        end_s
    }

    /// How much of a waypoint's blend lies on either side \[s\]: half of it, all at an end.
    fn part(&self, waypoint: usize) -> f64 {
        let length_s = self.blends[waypoint].length_s;
        let is_end = waypoint == 0 || waypoint + 1 == self.blends.len();
        if is_end { length_s } else { 0.5 * length_s }
    }

    fn line_s(&self, line: usize) -> f64 {
        self.knots.times[line + 1] - self.knots.times[line]
    }

    fn position(&self, waypoint: usize, joint: usize) -> f64 {
        self.knots.positions[waypoint * self.joints + joint]
    }

    fn distance(&self, line: usize, joint: usize) -> f64 {
        self.position(line + 1, joint) - self.position(line, joint)
    }

    fn velocity(&self, line: usize, joint: usize) -> f64 {
        self.velocities[line * self.joints + joint]
    }

    /// Change of velocity at an inner waypoint.
    fn change(&self, waypoint: usize, joint: usize) -> f64 {
        self.velocity(waypoint, joint) - self.velocity(waypoint - 1, joint)
    }
}
