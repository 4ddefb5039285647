//! Holding the right to command several robots: all or none.

use std::collections::BTreeMap;
use std::time::Duration;

use tokio::sync::{oneshot, watch};
use tokio::task::JoinHandle;
use tokio::time::Instant;
use uuid::Uuid;

use super::{RENEWALS, millis, renewal, start};
use crate::RobotName;
use crate::client::{Client, ClientError, now};
use crate::messages::{
    AcquireLeaseParams, Denial, LeaseGrant, LeaseParams, RenewLeaseParams, Role,
};
use crate::method::robot::{AcquireLease, ReleaseLease, RenewLease};

/// How long each lease lasts until all have been granted: whoever dies in between, or is not heard,
/// keeps nobody waiting for longer.
const PROVISIONAL: Duration = Duration::from_millis(500);
/// The shortest that a lease may last.
const SHORTEST: Duration = Duration::from_millis(200);

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

/// Holds the leases of several robots: renews all at the same time, at a third of the time they
/// last, tells which is lost, and gives all back when it is released or dropped.
///
/// One that is lost stays lost, and the others are kept: what to do then is for the program to
/// say, which knows what moves.
#[derive(Debug)]
pub struct GroupLeaseKeeper {
    leases: BTreeMap<RobotName, LeaseGrant>,
    lost: watch::Receiver<Vec<RobotName>>,
    /// Tells the task to give the leases back; dropping it does too.
    end: oneshot::Sender<()>,
    task: JoinHandle<Vec<(RobotName, ClientError)>>,
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
        let names: std::collections::BTreeSet<&RobotName> = robots.iter().collect();
        let mut leases = BTreeMap::new();
        for robot in names {
            match self.acquire_provisional(robot).await {
                Ok(grant) => {
                    leases.insert(robot.clone(), grant);
                }
                Err(error) => return Err(self.undo(&leases, (robot.clone(), error)).await),
            }
        }
        let ids = leases.iter().map(|(robot, grant)| (robot.clone(), grant.lease)).collect();
        let mut keeping = Keeping { client: self.clone(), ttl, leases: ids };
        let asked = now();
        let results = keeping.renew(Some(millis(ttl)), PROVISIONAL).await;
        for (robot, result) in results {
            match result {
                Ok(grant) => {
                    leases.insert(robot, grant);
                }
                Err(error) => return Err(self.undo(&leases, (robot, error)).await),
            }
        }
        let (told, lost) = watch::channel(Vec::new());
        let (end, ended) = oneshot::channel();
        let task = start(async move { keeping.run(asked, told, ended).await });
        Ok(GroupLeaseKeeper { leases, lost, end, task })
    }

    async fn acquire_provisional(&self, robot: &RobotName) -> Result<LeaseGrant, ClientError> {
        let params = AcquireLeaseParams { ttl_ms: millis(PROVISIONAL), role: Role::Program };
        self.call::<AcquireLease>(robot, params).await
    }

    /// Gives back what was granted; what cannot be given back runs out by itself.
    async fn undo(
        &self,
        leases: &BTreeMap<RobotName, LeaseGrant>,
        (robot, error): (RobotName, ClientError),
    ) -> GroupLeaseError {
        let leases = leases.iter().map(|(robot, grant)| (robot.clone(), grant.lease)).collect();
        drop(Keeping { client: self.clone(), ttl: PROVISIONAL, leases }.give_back().await);
        let holder = match &error {
            ClientError::Denied(Denial { details, .. }) => {
                details.get("holder").and_then(|holder| holder.as_str()).map(str::to_owned)
            }
            _ => None,
        };
        GroupLeaseError { robot, holder, error }
    }
}

impl GroupLeaseKeeper {
    /// The leases, by robot: whoever knows one may command its robot.
    #[must_use]
    pub fn leases(&self) -> BTreeMap<RobotName, Uuid> {
        self.leases.iter().map(|(robot, grant)| (robot.clone(), grant.lease)).collect()
    }

    /// What was granted, by robot.
    #[must_use]
    pub const fn grants(&self) -> &BTreeMap<RobotName, LeaseGrant> {
        &self.leases
    }

