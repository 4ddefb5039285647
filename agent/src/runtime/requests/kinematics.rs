//! Forward and inverse kinematics.

use armada_protocol::messages::{
    Denial, ForwardKinematicsAnswer, ForwardKinematicsParams, InverseKinematicsAnswer,
    InverseKinematicsParams,
};

use super::{Asker, Requests};

impl Requests {
    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn forward_kinematics(
        &self,
        _: Asker,
        _: ForwardKinematicsParams,
    ) -> Result<ForwardKinematicsAnswer, Denial> {
        Err(self.not_supported("forward_kinematics"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn inverse_kinematics(
        &self,
        _: Asker,
        _: InverseKinematicsParams,
    ) -> Result<InverseKinematicsAnswer, Denial> {
        Err(self.not_supported("inverse_kinematics"))
    }
}
