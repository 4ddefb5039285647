//! The lease: who may command.

use std::time::Duration;

use armada_protocol::messages::{
    AcquireLeaseParams, DelegateLeaseParams, Denial, DenialCode, LeaseGrant, LeaseParams,
    LeaseReleased, RenewLeaseParams, TakeLeaseParams,
};
use armada_protocol::method::{Method, robot};
use uuid::Uuid;

use super::{Asker, LOOP_PATIENCE, Requests};
use crate::control::{Granted, Order};
use crate::runtime::leases::Holder;

/// How long a lease may last without being renewed \[ms\].
const TTL_MS: std::ops::RangeInclusive<u64> = 200..=60_000;

impl Requests {
    pub(super) async fn acquire_lease(
        &self,
        asker: Asker,
        params: AcquireLeaseParams,
    ) -> Result<LeaseGrant, Denial> {
        let ttl_ms = params.ttl_ms;
        if !TTL_MS.contains(&ttl_ms) {
            return Err(ttl_denial(ttl_ms));
        }
        let lease = Uuid::now_v7();
        let holder = Holder { name: asker.client.clone(), ttl_ms };
        // Before the loop is asked, so that whoever is refused because of it learns its name.
        self.board.lock().leases.announce(lease, holder);
        let order = Order::AcquireLease { lease, ttl: Duration::from_millis(ttl_ms) };
        match self.ask(&asker, order, LOOP_PATIENCE).await {
            Ok(Granted { epoch, .. }) => Ok(LeaseGrant { lease, epoch, ttl_ms }),
            Err(denial) => {
                if denial.code == DenialCode::Timeout {
                    // A loop that is late may have granted it to nobody who knows of it.
                    drop(self.ask(&asker, Order::ReleaseLease(lease), LOOP_PATIENCE).await);
                }
                self.board.lock().leases.forget(lease);
                Err(denial)
            }
        }
    }

    pub(super) async fn renew_lease(
        &self,
        asker: Asker,
        params: RenewLeaseParams,
    ) -> Result<LeaseGrant, Denial> {
        let lease = params.lease;
        let ttl_ms = self.board.lock().leases.ttl_ms(lease);
        let Granted { epoch, .. } =
            self.ask(&asker, Order::RenewLease(lease), robot::RenewLease::TIMEOUT).await?;
        Ok(LeaseGrant { lease, epoch, ttl_ms })
    }

    pub(super) async fn release_lease(
        &self,
        asker: Asker,
        params: LeaseParams,
    ) -> Result<LeaseReleased, Denial> {
        let order = Order::ReleaseLease(params.lease);
        let Granted { epoch, .. } = self.ask(&asker, order, LOOP_PATIENCE).await?;
        Ok(LeaseReleased { epoch })
    }
}

impl Requests {
    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn take_lease(
        &self,
        _: Asker,
        _: TakeLeaseParams,
    ) -> Result<LeaseGrant, Denial> {
        Err(Denial::new(DenialCode::NotSupported, "take_lease is not supported yet"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn delegate_lease(
        &self,
        _: Asker,
        _: DelegateLeaseParams,
    ) -> Result<LeaseGrant, Denial> {
        Err(Denial::new(DenialCode::NotSupported, "delegate_lease is not supported yet"))
    }
}

fn ttl_denial(ttl_ms: u64) -> Denial {
    let (least, most) = (*TTL_MS.start(), *TTL_MS.end());
    Denial::new(
        DenialCode::OutOfRange,
        format!("ttl_ms is {ttl_ms}, expected {least} to {most}: renew a lease to keep it longer"),
    )
    .with("field", "ttl_ms")
    .with("value", ttl_ms)
    .with("limit", if ttl_ms < least { least } else { most })
}
