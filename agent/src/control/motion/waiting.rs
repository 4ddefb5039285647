//! What waits for the end of another motion.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use armada_model::{CompiledTrajectory, JointVector};
use armada_protocol::messages::{
    ActionStatus, Executor, LeaseLoss, MotionKind, MotionProgress, Queue,
};
use uuid::Uuid;

use super::course::Leg;
use super::delegated::{DelegatedMotion, end_of};
use super::trajectory::TrajectoryMotion;
use super::{Motion, Source};
use crate::control::io::{DelegateOrder, FollowOrder, MotionReport, Refusal, Retired};
use crate::control::state::Tick;
use crate::drivers::DelegatedMove;

/// A motion that waits for the end of another.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) enum Queued {
    /// The loop's own.
    Trajectory(Waiting),
    /// The controller's.
    Delegated(WaitingMove),
}

/// A trajectory that waits.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct Waiting {
    pub(super) id: Uuid,
    pub(super) kind: MotionKind,
    #[serde(with = "crate::control::shared")]
    pub(super) trajectory: Arc<CompiledTrajectory>,
    pub(super) blended: bool,
    /// The lease it was ordered under.
    lease: Option<Uuid>,
    on_lease_loss: LeaseLoss,
}

/// A move of the controller's own that waits.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct WaitingMove {
    id: Uuid,
    kind: MotionKind,
    order: DelegatedMove,
    /// The lease it was ordered under.
    lease: Option<Uuid>,
    on_lease_loss: LeaseLoss,
}

impl Queued {
    pub(super) const fn id(&self) -> Uuid {
        match self {
            Self::Trajectory(waiting) => waiting.id,
            Self::Delegated(waiting) => waiting.id,
        }
    }

    /// Where the joints are at its end, if that is known.
    pub(super) fn end(&self) -> Option<JointVector> {
        match self {
            Self::Trajectory(waiting) => Some(waiting.trajectory.end()),
            Self::Delegated(waiting) => end_of(&waiting.order),
        }
    }

    pub(super) const fn set_lease(&mut self, lease: Option<Uuid>) {
        match self {
            Self::Trajectory(waiting) => waiting.lease = lease,
            Self::Delegated(waiting) => waiting.lease = lease,
        }
    }

    pub(super) fn report(&self, status: ActionStatus, reason: Option<Refusal>) -> MotionReport {
        match self {
            Self::Trajectory(waiting) => waiting.report(status, reason),
            Self::Delegated(waiting) => {
                let WaitingMove { id, kind, .. } = *waiting;
                report((id, kind, Executor::Controller), status, reason, 1.0)
            }
        }
    }

    /// Gives back what it holds on the heap.
    pub(super) fn retire(self, tick: &mut Tick<'_>) {
        if let Self::Trajectory(waiting) = self {
            tick.retire(Retired::Trajectory(waiting.trajectory));
        }
    }
}

impl Waiting {
    pub(super) fn new(order: FollowOrder) -> Self {
        Self {
            id: order.id,
            kind: order.kind,
            trajectory: order.trajectory,
            blended: order.queue == Queue::AppendBlended,
            lease: None,
            on_lease_loss: order.on_lease_loss,
        }
    }

    pub(super) fn leg(&self) -> Leg {
        Leg::new(Arc::clone(&self.trajectory))
    }

    pub(super) fn report(&self, status: ActionStatus, reason: Option<Refusal>) -> MotionReport {
        let who = (self.id, self.kind, Executor::Agent);
        report(who, status, reason, self.trajectory.duration_s())
    }

    pub(super) fn motion(&self, trajectory: TrajectoryMotion) -> Motion {
        let mut motion = Motion::new(self.id, Source::Trajectory(trajectory));
        motion.lease = self.lease;
        motion.queued = true;
        motion.on_lease_loss(self.on_lease_loss)
    }
}

impl WaitingMove {
    pub(super) const fn new(order: &DelegateOrder) -> Self {
        let DelegateOrder { id, kind, order, on_lease_loss, .. } = *order;
        Self { id, kind, order, lease: None, on_lease_loss }
    }

    /// The motion, still to be handed over; `queued` tells whether it was said that it waits.
    pub(super) fn motion(&self, queued: bool) -> Motion {
        let delegated = DelegatedMotion::new(self.kind, self.order);
        let mut motion = Motion::new(self.id, Source::Delegated(delegated));
        (motion.lease, motion.queued) = (self.lease, queued);
        motion.on_lease_loss(self.on_lease_loss)
    }
}

fn report(
    (id, kind, executor): (Uuid, MotionKind, Executor),
    status: ActionStatus,
    reason: Option<Refusal>,
    duration_s: f64,
) -> MotionReport {
    let progress = MotionProgress {
        id,
        elapsed_s: 0.0,
        duration_s,
        waypoint: 0,
        rate: 0.0,
        paused: false,
        queued: 0,
    };
    MotionReport { id, kind, executor, status, reason, started: None, progress, group: None }
}
