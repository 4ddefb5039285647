//! Holding the right to command several robots: all or none.

use std::collections::{BTreeMap, BTreeSet};
use std::future::poll_fn;
use std::sync::Arc;
use std::task::Poll;
use std::time::Duration;

use uuid::Uuid;

use super::{LeaseKeeper, millis, renewal, start};
use crate::RobotName;
use crate::client::{Client, ClientError};
use crate::messages::{Denial, RenewLeaseParams, Role};
use crate::method::robot::RenewLease;

/// How long each lease lasts until all have been granted: whoever dies in between keeps nobody
/// waiting for longer.
const PROVISIONAL: Duration = Duration::from_millis(500);

/// Why the leases of several robots were not granted; none is held then.
#[derive(Debug, thiserror::Error)]
#[error("no lease of {robot}{}: {error}", held(.holder))]
pub struct GroupLeaseError {
    /// The robot that was in the way.
    pub robot: RobotName,
    /// Who holds its lease, if that is why.
    pub holder: Option<String>,
    /// What its agent said.
    #[source]
    pub error: ClientError,
}

fn held(holder: &Option<String>) -> String {
    holder.as_ref().map(|holder| format!(", {holder} has it")).unwrap_or_default()
}

/// Holds the leases of several robots, each as a [`LeaseKeeper`] does, and gives all back when it is
/// released or dropped.
///
/// One that is lost stays lost, and the others are kept: what to do then is for the program to
/// say, which knows what moves.
#[derive(Debug)]
pub struct GroupLeaseKeeper {
    keepers: BTreeMap<RobotName, LeaseKeeper>,
}

impl Client {
    /// Acquires the leases of several robots, all or none, and keeps them; each lasts `ttl`, 200 ms
    /// to 60 s, after the last renewal.
    ///
    /// They are asked for in the order of the names, so two groups never wait for each other; if one
    /// is refused, those before it are given back at once.
    ///
    /// # Errors
    /// [`GroupLeaseError`] with the robot that refused or did not answer.
    pub async fn acquire_group(
        &self,
        robots: &[RobotName],
        ttl: Duration,
    ) -> Result<GroupLeaseKeeper, GroupLeaseError> {
        self.acquire_group_as(robots, ttl, Role::Program).await
    }

    /// As [`Self::acquire_group`], as more than a program: nobody of a lower role can take them away.
    ///
    /// # Errors
    /// As [`Self::acquire_group`].
    pub async fn acquire_group_as(
        &self,
        robots: &[RobotName],
        ttl: Duration,
        role: Role,
    ) -> Result<GroupLeaseKeeper, GroupLeaseError> {
        let names: BTreeSet<&RobotName> = robots.iter().collect();
        let mut group = GroupLeaseKeeper { keepers: BTreeMap::new() };
        for &robot in &names {
            match self.acquire_lease_as(robot, PROVISIONAL.min(ttl), role).await {
                Ok(keeper) => {
                    group.keepers.insert(robot.clone(), keeper);
                }
                Err(error) => return Err(group.undo(robot, error).await),
            }
        }
        for &robot in &names {
            let Some(keeper) = group.keepers.get_mut(robot) else { continue };
            let params = RenewLeaseParams { ttl_ms: Some(millis(ttl)), ..renewal(keeper.lease()) };
            match self.call::<RenewLease>(robot, params).await {
                Ok(grant) => keeper.grant = grant,
                Err(error) => return Err(group.undo(robot, error).await),
            }
        }
        Ok(group)
    }
}

impl GroupLeaseKeeper {
    /// A group of one.
    #[must_use]
    pub fn of(robot: RobotName, keeper: LeaseKeeper) -> Self {
        Self { keepers: BTreeMap::from([(robot, keeper)]) }
    }

    /// The leases, by robot: whoever knows one may command its robot.
    #[must_use]
    pub fn leases(&self) -> BTreeMap<RobotName, Uuid> {
        self.keepers.iter().map(|(robot, keeper)| (robot.clone(), keeper.lease())).collect()
    }

    /// Who keeps them, by robot.
    #[must_use]
    pub const fn keepers(&self) -> &BTreeMap<RobotName, LeaseKeeper> {
        &self.keepers
    }

    /// Robots whose lease is lost, and why, in the order of their names.
    #[must_use]
    pub fn losses(&self) -> Vec<(RobotName, Arc<ClientError>)> {
        let lost =
            |(robot, keeper): (&RobotName, &LeaseKeeper)| Some((robot.clone(), keeper.loss()?));
        self.keepers.iter().filter_map(lost).collect()
    }

    /// Waits until a lease is lost; then [`Self::losses`] says which and why.
    pub async fn lost(&self) {
        let mut waits: Vec<_> =
            self.keepers.values().map(|keeper| Box::pin(keeper.lost())).collect();
        poll_fn(|context| {
            let is_lost = waits.iter_mut().any(|wait| wait.as_mut().poll(context).is_ready());
            if is_lost { Poll::Ready(()) } else { Poll::Pending }
        })
        .await;
    }

    /// Gives all leases back, which brings the robots to rest, and waits for the answers; returns
    /// the robots that did not take theirs, but for those that were lost before.
    pub async fn release(self) -> Vec<(RobotName, ClientError)> {
        // All at the same time.
        let releases = self.keepers.into_iter();
        let releases: Vec<_> =
            releases.map(|(robot, keeper)| (robot, start(keeper.release()))).collect();
        let mut failed = Vec::new();
        for (robot, release) in releases {
            // A task ends early only if the program does.
            if let Ok(Err(error)) = release.await {
                failed.push((robot, error));
            }
        }
        failed
    }

    /// Gives back what was granted; what cannot be given back runs out by itself.
    async fn undo(self, robot: &RobotName, error: ClientError) -> GroupLeaseError {
        drop(self.release().await);
        let holder = match &error {
            ClientError::Denied(Denial { details, .. }) => {
                details.get("holder").and_then(|holder| holder.as_str()).map(str::to_owned)
            }
            _ => None,
        };
        GroupLeaseError { robot: robot.clone(), holder, error }
    }
}
