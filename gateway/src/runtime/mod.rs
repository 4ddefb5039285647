//! Everything of the gateway that touches a clock, a task or Zenoh.
//!
//! ```text
//! samples --callbacks--> slots, bounded queues --+
//! requests --serve--> queues (stops apart) ------+--> executor: coordinator, world
//! answers <--one task a question-- questions <---+        |
//!                                                         +--> publications, kept values
//! ```
//! One executor task owns the coordinator and the world. It never waits for the network: questions
//! and answers have tasks of their own, and what is published is dropped rather than waited for. Nor
//! does it calculate for long: clearances are checked on threads of their own.
//!
//! | what comes in | where it waits | when that is full |
//! |---|---|---|
//! | state, status, info, presence | one slot a robot | the newest replaces the one before |
//! | status of motions | queue of 1024 | dropped and counted; asked for when it is missed |
//! | events of robots | queue of 1024 | dropped and counted; the gap is an event |
//! | stops and their acknowledgements | queue of 256 | dropped and counted; agents repeat them |
//! | requests to stop | queue of 64 | answered `busy`; that many stops are in progress |
//! | other requests | queue of 64 | answered `busy` |
//!
//! A sample that is not a message is counted, dropped and warned about, at most once in five
//! seconds for each key.

mod answers;
mod asks;
mod clock;
mod executor;
mod intake;
mod outlet;
mod requests;

use std::future::Future;
use std::sync::Arc;

use armada_protocol::messages::CellInfo;
use armada_protocol::session::{self, Role, SessionError, SessionOptions};
use armada_protocol::{keys, serve};
use tokio::sync::oneshot;
use tracing::{debug, info, warn};
use uuid::Uuid;
use zenoh::Session;

use crate::config::CellConfig;
use crate::coordinator::{Coordinator, CoordinatorConfig};
use crate::world::World;
use executor::{Executor, Inboxes};
use intake::Intake;
use outlet::Outlet;
use requests::CellRequests;

/// How a gateway is started.
#[derive(Clone, Debug)]
pub struct GatewayOptions {
    /// The cell.
    pub config: CellConfig,
    /// Zenoh endpoints to listen on, instead of those of the cell file.
    pub listen: Option<Vec<String>>,
    /// Whether listening outside loopback without authentication is allowed.
    pub insecure_lan: bool,
}

/// Why a gateway cannot run.
#[derive(Debug, thiserror::Error)]
pub enum GatewayError {
    /// No Zenoh session could be opened.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Zenoh refuses a key.
    #[error("zenoh: {0}")]
    Zenoh(String),
}

impl From<zenoh::Error> for GatewayError {
    fn from(error: zenoh::Error) -> Self {
        Self::Zenoh(error.to_string())
    }
}

/// Runs the gateway of a cell until `shutdown` is done; sends on `ready` once it can be asked.
///
/// At its end it refuses what has not begun, says that what runs goes on without it, and closes its
/// session. No stop depends on it: agents hear stops without it.
///
/// # Errors
/// [`GatewayError::Session`] if it cannot listen, [`GatewayError::Zenoh`] if a key cannot be
/// declared.
pub async fn run(
    options: GatewayOptions,
    ready: oneshot::Sender<()>,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), GatewayError> {
    let GatewayOptions { config, listen, insecure_lan } = options;
    let session = session::open(&SessionOptions {
        role: Role::Gateway,
        listen: listen.unwrap_or_else(|| config.listen.clone()),
        connect: Vec::new(),
        namespace: config.namespace.clone(),
        insecure_lan,
    })
    .await?;
    let result = serve_cell(&session, config, ready, shutdown).await;
    if let Err(error) = session.close().await {
        warn!(%error, "the session did not close");
    }
    result
}

async fn serve_cell(
    session: &Session,
    config: CellConfig,
    ready: oneshot::Sender<()>,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), GatewayError> {
    let boot_id = Uuid::now_v7();
    let info = CellInfo {
        cell: config.cell.clone(),
        boot_id,
        seqno: 0,
        software_version: env!("CARGO_PKG_VERSION").to_owned(),
        robots: config.cell_robots().collect(),
    };
    let coordinator = Coordinator::new(
        CoordinatorConfig {
            cell: config.cell.clone(),
            boot_id,
            robots: config.robots.iter().map(|robot| robot.name.clone()).collect(),
            timers: config.motion,
            clearance: config.clearance,
        },
        clock::monotonic(),
    );
    let world = World::new(config.cell_robots());
    let outlet = Outlet::open(session, info).await?;
    let (handler, orders) = CellRequests::new();
    let rpc = keys::CELL_RPC.any();
    let server = serve::rpc(session, rpc.trim_end_matches("/*"), Arc::new(handler)).await?;
    let robots = config.robots.iter().map(|robot| robot.name.clone()).collect();
    let intake = Intake::open(session, robots).await?;
    let alive = session.liveliness().declare_token(keys::CELL_GATEWAY_ALIVE.any()).await?;
    info!(cell = %config.cell, robots = config.robots.len(), "gateway runs");
    if ready.send(()).is_err() {
        debug!("whoever started the gateway does not wait for it");
    }
    let inboxes = Inboxes { intake, orders };
    Executor::new(session.clone(), coordinator, world, outlet).run(inboxes, shutdown).await;
    drop((alive, server));
    info!(cell = %config.cell, "gateway ends");
    Ok(())
}
