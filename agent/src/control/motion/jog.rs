//! Moves of all joints to a position.
//!
//! A jog may be given another goal on the way: the old motion ends as cancelled, and the new one
//! begins in the state of the old one's curve at the last tick, so that position, velocity and
//! acceleration are continuous. The same happens inside a motion when the speed ratio changes.
//!
//! Paused, it comes to rest on its way as a trajectory does; resumed, it goes on from that rest with
//! a way of its own, which is planned anew. A resume on the way to rest waits for the rest.

use armada_model::{
    JerkLimitedMove, JointMoveError, JointVector, MAX_ONLINE_VALUE, MotionLimits,
    MotionLimitsError, OnPath, OnlineError, OnlineOptions, OnlineState, Synchronisation,
};
use serde::{Deserialize, Serialize};

use super::{Drive, Next};
use crate::control::io::Refusal;

/// A move of all joints to a position, on its way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct JogMotion {
    plan: JerkLimitedMove,
    goal: JointVector,
    /// Limits of the motion at a speed ratio of 1.
    limits: MotionLimits,
    speed_ratio: f64,
    /// Set-points sent of this plan.
    ticks: u64,
    /// Time of the plans before it \[s\].
    before_s: f64,
    paused: bool,
    /// The plan on its way to a pause, or at it, and the state there.
    brake: Option<(OnPath, OnlineState)>,
}

impl JogMotion {
    /// Plans the move from `start` to `goal`, if that is within the limits.
    ///
    /// `max_velocity` lowers the limits' velocities; empty, it leaves them.
    pub(in crate::control) fn plan(
        start: &OnlineState,
        goal: &JointVector,
        max_velocity: &JointVector,
        limits: &MotionLimits,
        speed_ratio: f64,
    ) -> Result<Self, Refusal> {
        check_length(goal, limits)?;
        for (joint, (&value, axis)) in goal.iter().zip(limits.iter()).enumerate() {
            if !axis.contains(value) {
                return Err(Refusal::OutOfRange { joint, value, limit: axis.nearer_limit(value) });
            }
        }
        let limits = if max_velocity.is_empty() {
            *limits
        } else {
            limits.with_max_velocity(max_velocity).map_err(speed_refusal)?
        };
        let plan = plan(start, goal, &limits, speed_ratio)?;
        let (ticks, before_s, paused, brake) = (0, 0.0, false, None);
        Ok(Self { plan, goal: *goal, limits, speed_ratio, ticks, before_s, paused, brake })
    }

    /// The state of the curve at the last set-point.
    pub(in crate::control) fn state(&self, period_s: f64) -> OnlineState {
        match &self.brake {
            Some((_, state)) => *state,
            None => self.plan.at(self.time_s(period_s)),
        }
    }

    pub(super) fn elapsed_s(&self, period_s: f64) -> f64 {
        self.before_s + self.time_s(period_s).min(self.plan.duration_s())
    }

    pub(super) const fn duration_s(&self) -> f64 {
        self.before_s + self.plan.duration_s()
    }

    pub(super) const fn is_paused(&self) -> bool {
        self.paused
    }

    /// How fast its clock runs.
    pub(super) fn rate(&self) -> f64 {
        self.brake.as_ref().map_or(1.0, |(path, _)| path.rate())
    }

    /// Comes to rest on its way, or goes on; returns whether that is a change.
    pub(super) const fn set_paused(&mut self, paused: bool) -> bool {
        let changed = self.paused != paused;
        self.paused = paused;
        changed
    }

    pub(super) fn next(&mut self, drive: &Drive<'_>) -> Next {
        // Before its first set-point it is where another jog was, perhaps in motion.
        if self.paused && self.brake.is_none() && self.ticks > 0 {
            self.begin_brake(drive.period_s);
        }
        match self.brake_step(drive) {
            Some(next) => next,
            None => self.go_on(drive),
        }
    }

    fn begin_brake(&mut self, period_s: f64) {
        let (time_s, state) = (self.time_s(period_s), self.state(period_s));
        // Never refused: as many joints as there are limits.
        if let Ok(mut path) = OnPath::join(&self.plan, &self.limits, time_s) {
            let _ = path.pause();
            self.brake = Some((path, state));
        }
    }

    /// The next state on the way to a pause and at it; none if it goes on.
    fn brake_step(&mut self, drive: &Drive<'_>) -> Option<Next> {
        let (path, state) = self.brake.as_mut()?;
        if !self.paused && path.is_at_rest() {
            let rest = OnlineState::at_rest(state.position);
            return match plan(&rest, &self.goal, &self.limits, drive.speed_ratio) {
                Ok(plan) => {
                    self.before_s = self.elapsed_s(drive.period_s);
                    (self.plan, self.speed_ratio, self.ticks) = (plan, drive.speed_ratio, 0);
                    self.brake = None;
                    None
                }
                Err(refusal) => Some(Next::Failed(refusal)),
            };
        }
        *state = path.tick(&self.plan, drive.period_s).state;
        let motion = state.motion_state();
        Some(if path.is_finished() { Next::Last(motion) } else { Next::Moving(motion) })
    }

