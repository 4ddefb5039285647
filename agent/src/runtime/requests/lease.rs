//! The lease: who may command.

use std::time::Duration;

use armada_protocol::messages::{
    AcquireLeaseParams, DelegateLeaseParams, Denial, DenialCode, LeaseGrant, LeaseParams,
    LeaseReleased, LeaseScope, RenewLeaseParams, Role, TakeLeaseParams,
};
use armada_protocol::method::{Method, robot};
use uuid::Uuid;

use super::{Asker, LOOP_PATIENCE, Requests};
use crate::control::{Granted, Order};
use crate::runtime::leases::Holder;
use crate::runtime::words::role_name;

/// How long a lease may last without being renewed \[ms\].
const TTL_MS: std::ops::RangeInclusive<u64> = 200..=60_000;
/// Longest reason for taking a lease \[characters\].
const MAX_REASON: usize = 200;
/// Longest name of a client \[characters\].
const MAX_NAME: usize = 100;

impl Requests {
    pub(super) async fn acquire_lease(
        &self,
        asker: Asker,
        params: AcquireLeaseParams,
    ) -> Result<LeaseGrant, Denial> {
        let AcquireLeaseParams { ttl_ms, role } = params;
        let ttl = check_ttl(ttl_ms)?;
        let (name, scope) = (asker.client.clone(), LeaseScope::Arm);
        let holder = Holder { name, ttl_ms, role, scope, reason: None };
        let order = |lease| Order::AcquireLease { lease, ttl, role };
        self.grant(&asker, holder, order).await
    }

    pub(super) async fn take_lease(
        &self,
        asker: Asker,
        params: TakeLeaseParams,
    ) -> Result<LeaseGrant, Denial> {
        let TakeLeaseParams { ttl_ms, role, reason } = params;
        let ttl = check_ttl(ttl_ms)?;
        check_text("reason", &reason, MAX_REASON)?;
        if role < Role::Operator {
            return Err(low_role(role));
        }
        let (name, scope) = (asker.client.clone(), LeaseScope::Arm);
        let holder = Holder { name, ttl_ms, role, scope, reason: Some(reason) };
        let order = |lease| Order::TakeLease { lease, ttl, role };
        self.grant(&asker, holder, order).await
    }

    pub(super) async fn delegate_lease(
        &self,
        asker: Asker,
        params: DelegateLeaseParams,
    ) -> Result<LeaseGrant, Denial> {
        let DelegateLeaseParams { lease: parent, to, scope, ttl_ms } = params;
        let ttl = check_ttl(ttl_ms)?;
        check_text("to", &to, MAX_NAME)?;
        let holder = Holder { name: to, ttl_ms, role: Role::Program, scope, reason: None };
        let order = |lease| Order::DelegateLease { parent, lease, scope, ttl };
        self.grant(&asker, holder, order).await
    }

    pub(super) async fn renew_lease(
        &self,
        asker: Asker,
        params: RenewLeaseParams,
    ) -> Result<LeaseGrant, Denial> {
        let RenewLeaseParams { lease, ttl_ms } = params;
        let ttl = ttl_ms.map(check_ttl).transpose()?;
        let order = Order::RenewLease { lease, ttl };
        let Granted { epoch, .. } = self.ask(&asker, order, robot::RenewLease::TIMEOUT).await?;
        let ttl_ms = self.board.lock().leases.renewed(lease, ttl_ms);
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

    /// Asks the loop for a new lease of `holder`.
    async fn grant(
        &self,
        asker: &Asker,
        holder: Holder,
        order: impl FnOnce(Uuid) -> Order,
    ) -> Result<LeaseGrant, Denial> {
        let (lease, ttl_ms) = (Uuid::now_v7(), holder.ttl_ms);
        // Before the loop is asked, so that whoever is refused because of it learns its name.
        self.board.lock().leases.announce(lease, holder);
        match self.ask(asker, order(lease), LOOP_PATIENCE).await {
            Ok(Granted { epoch, .. }) => Ok(LeaseGrant { lease, epoch, ttl_ms }),
            Err(denial) => {
                if denial.code == DenialCode::Timeout {
                    // A loop that is late may have granted it to nobody who knows of it.
                    drop(self.ask(asker, Order::ReleaseLease(lease), LOOP_PATIENCE).await);
                }
                self.board.lock().leases.forget(lease);
                Err(denial)
            }
        }
    }
}

fn check_ttl(ttl_ms: u64) -> Result<Duration, Denial> {
    if TTL_MS.contains(&ttl_ms) {
        return Ok(Duration::from_millis(ttl_ms));
    }
    let (least, most) = (*TTL_MS.start(), *TTL_MS.end());
    Err(Denial::new(
        DenialCode::OutOfRange,
        format!("ttl_ms is {ttl_ms}, expected {least} to {most}: renew a lease to keep it longer"),
    )
    .with("field", "ttl_ms")
    .with("value", ttl_ms)
    .with("limit", if ttl_ms < least { least } else { most }))
}

/// Refuses a text that says nothing, is too long, or would spoil a line of a log.
fn check_text(field: &str, text: &str, most: usize) -> Result<(), Denial> {
    if text.chars().any(char::is_control) {
        let message = format!("{field} has a control character, expected one line of text");
        return Err(Denial::new(DenialCode::InvalidArgument, message).with("field", field));
    }
    let count = text.trim().chars().count();
    if (1..=most).contains(&count) {
        return Ok(());
    }
    let message = format!("{field} has {count} characters, expected 1 to {most}");
    let limit = if count < 1 { 1 } else { most };
    Err(Denial::new(DenialCode::OutOfRange, message)
        .with("field", field)
        .with("value", count)
        .with("limit", limit))
}

fn low_role(role: Role) -> Denial {
    let (given, least) = (role_name(role), role_name(Role::Operator));
    let message = format!("role is {given}, but a lease is taken by an {least} or a supervisor");
    Denial::new(DenialCode::OutOfRange, message)
        .with("field", "role")
        .with("value", given)
        .with("limit", least)
}
