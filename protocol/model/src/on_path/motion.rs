//! A motion under way on a path.

use super::curve::{CurveBounds, TimedCurve};
use super::legality::Legality;
use super::ramp::strongest;
use super::rate::{RATE_TOLERANCE, Rate};
use crate::{JointVector, MotionLimits, OnlineState};
use serde::{Deserialize, Serialize};

/// Longest step in which the rate is planned \[s\], while a tick has not more than
/// [`MAX_SUBSTEPS`] of them; beyond, steps are longer, which is as legal but less eager.
const SUBSTEP_S: f64 = 1e-3;

/// Most steps of one tick.
const MAX_SUBSTEPS: u32 = 250;

/// Longest step at all \[s\]; what a tick has left after its last step it goes at a constant rate.
const MAX_SUBSTEP_S: f64 = 0.02;

/// Most steps of a prediction.
const PREDICTION_STEPS: u32 = 4096;

/// Moves along a path, which it never leaves, at a rate that may change at any instant.
///
/// See the head of the module for the method and its proof. Nothing allocates, the work of a tick
/// is bounded, and the curve is an argument so that its owner keeps it.
///
/// ```text
///            set_speed_ratio(r)                 stop
///   running <-------------------> ramping ------------------> stopping --> stopped
///      |  ^                          ^                            (nothing leads back)
///      |  +--------- resume ---------+-- pause: a ratio of 0 that remembers
///      +---> finished: at rest at exactly the end
/// ```
///
/// ```
/// # use armada_model::{JointLimits, JointMove, JointVector, MotionLimits, MotionState, OnPath};
/// # let joint = JointLimits {
/// #     velocity: 1.0, acceleration: Some(2.0), jerk: Some(40.0), ..JointLimits::default()
/// # };
/// # let limits = MotionLimits::new(&[joint])?;
/// # let zero = JointVector::zeros(1)?;
/// # let start = MotionState { position: zero, velocity: zero };
/// let curve = JointMove::plan(&start, &JointVector::from_slice(&[3.0])?, &limits)?;
/// let mut motion = OnPath::start(&curve, &limits)?;
/// motion.tick(&curve, 1.0);
/// motion.pause()?;
/// while !motion.is_at_rest() {
///     motion.tick(&curve, 0.001); // the position to send is in what it returns
/// }
/// motion.set_speed_ratio(0.5)?;
/// motion.resume()?;
/// while !motion.is_finished() {
///     motion.tick(&curve, 0.001);
/// }
/// assert_eq!(motion.state(&curve).state.position, curve.target());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct OnPath {
    limits: MotionLimits,
    duration_s: f64,
    hint: usize,
    rate: Rate,
    /// Absolute curvature with which the slope of the rate goes to zero from here: verified.
    way_back: f64,
    ratio: f64,
    demand: Demand,
    has_begun: bool,
}

/// What is asked of the rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Demand {
    Run,
    Pause,
    Stop,
}

/// What a motion on a path asks for at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathState {
    /// Where it is on the path, as time of the curve \[s\].
    pub phase_s: f64,
    /// How fast the phase runs: 1 as the curve was made, 0 at rest.
    pub rate: f64,
    /// Position, velocity and acceleration of the joints.
    pub state: OnlineState,
}

/// Where and when a stop would end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedStop {
    /// Time from now \[s\].
    pub time_s: f64,
    /// Phase \[s\].
    pub phase_s: f64,
}

/// Why an operation on a motion is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OnPathError {
    /// Curve and limits are for different numbers of joints.
    #[error("the curve has {joints} joints, the limits {limits}")]
    JointCount {
        /// Number of joints of the curve.
        joints: usize,
        /// Number of joints that have limits.
        limits: usize,
    },
    /// The ratio is not a number from 0 to 1.
    #[error("speed ratio is {ratio}, expected 0 to 1")]
    SpeedRatio {
        /// The ratio.
        ratio: f64,
    },
    /// The motion was stopped for good.
    #[error("the motion was stopped")]
    Stopped,
}

