//! Holding the right to command a robot, or several.

mod group;

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{oneshot, watch};
use tokio::task::JoinHandle;
use tokio::time::Instant;
use uuid::Uuid;

pub use group::{GroupLeaseError, GroupLeaseKeeper};

use super::{Client, ClientError, Subscription, now};
use crate::RobotName;
use crate::keys;
use crate::messages::{
    AcquireLeaseParams, DelegateLeaseParams, DenialCode, Event, EventKind, LeaseGrant, LeaseParams,
    LeaseScope, RenewLeaseParams, Role, TakeLeaseParams,
};
use crate::method::robot::{AcquireLease, DelegateLease, ReleaseLease, RenewLease, TakeLease};

/// A lease is renewed so many times while it lasts.
const RENEWALS: u32 = 3;
/// Events of a robot that may wait for the task that keeps its lease.
const EVENTS: usize = 16;

/// Holds a robot's lease or sub-lease: renews it in the background at a third of the time it lasts,
/// tells when it is lost, and gives it back when it is released or dropped.
///
/// It listens to what the robot tells of leases, so a lease that somebody took is known to be lost
/// after one more round trip, not with the next renewal.
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
#[derive(Debug)]
struct KeptLease {
    epoch: u64,
    /// Why it is lost, if it is.
    lost: Option<Arc<ClientError>>,
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
        self.acquire_lease_as(robot, ttl, Role::Program).await
    }

    /// As [`Self::acquire_lease`], as more than a program: nobody of a lower role can take it away.
    ///
    /// # Errors
    /// As [`Self::acquire_lease`].
    pub async fn acquire_lease_as(
        &self,
        robot: &RobotName,
        ttl: Duration,
        role: Role,
    ) -> Result<LeaseKeeper, ClientError> {
        let params = AcquireLeaseParams { ttl_ms: millis(ttl), role };
        // It lasts from its grant on, which is later than this.
        let asked = now();
        let grant = self.call::<AcquireLease>(robot, params).await?;
        Ok(self.keep(robot, grant, asked).await)
    }

    /// Takes the lease of a robot from whoever has it, and keeps it: what moves comes to rest, and
    /// the other is told by whom and why. `role` is operator or supervisor and not below the
    /// holder's; `reason` has 1 to 200 characters.
    ///
    /// # Errors
    /// As [`Self::call`]; [`ClientError::Denied`] if the role is too low, the pendant has control, or
    /// a stop is latched.
    pub async fn take_lease(
        &self,
        robot: &RobotName,
        ttl: Duration,
        role: Role,
        reason: impl Into<String>,
    ) -> Result<LeaseKeeper, ClientError> {
        let params = TakeLeaseParams { ttl_ms: millis(ttl), role, reason: reason.into() };
        let asked = now();
        let grant = self.call::<TakeLease>(robot, params).await?;
        Ok(self.keep(robot, grant, asked).await)
    }

    /// Lets the client named `to` command a robot as well, while `lease` is in force: the grant is
    /// for it, to be kept with [`Self::keep_lease`] before it has run out.
    ///
    /// # Errors
    /// As [`Self::call`]; [`ClientError::Denied`] if `lease` is not in force, is a sub-lease itself,
    /// or has eight already.
    pub async fn delegate_lease(
        &self,
        robot: &RobotName,
        lease: Uuid,
        (to, scope, ttl): (&str, LeaseScope, Duration),
    ) -> Result<LeaseGrant, ClientError> {
        let params = DelegateLeaseParams { lease, to: to.to_owned(), scope, ttl_ms: millis(ttl) };
        self.call::<DelegateLease>(robot, params).await
    }

    /// Renews a lease that was granted to somebody else for this client, and keeps it.
    ///
    /// # Errors
    /// As [`Self::call`]; [`ClientError::Denied`] if it is not in force any more.
    pub async fn keep_lease(
        &self,
        robot: &RobotName,
        lease: Uuid,
    ) -> Result<LeaseKeeper, ClientError> {
        let asked = now();
        let grant = self.call::<RenewLease>(robot, renewal(lease)).await?;
        Ok(self.keep(robot, grant, asked).await)
    }

    async fn keep(&self, robot: &RobotName, grant: LeaseGrant, asked: Instant) -> LeaseKeeper {
        let (told, state) = watch::channel(KeptLease { epoch: grant.epoch, lost: None });
        let (end, ended) = oneshot::channel();
        let keeping = Keeping {
            client: self.clone(),
            robot: robot.clone(),
            lease: grant.lease,
            ttl: Duration::from_millis(grant.ttl_ms),
            told,
            news: News::of(self, robot).await,
        };
        let task = start(keeping.run(asked, ended));
        LeaseKeeper { grant, state, end, task }
    }
}