    fn go_on(&mut self, drive: &Drive<'_>) -> Next {
        if drive.speed_ratio != self.speed_ratio {
            self.change_speed(drive);
        }
        self.ticks += 1;
        let state = self.state(drive.period_s).motion_state();
        if self.time_s(drive.period_s) >= self.plan.duration_s() {
            Next::Last(state)
        } else {
            Next::Moving(state)
        }
    }

    /// Plans the rest of the way anew. Where that fails, which is rare, the old plan goes on and
    /// it is tried again at the next tick.
    fn change_speed(&mut self, drive: &Drive<'_>) {
        let here = self.state(drive.period_s);
        if let Ok(changed) = plan(&here, &self.goal, &self.limits, drive.speed_ratio) {
            self.before_s = self.elapsed_s(drive.period_s);
            (self.plan, self.speed_ratio, self.ticks) = (changed, drive.speed_ratio, 0);
        }
    }

    fn time_s(&self, period_s: f64) -> f64 {
        match &self.brake {
            Some((path, _)) => path.phase_s(),
            None => self.ticks as f64 * period_s,
        }
    }
}

fn plan(
    start: &OnlineState,
    goal: &JointVector,
    limits: &MotionLimits,
    speed_ratio: f64,
) -> Result<JerkLimitedMove, Refusal> {
    let slowed = goal
        .map_indexed(|joint, _| limits.get(joint).map_or(0.0, |axis| speed_ratio * axis.velocity));
    let limits = limits.with_max_velocity(&slowed).map_err(speed_refusal)?;
    let options = OnlineOptions { synchronisation: Synchronisation::Phase, ..Default::default() };
    let goal = OnlineState::at_rest(*goal);
    JerkLimitedMove::plan(start, &goal, &limits, &options).map_err(plan_refusal)
}

/// A refused plan in the loop's words.
fn plan_refusal(error: OnlineError) -> Refusal {
    match error {
        OnlineError::JointCount { len, expected, .. } => {
            Refusal::WrongLength { given: len, expected }
        }
        OnlineError::TargetBeyondLimit { joint, value, limit, .. }
        | OnlineError::OvershootBeyondLimit { joint, value, limit } => {
            Refusal::OutOfRange { joint, value, limit }
        }
        OnlineError::NotUsable { joint, value, .. } => {
            Refusal::OutOfRange { joint, value, limit: MAX_ONLINE_VALUE }
        }
        // From a state a little later there is a plan: to ask again is what helps.
        OnlineError::NoProfile { .. } | OnlineError::MinimumDuration { .. } => Refusal::StillMoving,
    }
}

fn speed_refusal(error: MotionLimitsError) -> Refusal {
    match error {
        MotionLimitsError::VelocityAboveLimit { joint, value, limit } => {
            Refusal::OutOfRange { joint, value, limit }
        }
        MotionLimitsError::NotPositive { joint, value, .. } => {
            Refusal::OutOfRange { joint, value, limit: 0.0 }
        }
        MotionLimitsError::VelocityCount { len, expected } => {
            Refusal::WrongLength { given: len, expected }
        }
        // Of the limits themselves, which were found complete when the loop began.
        MotionLimitsError::JointCount { len } => Refusal::WrongLength { given: len, expected: len },
        MotionLimitsError::AccelerationMissing { joint }
        | MotionLimitsError::PositionRange { joint, .. } => {
            Refusal::OutOfRange { joint, value: f64::NAN, limit: 0.0 }
        }
    }
}

/// Refuses a vector that does not have one value for each joint.
fn check_length(vector: &JointVector, limits: &MotionLimits) -> Result<(), Refusal> {
    let (given, expected) = (vector.len(), limits.len());
    if given == expected { Ok(()) } else { Err(Refusal::WrongLength { given, expected }) }
}

/// A refused plan of a slow way in the loop's words.
pub(super) fn move_refusal(error: JointMoveError) -> Refusal {
    match error {
        JointMoveError::JointCount { len, expected, .. } => {
            Refusal::WrongLength { given: len, expected }
        }
        JointMoveError::TargetBeyondLimit { joint, value, limit }
        | JointMoveError::OvershootBeyondLimit { joint, value, limit } => {
            Refusal::OutOfRange { joint, value, limit }
        }
        JointMoveError::Profile { joint, .. } => {
            Refusal::OutOfRange { joint, value: f64::NAN, limit: 0.0 }
        }
    }
}