    /// Robots whose lease is lost, in the order of the losses.
    #[must_use]
    pub fn lost_robots(&self) -> Vec<RobotName> {
        self.lost.borrow().clone()
    }

    /// Waits until a lease is lost; returns all that are lost by then.
    pub async fn lost(&self) -> Vec<RobotName> {
        match self.lost.clone().wait_for(|lost| !lost.is_empty()).await {
            Ok(lost) => lost.clone(),
            // The task has ended without: everything is lost with it.
            Err(_) => self.leases.keys().cloned().collect(),
        }
    }

    /// Gives all leases back, which brings the robots to rest, and waits for the answers; returns
    /// the robots that did not take theirs, but for those that were lost before.
    pub async fn release(self) -> Vec<(RobotName, ClientError)> {
        // If the task has ended already there is nothing to tell.
        let _ = self.end.send(());
        self.task.await.unwrap_or_default()
    }
}

/// The task that keeps the leases.
struct Keeping {
    client: Client,
    ttl: Duration,
    /// Those that are not lost.
    leases: BTreeMap<RobotName, Uuid>,
}

impl Keeping {
    /// Renews the leases until all are lost or they are to be given back.
    async fn run(
        mut self,
        asked: Instant,
        told: watch::Sender<Vec<RobotName>>,
        mut ended: oneshot::Receiver<()>,
    ) -> Vec<(RobotName, ClientError)> {
        let pause = self.ttl / RENEWALS;
        let mut until: BTreeMap<RobotName, Instant> =
            self.leases.keys().map(|robot| (robot.clone(), asked + self.ttl)).collect();
        let mut next = asked + pause;
        while !self.leases.is_empty() {
            if tokio::time::timeout_at(next, &mut ended).await.is_ok() {
                return self.give_back().await;
            }
            let asked = now();
            next = asked + pause;
            for (robot, result) in self.renew(None, pause).await {
                let lost = match result {
                    Ok(_) => {
                        until.insert(robot.clone(), asked + self.ttl);
                        continue;
                    }
                    Err(ClientError::Denied(_)) => true,
                    Err(_) => until.get(&robot).is_none_or(|until| now() >= *until),
                };
                // Sooner than the next one was due: each may be the last.
                next = next.min(now() + pause / RENEWALS);
                if lost {
                    self.leases.remove(&robot);
                    told.send_modify(|lost| lost.push(robot));
                }
            }
        }
        Vec::new()
    }

    /// Renews all at the same time; each answer may take so long.
    async fn renew(
        &mut self,
        ttl_ms: Option<u64>,
        patience: Duration,
    ) -> Vec<(RobotName, Result<LeaseGrant, ClientError>)> {
        let tasks = self.leases.iter().map(|(robot, lease)| {
            let (client, robot) = (self.client.clone(), robot.clone());
            let params = RenewLeaseParams { ttl_ms, ..renewal(*lease) };
            start(async move {
                let answer = client.call_within::<RenewLease>(&robot, params, patience).await;
                (robot, answer)
            })
        });
        join(tasks.collect()).await
    }

    /// Gives all back at the same time; returns those that failed.
    async fn give_back(self) -> Vec<(RobotName, ClientError)> {
        let patience = self.ttl.max(SHORTEST);
        let tasks = self.leases.into_iter().map(|(robot, lease)| {
            let client = self.client.clone();
            start(async move {
                let params = LeaseParams { lease };
                let answer = client.call_within::<ReleaseLease>(&robot, params, patience).await;
                (robot, answer)
            })
        });
        let answers = join(tasks.collect()).await;
        answers.into_iter().filter_map(|(robot, answer)| Some((robot, answer.err()?))).collect()
    }
}

/// The results of tasks that are under way.
async fn join<T>(tasks: Vec<JoinHandle<T>>) -> Vec<T> {
    let mut results = Vec::with_capacity(tasks.len());
    for task in tasks {
        // A task ends early only if the program does.
        results.extend(task.await.ok());
    }
    results
}
