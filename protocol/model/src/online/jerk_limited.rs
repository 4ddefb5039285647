//! Motion of all joints from any state to a target, with limited jerk.

use arrayvec::ArrayVec;
use serde::{Deserialize, Serialize};

use super::axis::{AxisMotion, AxisPoint};
use super::generator::{AxisDurations, AxisRequest, OnlineGenerator};
use super::line::Line;
use super::request::{MAX_ONLINE_VALUE, OnlineError, OnlineOptions, OnlineState, Synchronisation};
use super::ruckig::RuckigGenerator;
use crate::{AxisLimits, JointVector, MAX_JOINTS, MotionLimits};

/// How far the end of a profile may be from its target \[rad or m\]; the last set-point goes there.
const ARRIVAL_TOLERANCE: f64 = 1e-8;

/// How far a motion may go beyond a limit, of that limit: rounding, no more.
const ROUNDING: f64 = 1e-9;

/// How far a motion may go beyond a position limit \[rad or m\]: rounding, no more.
const POSITION_ROUNDING: f64 = 1e-8;

/// Longer common durations that are tried where the least one has no profile, as it may happen by
/// rounding at the border of what is possible.
const STRETCHES: [f64; 4] = [1.0, 1.0 + 1e-12, 1.0 + 1e-9, 1.0 + 1e-6];

/// A jerk-limited motion of all joints from any state to a target, and to rest after it.
///
/// Velocity, acceleration and jerk stay within their limits. A start outside of them is taken: an
/// acceleration above its limit falls at full jerk, then a velocity above its limit falls as fast
/// as acceleration and jerk allow (after what its acceleration at the start makes inevitable);
/// neither comes back above. Positions stay inside their limits, or no further out than the start
/// is. A target in motion is reached at [`duration_s`](Self::duration_s); from there on each joint
/// stops in the least time, so that the motion ends at rest at [`rest_s`](Self::rest_s).
///
/// Planning and evaluating allocate nothing.
///
/// ```
/// # use armada_model::{JerkLimitedMove, JointLimits, JointVector, MotionLimits, OnlineOptions, OnlineState};
/// let joint = JointLimits {
///     velocity: 1.0, acceleration: Some(2.0), jerk: Some(40.0), ..JointLimits::default()
/// };
/// let limits = MotionLimits::new(&[joint; 2])?;
/// let start = OnlineState::at_rest(JointVector::from_slice(&[0.0, 0.0])?);
/// let target = OnlineState::at_rest(JointVector::from_slice(&[1.0, -0.5])?);
/// let motion = JerkLimitedMove::plan(&start, &target, &limits, &OnlineOptions::default())?;
/// // 1 rad / 1 rad/s + 1 rad/s / 2 rad/s² + 2 rad/s² / 40 rad/s³
/// assert!((motion.duration_s() - 1.55).abs() < 1e-12);
/// assert_eq!(motion.at(motion.duration_s()), target);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JerkLimitedMove {
    axes: ArrayVec<AxisMotion, MAX_JOINTS>,
    duration_s: f64,
    is_straight: bool,
}

/// What [`JerkLimitedMove::plan`] is asked for.
struct Request<'a> {
    state: &'a OnlineState,
    target: &'a OnlineState,
    limits: &'a MotionLimits,
    options: &'a OnlineOptions,
}

impl JerkLimitedMove {
    /// The fastest motion from `state` to `target` that `options` allow.
    ///
    /// # Errors
    /// [`OnlineError::JointCount`] if a vector does not have one value per joint,
    /// [`OnlineError::NotUsable`] if a value is not a number or above [`MAX_ONLINE_VALUE`],
    /// [`OnlineError::MinimumDuration`] if that of the options is negative or not a number,
    /// [`OnlineError::TargetBeyondLimit`] if the target breaks a limit or makes that inevitable,
    /// [`OnlineError::OvershootBeyondLimit`] if a joint would leave its position limits,
    /// [`OnlineError::NoProfile`] if the generator failed.
    pub fn plan(
        state: &OnlineState,
        target: &OnlineState,
        limits: &MotionLimits,
        options: &OnlineOptions,
    ) -> Result<Self, OnlineError> {
        Self::plan_with(&mut RuckigGenerator::default(), state, target, limits, options)
    }

