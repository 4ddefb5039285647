//! Jerk-limited timed paths as waypoints that any agent accepts, with their jerk still limited.

use super::geometric::{GeometricPath, PathRows};
use super::timed::TimedPath;
use super::waypoints::{PathTrajectory, PathTrajectoryError};
use crate::{
    AxisLimits, CompiledTrajectory, Interpolation, JerkLimit, JointLimits, JointTrajectory,
    MAX_JOINTS, MIN_WAYPOINT_SPACING_S, MotionLimits, TrajectoryError, TrajectoryOptions, Waypoint,
};

/// A motion that would have to be this much slower was not limited in jerk to begin with.
const MOST_STRETCH: f64 = 2.0;

/// By how much more than needed a motion is slowed down, against rounding.
const MARGIN: f64 = 1e-9;

/// Far above any limit, and far from overflow.
const UNLIMITED: f64 = 1e100;

impl<P: GeometricPath> TimedPath<P> {
    /// This motion, made by [`retime_jerk_limited`](super::retime_jerk_limited), as waypoints of
    /// [`Interpolation::QuinticHermite`], for joints called `names` in the order of the coordinates.
    ///
    /// There is a waypoint where the jerk of the path parameter changes, and no two are further
    /// apart than `spacing_s` \[s\] or much nearer than a quarter of it. Between them the motion is
    /// a polynomial whose peaks of velocity, acceleration and jerk are found exactly; what is beyond
    /// a limit is removed by slowing the whole motion down. So compiling the result with
    /// [`JerkLimit::Enforced`] succeeds for the limits that the path was retimed with.
    ///
    /// # Errors
    /// As [`to_trajectory`](Self::to_trajectory), and [`PathTrajectoryError::NotSmooth`] if the
    /// motion would become more than twice as long: acceleration jumps, or the waypoints are too
    /// far apart.
    pub fn to_smooth_trajectory(
        &self,
        names: &[impl AsRef<str>],
        spacing_s: f64,
    ) -> Result<PathTrajectory, PathTrajectoryError> {
        let coordinates = self.limits().len();
        if names.len() != coordinates {
            return Err(PathTrajectoryError::NameCount { names: names.len(), coordinates });
        }
        self.steps(spacing_s)?;
        let joint_names = names.iter().map(|name| name.as_ref().to_owned()).collect();
        let waypoints =
            self.smooth_times(spacing_s).into_iter().map(|time_s| self.waypoint(time_s));
        let mut trajectory = JointTrajectory {
            joint_names,
            waypoints: waypoints.collect(),
            interpolation: Interpolation::QuinticHermite,
            ..JointTrajectory::default()
        };
        let stretch = self.needed_stretch(&trajectory)?;
        if stretch > MOST_STRETCH {
            return Err(PathTrajectoryError::NotSmooth { stretch });
        }
        for waypoint in &mut trajectory.waypoints {
            slow_down(waypoint, stretch);
        }
        Ok(PathTrajectory { trajectory, stretch })
    }

    /// Times of the waypoints: where jerk changes, and between these at equal distances.
    fn smooth_times(&self, spacing_s: f64) -> Vec<f64> {
        let duration_s = self.duration_s();
        let least_s = (0.25 * spacing_s).max(2.0 * MIN_WAYPOINT_SPACING_S);
        let mut times = vec![0.0];
        let mut from_s = 0.0;
        let changes = self.knots().iter().map(|knot| knot.time_s);
        let inner = changes.filter(|&time_s| time_s > least_s && time_s < duration_s - least_s);
        for time_s in inner.chain([duration_s]) {
            if time_s < from_s + least_s && time_s < duration_s {
                continue;
            }
            let parts = ((time_s - from_s) / spacing_s).ceil().max(1.0) as u32;
            let part_s = (time_s - from_s) / f64::from(parts);
            times.extend((1..parts).map(|part| from_s + part_s * f64::from(part)));
            times.push(time_s);
            from_s = time_s;
        }
        times
    }

