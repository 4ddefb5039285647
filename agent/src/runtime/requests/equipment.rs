//! Tools and payloads.

use armada_protocol::messages::{
    AttachPayloadParams, AttachToolParams, Denial, DetachParams, EquipmentAnswer,
};

use super::{Asker, Requests};

impl Requests {
    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn attach_tool(
        &self,
        _: Asker,
        _: AttachToolParams,
    ) -> Result<EquipmentAnswer, Denial> {
        Err(self.not_supported("attach_tool"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn detach_tool(
        &self,
        _: Asker,
        _: DetachParams,
    ) -> Result<EquipmentAnswer, Denial> {
        Err(self.not_supported("detach_tool"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn attach_payload(
        &self,
        _: Asker,
        _: AttachPayloadParams,
    ) -> Result<EquipmentAnswer, Denial> {
        Err(self.not_supported("attach_payload"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn detach_payload(
        &self,
        _: Asker,
        _: DetachParams,
    ) -> Result<EquipmentAnswer, Denial> {
        Err(self.not_supported("detach_payload"))
    }
}
