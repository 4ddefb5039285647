//! A trajectory that was found legal, ready to be sampled.

use super::check::{self, BOUNDS};
use super::curve::{Curve, Place};
use super::error::TrajectoryError;
use super::interpolate;
use super::motion_limits::MotionLimits;
use super::options::{Ends, JerkLimit, TrajectoryContext, TrajectoryOptions};
use super::tolerance::{Tolerance, Tolerances};
use super::validate::{self, REST_TOLERANCE};
use super::waypoints::JointTrajectory;
use crate::JointVector;
use serde::{Deserialize, Serialize};

/// A piecewise polynomial motion of all joints of one robot, inside all limits, from rest to rest
/// if nothing else was asked for.
///
/// That it exists means that it is legal: the extremes of position, velocity and acceleration of
/// every joint were found exactly and lie within the limits. Sampling does not allocate.
///
/// ```
/// use armada_model::{
///     CompiledTrajectory, JointLimits, JointTrajectory, JointType, JointUnit, MotionLimits,
///     TrajectoryContext, TrajectoryOptions, Waypoint,
/// };
///
/// let row = |time_from_start_s, angle| Waypoint {
///     time_from_start_s,
///     joint_position: vec![angle],
///     ..Waypoint::default()
/// };
/// let trajectory = JointTrajectory {
///     joint_names: vec!["elbow".to_owned()],
///     joint_units: vec![JointUnit::Degree],
///     waypoints: vec![row(0.0, 0.0), row(2.0, 90.0)],
///     ..JointTrajectory::default()
/// };
/// let limit = JointLimits { velocity: 2.0, acceleration: Some(5.0), ..JointLimits::default() };
/// let context = TrajectoryContext {
///     joint_order: &["elbow"],
///     joint_types: Some(&[JointType::Revolute]),
///     limits: &MotionLimits::new(&[limit])?,
/// };
/// let options = TrajectoryOptions::default();
/// let motion = CompiledTrajectory::compile_for(&trajectory, &context, &options)?;
///
/// let mut hint = 0;
/// let half_way = motion.sample(1.0, &mut hint);
/// assert!((half_way.position[0] - 45.0_f64.to_radians()).abs() < 1e-12);
/// let state = motion.state_at(1.0, &mut hint);
/// assert!(state.acceleration[0].abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CompiledTrajectory {
    start: JointVector,
    end: JointVector,
    end_velocity: JointVector,
    waypoints: usize,
    curve: Curve,
    /// Per segment three rows of one value per joint, see [`SegmentBounds`].
    bounds: Vec<f64>,
    tolerances: Tolerances,
    limits_jerk: bool,
    /// Highest magnitudes of all segments.
    peak_velocity: JointVector,
    peak_acceleration: JointVector,
}

/// What a trajectory asks for at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position of each joint \[rad or m\].
    pub position: JointVector,
    /// Velocity of each joint \[rad/s or m/s\].
    pub velocity: JointVector,
    /// Index of the last waypoint whose time has come.
    pub waypoint: usize,
}

/// A [`Sample`] with accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryState {
    /// Position of each joint \[rad or m\].
    pub position: JointVector,
    /// Velocity of each joint \[rad/s or m/s\].
    pub velocity: JointVector,
    /// Acceleration of each joint \[rad/s² or m/s²\]; where it jumps, that after the jump.
    pub acceleration: JointVector,
    /// Index of the last waypoint whose time has come.
    pub waypoint: usize,
}

/// A segment of a [`CompiledTrajectory`], on which every joint follows one polynomial, and the
/// exact highest magnitudes on it. Slices hold one value per joint, in the robot's joint order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentBounds<'a> {
    /// When it begins \[s since the start\].
    pub start_s: f64,
    /// How long it takes \[s\].
    pub length_s: f64,
    /// Index of the last waypoint whose time has come when it begins.
    pub waypoint: usize,
    /// Highest speed \[rad/s or m/s\].
    pub velocity: &'a [f64],
    /// Highest magnitude of acceleration \[rad/s² or m/s²\].
    pub acceleration: &'a [f64],
    /// Highest magnitude of jerk \[rad/s³ or m/s³\].
    pub jerk: &'a [f64],
}

