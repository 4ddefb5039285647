//! Samples on their way to the executor. Callbacks run on Zenoh's receiving threads: they only put
//! things down.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::keys::{self, Key};
use tokio::sync::{Notify, mpsc};
use zenoh::Session;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Locality, Sample, SampleKind};
use zenoh_ext::{AdvancedSubscriber, AdvancedSubscriberBuilderExt, RecoveryConfig};

use super::clock::monotonic;

/// Statuses of motions that wait for the executor.
const MOTIONS: usize = 1024;
/// Events that wait for the executor.
const EVENTS: usize = 1024;
/// Stops and acknowledgements that wait for the executor.
const STOPS: usize = 256;

/// The executor's end.
pub(super) struct Intake {
    pub(super) slots: Arc<Slots>,
    /// Samples of `cell/stop` and `stop/ack`.
    pub(super) stops: mpsc::Receiver<Sample>,
    pub(super) motions: mpsc::Receiver<Sample>,
    pub(super) events: mpsc::Receiver<Sample>,
    _events: AdvancedSubscriber<()>,
    _subscribers: Vec<Subscriber<()>>,
}

/// The newest of everything of which only the newest counts.
pub(super) struct Slots {
    robots: BTreeMap<RobotName, Mutex<Slot>>,
    /// Raised when there is something but states, which are fetched at their own pace.
    pub(super) wake: Notify,
    /// Samples of robots that the cell does not have.
    pub(super) strangers: AtomicU64,
    /// Samples that found their queue full.
    pub(super) overflow: AtomicU64,
}

/// What came in about one robot since it was taken last.
#[derive(Default)]
pub(super) struct Slot {
    pub(super) online: Option<bool>,
    pub(super) info: Option<Sample>,
    pub(super) status: Option<Sample>,
    pub(super) state: Option<Sample>,
    /// When the state came in.
    pub(super) arrived: MonoTime,
    /// How many states came in.
    pub(super) arrivals: u32,
}

impl Slots {
    /// The robots of the cell, each with what waits for it.
    pub(super) fn each(&self) -> impl Iterator<Item = (&RobotName, MutexGuard<'_, Slot>)> {
        self.robots.iter().map(|(robot, slot)| (robot, locked(slot)))
    }

    fn put(&self, sample: &Sample, put: impl FnOnce(&mut Slot)) {
        let robot = keys::robot_of(sample.key_expr().as_str());
        match robot.and_then(|robot| self.robots.get(&robot)) {
            Some(slot) => put(&mut locked(slot)),
            None => {
                self.strangers.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

fn locked(slot: &Mutex<Slot>) -> MutexGuard<'_, Slot> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Intake {
    /// Subscribes to everything the agents of `robots` publish, and to the cell's stops.
    pub(super) async fn open(session: &Session, robots: Vec<RobotName>) -> zenoh::Result<Self> {
        let slots = Arc::new(Slots {
            robots: robots.into_iter().map(|robot| (robot, Mutex::default())).collect(),
            wake: Notify::new(),
            strangers: AtomicU64::new(0),
            overflow: AtomicU64::new(0),
        });
        let (stop_sender, stops) = mpsc::channel(STOPS);
        let (motion_sender, motions) = mpsc::channel(MOTIONS);
        let (event_sender, events) = mpsc::channel(EVENTS);
        let event_subscriber =
            recovered(session, &keys::ROBOT_EVENTS, &slots, event_sender).await?;
        let subscribers = vec![
            queue(session, &keys::CELL_STOP, &slots, stop_sender.clone()).await?,
            queue(session, &keys::ROBOT_STOP_ACK, &slots, stop_sender).await?,
            queue(session, &keys::ROBOT_MOTION, &slots, motion_sender).await?,
            slot(session, &keys::ROBOT_INFO, &slots, |slot, sample| slot.info = Some(sample))
                .await?,
            slot(session, &keys::ROBOT_STATUS, &slots, |slot, sample| slot.status = Some(sample))
                .await?,
            states(session, &slots).await?,
            presence(session, &slots).await?,
        ];
        Ok(Self {
            slots,
            stops,
            motions,
            events,
            _events: event_subscriber,
            _subscribers: subscribers,
        })
    }
}

async fn queue(
    session: &Session,
    key: &Key,
    slots: &Arc<Slots>,
    queue: mpsc::Sender<Sample>,
) -> zenoh::Result<Subscriber<()>> {
    let slots = Arc::clone(slots);
    session
        .declare_subscriber(key.any())
        // The gateway's own stops need not come back to it.
        .allowed_origin(Locality::Remote)
        .callback(move |sample| {
            if queue.try_send(sample).is_err() {
                slots.overflow.fetch_add(1, Ordering::Relaxed);
            }
        })
        .await
}

/// As [`queue`], for samples that their publisher keeps: one that is missed is asked for.
async fn recovered(
    session: &Session,
    key: &Key,
    slots: &Arc<Slots>,
    queue: mpsc::Sender<Sample>,
) -> zenoh::Result<AdvancedSubscriber<()>> {
    let slots = Arc::clone(slots);
    session
        .declare_subscriber(key.any())
        .callback(move |sample| {
            if queue.try_send(sample).is_err() {
                slots.overflow.fetch_add(1, Ordering::Relaxed);
            }
        })
        .advanced()
        .recovery(RecoveryConfig::default().heartbeat())
        .await
}

async fn slot(
    session: &Session,
    key: &Key,
    slots: &Arc<Slots>,
    put: fn(&mut Slot, Sample),
) -> zenoh::Result<Subscriber<()>> {
    let slots = Arc::clone(slots);
    session
        .declare_subscriber(key.any())
        .callback(move |sample| {
            slots.put(&sample.clone(), |slot| put(slot, sample));
            slots.wake.notify_one();
        })
        .await
}

async fn states(session: &Session, slots: &Arc<Slots>) -> zenoh::Result<Subscriber<()>> {
    let slots = Arc::clone(slots);
    session
        .declare_subscriber(keys::ROBOT_STATE.any())
        .callback(move |sample| {
            slots.put(&sample.clone(), |slot| {
                slot.state = Some(sample);
                slot.arrived = monotonic();
                slot.arrivals = slot.arrivals.saturating_add(1);
            });
        })
        .await
}

async fn presence(session: &Session, slots: &Arc<Slots>) -> zenoh::Result<Subscriber<()>> {
    let slots = Arc::clone(slots);
    session
        .liveliness()
        .declare_subscriber(keys::ROBOT_ALIVE.any())
        .history(true)
        .callback(move |sample| {
            let online = sample.kind() == SampleKind::Put;
            slots.put(&sample, |slot| slot.online = Some(online));
            slots.wake.notify_one();
        })
        .await
}
