//! Leases that are kept until somebody ends this program, or one of them is lost.

use std::time::{Duration, Instant};

use anyhow::bail;
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{
    AcquireLeaseParams, LeaseGrant, LeaseParams, RenewLeaseParams, Role,
};
use armada_protocol::method::robot::{AcquireLease, ReleaseLease, RenewLease};
use tokio::task::JoinSet;
use tokio::time::sleep;

use crate::clock;
use crate::commands::modes::words_of;
use crate::exit::Exit;
use crate::output::{Output, note};
use crate::signals::Signals;

/// Times that a lease is renewed while it lasts.
const RENEWALS: u32 = 3;
/// How long a lease of several robots lasts while the others are still asked for.
const PROVISIONAL: Duration = Duration::from_millis(500);

/// A lease that was granted.
#[derive(Clone)]
pub(super) struct Kept {
    client: Client,
    robot: RobotName,
    grant: LeaseGrant,
    /// When it was asked for, or for more time.
    asked: Instant,
}

impl Kept {
    /// A lease that was asked for at `asked` and granted.
    pub(super) fn new(
        client: &Client,
        robot: &RobotName,
        asked: Instant,
        grant: LeaseGrant,
    ) -> Self {
        Self { client: client.under(grant.lease), robot: robot.clone(), grant, asked }
    }

    async fn acquire(
        client: &Client,
        robot: &RobotName,
        params: AcquireLeaseParams,
    ) -> Result<Self, ClientError> {
        let asked = clock::now();
        let grant = client.call::<AcquireLease>(robot, params).await?;
        Ok(Self::new(client, robot, asked, grant))
    }

    const fn renewal(&self, ttl_ms: Option<u64>) -> RenewLeaseParams {
        RenewLeaseParams { lease: self.grant.lease, ttl_ms }
    }

    /// Makes it last longer from now on.
    async fn last(&mut self, ttl_ms: u64) -> Result<(), ClientError> {
        let asked = clock::now();
        let renewal = self.renewal(Some(ttl_ms));
        self.grant = self.client.call::<RenewLease>(&self.robot, renewal).await?;
        self.asked = asked;
        Ok(())
    }

    /// Renews it until it is lost; returns why.
    async fn renew(self) -> String {
        let ttl = Duration::from_millis(self.grant.ttl_ms);
        let mut renewed = self.asked;
        loop {
            sleep(ttl / RENEWALS).await;
            let asked = clock::now();
            let renewal = self.renewal(None);
            let patience = ttl / RENEWALS;
            match self.client.call_within::<RenewLease>(&self.robot, renewal, patience).await {
                Ok(_) => renewed = asked,
                // The agent or the link may be back before the lease has run out.
                Err(ClientError::NoReply { .. } | ClientError::Timeout { .. })
                    if clock::now().saturating_duration_since(renewed) < ttl => {}
                Err(error) => {
                    return format!("{}: the lease is lost: {}", self.robot, words_of(&error));
                }
            }
        }
    }

    async fn release(&self) -> Result<u64, ClientError> {
        let params = LeaseParams { lease: self.grant.lease };
        Ok(self.client.call::<ReleaseLease>(&self.robot, params).await?.epoch)
    }
}

/// Acquires the leases of robots in the order of their names, all or none.
///
/// Until all are there each lasts half a second only: a program that dies in between keeps none.
///
/// # Errors
/// What the first that is refused says, with its name; those before it are given back.
pub(super) async fn acquire_all(
    client: &Client,
    mut robots: Vec<RobotName>,
    ttl: Duration,
    role: Role,
) -> anyhow::Result<Vec<Kept>> {
    robots.sort();
    robots.dedup();
    let ttl_ms = millis(ttl);
    let first_ms = if robots.len() > 1 { millis(ttl.min(PROVISIONAL)) } else { ttl_ms };
    let mut kept: Vec<Kept> = Vec::new();
    for robot in &robots {
        let params = AcquireLeaseParams { ttl_ms: first_ms, role };
        match Kept::acquire(client, robot, params).await {
            Ok(lease) => kept.push(lease),
            Err(error) => return Err(given_back(kept, robot, error).await),
        }
    }
    if first_ms != ttl_ms {
        for index in 0..kept.len() {
            let Some(lease) = kept.get_mut(index) else { break };
            if let Err(error) = lease.last(ttl_ms).await {
                let robot = lease.robot.clone();
                return Err(given_back(kept, &robot, error).await);
            }
        }
    }
    Ok(kept)
}

/// The time as it is on the wire.
pub(super) fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}

async fn given_back(kept: Vec<Kept>, robot: &RobotName, error: ClientError) -> anyhow::Error {
    let context =
        if kept.is_empty() { robot.to_string() } else { format!("{robot}, so none is held") };
    for lease in kept {
        if let Err(error) = lease.release().await {
            note(format_args!("{}: {}", lease.robot, words_of(&error)));
        }
    }
    anyhow::Error::new(error).context(context)
}

/// Prints the leases, and renews them until a signal comes or one is lost; then gives them back.
///
/// # Errors
/// If one was lost, with its robot and why.
pub(super) async fn until_ended(
    kept: Vec<Kept>,
    out: &Output,
    signals: &mut Signals,
) -> anyhow::Result<Exit> {
    for Kept { robot, grant, .. } in &kept {
        if out.is_json() {
            out.json_line(&line(robot, grant))?;
        } else {
            out.line(format_args!("{robot}: lease {}, epoch {}", grant.lease, grant.epoch))?;
        }
    }
    note("held until Ctrl-C");
    let mut renewing = JoinSet::new();
    for (index, lease) in kept.iter().cloned().enumerate() {
        renewing.spawn(async move { (index, lease.renew().await) });
    }
    let lost = tokio::select! {
        signal = signals.next() => {
            note(format_args!("{signal}: giving back"));
            None
        }
        lost = renewing.join_next() => lost,
    };
    renewing.abort_all();
    let (lost_index, why) = match lost {
        Some(Ok((index, why))) => (Some(index), Some(why)),
        Some(Err(error)) => (None, Some(error.to_string())),
        None => (None, None),
    };
    for (_, lease) in kept.iter().enumerate().filter(|(index, _)| Some(*index) != lost_index) {
        match lease.release().await {
            Ok(epoch) => note(format_args!("{}: given back, epoch {epoch}", lease.robot)),
            Err(error) => note(format_args!("{}: {}", lease.robot, words_of(&error))),
        }
    }
    match why {
        Some(why) => bail!(why),
        None => Ok(Exit::Success),
    }
}

/// The grant with its robot.
fn line(robot: &RobotName, grant: &LeaseGrant) -> serde_json::Value {
    let LeaseGrant { lease, epoch, ttl_ms } = grant;
    serde_json::json!({ "robot": robot, "lease": lease, "epoch": epoch, "ttl_ms": ttl_ms })
}
