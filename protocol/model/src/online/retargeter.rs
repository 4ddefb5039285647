//! A target that changes while the joints move.

use super::generator::OnlineGenerator;
use super::jerk_limited::JerkLimitedMove;
use super::request::{OnlineError, OnlineOptions, OnlineState};
use super::ruckig::RuckigGenerator;
use super::stop::JerkLimitedStop;
use crate::MotionLimits;
use serde::{Deserialize, Serialize};

/// Follows a target that may change at any instant, with limited jerk, for a control loop.
///
/// ```text
///   new: stops ---retarget---> follows the motion to the target ---> at rest
///                                ^    |        |
///                                +----+        +--stop--> stops ---> at rest
///              retarget: from the state of this instant; refused: the motion goes on
/// ```
///
/// There is always a motion, and every motion ends at rest inside the limits: the first is the stop
/// from the state it was made with. A retarget that is refused, or for which the generator fails,
/// changes nothing. The set-points are samples of one curve with continuous acceleration and
/// limited jerk, taken at the real time of each tick: late ticks leave no error. Nothing allocates,
/// nothing panics.
///
/// ```
/// # use armada_model::{JointLimits, JointVector, MotionLimits, OnlineOptions, OnlineState, Retargeter};
/// # let joint = JointLimits {
/// #     velocity: 1.0, acceleration: Some(2.0), jerk: Some(40.0), ..JointLimits::default()
/// # };
/// # let limits = MotionLimits::new(&[joint])?;
/// let at = |x: f64| Ok::<_, armada_model::JointVectorError>(
///     OnlineState::at_rest(JointVector::from_slice(&[x])?)
/// );
/// let mut joints = Retargeter::new(&at(0.0)?, &limits, OnlineOptions::default())?;
/// joints.retarget(&at(1.0)?)?;
/// for _ in 0..300 {
///     joints.tick(0.001); // the position to send is in what it returns
/// }
/// joints.retarget(&at(-0.5)?)?;
/// assert_eq!(joints.tick(10.0), at(-0.5)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Retargeter<G = RuckigGenerator> {
    /// Holds nothing that outlives a plan.
    #[serde(skip)]
    generator: G,
    limits: MotionLimits,
    options: OnlineOptions,
    target: Option<OnlineState>,
    /// The motion under way, and where the next one is planned: nothing large is moved.
    motions: [JerkLimitedMove; 2],
    active: usize,
    elapsed_s: f64,
    failures: u64,
}

impl Retargeter {
    /// Stops from `state`, until there is a target.
    ///
    /// # Errors
    /// As [`JerkLimitedStop::plan`], for `state`.
    pub fn new(
        state: &OnlineState,
        limits: &MotionLimits,
        options: OnlineOptions,
    ) -> Result<Self, OnlineError> {
        Self::with_generator(RuckigGenerator::default(), state, limits, options)
    }
}

impl<G: OnlineGenerator> Retargeter<G> {
    /// As [`new`](Retargeter::new), with another generator.
    ///
    /// # Errors
    /// As [`JerkLimitedStop::plan`], for `state`.
    pub fn with_generator(
        generator: G,
        state: &OnlineState,
        limits: &MotionLimits,
        options: OnlineOptions,
    ) -> Result<Self, OnlineError> {
        JerkLimitedStop::plan(state, limits)?;
        let motion = JerkLimitedMove::stop(state, limits);
        let (limits, elapsed_s) = (*limits, 0.0);
        let motions = [motion, JerkLimitedMove::empty()];
        let (target, active, failures) = (None, 0, 0);
        Ok(Self { generator, limits, options, target, motions, active, elapsed_s, failures })
    }

    /// Goes to `target` from the state of this instant.
    ///
    /// # Errors
    /// As [`JerkLimitedMove::plan`]; the motion under way then goes on.
    /// [`OnlineError::NoProfile`] is counted in [`failures`](Self::failures).
    pub fn retarget(&mut self, target: &OnlineState) -> Result<(), OnlineError> {
        let state = self.state();
        let planned = self.motions[1 - self.active].replan(
            &mut self.generator,
            &state,
            target,
            &self.limits,
            &self.options,
        );
        match planned {
            Ok(()) => {
                self.active = 1 - self.active;
                self.elapsed_s = 0.0;
                self.target = Some(*target);
                Ok(())
            }
            Err(error) => {
                let failed = matches!(error, OnlineError::NoProfile { .. });
                self.failures = self.failures.saturating_add(u64::from(failed));
                Err(error)
            }
        }
    }

    /// Stops all joints in the least time, see [`JerkLimitedStop`]; never refused.
    pub fn stop(&mut self) {
        self.motions[self.active] = JerkLimitedMove::stop(&self.state(), &self.limits);
        self.elapsed_s = 0.0;
        self.target = None;
    }

    /// Takes other limits from now on, and goes to the same target under them. Where they are lower
    /// than the motion is now, it recovers as [`JerkLimitedMove`] says.
    ///
    /// # Errors
    /// [`OnlineError::JointCount`] if they are for another number of joints; nothing has changed
    /// then. As [`retarget`](Self::retarget) if the target cannot be reached under the new limits;
    /// the joints then stop under them.
    pub fn set_limits(&mut self, limits: &MotionLimits) -> Result<(), OnlineError> {
        let (len, expected) = (limits.len(), self.limits.len());
        if len != expected {
            return Err(OnlineError::JointCount { field: "limits", len, expected });
        }
        self.limits = *limits;
        let replanned = match self.target {
            Some(target) if !self.is_at_rest() => self.retarget(&target),
            Some(_) | None => Ok(()),
        };
        if self.target.is_none() || replanned.is_err() {
            self.stop();
        }
        replanned
    }

    /// The state `dt_s` \[s\] after the last one. Any time is good; a negative one and not a number
    /// count as none.
    pub fn tick(&mut self, dt_s: f64) -> OnlineState {
        // Time stands still at rest, so that it keeps its digits however long that is.
        self.elapsed_s = (self.elapsed_s + dt_s.max(0.0)).min(self.motion().rest_s());
        self.state()
    }

    /// The state of the last tick.
    #[must_use]
    pub fn state(&self) -> OnlineState {
        self.motion().at(self.elapsed_s)
    }

    /// What the joints go to, if not to a stop.
    #[must_use]
    pub const fn target(&self) -> Option<&OnlineState> {
        self.target.as_ref()
    }

    /// How long until all joints are at rest, if nothing changes \[s\].
    #[must_use]
    pub fn remaining_s(&self) -> f64 {
        self.motion().rest_s() - self.elapsed_s
    }

    /// Whether all joints are at rest and stay there, if nothing changes.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.elapsed_s >= self.motion().rest_s()
    }

    /// How often the generator found no profile for a legal target. Worth a metric: it is rare.
    #[must_use]
    pub const fn failures(&self) -> u64 {
        self.failures
    }

    #[cfg(test)]
    pub(super) const fn generator_mut(&mut self) -> &mut G {
        &mut self.generator
    }

    /// The motion under way; `active` is 0 or 1.
    const fn motion(&self) -> &JerkLimitedMove {
        &self.motions[self.active]
    }
}
