//! What the loop remembers from tick to tick, and the few ways to change it.

use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;

use armada_model::{JointVector, MonoTime, MotionLimits, MotionLimitsError};
use armada_protocol::messages::{CommandMode, OperationalMode};
use arrayvec::ArrayVec;

use super::acknowledge::Acknowledgement;
use super::authority::Authority;
use super::controller::Controller;
use super::equipment::{Equipment, Owed};
use super::group::GroupMachine;
use super::io::{Granted, LoopEvent, LoopFault, MAX_QUEUED, Output, Params, Refusal, Retired};
use super::limit::Limiter;
use super::motion::{Brake, End, Motion, OwnMotion, Queued};
use super::standstill::Standstill;
use super::stop::Stop;
use super::stream::Stream;
use super::tracking::Tracking;
use super::values::PendingValues;
use super::verify::Condition;

/// Most faults that can be latched: one of each kind.
pub(super) const MAX_FAULTS: usize = 11;

/// What the loop remembers from tick to tick.
#[derive(Debug, Serialize, Deserialize)]
pub struct LoopState {
    pub(super) limits: MotionLimits,
    /// Limits at reduced speed; see [`limits_in_force`](Self::limits_in_force).
    pub(super) reduced: MotionLimits,
    pub(super) seqno: u64,
    /// Changed by [`raise_epoch`](Self::raise_epoch) only.
    pub(super) epoch: u64,
    /// Changed by [`change_mode`](Self::change_mode) only.
    pub(super) mode: CommandMode,
    pub(super) condition: Condition,
    /// Latched faults, oldest first.
    pub(super) faults: ArrayVec<LoopFault, MAX_FAULTS>,
    pub(super) stop: Stop,
    pub(super) authority: Authority,
    pub(super) controller: Controller,
    pub(super) standstill: Standstill,
    pub(super) tracking: Tracking,
    pub(super) limiter: Limiter,
    /// Where the robot is held while neither ramp nor motion is in progress.
    pub(super) hold: JointVector,
    pub(super) ramp: Option<Brake>,
    pub(super) motion: Option<Motion>,
    pub(super) stream: Stream,
    /// What waits for its end, in order; empty if there is no motion.
    pub(super) queue: ArrayVec<Queued, MAX_QUEUED>,
    /// What the controller is told about motions that it makes itself.
    pub(super) own_motion: OwnMotion,
    /// Speed of all motions, 0.01 to 1.
    pub(super) speed_ratio: f64,
    /// The chains with their tools.
    #[serde(with = "crate::control::shared")]
    pub(super) equipment: Arc<Equipment>,
    pub(super) owed_loads: Owed,
    pub(super) owed_tools: Owed,
    pub(super) values: PendingValues,
    pub(super) acknowledgement: Acknowledgement,
    /// The motion of several robots that this one takes part in, until all know that it has ended.
    pub(super) group: Option<GroupMachine>,
}

/// Why a loop cannot run with its parameters.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A joint's limits are not complete or make no sense.
    #[error(transparent)]
    Limits(#[from] MotionLimitsError),
    /// A vector does not have one positive, finite value per joint.
    #[error("{field} has {len} values, expected one above 0 for each of {expected} joints")]
    JointValues {
        /// Which vector.
        field: &'static str,
        /// Number of its values.
        len: usize,
        /// Number of joints.
        expected: usize,
    },
    /// The period is zero or longer than the communication timeout.
    #[error("period is {period:?}, expected above 0 and at most the timeout of {limit:?}")]
    Period {
        /// The period.
        period: Duration,
        /// The communication timeout.
        limit: Duration,
    },
}

/// What the phases of one tick share.
pub(super) struct Tick<'a> {
    pub(super) params: &'a Params,
    pub(super) now: MonoTime,
    pub(super) loop_error: bool,
    /// Whether the stop gate is closed.
    pub(super) stopped: bool,
    pub(super) output: &'a mut Output,
}