    /// As [`plan`](Self::plan), with a generator that is kept: some 30 kB that need not be set up.
    ///
    /// # Errors
    /// As [`plan`](Self::plan).
    pub fn plan_with(
        generator: &mut impl OnlineGenerator,
        state: &OnlineState,
        target: &OnlineState,
        limits: &MotionLimits,
        options: &OnlineOptions,
    ) -> Result<Self, OnlineError> {
        let mut motion = Self::empty();
        motion.replan(generator, state, target, limits, options)?;
        Ok(motion)
    }

    /// Of no joints.
    pub(super) const fn empty() -> Self {
        Self { axes: ArrayVec::new_const(), duration_s: 0.0, is_straight: false }
    }

    /// As [`plan_with`](Self::plan_with), in place: it is some 10 kB. What it was is lost, also on
    /// an error.
    pub(super) fn replan(
        &mut self,
        generator: &mut impl OnlineGenerator,
        state: &OnlineState,
        target: &OnlineState,
        limits: &MotionLimits,
        options: &OnlineOptions,
    ) -> Result<(), OnlineError> {
        state.check(["start position", "start velocity", "start acceleration"], limits.len())?;
        target.check_target(limits)?;
        let least_s = options.minimum_duration_s;
        if !(0.0..=MAX_ONLINE_VALUE).contains(&least_s) {
            return Err(OnlineError::MinimumDuration { value: least_s });
        }
        let line = match options.synchronisation {
            Synchronisation::Phase => Line::through(state, target, limits),
            Synchronisation::Time | Synchronisation::None => None,
        };
        let axes = &mut self.axes;
        self.is_straight = line.is_some_and(|line| line.plan(generator, least_s, axes).is_some());
        if !self.is_straight {
            separate(generator, &Request { state, target, limits, options }, axes)?;
        }
        self.duration_s = axes.iter().map(AxisMotion::arrival_s).fold(0.0, f64::max);
        for (joint, (axis, limits)) in axes.iter_mut().zip(limits.iter()).enumerate() {
            finish(joint, axis, target.axis(joint), limits)?;
        }
        Ok(())
    }

    /// When the last joint reaches its target \[s\].
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// When all joints are at rest \[s\]: not before the duration, later if the target moves.
    #[must_use]
    pub fn rest_s(&self) -> f64 {
        self.axes.iter().map(AxisMotion::rest_s).fold(0.0, f64::max)
    }

    /// Whether all joints move in proportion, see [`Synchronisation::Phase`].
    #[must_use]
    pub const fn is_straight(&self) -> bool {
        self.is_straight
    }

    /// Where all joints come to rest \[rad or m\]: the target, if that is at rest.
    #[must_use]
    pub fn rest_position(&self) -> JointVector {
        self.state(|axis| axis.end()).position
    }

    /// The state at `t_s` \[s\]: the start before zero, at rest from [`rest_s`](Self::rest_s) on.
    #[must_use]
    pub fn at(&self, t_s: f64) -> OnlineState {
        self.state(|axis| axis.at(t_s))
    }

    /// Lowest and highest position of each joint from start to rest \[rad or m\], exactly.
    #[must_use]
    pub fn position_extrema(&self) -> (JointVector, JointVector) {
        let zero = JointVector::zeros(self.axes.len()).unwrap_or_default();
        let of = |joint: usize| self.axes[joint].position_range();
        (zero.map_indexed(|joint, _| of(joint).low), zero.map_indexed(|joint, _| of(joint).high))
    }

    fn state(&self, point: impl Fn(&AxisMotion) -> AxisPoint) -> OnlineState {
        OnlineState::from_axes(self.axes.len(), |joint| point(&self.axes[joint]))
    }

    /// The least-time stop of all joints, with the limits as far as that can be.
    pub(super) fn stop(state: &OnlineState, limits: &MotionLimits) -> Self {
        let axes: ArrayVec<_, MAX_JOINTS> = limits
            .iter()
            .enumerate()
            .map(|(joint, axis)| AxisMotion::stop_inside(state.axis(joint), axis))
            .collect();
        let duration_s = axes.iter().map(AxisMotion::rest_s).fold(0.0, f64::max);
        Self { axes, duration_s, is_straight: false }
    }

    pub(crate) fn axes(&self) -> &[AxisMotion] {
        &self.axes
    }
}