impl OnPath {
    /// At the start of `curve`, to run as fast as it was made.
    ///
    /// # Errors
    /// [`OnPathError::JointCount`] if `limits` are for another number of joints.
    pub fn start(curve: &impl TimedCurve, limits: &MotionLimits) -> Result<Self, OnPathError> {
        let (joints, count) = (curve.joint_count(), limits.len());
        if joints != count {
            return Err(OnPathError::JointCount { joints, limits: count });
        }
        Ok(Self {
            limits: *limits,
            duration_s: curve.duration_s(),
            hint: 0,
            rate: Rate { phase_s: 0.0, rate: 1.0, slope: 0.0 },
            way_back: 1.0,
            ratio: 1.0,
            demand: Demand::Run,
            has_begun: false,
        })
    }

    /// On its way at `phase_s` \[s\] of `curve`, as fast as it was made: where a
    /// [`Transition`](super::Transition) has led the joints.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    pub fn join(
        curve: &impl TimedCurve,
        limits: &MotionLimits,
        phase_s: f64,
    ) -> Result<Self, OnPathError> {
        let mut motion = Self::start(curve, limits)?;
        motion.rate.phase_s = phase_s.clamp(0.0, motion.duration_s);
        motion.has_begun = motion.rate.phase_s > 0.0;
        Ok(motion)
    }

    /// Goes on along another `curve` from its phase `phase_s` \[s\], as fast as now.
    ///
    /// That is legal where both curves have the same position and derivatives here, and are the
    /// same as far as this motion has [committed](Self::committed_s) itself.
    ///
    /// # Errors
    /// [`OnPathError::JointCount`] if the curve has another number of joints.
    pub fn go_over(&mut self, curve: &impl TimedCurve, phase_s: f64) -> Result<(), OnPathError> {
        let (joints, limits) = (curve.joint_count(), self.limits.len());
        if joints != limits {
            return Err(OnPathError::JointCount { joints, limits });
        }
        self.duration_s = curve.duration_s();
        self.hint = 0;
        self.rate.phase_s = phase_s.clamp(0.0, self.duration_s);
        self.has_begun = true;
        Ok(())
    }

    /// Where it is on its path, as time of the curve \[s\].
    #[must_use]
    pub const fn phase_s(&self) -> f64 {
        self.rate.phase_s
    }

    /// How fast the phase runs, 0 to 1.
    #[must_use]
    pub const fn rate(&self) -> f64 {
        self.rate.rate
    }

    /// Up to which phase \[s\] the curve was relied on: where the rate could be constant again. It
    /// is the present one unless the rate changes.
    #[must_use]
    pub fn committed_s(&self) -> f64 {
        if self.rate.slope == 0.0 {
            return self.rate.phase_s;
        }
        let settle_s = self.rate.slope.abs() / self.way_back;
        self.rate.piece(-self.way_back.copysign(self.rate.slope), settle_s).end.phase_s
    }

    /// Runs at `ratio` times the speed that the curve was made for, from 0 to 1, as soon as the
    /// limits allow; before the first tick at once, for the joints are at rest.
    ///
    /// While paused it is what [`resume`](Self::resume) goes to.
    ///
    /// # Errors
    /// [`OnPathError::SpeedRatio`] if it is not a number from 0 to 1, [`OnPathError::Stopped`] after
    /// [`stop`](Self::stop).
    pub fn set_speed_ratio(&mut self, ratio: f64) -> Result<(), OnPathError> {
        if !(0.0..=1.0).contains(&ratio) {
            return Err(OnPathError::SpeedRatio { ratio });
        }
        if self.demand == Demand::Stop {
            return Err(OnPathError::Stopped);
        }
        self.ratio = ratio;
        self.begin_at_once();
        Ok(())
    }

    /// Comes to rest on the path as soon as the limits allow, until [`resume`](Self::resume).
    ///
    /// # Errors
    /// [`OnPathError::Stopped`] after [`stop`](Self::stop), which has the same effect on the joints.
    pub fn pause(&mut self) -> Result<(), OnPathError> {
        self.demand_unless_stopped(Demand::Pause)
    }

    /// Goes on after a pause.
    ///
    /// # Errors
    /// [`OnPathError::Stopped`] after [`stop`](Self::stop).
    pub fn resume(&mut self) -> Result<(), OnPathError> {
        self.demand_unless_stopped(Demand::Run)
    }

    /// Comes to rest on the path as soon as the limits allow, for good.
    pub fn stop(&mut self) {
        self.demand = Demand::Stop;
        self.begin_at_once();
    }

    /// The state `dt_s` \[s\] after the last one, on the same `curve`. Any time is good; a negative
    /// one and not a number count as none. At a constant rate it is one sample of the curve; while
    /// the rate changes there is a step to be planned for each millisecond, of at most 250.
    pub fn tick(&mut self, curve: &impl TimedCurve, dt_s: f64) -> PathState {
        self.advance(curve, dt_s.max(0.0));
        self.state(curve)
    }

    /// The state of the last tick.
    pub fn state(&mut self, curve: &impl TimedCurve) -> PathState {
        let Rate { phase_s, rate, slope } = self.rate;
        let point = curve.point(phase_s, &mut self.hint);
        let velocity = point.first.map_indexed(|_, first| first * rate);
        let acceleration = JointVector::map_indexed(&point.second, |joint, second| {
            second * rate * rate + point.first[joint] * slope
        });
        PathState {
            phase_s,
            rate,
            state: OnlineState { position: point.position, velocity, acceleration },
        }
    }

    /// Where and when a stop commanded now would end, found by making it in steps of 1 ms; ticks of
    /// that length end just there. It costs as much as the ticks of the stop, of at most 4 s.
    #[must_use]
    pub fn predicted_stop(&self, curve: &impl TimedCurve) -> PredictedStop {
        let mut copy = self.clone();
        copy.stop();
        let mut time_s = 0.0;
        for _ in 0..PREDICTION_STEPS {
            if copy.is_at_rest() {
                break;
            }
            time_s += copy.advance(curve, SUBSTEP_S);
        }
        PredictedStop { time_s, phase_s: copy.rate.phase_s }
    }

    /// Whether the joints are at rest and stay there, if nothing is asked for.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.is_finished()
            || (self.rate.rate == 0.0 && self.rate.slope == 0.0 && self.asked() == 0.0)
    }

    /// Whether the end of the path is reached.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.rate.phase_s >= self.duration_s
    }

    /// Whether it was stopped for good.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.demand == Demand::Stop
    }

    /// How long the rest of the path takes at the rate asked for \[s\], but for ramps; `None` if
    /// that is zero.
    #[must_use]
    pub fn remaining_s(&self) -> Option<f64> {
        let left_s = self.duration_s - self.rate.phase_s;
        (self.asked() > 0.0).then(|| left_s / self.asked())
    }

    /// The rate that it goes to.
    fn asked(&self) -> f64 {
        if self.demand == Demand::Run { self.ratio } else { 0.0 }
    }

    fn demand_unless_stopped(&mut self, demand: Demand) -> Result<(), OnPathError> {
        if self.demand == Demand::Stop {
            return Err(OnPathError::Stopped);
        }
        self.demand = demand;
        self.begin_at_once();
        Ok(())
    }

    /// Before the first tick all joints are at rest, so any rate is legal.
    fn begin_at_once(&mut self) {
        if !self.has_begun {
            self.rate.rate = self.asked();
        }
    }

    /// Moves on by `dt_s` \[s\], and returns how much of it passed before the joints were at rest.
    fn advance(&mut self, curve: &impl TimedCurve, dt_s: f64) -> f64 {
        self.has_begun |= dt_s > 0.0;
        if self.is_settled() {
            return self.run(dt_s);
        }
        let steps = (dt_s / SUBSTEP_S).ceil().clamp(1.0, f64::from(MAX_SUBSTEPS));
        let length_s = (dt_s / steps).min(MAX_SUBSTEP_S);
        let mut passed_s = 0.0;
        for step in 0..MAX_SUBSTEPS {
            let is_over = f64::from(step) >= steps || self.is_finished();
            if is_over || self.is_settled() {
                break;
            }
            passed_s += self.ramp(curve, length_s);
        }
        let left_s = dt_s - passed_s;
        if left_s > 1e-9 * length_s {
            passed_s += self.settle();
            passed_s += self.run((dt_s - passed_s).max(0.0));
        }
        self.end();
        passed_s
    }

    /// Follows the verified way back to its end, and returns how long that takes \[s\].
    fn settle(&mut self) -> f64 {
        let settle_s = self.rate.slope.abs() / self.way_back;
        if settle_s > 0.0 {
            self.go_back(settle_s, self.asked());
        }
        settle_s
    }

    fn is_settled(&self) -> bool {
        self.rate.slope == 0.0 && self.rate.rate == self.asked()
    }

    /// Moves on at a constant rate.
    fn run(&mut self, dt_s: f64) -> f64 {
        if self.rate.rate == 0.0 || self.is_finished() {
            return 0.0;
        }
        let left_s = (self.duration_s - self.rate.phase_s) / self.rate.rate;
        self.rate.phase_s += self.rate.rate * dt_s;
        self.end();
        dt_s.min(left_s)
    }

    /// Stays at exactly the end.
    fn end(&mut self) {
        if self.is_finished() {
            let rate = self.rate.rate;
            self.rate = Rate { phase_s: self.duration_s, rate, slope: 0.0 };
        }
    }

    /// One step toward the rate asked for: the strongest curvature after which the way back to a
    /// constant rate is still legal, else the next step of the way back that was verified before.
    fn ramp(&mut self, curve: &impl TimedCurve, length_s: f64) -> f64 {
        let phase_s = self.rate.phase_s;
        let passed_s = self.step(curve, length_s);
        // Rounding alone would go beyond.
        self.rate.rate = self.rate.rate.clamp(0.0, 1.0);
        self.rate.phase_s = self.rate.phase_s.max(phase_s);
        passed_s
    }

    fn step(&mut self, curve: &impl TimedCurve, length_s: f64) -> f64 {
        let asked = self.asked();
        let error = asked - self.rate.settled(self.way_back);
        if error.abs() > RATE_TOLERANCE {
            let mut legality = Legality {
                curve,
                limits: &self.limits,
                hint: self.hint,
                bounds: CurveBounds::EMPTY,
            };
            let found = strongest(&mut legality, self.rate, self.way_back, asked, length_s);
            if let Some((next, way_back)) = found {
                self.rate = next;
                self.way_back = way_back;
                return length_s;
            }
        }
        self.go_back(length_s, asked)
    }

    /// Follows the verified way back to a constant rate.
    fn go_back(&mut self, length_s: f64, asked: f64) -> f64 {
        let settle_s = self.rate.slope.abs() / self.way_back;
        let curvature = -self.way_back.copysign(self.rate.slope);
        let Rate { slope, .. } = self.rate;
        if settle_s > length_s {
            self.rate = self.rate.piece(curvature, length_s).end;
            return length_s;
        }
        if slope != 0.0 {
            self.rate = self.rate.piece(curvature, settle_s).end;
        }
        self.rate.slope = 0.0;
        if (self.rate.rate - asked).abs() <= RATE_TOLERANCE {
            self.rate.rate = asked;
        }
        let rest_s = length_s - settle_s;
        self.rate.phase_s += self.rate.rate * rest_s;
        if self.rate.rate == 0.0 { settle_s } else { length_s }
    }
}