impl Tick<'_> {
    pub(super) fn event(&mut self, event: LoopEvent) {
        let pushed = self.output.events.try_push(event);
        // `MAX_EVENTS` says why there is room; the tests look for a tick that needs more.
        debug_assert!(pushed.is_ok(), "more events in a tick than MAX_EVENTS");
    }

    pub(super) fn answer(&mut self, ticket: u64, result: Result<Granted, Refusal>) {
        self.event(LoopEvent::Answer { ticket, result });
    }

    /// Gives something on the heap back, so that it is not freed in the loop.
    pub(super) fn retire(&mut self, retired: Retired) {
        let pushed = self.output.retired.try_push(retired);
        debug_assert!(pushed.is_ok(), "more is given back in a tick than MAX_RETIRED");
    }

    pub(super) const fn period_s(&self) -> f64 {
        self.params.period.as_secs_f64()
    }
}

impl LoopState {
    /// The state before the first tick: `invalid_state`, nothing known of the robot.
    ///
    /// # Errors
    /// [`ParamsError::Limits`] if a limit is missing or makes no sense,
    /// [`ParamsError::JointValues`] if a tolerance or the standstill velocity does not have one
    /// value above zero per joint,
    /// [`ParamsError::Period`] if the period is zero or longer than the communication timeout.
    pub fn new(params: &Params) -> Result<Self, ParamsError> {
        let limits = MotionLimits::new(&params.limits)?;
        let reduced = params.limits_in(OperationalMode::ManualReducedSpeed)?;
        let expected = limits.len();
        for (field, vector) in [
            ("start_tolerance", &params.start_tolerance),
            ("tracking_tolerance", &params.tracking_tolerance),
            ("standstill_velocity", &params.standstill_velocity),
        ] {
            let sensible = vector.iter().all(|&value| value.is_finite() && value > 0.0);
            if vector.len() != expected || !sensible {
                return Err(ParamsError::JointValues { field, len: vector.len(), expected });
            }
        }
        let (period, limit) = (params.period, params.communication_timeout);
        if period.is_zero() || period > limit {
            return Err(ParamsError::Period { period, limit });
        }
        Ok(Self {
            limits,
            reduced,
            seqno: 0,
            epoch: 0,
            mode: CommandMode::InvalidState,
            condition: Condition::default(),
            faults: ArrayVec::new(),
            stop: Stop::default(),
            authority: Authority::default(),
            controller: Controller::default(),
            standstill: Standstill::default(),
            tracking: Tracking::new(params),
            limiter: Limiter::new(&limits, params.period),
            hold: JointVector::EMPTY,
            ramp: None,
            motion: None,
            stream: Stream::new(params),
            queue: ArrayVec::new(),
            own_motion: OwnMotion::default(),
            speed_ratio: 1.0,
            equipment: Arc::clone(&params.equipment),
            owed_loads: Owed::ALL,
            owed_tools: Owed::ALL,
            values: PendingValues::default(),
            acknowledgement: Acknowledgement::default(),
            group: None,
        })
    }

    pub(super) const fn granted(&self) -> Granted {
        Granted { epoch: self.epoch, command_mode: self.mode }
    }

    /// Raises the epoch, which ends the motion and the stream of the epoch before.
    pub(super) fn raise_epoch(&mut self, tick: &mut Tick<'_>, end: End) {
        self.epoch += 1;
        self.end_motion(tick, end);
        self.end_stream(tick);
        self.decelerate(tick);
        if end.is_urgent() {
            self.hurry(tick, end);
        }
    }

    /// Enters `mode` in a new epoch; `end` is what becomes of the motion of the old one.
    pub(super) fn change_mode(&mut self, tick: &mut Tick<'_>, mode: CommandMode, end: End) {
        self.raise_epoch(tick, end);
        self.enter(tick, mode);
    }

    fn enter(&mut self, tick: &mut Tick<'_>, mode: CommandMode) {
        let from = std::mem::replace(&mut self.mode, mode);
        if from != mode {
            tick.event(LoopEvent::Mode { from, to: mode });
        }
    }
}