/// Each joint on its own way, at one common duration unless there is no synchronisation.
fn separate(
    generator: &mut impl OnlineGenerator,
    request: &Request<'_>,
    axes: &mut ArrayVec<AxisMotion, MAX_JOINTS>,
) -> Result<(), OnlineError> {
    let Request { state, target, limits, options } = request;
    let mut durations: ArrayVec<AxisDurations, MAX_JOINTS> = ArrayVec::new();
    for (joint, &limits) in limits.iter().enumerate() {
        let request = AxisRequest { from: state.axis(joint), to: target.axis(joint), limits };
        let found = generator.durations(joint, &request);
        durations.push(found.ok_or(OnlineError::NoProfile { joint })?);
    }
    let least_s = options.minimum_duration_s;
    if options.synchronisation == Synchronisation::None {
        let each = |joint: usize| common_duration(&durations[joint..=joint], least_s);
        return motions(generator, durations.len(), each, axes);
    }
    let first_s =
        common_duration(&durations, least_s).ok_or(OnlineError::NoProfile { joint: 0 })?;
    let mut outcome = Ok(());
    for stretch in STRETCHES {
        let common = common_duration(&durations, first_s * stretch);
        outcome = motions(generator, durations.len(), |_| common, axes);
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}

/// The motions of `joints` joints that take `duration` of each.
fn motions(
    generator: &mut impl OnlineGenerator,
    joints: usize,
    duration: impl Fn(usize) -> Option<f64>,
    axes: &mut ArrayVec<AxisMotion, MAX_JOINTS>,
) -> Result<(), OnlineError> {
    axes.clear();
    for joint in 0..joints {
        let motion = duration(joint).and_then(|duration_s| generator.motion(joint, duration_s));
        axes.push(motion.ok_or(OnlineError::NoProfile { joint })?);
    }
    Ok(())
}

/// The least time from `least_s` on that all joints can take. It is `least_s`, the least time of a
/// joint, or the end of a gap, so only these are tried.
pub(super) fn common_duration(durations: &[AxisDurations], least_s: f64) -> Option<f64> {
    let slowest = durations.iter().map(|joint| joint.least_s).fold(least_s, f64::max);
    let ends = durations.iter().flat_map(|joint| joint.gaps.iter().flatten().map(|gap| gap.1));
    std::iter::once(slowest)
        .chain(ends)
        .filter(|&t_s| t_s >= slowest && durations.iter().all(|joint| joint.allows(t_s)))
        .reduce(f64::min)
}

/// Ends `axis` at exactly `target` and with a stop, if it is what was asked for and legal.
fn finish(
    joint: usize,
    axis: &mut AxisMotion,
    target: AxisPoint,
    limits: &AxisLimits,
) -> Result<(), OnlineError> {
    let (start, end) = (axis.at(0.0), axis.end());
    let near = |a: f64, b: f64, scale: f64| (a - b).abs() <= ARRIVAL_TOLERANCE * scale.max(1.0);
    let arrived = near(end.position, target.position, target.position.abs())
        && near(end.velocity, target.velocity, limits.velocity)
        && near(end.acceleration, target.acceleration, limits.acceleration);
    if !arrived || !is_legal(axis, start, limits) {
        return Err(OnlineError::NoProfile { joint });
    }
    axis.arrive(target);
    if !target.is_at_rest() {
        axis.append_stop(limits);
    }
    let range = axis.position_range();
    if limits.excess(range, start.position) > POSITION_ROUNDING {
        let above = range.high - limits.upper.max(start.position) > POSITION_ROUNDING;
        let (value, limit) =
            if above { (range.high, limits.upper) } else { (range.low, limits.lower) };
        return Err(OnlineError::OvershootBeyondLimit { joint, value, limit });
    }
    Ok(())
}

/// Whether `axis` keeps its limits, but for what its start makes inevitable.
fn is_legal(axis: &AxisMotion, start: AxisPoint, limits: &AxisLimits) -> bool {
    let within = |value: f64, limit: f64| value <= limit * (1.0 + ROUNDING) + ROUNDING;
    let inevitable =
        start.velocity.abs() + start.acceleration * start.acceleration / (2.0 * limits.jerk);
    within(axis.jerk_peak(), limits.jerk)
        && within(
            axis.acceleration_range().peak(),
            limits.acceleration.max(start.acceleration.abs()),
        )
        && within(axis.velocity_range().peak(), limits.velocity.max(inevitable))
}
