//! The lease: who may command.

use armada_protocol::messages::{
    AcquireLeaseParams, Denial, LeaseGrant, LeaseParams, LeaseReleased,
};

use super::{Asker, Requests};

impl Requests {
    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn acquire_lease(
        &self,
        _: Asker,
        _: AcquireLeaseParams,
    ) -> Result<LeaseGrant, Denial> {
        Err(self.not_supported("acquire_lease"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn renew_lease(&self, _: Asker, _: LeaseParams) -> Result<LeaseGrant, Denial> {
        Err(self.not_supported("renew_lease"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn release_lease(
        &self,
        _: Asker,
        _: LeaseParams,
    ) -> Result<LeaseReleased, Denial> {
        Err(self.not_supported("release_lease"))
    }
}
