//! What the gateway publishes, and what it keeps for those who ask.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use armada_protocol::client::utc_ns;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys::{self, Key};
use armada_protocol::messages::{
    CellFrames, CellInfo, CellMotionStatus, CellStatus, Denial, DenialCode, Event, Severity,
    StopRequest,
};
use armada_protocol::publish::{Cached, Latest, PublishError};
use armada_protocol::serve::{self, RpcServer};
use tracing::{debug, error, info, warn};
use uuid::Uuid;
use zenoh::{Session, Wait};

use super::clock::monotonic;
use crate::coordinator::ROBOT_SEQNO;

/// Motions that can be asked for: well over ten minutes of the shortest ones.
const KEPT_MOTIONS: usize = 2048;
/// Events kept for late joiners and reviewers: those of every robot.
const KEPT_EVENTS: usize = 2048;

/// The gateway's publishers and kept values.
pub(super) struct Outlet {
    session: Session,
    info: CellInfo,
    stop: Latest,
    frames: Latest,
    status: Cached,
    events: Cached,
    _info: Cached,
    kept: Arc<Mutex<Kept>>,
    _servers: Vec<RpcServer>,
}

#[derive(Default)]
struct Kept {
    status: Option<CellStatus>,
    motions: BTreeMap<Uuid, CellMotionStatus>,
    /// Oldest first.
    order: VecDeque<Uuid>,
}

impl Outlet {
    pub(super) async fn open(session: &Session, info: CellInfo) -> zenoh::Result<Self> {
        let kept = Arc::new(Mutex::new(Kept::default()));
        let info_publisher = cached(session, &keys::CELL_INFO, 1).await?;
        told("info", info_publisher.put(&info).await);
        let known = info.clone();
        let of_status = Arc::clone(&kept);
        let of_motions = Arc::clone(&kept);
        let servers = vec![
            serve::value(session, keys::CELL_INFO.any(), move || Ok(known.clone())).await?,
            serve::value(session, keys::CELL_STATUS.any(), move || status(&of_status)).await?,
            serve::values(session, keys::CELL_MOTION.any(), move |asked| {
                motions(&of_motions, asked)
            })
            .await?,
        ];
        Ok(Self {
            session: session.clone(),
            info,
            stop: latest(session, &keys::CELL_STOP).await?,
            frames: latest(session, &keys::CELL_FRAMES).await?,
            status: cached(session, &keys::CELL_STATUS, 1).await?,
            events: cached(session, &keys::CELL_EVENTS, KEPT_EVENTS).await?,
            _info: info_publisher,
            kept,
            _servers: servers,
        })
    }

    pub(super) const fn boot_id(&self) -> Uuid {
        self.info.boot_id
    }

    pub(super) fn publish_stop(&self, request: &StopRequest) {
        told("stop", self.stop.put(request));
    }

    pub(super) fn wants_frames(&self) -> bool {
        self.frames.has_subscribers()
    }

    pub(super) fn publish_frames(&self, frames: &CellFrames) {
        told("frames", self.frames.put(frames));
    }

    pub(super) async fn publish_status(&self, status: CellStatus) {
        told("status", self.status.put(&status).await);
        locked(&self.kept).status = Some(status);
    }

    pub(super) async fn publish_event(&self, mut event: Event) {
        let (kind, message) = (event.kind, &event.message);
        // A robot's event has been in its agent's log, and carries its wall clock.
        if event.details.contains_key(ROBOT_SEQNO) {
            debug!(?kind, "{message}");
            return told("event", self.events.put(&event).await);
        }
        let age = monotonic().saturating_since(event.stamp_ns).as_nanos();
        event.utc_ns = utc_ns().saturating_sub(u64::try_from(age).unwrap_or_default());
        match event.severity {
            Severity::Info => info!(?kind, "{message}"),
            Severity::Warning => warn!(?kind, "{message}"),
            Severity::Error => error!(?kind, "{message}"),
        }
        told("event", self.events.put(&event).await);
    }

    pub(super) fn publish_motion(&self, status: CellMotionStatus) {
        let key = motion_key(&status);
        let (encoding, channel) = (WireEncoding::Json, keys::CELL_MOTION.channel);
        match encoding.encode(&status) {
            Ok(bytes) => {
                let put = self
                    .session
                    .put(&key, bytes)
                    .encoding(encoding.to_zenoh())
                    .priority(channel.priority())
                    .congestion_control(channel.congestion_control())
                    .express(channel.express());
                if let Err(error) = put.wait() {
                    debug!(key, %error, "status of a motion not published");
                }
            }
            Err(error) => warn!(key, %error, "status of a motion cannot be encoded"),
        }
        locked(&self.kept).keep(status);
    }
}

impl Kept {
    fn keep(&mut self, status: CellMotionStatus) {
        let id = status.id;
        if self.motions.insert(id, status).is_none() {
            self.order.push_back(id);
        }
        if self.order.len() > KEPT_MOTIONS
            && let Some(oldest) = self.order.pop_front()
        {
            self.motions.remove(&oldest);
        }
    }
}

fn status(kept: &Mutex<Kept>) -> Result<CellStatus, Denial> {
    let none = || Denial::new(DenialCode::NotReady, "the gateway is starting");
    locked(kept).status.clone().ok_or_else(none)
}

fn motions(kept: &Mutex<Kept>, asked: &str) -> Result<Vec<(String, CellMotionStatus)>, Denial> {
    let kept = locked(kept);
    let id = asked.rsplit('/').next().unwrap_or_default();
    if id == "*" || id == "**" {
        return Ok(kept.motions.values().map(|m| (motion_key(m), m.clone())).collect());
    }
    let found = id.parse().ok().and_then(|id: Uuid| kept.motions.get(&id));
    found.map(|motion| vec![(motion_key(motion), motion.clone())]).ok_or_else(|| {
        let message = format!("the cell has no motion {id:?} on record");
        Denial::new(DenialCode::NotAttached, message)
    })
}

fn motion_key(status: &CellMotionStatus) -> String {
    keys::CELL_MOTION.with(&[&status.id.to_string()])
}

fn locked(kept: &Mutex<Kept>) -> MutexGuard<'_, Kept> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}

async fn latest(session: &Session, key: &Key) -> zenoh::Result<Latest> {
    Latest::declare(session, key.any(), key.channel, WireEncoding::Json).await
}

async fn cached(session: &Session, key: &Key, samples: usize) -> zenoh::Result<Cached> {
    Cached::declare(session, key.any(), key.channel, samples).await
}

/// What cannot be published is told in the log; the next one may get through.
fn told(what: &str, result: Result<(), PublishError>) {
    if let Err(error) = result {
        warn!(what, %error, "not published");
    }
}
