//! Jogs and homing.

use armada_model::JointVector;
use armada_protocol::messages::{
    Accepted, Denial, Executor, HomeParams, JogCartesianParams, JogFreespaceParams, JogJointParams,
    MotionKind,
};
use uuid::Uuid;

use super::{Asker, NewMotion, Requests};
use crate::control::{JogOrder, Order};

impl Requests {
    pub(super) async fn jog_freespace(
        &self,
        asker: Asker,
        params: JogFreespaceParams,
    ) -> Result<Accepted, Denial> {
        let answering = self.answering(params.wait)?;
        let fastest = self.limits.iter().map(|axis| axis.velocity).collect::<Vec<_>>();
        let fastest = JointVector::from_slice(&fastest).unwrap_or_default();
        let order = JogOrder {
            id: params.motion_id.unwrap_or_else(Uuid::now_v7),
            joint_position: params.joint_position_rad,
            max_velocity: params.max_velocity_rad_s.unwrap_or(fastest),
        };
        let motion = NewMotion {
            id: order.id,
            kind: MotionKind::JogFreespace,
            executor: Executor::Agent,
            duration_s: 0.0,
            waypoint_count: 0,
        };
        self.start_and(answering, &asker, motion, Order::Jog(order)).await
    }

    pub(super) async fn jog_joint(&self, _: Asker, _: JogJointParams) -> Result<Accepted, Denial> {
        Err(self.not_supported("jog_joint"))
    }

    pub(super) async fn jog_cartesian(
        &self,
        _: Asker,
        _: JogCartesianParams,
    ) -> Result<Accepted, Denial> {
        Err(self.not_supported("jog_cartesian"))
    }

    pub(super) async fn home(&self, _: Asker, _: HomeParams) -> Result<Accepted, Denial> {
        Err(self.not_supported("home"))
    }
}
