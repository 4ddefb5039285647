//! Timed paths as waypoints that any agent accepts.

use super::geometric::{GeometricPath, PathRows};
use super::timed::TimedPath;
use crate::{
    AxisLimits, Interpolation, JointTrajectory, LIMIT_TOLERANCE, MIN_WAYPOINT_SPACING_S,
    REST_TOLERANCE, TrajectoryOptions, Waypoint,
};

/// A segment is split if its cubic uses more than this beyond what the motion itself does.
const SPLIT_ABOVE: f64 = 1e-3;

/// Shortest segment that is split, and the least that is left on either side \[s\].
const SHORTEST_SPLIT_S: f64 = 1e-3;
const SHORTEST_PART_S: f64 = 2.0 * MIN_WAYPOINT_SPACING_S;

/// A segment is split if its cubic is this far off the path in its middle \[rad or m\].
const MAX_DEVIATION: f64 = 1e-4;

/// By how much more than needed a motion is slowed down, against rounding.
const MARGIN: f64 = 1e-9;

/// A timed path as waypoints.
#[derive(Clone, Debug, PartialEq)]
pub struct PathTrajectory {
    /// Waypoints with times, positions and velocities, from rest to rest.
    pub trajectory: JointTrajectory,
    /// Factor by which it takes longer than the timed path, so that the cubics between waypoints
    /// keep all limits; 1 if they do anyway.
    pub stretch: f64,
}

/// Why there are no waypoints of a timed path.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PathTrajectoryError {
    /// There is not one name per coordinate.
    #[error("{names} joint names, but the path has {coordinates} coordinates")]
    NameCount {
        /// Number of names.
        names: usize,
        /// Number of coordinates of the path.
        coordinates: usize,
    },
    /// The spacing of waypoints is too small or not a number.
    #[error("spacing is {spacing_s} s, expected at least {MIN_WAYPOINT_SPACING_S} s")]
    Spacing {
        /// The spacing \[s\].
        spacing_s: f64,
    },
    /// There would be more waypoints than a trajectory may have.
    #[error("spacing {spacing_s} s makes more than the {limit} waypoints a trajectory may have")]
    TooManyWaypoints {
        /// The spacing \[s\].
        spacing_s: f64,
        /// Highest number allowed.
        limit: usize,
    },
    /// The motion does not start or does not end at rest.
    #[error(
        "joint {joint} moves at {velocity} at {time_s} s, but a trajectory starts and ends at rest"
    )]
    NotAtRest {
        /// Index of the joint.
        joint: usize,
        /// Time: zero or the duration \[s\].
        time_s: f64,
        /// Its velocity \[rad/s or m/s\].
        velocity: f64,
    },
    /// The motion is not one that polynomials limited in jerk can follow.
    #[error(
        "the motion would have to be {stretch} times as long to keep limits of jerk between its \
         waypoints; retime it limited in jerk, or give a smaller spacing"
    )]
    NotSmooth {
        /// The factor.
        stretch: f64,
    },
    /// A joint leaves its position limits.
    #[error("joint {joint}: position {value} at about {time_s} s is beyond the limit {limit}")]
    PositionBeyondLimit {
        /// Index of the joint.
        joint: usize,
        /// When \[s\].
        time_s: f64,
        /// Position there.
        value: f64,
        /// The limit.
        limit: f64,
    },
}