impl CompiledTrajectory {
    /// [`compile_for`](Self::compile_for) a robot whose joint types are not known.
    ///
    /// # Errors
    /// As there. [`TrajectoryError::UnitUnknownType`] also for units that would be right.
    pub fn compile(
        trajectory: &JointTrajectory,
        joint_order: &[impl AsRef<str>],
        limits: &MotionLimits,
        options: &TrajectoryOptions,
    ) -> Result<Self, TrajectoryError> {
        let context = TrajectoryContext { joint_order, joint_types: None, limits };
        Self::compile_for(trajectory, &context, options)
    }

    /// Validates and interpolates `trajectory` for the robot that `context` describes. Its joint
    /// names may come in any order.
    ///
    /// # Errors
    /// The first [`TrajectoryError`] that applies, in the order of the checks: names and units,
    /// number and shape of the waypoints, times, finite values, rest at both ends, tolerances,
    /// blends, limits. Of several violations of limits it is the earliest by segment, then by
    /// joint; jumps of acceleration come last.
    pub fn compile_for<S: AsRef<str>>(
        trajectory: &JointTrajectory,
        context: &TrajectoryContext<'_, S>,
        options: &TrajectoryOptions,
    ) -> Result<Self, TrajectoryError> {
        let limits = context.limits;
        let names: Vec<&str> = context.joint_order.iter().map(AsRef::as_ref).collect();
        let joints = names.len();
        if joints != limits.len() {
            return Err(TrajectoryError::LimitCount { joints, limits: limits.len() });
        }
        if let Some(types) = context.joint_types.map(<[_]>::len).filter(|&types| types != joints) {
            return Err(TrajectoryError::TypeCount { joints, types });
        }
        let knots = validate::knots(trajectory, &names, context, options)?;
        let waypoints = knots.times.len();
        let start = row(&knots.positions, joints, 0);
        let end = row(&knots.positions, joints, waypoints - 1);
        let tolerances = knots.tolerances.clone();
        let interpolation = trajectory.interpolation;
        let curve = interpolate::curve(interpolation, knots, &names, limits, options.ends)?;
        let bounds = check::check(&curve, &names, limits, options)?;
        let end_velocity = end_velocity(&curve, end, options.ends);
        let limits_jerk = options.jerk == JerkLimit::Enforced;
        Ok(Self {
            peak_velocity: peak(&bounds, start, 0),
            peak_acceleration: peak(&bounds, start, 1),
            start,
            end,
            end_velocity,
            waypoints,
            curve,
            bounds,
            tolerances,
            limits_jerk,
        })
    }

