//! How a trajectory is begun: whether it may be, the way to its first waypoint, the instant.

use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;

use armada_model::{CompiledTrajectory, JointVector, MonoTime, MotionLimits, MotionState};
use armada_protocol::messages::MotionKind;

use super::{Speed, TrajectoryMotion};
use crate::control::io::{FollowOrder, Params, Refusal};
use crate::control::motion::Next;
use crate::control::motion::course::Leg;
use crate::control::motion::lead_in::LeadIn;
use crate::control::state::Tick;

/// Speed of the way to the first waypoint, as a share of each joint's limit.
const LEAD_IN_SPEED: f64 = 0.1;
/// The same where the way may be long, since the trajectory took the place of another.
const REPLACING_SPEED: f64 = 0.5;

/// The way to the first waypoint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "the loop allocates nothing")]
pub(super) enum Opening {
    /// To be planned when the robot is at rest.
    Unplanned {
        /// At this share of the speed limits.
        share: f64,
        /// However long it is; else within the start tolerance.
        is_far: bool,
    },
    /// None if there is no distance.
    Planned(Option<LeadIn>),
}

/// Where a trajectory is begun.
#[derive(Clone, Copy, Debug)]
pub(in crate::control) struct StartPoint<'a> {
    /// The set-point held.
    pub(in crate::control) held: &'a MotionState,
    /// Measured positions.
    pub(in crate::control) measured: &'a JointVector,
}

impl TrajectoryMotion {
    /// Makes ready to follow, if the robot is where the trajectory begins and in time.
    pub(in crate::control::motion) fn plan(
        order: &FollowOrder,
        from: &StartPoint<'_>,
        speed: &Speed<'_>,
        limits: &MotionLimits,
        tick: &Tick<'_>,
    ) -> Result<Self, Refusal> {
        let first = order.trajectory.start();
        let tolerance = &tick.params.start_tolerance;
        check_near(&first, from.measured, tolerance)?;
        check_near(&first, &from.held.position, tolerance)?;
        let period = tick.params.period;
        let share = speed.lead_in(LEAD_IN_SPEED, limits);
        let lead_in = LeadIn::plan(&from.held.position, &first, share, limits, period)?;
        if let Some(start) = order.start {
            let earliest = tick.now + lead_in.as_ref().map_or(Duration::ZERO, |l| l.lead(period));
            check_in_time(start, earliest, period)
                .map_err(|late_s| Refusal::StartMissed { late_s })?;
        }
        let leg = Leg::new(Arc::clone(&order.trajectory));
        let opening = Opening::Planned(lead_in);
        let coupling = order.group.map(|group| group.coupling);
        let (start, patience) = (order.start, patience(order, period));
        let motion = Self::on(leg, order.kind, speed);
        Ok(Self { start, patience, opening, coupling, ..motion })
    }

    /// To be begun when the robot stands, from wherever that is.
    pub(in crate::control::motion) fn later(
        trajectory: Arc<CompiledTrajectory>,
        kind: MotionKind,
        speed: &Speed<'_>,
        is_far: bool,
        limits: &MotionLimits,
    ) -> Self {
        let share = if is_far { REPLACING_SPEED } else { LEAD_IN_SPEED };
        let opening = Opening::Unplanned { share: speed.lead_in(share, limits), is_far };
        Self { opening, ..Self::on(Leg::new(trajectory), kind, speed) }
    }

    /// What is to be done before clock zero, unless that is now.
    pub(super) fn before_start(
        &mut self,
        tick: &Tick<'_>,
        held: &MotionState,
        limits: &MotionLimits,
    ) -> Option<Next> {
        let (now, period) = (tick.now, tick.params.period);
        if let Opening::Unplanned { share, is_far } = self.opening {
            let first = self.course.leg.trajectory.start();
            // Where a move of the controller's own ended it only promised.
            let near = check_near(&first, &held.position, &tick.params.start_tolerance);
            let near = if is_far { Ok(()) } else { near };
            let plan = || LeadIn::plan(&held.position, &first, share, limits, period);
            match near.and_then(|()| plan()) {
                Ok(lead_in) => self.opening = Opening::Planned(lead_in),
                Err(refusal) => return Some(Next::Failed(refusal)),
            }
        }
        let under_way = self.is_under_way();
        // With partners from the instant on, else at the nearest tick.
        let early = if self.has_partners() { Duration::ZERO } else { period / 2 };
        let Opening::Planned(lead_in) = &mut self.opening else { return None };
        if !under_way {
            let lead = lead_in.as_ref().map_or(Duration::ZERO, |lead_in| lead_in.lead(period));
            if self.start.is_some_and(|start| now + lead + early < start) {
                return Some(Next::Waiting);
            }
        }
        if let Some(state) = lead_in.as_mut().and_then(|lead_in| lead_in.next(period)) {
            return Some(Next::Approaching(state));
        }
        let missed = self.start.and_then(|start| check_in_time(start, now, self.patience).err());
        missed.map(|late_s| Next::Failed(Refusal::StartMissed { late_s }))
    }
}

/// How late a start may be: those ahead of it wait, if it has partners.
fn patience(order: &FollowOrder, period: Duration) -> Duration {
    let apart_s = order.group.map_or(0.0, |group| group.max_divergence_s);
    Duration::try_from_secs_f64(apart_s).unwrap_or_default().max(period)
}

/// How late \[s\] a start at `now` would be for `start`, if that is too late.
fn check_in_time(start: MonoTime, now: MonoTime, patience: Duration) -> Result<(), f64> {
    let late = now.saturating_since(start);
    if late > patience { Err(late.as_secs_f64()) } else { Ok(()) }
}

pub(in crate::control::motion) fn check_near(
    first: &JointVector,
    actual: &JointVector,
    limits: &JointVector,
) -> Result<(), Refusal> {
    let joints = first.iter().zip(actual.iter()).zip(limits.iter());
    for (joint, ((first, actual), &limit)) in joints.enumerate() {
        let value = (first - actual).abs();
        if value > limit {
            return Err(Refusal::StartTolerance { joint, value, limit });
        }
    }
    Ok(())
}

/// Refuses a trajectory that does not suit the robot.
pub(in crate::control::motion) fn check_suits(
    order: &FollowOrder,
    params: &Params,
    measures_velocity: bool,
) -> Result<(), Refusal> {
    let (given, expected) = (order.trajectory.joint_count(), params.limits.len());
    if given != expected {
        return Err(Refusal::WrongLength { given, expected });
    }
    if order.trajectory.has_velocity_tolerance() && !measures_velocity {
        return Err(Refusal::NotSupported("measured speeds, which velocity_tolerance needs"));
    }
    Ok(())
}