impl<P: GeometricPath> TimedPath<P> {
    /// This motion as waypoints at most `spacing_s` \[s\] apart, for joints called `names` in the
    /// order of the coordinates.
    ///
    /// The cubics between them are checked at their extremes. Where they use more of a limit than
    /// the motion itself, as at a switch of acceleration, or leave the path by more than 1e-4 rad
    /// or m in their middle, waypoints are added; what is then still beyond a limit is removed by
    /// slowing the whole motion down. So
    /// [`CompiledTrajectory::compile`](crate::CompiledTrajectory::compile) accepts the result for
    /// the limits that the path was retimed with. Acceleration may jump at waypoints; jerk is not
    /// promised: for that there is [`to_smooth_trajectory`](Self::to_smooth_trajectory).
    ///
    /// # Errors
    /// [`PathTrajectoryError::NameCount`] if there is not one name per coordinate,
    /// [`PathTrajectoryError::Spacing`] if the spacing is too small,
    /// [`PathTrajectoryError::TooManyWaypoints`] if the motion is too long for it,
    /// [`PathTrajectoryError::NotAtRest`] if the motion does not start and end at rest,
    /// [`PathTrajectoryError::PositionBeyondLimit`] if it leaves the position limits.
    pub fn to_trajectory(
        &self,
        names: &[impl AsRef<str>],
        spacing_s: f64,
    ) -> Result<PathTrajectory, PathTrajectoryError> {
        let coordinates = self.limits().len();
        if names.len() != coordinates {
            return Err(PathTrajectoryError::NameCount { names: names.len(), coordinates });
        }
        let steps = self.steps(spacing_s)?;
        let mut points = Points { timed: self, steps, found: vec![self.point(0.0)], stretch: 1.0 };
        points.check_rest()?;
        points.fill(spacing_s)?;
        let Points { found, stretch, .. } = points;
        let waypoints = found.into_iter().map(|point| point.into_waypoint(stretch)).collect();
        let joint_names = names.iter().map(|name| name.as_ref().to_owned()).collect();
        let interpolation = Interpolation::CubicSpline;
        Ok(PathTrajectory {
            trajectory: JointTrajectory {
                joint_names,
                waypoints,
                interpolation,
                ..JointTrajectory::default()
            },
            stretch,
        })
    }

    /// Into how many equal steps of at most `spacing_s` the duration is divided.
    pub(super) fn steps(&self, spacing_s: f64) -> Result<usize, PathTrajectoryError> {
        let is_enough = spacing_s >= MIN_WAYPOINT_SPACING_S;
        if !is_enough {
            return Err(PathTrajectoryError::Spacing { spacing_s });
        }
        let limit = TrajectoryOptions::default().max_waypoints;
        let steps = (self.duration_s() / spacing_s).ceil().max(1.0);
        if steps >= limit as f64 {
            return Err(PathTrajectoryError::TooManyWaypoints { spacing_s, limit });
        }
        Ok(steps as usize)
    }

    fn point(&self, time_s: f64) -> Point {
        let n = self.limits().len();
        let mut point = Point { time_s, position: vec![0.0; n], velocity: vec![0.0; n] };
        let mut rows = PathRows {
            position: &mut point.position,
            first: &mut point.velocity,
            second: &mut vec![0.0; n],
        };
        self.write_at(time_s, &mut rows);
        point
    }

    /// By what factor the motion between two times would have to be slower to keep its limits, as
    /// seen at both ends and in the middle of each piece; below one if it keeps
    /// them.
    fn slowness_between(&self, from_s: f64, to_s: f64) -> f64 {
        let knots = self.knots();
        let first = knots.partition_point(|knot| knot.time_s <= from_s).saturating_sub(1);
        let mut scratch = vec![0.0; 3 * self.limits().len()];
        let mut needed = 0.0_f64;
        for pair in knots[first..].windows(2).take_while(|pair| pair[0].time_s < to_s) {
            let (low, high) = (pair[0].time_s.max(from_s), pair[1].time_s.min(to_s));
            for time_s in [low, 0.5 * (low + high), high] {
                let mut rows = PathRows::split(&mut scratch);
                self.write_state(&pair[0].after(time_s - pair[0].time_s), &mut rows);
                for (joint, axis) in self.limits().iter().enumerate() {
                    needed = needed.max(rows.first[joint].abs() / axis.velocity);
                    let share = rows.second[joint].abs() / axis.acceleration;
                    needed = needed.max(share.sqrt());
                }
            }
        }
        needed
    }