    /// Time of the last waypoint \[s\].
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.curve.duration_s()
    }

    /// Number of waypoints, two at least.
    #[must_use]
    pub const fn waypoint_count(&self) -> usize {
        self.waypoints
    }

    /// Number of joints, one at least.
    #[must_use]
    pub fn joint_count(&self) -> usize {
        self.start.len()
    }

    /// Position at the first waypoint \[rad or m\].
    #[must_use]
    pub const fn start(&self) -> JointVector {
        self.start
    }

    /// Position at the last waypoint \[rad or m\].
    #[must_use]
    pub const fn end(&self) -> JointVector {
        self.end
    }

    /// The motion at `t_s` \[s since its start\]: before zero (and for not a number) as at the
    /// first waypoint, from the duration on as at exactly the last. It rests there, unless it was
    /// compiled for [`Ends::InMotion`]; then the velocity there is that of the end, and there is
    /// no motion to sample outside.
    ///
    /// `hint` holds where the last sample was found; begin with zero. While time goes on by small
    /// steps the cost does not depend on the number of waypoints; for any other it is its logarithm.
    #[must_use]
    pub fn sample(&self, t_s: f64, hint: &mut usize) -> Sample {
        let Some(place) = self.locate(t_s, hint) else {
            return Sample {
                position: self.end,
                velocity: self.end_velocity,
                waypoint: self.waypoints - 1,
            };
        };
        let (mut position, mut velocity) = (self.start, self.start);
        self.curve.motion(place, &mut position, &mut velocity);
        Sample { position, velocity, waypoint: self.curve.waypoint(place.segment) }
    }

    /// [`sample`](Self::sample) with accelerations, which are zero before zero and from the
    /// duration on. What they are just before the end tells [`end_state`](Self::end_state).
    #[must_use]
    pub fn state_at(&self, t_s: f64, hint: &mut usize) -> TrajectoryState {
        let Some(place) = self.locate(t_s, hint) else {
            return TrajectoryState { acceleration: self.zeros(), ..self.end_state() };
        };
        let (mut position, mut velocity) = (self.start, self.start);
        self.curve.motion(place, &mut position, &mut velocity);
        let acceleration =
            if t_s >= 0.0 { self.curve.acceleration(place, self.start) } else { self.zeros() };
        let waypoint = self.curve.waypoint(place.segment);
        TrajectoryState { position, velocity, acceleration, waypoint }
    }

    /// Jerk of each joint \[rad/s³ or m/s³\] at `t_s`, zero outside of the motion. Jumps of
    /// acceleration are not in it.
    #[must_use]
    pub fn jerk_at(&self, t_s: f64, hint: &mut usize) -> JointVector {
        match self.locate(t_s, hint) {
            Some(place) if t_s >= 0.0 => self.curve.jerk(place, self.start),
            _ => self.zeros(),
        }
    }

    /// The state at the end of the last segment, with the acceleration before the end.
    #[must_use]
    pub fn end_state(&self) -> TrajectoryState {
        let acceleration = self.curve.acceleration(end_place(&self.curve), self.start);
        TrajectoryState {
            position: self.end,
            velocity: self.end_velocity,
            acceleration,
            waypoint: self.waypoints - 1,
        }
    }

    /// How far the robot may be from set-points from the time of `waypoint` until that of the next
    /// one, as [`Sample::waypoint`] tells. Nothing is asked for if there is no such waypoint.
    #[must_use]
    pub fn tolerance(&self, waypoint: usize) -> Tolerance<'_> {
        self.tolerances.at(waypoint)
    }

    /// Index of the last waypoint whose time has come at `t_s` \[s\], as [`Sample::waypoint`] tells.
    /// `hint` is as for [`sample`](Self::sample).
    #[must_use]
    pub fn waypoint_at(&self, t_s: f64, hint: &mut usize) -> usize {
        self.locate(t_s, hint)
            .map_or(self.waypoints - 1, |place| self.curve.waypoint(place.segment))
    }

    /// Whether a waypoint has a tolerance of velocities.
    #[must_use]
    pub fn has_velocity_tolerance(&self) -> bool {
        self.tolerances.has_velocity()
    }

    /// Highest speed of each joint anywhere \[rad/s or m/s\], exactly.
    #[must_use]
    pub const fn peak_velocity(&self) -> JointVector {
        self.peak_velocity
    }

    /// Highest magnitude of the acceleration of each joint anywhere \[rad/s² or m/s²\], exactly.
    #[must_use]
    pub const fn peak_acceleration(&self) -> JointVector {
        self.peak_acceleration
    }

    /// Number of segments, one at least: in a spline those between the waypoints, with blends more.
    #[must_use]
    pub const fn segment_count(&self) -> usize {
        self.curve.segments()
    }

    /// All segments in the order of time, without gaps. They were looked at when the trajectory
    /// was compiled; this only reads.
    pub fn segments(&self) -> impl ExactSizeIterator<Item = SegmentBounds<'_>> {
        self.segments_from(0)
    }

    /// The segments from that at `t_s` on, which is the first one before the start (and for not a
    /// number) and the last one after the end. `hint` is as for [`sample`](Self::sample).
    pub fn segments_at(
        &self,
        t_s: f64,
        hint: &mut usize,
    ) -> impl ExactSizeIterator<Item = SegmentBounds<'_>> {
        let last = self.segment_count() - 1;
        self.segments_from(self.locate(t_s, hint).map_or(last, |place| place.segment))
    }

    fn segments_from(&self, first: usize) -> impl ExactSizeIterator<Item = SegmentBounds<'_>> {
        let joints = self.joint_count();
        let rows = self.bounds[first * BOUNDS * joints..].chunks_exact(BOUNDS * joints);
        rows.enumerate().map(move |(index, rows)| {
            let (start_s, length_s) = self.curve.span(first + index);
            let (velocity, rows) = rows.split_at(joints);
            let (acceleration, jerk) = rows.split_at(joints);
            let waypoint = self.curve.waypoint(first + index);
            SegmentBounds { start_s, length_s, waypoint, velocity, acceleration, jerk }
        })
    }

    /// Whether jerk was found to be within the limits, and acceleration without jumps.
    pub(crate) const fn limits_jerk(&self) -> bool {
        self.limits_jerk
    }

    /// Index of the segment at `t_s`, as [`segments_at`](Self::segments_at) finds it.
    pub(crate) fn segment_index(&self, t_s: f64, hint: &mut usize) -> usize {
        let last = self.segment_count() - 1;
        self.locate(t_s, hint).map_or(last, |place| place.segment)
    }

    /// Where segment `index` begins and how long it is \[s\]; there must be such a segment.
    pub(crate) fn segment_span(&self, index: usize) -> (f64, f64) {
        self.curve.span(index)
    }

    /// First to fifth derivative of a joint, `u_s` after the beginning of segment `index`; joint
    /// and segment must exist.
    pub(crate) fn derivatives(&self, index: usize, u_s: f64, joint: usize) -> [f64; 5] {
        self.curve.derivatives(Place { segment: index, u: u_s }, joint)
    }

    /// The place of `t_s`, of zero if it is before or not a number, `None` from the end on.
    fn locate(&self, t_s: f64, hint: &mut usize) -> Option<Place> {
        if t_s >= self.duration_s() {
            *hint = self.segment_count().saturating_sub(1);
            return None;
        }
        Some(self.curve.locate(t_s.max(0.0), hint))
    }

    fn zeros(&self) -> JointVector {
        self.start.map_indexed(|_, _| 0.0)
    }
}

fn end_place(curve: &Curve) -> Place {
    let segment = curve.segments().saturating_sub(1);
    Place { segment, u: curve.span(segment).1 }
}

fn end_velocity(curve: &Curve, like: JointVector, ends: Ends) -> JointVector {
    let (mut position, mut velocity) = (like, like);
    curve.motion(end_place(curve), &mut position, &mut velocity);
    velocity.map_indexed(|_, v| {
        let rests = ends == Ends::AtRest || v.abs() <= REST_TOLERANCE;
        if rests { 0.0 } else { v }
    })
}

/// The highest of row `row` of the bounds of all segments, for each joint.
fn peak(bounds: &[f64], like: JointVector, row: usize) -> JointVector {
    let joints = like.len();
    let mut peak = like.map_indexed(|_, _| 0.0);
    for rows in bounds.chunks_exact(BOUNDS * joints) {
        for (peak, &value) in peak.iter_mut().zip(rows.iter().skip(row * joints)) {
            *peak = value.max(*peak);
        }
    }
    peak
}

fn row(rows: &[f64], joints: usize, index: usize) -> JointVector {
    // Rows are finite and not longer than the limits are, so this never fails.
    JointVector::from_slice(&rows[index * joints..][..joints]).unwrap_or_default()
}