impl LeaseKeeper {
    /// The lease: whoever knows it may command.
    #[must_use]
    pub const fn lease(&self) -> Uuid {
        self.grant.lease
    }

    /// What was granted.
    #[must_use]
    pub const fn grant(&self) -> &LeaseGrant {
        &self.grant
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
        self.state.borrow().lost.is_some()
    }

    /// Why it is lost: what the agent answered, or how it could not be reached while the lease
    /// lasted.
    #[must_use]
    pub fn loss(&self) -> Option<Arc<ClientError>> {
        self.state.borrow().lost.clone()
    }

    /// Waits until it is lost; then [`Self::loss`] says why.
    pub async fn lost(&self) {
        // The sender ends with its task only, which has told before or was aborted: lost as well.
        drop(self.state.clone().wait_for(|state| state.lost.is_some()).await);
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
    news: News,
}

impl Keeping {
    /// Renews the lease until it is lost or is to be given back.
    async fn run(
        mut self,
        asked: Instant,
        mut ended: oneshot::Receiver<()>,
    ) -> Result<(), ClientError> {
        let mut until = asked + self.ttl;
        let mut next = asked + self.ttl / RENEWALS;
        loop {
            let pause = self.ttl / RENEWALS;
            tokio::select! {
                biased;
                _ = &mut ended => return self.give_back().await,
                () = tokio::time::sleep_until(next) => {}
                () = self.news.next() => {}
            }
            let asked = now();
            match self.renew(pause).await {
                Ok(grant) => {
                    self.told.send_modify(|state| state.epoch = grant.epoch);
                    // Somebody who knows the lease may have asked for another time.
                    self.ttl = Duration::from_millis(grant.ttl_ms);
                    (until, next) = (asked + self.ttl, asked + self.ttl / RENEWALS);
                }
                Err(error @ ClientError::Denied(_)) => return self.lose(error),
                Err(error) if now() >= until => return self.lose(error),
                // Sooner than the next one was due: each may be the last.
                Err(_) => next = now() + pause / RENEWALS,
            }
        }
    }

    async fn renew(&self, patience: Duration) -> Result<LeaseGrant, ClientError> {
        self.client.call_within::<RenewLease>(&self.robot, renewal(self.lease), patience).await
    }

    async fn give_back(self) -> Result<(), ClientError> {
        let params = LeaseParams { lease: self.lease };
        match self.client.call_within::<ReleaseLease>(&self.robot, params, self.ttl).await {
            // It was lost a moment ago.
            Err(ClientError::Denied(denial)) if denial.code == DenialCode::LeaseStale => Ok(()),
            released => released.map(drop),
        }
    }

    fn lose(self, why: ClientError) -> Result<(), ClientError> {
        self.told.send_modify(|state| state.lost = Some(Arc::new(why)));
        Ok(())
    }
}

/// What a robot tells of leases.
#[derive(Debug)]
struct News(Option<Subscription<Event>>);

impl News {
    /// Listens to a robot; if that fails, a lost lease is seen when it is to be renewed.
    async fn of(client: &Client, robot: &RobotName) -> Self {
        Self(client.subscribe(&keys::ROBOT_EVENTS.of(robot), EVENTS).await.ok())
    }

    /// Waits until something has become of a lease.
    async fn next(&self) {
        let Some(events) = &self.0 else { return std::future::pending().await };
        loop {
            match events.next().await {
                Ok((_, event)) if event.kind == EventKind::Lease => return,
                Ok(_) | Err(ClientError::Codec(_)) => {}
                // The session is closed: nothing comes any more.
                Err(_) => std::future::pending().await,
            }
        }
    }
}

const fn renewal(lease: Uuid) -> RenewLeaseParams {
    RenewLeaseParams { lease, ttl_ms: None }
}

fn millis(ttl: Duration) -> u64 {
    u64::try_from(ttl.as_millis()).unwrap_or(u64::MAX)
}

#[expect(clippy::disallowed_methods, reason = "the asking end is runtime code")]
fn start<T: Send + 'static>(task: impl Future<Output = T> + Send + 'static) -> JoinHandle<T> {
    tokio::spawn(task)
}