    fn waypoint(&self, time_from_start_s: f64) -> Waypoint {
        let zeros = vec![0.0; self.limits().len()];
        let mut waypoint = Waypoint {
            time_from_start_s,
            joint_position: zeros.clone(),
            joint_velocity: zeros.clone(),
            joint_acceleration: zeros,
            ..Waypoint::default()
        };
        let mut rows = PathRows {
            position: &mut waypoint.joint_position,
            first: &mut waypoint.joint_velocity,
            second: &mut waypoint.joint_acceleration,
        };
        self.write_at(time_from_start_s, &mut rows);
        waypoint
    }

    /// By what factor the polynomials have to be slower to keep all limits; one if they do.
    fn needed_stretch(&self, trajectory: &JointTrajectory) -> Result<f64, PathTrajectoryError> {
        let mut stretch = 1.0_f64;
        let columns: Vec<usize> = (0..self.limits().len()).collect();
        for (columns, limits) in columns.chunks(MAX_JOINTS).zip(self.limits().chunks(MAX_JOINTS)) {
            let names: Vec<String> = columns.iter().map(|column| column.to_string()).collect();
            let part = trajectory.select(columns, names.clone());
            let compiled = part.and_then(|part| compile_freely(&part, &names, limits));
            let compiled = compiled.map_err(|error| self.refusal(error, columns))?;
            for segment in compiled.segments() {
                for (joint, axis) in limits.iter().enumerate() {
                    let velocity = segment.velocity[joint] / axis.velocity;
                    let acceleration = (segment.acceleration[joint] / axis.acceleration).sqrt();
                    let jerk = (segment.jerk[joint] / axis.jerk).cbrt();
                    stretch = stretch.max(velocity.max(acceleration).max(jerk) * (1.0 + MARGIN));
                }
            }
        }
        Ok(stretch)
    }

    /// What can be wrong once velocity, acceleration and jerk are left out.
    fn refusal(&self, error: TrajectoryError, columns: &[usize]) -> PathTrajectoryError {
        let column =
            |name: &str| name.parse().ok().or_else(|| columns.first().copied()).unwrap_or_default();
        match error {
            TrajectoryError::BeyondLimit { joint, time_s, value, limit, .. } => {
                let joint = column(&joint);
                PathTrajectoryError::PositionBeyondLimit { joint, time_s, value, limit }
            }
            TrajectoryError::NotAtRest { waypoint, joint, value } => {
                let time_s = if waypoint == 0 { 0.0 } else { self.duration_s() };
                PathTrajectoryError::NotAtRest { joint: column(&joint), time_s, velocity: value }
            }
            // Anything else means that numbers overflowed: too fast for any stretch.
            _ => PathTrajectoryError::NotSmooth { stretch: f64::INFINITY },
        }
    }
}

/// Compiles with limits of position only.
fn compile_freely(
    part: &JointTrajectory,
    names: &[String],
    limits: &[AxisLimits],
) -> Result<CompiledTrajectory, TrajectoryError> {
    let free = |axis: &AxisLimits| JointLimits {
        lower: Some(axis.lower).filter(|lower| lower.is_finite()),
        upper: Some(axis.upper).filter(|upper| upper.is_finite()),
        velocity: UNLIMITED,
        acceleration: Some(UNLIMITED),
        jerk: Some(UNLIMITED),
        effort: None,
    };
    let free: Vec<_> = limits.iter().map(free).collect();
    let count = TrajectoryError::LimitCount { joints: names.len(), limits: free.len() };
    let free = MotionLimits::new(&free).map_err(|_| count)?;
    let options = TrajectoryOptions { jerk: JerkLimit::Ignored, ..TrajectoryOptions::default() };
    CompiledTrajectory::compile(part, names, &free, &options)
}

fn slow_down(waypoint: &mut Waypoint, stretch: f64) {
    waypoint.time_from_start_s *= stretch;
    waypoint.joint_velocity.iter_mut().for_each(|v| *v /= stretch);
    waypoint.joint_acceleration.iter_mut().for_each(|a| *a /= stretch * stretch);
}
