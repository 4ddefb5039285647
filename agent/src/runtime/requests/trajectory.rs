//! Trajectories, and what changes motions in progress.

use std::sync::Arc;

use armada_model::{
    CompiledTrajectory, JointTrajectory, MotionLimits, Tolerance, TrajectoryContext,
    TrajectoryOptions,
};
use armada_protocol::messages::{
    Accepted, CancelParams, Denial, DenialCode, Empty, ExecuteTrajectoryParams, Executor,
    LeaseLoss, MotionKind, MotionParams, SpeedRatioAnswer, SpeedRatioParams,
};
use uuid::Uuid;

use super::{Asker, LOOP_PATIENCE, NewMotion, Requests};
use crate::control::{FollowOrder, Order};
use crate::runtime::words::{trajectory_denial, wide_tolerance_denial};

/// Lowest speed of all motions over what they were planned for.
const MIN_SPEED_RATIO: f64 = 0.01;
/// Longest time a motion may go on without its lease \[s\].
const MAX_CONTINUE_S: f64 = 60.0;

impl Requests {
    pub(super) async fn execute_trajectory(
        &self,
        asker: Asker,
        params: ExecuteTrajectoryParams,
    ) -> Result<Accepted, Denial> {
        let answering = self.answering(params.wait)?;
        check_lease_loss(params.on_lease_loss)?;
        let trajectory = self.compile(&params.trajectory, &self.limits)?;
        let id = params.motion_id.unwrap_or_else(Uuid::now_v7);
        let order = FollowOrder {
            id,
            trajectory,
            start: None,
            epoch: None,
            kind: MotionKind::Trajectory,
            queue: params.queue,
            on_lease_loss: params.on_lease_loss,
            group: None,
        };
        let accepted = self.follow(&asker, order).await?;
        self.finish(accepted, answering).await
    }

    /// Hands a compiled trajectory to the loop.
    pub(super) async fn follow(
        &self,
        asker: &Asker,
        order: FollowOrder,
    ) -> Result<Accepted, Denial> {
        let motion = NewMotion {
            id: order.id,
            kind: order.kind,
            executor: Executor::Agent,
            duration_s: order.trajectory.duration_s(),
            waypoint_count: u32::try_from(order.trajectory.waypoint_count()).unwrap_or(u32::MAX),
        };
        self.start(asker, motion, Order::Follow(order)).await
    }

    pub(super) async fn cancel(&self, asker: Asker, params: CancelParams) -> Result<Empty, Denial> {
        if let Some(cancelled) = self.cancel_connected(&asker, params.motion_id).await {
            return cancelled.map(|()| Empty {});
        }
        self.ask(&asker, Order::Cancel(params.motion_id), LOOP_PATIENCE).await?;
        Ok(Empty {})
    }

    pub(super) async fn pause(&self, asker: Asker, params: MotionParams) -> Result<Empty, Denial> {
        self.ask(&asker, Order::Pause(params.motion_id), LOOP_PATIENCE).await?;
        Ok(Empty {})
    }

    pub(super) async fn resume(&self, asker: Asker, params: MotionParams) -> Result<Empty, Denial> {
        self.ask(&asker, Order::Resume(params.motion_id), LOOP_PATIENCE).await?;
        Ok(Empty {})
    }

    pub(super) async fn set_speed_ratio(
        &self,
        asker: Asker,
        params: SpeedRatioParams,
    ) -> Result<SpeedRatioAnswer, Denial> {
        let ratio = params.ratio;
        if !(MIN_SPEED_RATIO..=1.0).contains(&ratio) {
            return Err(Denial::new(
                DenialCode::OutOfRange,
                format!("ratio is {ratio}, expected {MIN_SPEED_RATIO} to 1"),
            )
            .with("field", "ratio")
            .with("value", ratio)
            .with("limit", if ratio > 1.0 { 1.0 } else { MIN_SPEED_RATIO }));
        }
        self.ask(&asker, Order::SetSpeedRatio(ratio), LOOP_PATIENCE).await?;
        Ok(SpeedRatioAnswer { speed_ratio: ratio })
    }

    pub(super) fn compile(
        &self,
        trajectory: &JointTrajectory,
        limits: &MotionLimits,
    ) -> Result<Arc<CompiledTrajectory>, Denial> {
        let context = TrajectoryContext {
            joint_order: &self.joint_names,
            joint_types: Some(&self.joint_types),
            limits,
        };
        let compiled =
            CompiledTrajectory::compile_for(trajectory, &context, &TrajectoryOptions::default())
                .map_err(|error| trajectory_denial(&error))?;
        self.check_tolerances(&compiled)?;
        Ok(Arc::new(compiled))
    }

    /// Refuses tolerances that the loop would not keep: wider than the robot's own.
    fn check_tolerances(&self, trajectory: &CompiledTrajectory) -> Result<(), Denial> {
        let names = &self.joint_names;
        for waypoint in 0..trajectory.waypoint_count() {
            let Tolerance { position, .. } = trajectory.tolerance(waypoint);
            let rows = position.iter().zip(self.params.tracking_tolerance.iter()).zip(names);
            for ((&value, &limit), joint) in rows {
                if value > limit {
                    return Err(wide_tolerance_denial(waypoint, joint, value, limit));
                }
            }
        }
        Ok(())
    }
}

/// Refuses a time to go on without a lease that is out of its range.
pub(super) fn check_lease_loss(reaction: LeaseLoss) -> Result<(), Denial> {
    match reaction {
        LeaseLoss::ContinueS(time_s) if !(time_s > 0.0 && time_s <= MAX_CONTINUE_S) => {
            Err(Denial::new(
                DenialCode::OutOfRange,
                format!(
                    "on_lease_loss.continue_s is {time_s}, expected above 0 to {MAX_CONTINUE_S}"
                ),
            )
            .with("field", "on_lease_loss")
            .with("value", time_s)
            .with("limit", MAX_CONTINUE_S))
        }
        _ => Ok(()),
    }
}
