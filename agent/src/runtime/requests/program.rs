//! Single moves to a goal, planned here or by the controller.

use armada_protocol::messages::{
    Accepted, Denial, MoveHomeParams, MoveJointParams, MovePoseParams,
};

use super::{Asker, Requests};

impl Requests {
    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn move_joint(
        &self,
        _: Asker,
        _: MoveJointParams,
    ) -> Result<Accepted, Denial> {
        Err(self.not_supported("move_joint"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn move_pose(&self, _: Asker, _: MovePoseParams) -> Result<Accepted, Denial> {
        Err(self.not_supported("move_pose"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn move_linear(
        &self,
        _: Asker,
        _: MovePoseParams,
    ) -> Result<Accepted, Denial> {
        Err(self.not_supported("move_linear"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn move_home(&self, _: Asker, _: MoveHomeParams) -> Result<Accepted, Denial> {
        Err(self.not_supported("move_home"))
    }
}
