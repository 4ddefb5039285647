//! Holding the right to command a robot.

use std::time::Duration;

use tokio::sync::{oneshot, watch};
use tokio::task::JoinHandle;
use tokio::time::Instant;
use uuid::Uuid;

use super::{Client, ClientError, now};
use crate::RobotName;
use crate::messages::{AcquireLeaseParams, LeaseGrant, LeaseParams, RenewLeaseParams};
use crate::method::robot::{AcquireLease, ReleaseLease, RenewLease};

/// A lease is renewed so many times while it lasts.
const RENEWALS: u32 = 3;

/// Holds a robot's lease: renews it in the background at a third of the time it lasts, tells when
/// it is lost, and gives it back when it is released or dropped.
///
/// A lease that is lost stays lost; nothing moves again before somebody acquires another one and
/// asks for a motion. If the program dies, the lease runs out by itself.
#[derive(Debug)]
pub struct LeaseKeeper {
    grant: LeaseGrant,
    state: watch::Receiver<KeptLease>,
    /// Tells the task to give the lease back; dropping it does too.
    end: oneshot::Sender<()>,
    task: JoinHandle<Result<(), ClientError>>,
}

/// What is known of a lease that is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct KeptLease {
    epoch: u64,
    lost: bool,
}

impl Client {
    /// Acquires the lease of a robot and keeps it; it lasts `ttl`, 200 ms to 60 s, after the last
    /// renewal.
    ///
    /// # Errors
    /// As [`Self::call`]; [`ClientError::Denied`] if somebody else holds it.
    pub async fn acquire_lease(
        &self,
        robot: &RobotName,
        ttl: Duration,
    ) -> Result<LeaseKeeper, ClientError> {
        let ttl_ms = u64::try_from(ttl.as_millis()).unwrap_or(u64::MAX);
        // It lasts from its grant on, which is later than this.
        let asked = now();
        let grant = self
            .call::<AcquireLease>(robot, AcquireLeaseParams { ttl_ms, ..Default::default() })
            .await?;
        let (told, state) = watch::channel(KeptLease { epoch: grant.epoch, lost: false });
        let (end, ended) = oneshot::channel();
        let keeping = Keeping {
            client: self.clone(),
            robot: robot.clone(),
            lease: grant.lease,
            ttl: Duration::from_millis(grant.ttl_ms),
            told,
        };
        let task = start(keeping.run(asked, ended));
        Ok(LeaseKeeper { grant, state, end, task })
    }
}

impl LeaseKeeper {
    /// The lease: whoever knows it may command.
    #[must_use]
    pub const fn lease(&self) -> Uuid {
        self.grant.lease
    }

    /// The epoch in force when the lease was last granted or renewed.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.state.borrow().epoch
    }

    /// Whether it is lost: somebody else has one, a stop took it away, or it could not be renewed
    /// in time.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.state.borrow().lost
    }

    /// Waits until it is lost.
    pub async fn lost(&self) {
        // The sender ends with its task only, which has told before or was aborted: lost as well.
        drop(self.state.clone().wait_for(|state| state.lost).await);
    }

    /// Gives the lease back, which brings the robot to rest, and waits for the answer.
    ///
    /// # Errors
    /// As [`Client::call`]; a lease that was lost before is no error.
    pub async fn release(self) -> Result<(), ClientError> {
        // If the task has ended already there is nothing to tell.
        let _ = self.end.send(());
        self.task.await.unwrap_or(Ok(()))
    }
}

/// The task that keeps a lease.
struct Keeping {
    client: Client,
    robot: RobotName,
    lease: Uuid,
    ttl: Duration,
    told: watch::Sender<KeptLease>,
}

impl Keeping {
    /// Renews the lease until it is lost or is to be given back.
    async fn run(
        self,
        asked: Instant,
        mut ended: oneshot::Receiver<()>,
    ) -> Result<(), ClientError> {
        let pause = self.ttl / RENEWALS;
        let mut until = asked + self.ttl;
        let mut next = asked + pause;
        loop {
            let due = tokio::time::timeout_at(next, &mut ended).await.is_err();
            if !due {
                return self.give_back().await;
            }
            let asked = now();
            match self.renew(pause).await {
                Ok(grant) => {
                    self.told.send_modify(|state| state.epoch = grant.epoch);
                    (until, next) = (asked + self.ttl, asked + pause);
                }
                Err(ClientError::Denied(_)) => return self.lose(),
                Err(_) if now() >= until => return self.lose(),
                // Sooner than the next one was due: each may be the last.
                Err(_) => next = now() + pause / RENEWALS,
            }
        }
    }

    async fn renew(&self, patience: Duration) -> Result<LeaseGrant, ClientError> {
        let params = RenewLeaseParams { lease: self.lease, ttl_ms: None };
        self.client.call_within::<RenewLease>(&self.robot, params, patience).await
    }

    async fn give_back(self) -> Result<(), ClientError> {
        let params = LeaseParams { lease: self.lease };
        let released = self.client.call_within::<ReleaseLease>(&self.robot, params, self.ttl).await;
        released.map(drop)
    }

    fn lose(self) -> Result<(), ClientError> {
        self.told.send_modify(|state| state.lost = true);
        Ok(())
    }
}

#[expect(clippy::disallowed_methods, reason = "the asking end is runtime code")]
fn start<T: Send + 'static>(task: impl Future<Output = T> + Send + 'static) -> JoinHandle<T> {
    tokio::spawn(task)
}