    /// Where between two times path acceleration jumps most, if it does.
    fn jump_between(&self, from_s: f64, to_s: f64) -> Option<f64> {
        let knots = self.knots();
        let first = knots.partition_point(|knot| knot.time_s <= from_s).saturating_sub(1);
        let (mut best, mut most) = (None, 0.0);
        for pair in knots[first..].windows(2).take_while(|pair| pair[1].time_s < to_s) {
            let before = pair[0].acceleration + pair[0].jerk * (pair[1].time_s - pair[0].time_s);
            let jump = (pair[1].acceleration - before).abs();
            if pair[1].time_s > from_s && jump > most {
                (best, most) = (Some(pair[1].time_s), jump);
            }
        }
        best
    }
}

/// The motion at one time.
#[derive(Clone, Debug)]
struct Point {
    time_s: f64,
    position: Vec<f64>,
    velocity: Vec<f64>,
}

impl Point {
    fn into_waypoint(self, stretch: f64) -> Waypoint {
        Waypoint {
            time_from_start_s: self.time_s * stretch,
            joint_position: self.position,
            joint_velocity: self.velocity.into_iter().map(|v| v / stretch).collect(),
            ..Waypoint::default()
        }
    }
}

/// Waypoints in the making.
struct Points<'a, P> {
    timed: &'a TimedPath<P>,
    /// Number of steps before any is split.
    steps: usize,
    found: Vec<Point>,
    stretch: f64,
}

impl<P: GeometricPath> Points<'_, P> {
    fn check_rest(&self) -> Result<(), PathTrajectoryError> {
        for time_s in [0.0, self.timed.duration_s()] {
            let moving = self.timed.point(time_s).velocity;
            if let Some(joint) = moving.iter().position(|v| v.abs() > REST_TOLERANCE) {
                return Err(PathTrajectoryError::NotAtRest {
                    joint,
                    time_s,
                    velocity: moving[joint],
                });
            }
        }
        Ok(())
    }

    fn fill(&mut self, spacing_s: f64) -> Result<(), PathTrajectoryError> {
        let duration_s = self.timed.duration_s();
        let limit = TrajectoryOptions::default().max_waypoints;
        for step in 1..=self.steps {
            let to_s = if step == self.steps { duration_s } else { self.step_time(step) };
            let mut ahead = vec![self.timed.point(to_s)];
            while let (Some(from), Some(to)) = (self.found.last(), ahead.pop()) {
                let cubic = Segment { from, to: &to, limits: self.timed.limits() };
                let is_long = to.time_s - from.time_s >= SHORTEST_SPLIT_S.min(0.5 * duration_s);
                let needed = cubic.slowness();
                let middle = self.timed.point(0.5 * (from.time_s + to.time_s));
                let is_rough = needed > self.allowed(needed, (from.time_s, to.time_s))
                    || cubic.deviation(&middle) > MAX_DEVIATION
                    || cubic.beyond().is_some();
                if is_long && is_rough {
                    let (low, high) = (from.time_s + SHORTEST_PART_S, to.time_s - SHORTEST_PART_S);
                    let jump = self.timed.jump_between(low, high);
                    let middle = jump.map_or(middle, |time_s| self.timed.point(time_s));
                    ahead.extend([to, middle]);
                    continue;
                }
                if let Some(error) = cubic.beyond() {
                    return Err(error);
                }
                let spacing = MIN_WAYPOINT_SPACING_S / (to.time_s - from.time_s);
                self.stretch = self.stretch.max(needed * (1.0 + MARGIN)).max(spacing);
                self.found.push(to);
            }
            if self.found.len() > limit {
                return Err(PathTrajectoryError::TooManyWaypoints { spacing_s, limit });
            }
        }
        Ok(())
    }

    /// Time of a step, moved to a jump of path acceleration that is too near to stay beside.
    fn step_time(&self, step: usize) -> f64 {
        let spacing_s = self.timed.duration_s() / self.steps as f64;
        let time_s = spacing_s * step as f64;
        let reach_s = SHORTEST_PART_S.min(0.25 * spacing_s);
        self.timed.jump_between(time_s - reach_s, time_s + reach_s).unwrap_or(time_s)
    }

    /// Slowness that splitting between two times would hardly reduce; not looked for if `needed`
    /// is hardly more than one.
    fn allowed(&self, needed: f64, (from_s, to_s): (f64, f64)) -> f64 {
        let motion = if needed > 1.0 + SPLIT_ABOVE {
            self.timed.slowness_between(from_s, to_s).max(1.0)
        } else {
            1.0
        };
        motion * (1.0 + SPLIT_ABOVE)
    }
}

