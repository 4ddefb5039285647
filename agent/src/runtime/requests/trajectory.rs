//! Trajectories, and what changes motions in progress.

use std::sync::Arc;

use armada_model::{
    CompiledTrajectory, JointTrajectory, Tolerance, TrajectoryContext, TrajectoryOptions,
};
use armada_protocol::messages::{
    Accepted, CancelParams, Denial, Empty, ExecuteTrajectoryParams, Executor, MotionKind,
    MotionParams, SpeedRatioAnswer, SpeedRatioParams,
};
use uuid::Uuid;

use super::{Asker, LOOP_PATIENCE, NewMotion, Requests};
use crate::control::{FollowOrder, Order};
use crate::runtime::words::{trajectory_denial, velocity_tolerance_denial, wide_tolerance_denial};

impl Requests {
    pub(super) async fn execute_trajectory(
        &self,
        asker: Asker,
        params: ExecuteTrajectoryParams,
    ) -> Result<Accepted, Denial> {
        let trajectory = self.compile(&params.trajectory)?;
        let id = params.motion_id.unwrap_or_else(Uuid::now_v7);
        let order = FollowOrder {
            id,
            trajectory,
            start: None,
            epoch: None,
            kind: MotionKind::Trajectory,
            queue: params.queue,
            on_lease_loss: params.on_lease_loss,
        };
        self.follow(&asker, order).await
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

    pub(super) async fn pause(&self, _: Asker, _: MotionParams) -> Result<Empty, Denial> {
        Err(self.not_supported("pause"))
    }

    pub(super) async fn resume(&self, _: Asker, _: MotionParams) -> Result<Empty, Denial> {
        Err(self.not_supported("resume"))
    }

    pub(super) async fn set_speed_ratio(
        &self,
        _: Asker,
        _: SpeedRatioParams,
    ) -> Result<SpeedRatioAnswer, Denial> {
        Err(self.not_supported("set_speed_ratio"))
    }

    pub(super) fn compile(
        &self,
        trajectory: &JointTrajectory,
    ) -> Result<Arc<CompiledTrajectory>, Denial> {
        let context = TrajectoryContext {
            joint_order: &self.joint_names,
            joint_types: Some(&self.joint_types),
            limits: &self.limits,
        };
        let compiled =
            CompiledTrajectory::compile_for(trajectory, &context, &TrajectoryOptions::default())
                .map_err(|error| trajectory_denial(&error))?;
        self.check_tolerances(&compiled)?;
        Ok(Arc::new(compiled))
    }

    /// Refuses tolerances that the loop would not keep: wider than the robot's own, or of velocity.
    fn check_tolerances(&self, trajectory: &CompiledTrajectory) -> Result<(), Denial> {
        let names = &self.joint_names;
        for waypoint in 0..trajectory.waypoint_count() {
            let Tolerance { position, velocity, .. } = trajectory.tolerance(waypoint);
            if !velocity.is_empty() {
                return Err(velocity_tolerance_denial(waypoint));
            }
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
