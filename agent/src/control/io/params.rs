//! What does not change while a loop runs.

use std::sync::Arc;
use std::time::Duration;

use armada_model::{JointLimits, JointVector, JointVectorError};
use armada_protocol::messages::{OperationalMode, ReducedLimits};
use serde::{Deserialize, Serialize};

use crate::control::equipment::Equipment;
use crate::control::values::ValueSlot;

/// What does not change while a loop runs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Params {
    /// Limits of each joint; acceleration is always given.
    pub limits: Vec<JointLimits>,
    /// Period of the loop.
    pub period: Duration,
    /// Feedback older than this is a loss of communication.
    pub communication_timeout: Duration,
    /// How far the robot may be from where a trajectory begins, each joint \[rad or m\].
    pub start_tolerance: JointVector,
    /// How far measured may be from commanded position (lag allowed for), each joint \[rad or m\].
    pub tracking_tolerance: JointVector,
    /// How far behind its set-point the robot is when it follows well.
    pub tracking_lag: Duration,
    /// Measured speed below which a joint stands still, each joint \[1/s\].
    pub standstill_velocity: JointVector,
    /// How long it must be below.
    pub standstill_hold: Duration,
    /// How long the controller has to do what it is asked: switch drives, clear errors, take or
    /// end a move of its own.
    pub request_timeout: Duration,
    /// How long the controller may search the references of one group of joints.
    pub homing_timeout: Duration,
    /// Whether drives are switched on once, when the controller first answers.
    pub enable_on_start: bool,
    /// Whether modes are entered and motions are begun under a lease only.
    pub lease_required: bool,
    /// Limits of each joint at reduced speed.
    pub reduced: Vec<ReducedLimits>,
    /// Home position of each joint \[rad or m\], where the robot has one.
    pub home: Vec<Option<f64>>,
    /// The operational mode, if the controller does not report one.
    pub operational_mode: OperationalMode,
    /// What the controller can do besides following set-points.
    pub abilities: LoopAbilities,
    /// Whether single moves are left to the controller, if it can and nobody says otherwise.
    pub delegates: bool,
    /// The chains with their tools at the start.
    #[serde(with = "crate::control::shared")]
    pub equipment: Arc<Equipment>,
    /// Where the feedback shows each signal of the controller.
    pub signals: Vec<ValueSlot>,
    /// Where the feedback shows each parameter of the controller.
    pub parameters: Vec<ValueSlot>,
    /// Silence of a stream after which the robot decelerates, at the latest.
    pub stream_timeout: Duration,
    /// Highest age of the state that a sample of a stream was made for.
    pub stream_max_age: Duration,
    /// How long a stop may take to measured standstill before its level is raised.
    pub stop_time: Duration,
    /// Which number of the feedback's signals shows that somebody at the arm acknowledges, if one
    /// does.
    pub acknowledge: Option<usize>,
}

impl Params {
    /// Parameters of a robot with these joints and this period, every other one a common value:
    /// tolerances of 0.02 and 0.1, no chains, no abilities of the controller.
    ///
    /// # Errors
    /// [`JointVectorError`] if there are more joints than a robot may have.
    pub fn for_joints(
        limits: Vec<JointLimits>,
        period: Duration,
    ) -> Result<Self, JointVectorError> {
        let each = |value: f64| JointVector::from_slice(&vec![value; limits.len()]);
        let reduced = limits.iter().map(|joint| ReducedLimits {
            velocity: REDUCED_SHARE * joint.velocity,
            acceleration: joint.acceleration.unwrap_or_default(),
        });
        let stop_time = default_stop_time(&limits);
        Ok(Self {
            start_tolerance: each(0.02)?,
            tracking_tolerance: each(0.1)?,
            standstill_velocity: each(0.01)?,
            reduced: reduced.collect(),
            home: vec![None; limits.len()],
            limits,
            period,
            communication_timeout: (period * 4).max(Duration::from_millis(100)),
            tracking_lag: period * 2,
            standstill_hold: Duration::from_millis(100),
            request_timeout: Duration::from_secs(5),
            homing_timeout: Duration::from_secs(60),
            enable_on_start: false,
            lease_required: false,
            operational_mode: OperationalMode::Undefined,
            abilities: LoopAbilities::default(),
            delegates: false,
            equipment: Arc::default(),
            signals: Vec::new(),
            parameters: Vec::new(),
            stream_timeout: Duration::from_millis(40),
            stream_max_age: Duration::from_millis(100),
            stop_time,
            acknowledge: None,
        })
    }
}

/// How long a stop may take if nobody says so: twice the ramp from full speed of the joint that takes
/// longest, and a second for the robot's lag and the proof that it stands.
#[must_use]
pub fn default_stop_time(limits: &[JointLimits]) -> Duration {
    let ramp = |joint: &JointLimits| joint.velocity / joint.acceleration.unwrap_or(joint.velocity);
    let longest_s = limits.iter().map(ramp).filter(|time| time.is_finite()).fold(0.0, f64::max);
    Duration::try_from_secs_f64(2.0 * longest_s + 1.0).unwrap_or(MAX_STOP_TIME).min(MAX_STOP_TIME)
}

/// Longest time that a stop may take.
pub const MAX_STOP_TIME: Duration = Duration::from_secs(60);

/// Speed at reduced speed over the joint's limit, if nothing else is said.
pub const REDUCED_SHARE: f64 = 0.25;

/// What a controller can do besides following set-points, as far as the loop asks for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoopAbilities {
    /// It can search the references of its joints.
    pub homing: bool,
    /// It makes moves of its own to joint positions.
    pub move_joint: bool,
    /// It makes moves of its own to poses.
    pub move_pose: bool,
    /// It makes straight moves of its own.
    pub move_linear: bool,
    /// Its own moves can be paused and slowed down.
    pub pause: bool,
    /// It takes the load of tool and payload.
    pub load: bool,
}