/// The cubics of all joints between two points.
struct Segment<'a> {
    from: &'a Point,
    to: &'a Point,
    limits: &'a [AxisLimits],
}

impl Segment<'_> {
    /// Length, then for joint `joint` position, slope, half the second and a sixth of the third
    /// derivative at the beginning.
    fn cubic(&self, joint: usize) -> (f64, [f64; 4]) {
        let h = self.to.time_s - self.from.time_s;
        let (from, to) = (self.from.velocity[joint], self.to.velocity[joint]);
        let chord = (self.to.position[joint] - self.from.position[joint]) / h;
        let c2 = (3.0 * chord - 2.0 * from - to) / h;
        let c3 = (from + to - 2.0 * chord) / (h * h);
        (h, [self.from.position[joint], from, c2, c3])
    }

    /// By what factor the segment has to be slower to keep its limits of velocity and acceleration;
    /// below one if it keeps them.
    fn slowness(&self) -> f64 {
        let mut needed = 0.0_f64;
        for (joint, axis) in self.limits.iter().enumerate() {
            let (h, [_, c1, c2, c3]) = self.cubic(joint);
            let velocity = |u: f64| (c1 + u * (2.0 * c2 + u * 3.0 * c3)).abs();
            let vertex = Some(-c2 / (3.0 * c3)).filter(|&u| u > 0.0 && u < h);
            let fastest = velocity(0.0).max(velocity(h)).max(vertex.map_or(0.0, velocity));
            let hardest = (2.0 * c2).abs().max((2.0 * c2 + 6.0 * c3 * h).abs());
            needed = needed.max(fastest / axis.velocity).max((hardest / axis.acceleration).sqrt());
        }
        needed
    }

    /// How far the middle of the cubics is from `middle`, of the joint that is furthest.
    fn deviation(&self, middle: &Point) -> f64 {
        let mut most = 0.0_f64;
        for (joint, position) in middle.position.iter().enumerate() {
            let (h, [c0, c1, c2, c3]) = self.cubic(joint);
            let u = 0.5 * h;
            most = most.max((c0 + u * (c1 + u * (c2 + u * c3)) - position).abs());
        }
        most
    }

    /// The first joint that leaves its position limits.
    fn beyond(&self) -> Option<PathTrajectoryError> {
        for (joint, axis) in self.limits.iter().enumerate() {
            let (h, [c0, c1, c2, c3]) = self.cubic(joint);
            let root = (c2 * c2 - 3.0 * c3 * c1).max(0.0).sqrt();
            let q = -(c2 + root.copysign(c2));
            let turns = [0.0, q / (3.0 * c3), c1 / q, h];
            for u in turns.into_iter().filter(|u| (0.0..=h).contains(u)) {
                let value = c0 + u * (c1 + u * (c2 + u * c3));
                if value < axis.lower - LIMIT_TOLERANCE || value > axis.upper + LIMIT_TOLERANCE {
                    let (time_s, limit) = (self.from.time_s + u, axis.nearer_limit(value));
                    return Some(PathTrajectoryError::PositionBeyondLimit {
                        joint,
                        time_s,
                        value,
                        limit,
                    });
                }
            }
        }
        None
    }
}
