//! Stops as they come in: the gate closes in Zenoh's callback, everything else happens later.
//!
//! What comes in on a stop key and cannot be read stops as well: somebody wanted to stop
//! something, and standing still is the safe reading.

use std::sync::Arc;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::{StopLevel, StopRequest, StopScope};
use tokio::sync::mpsc;
use uuid::Uuid;
use zenoh::Session;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::pubsub::Subscriber;
use zenoh::query::{Query, Queryable};

use super::clock::monotonic;
use super::stop_gate::{Closing, StopGate};

/// Longest stop request that is read \[bytes\].
const MAX_STOP_BYTES: usize = 64 * 1024;
/// Stops waiting for the desk; the gate is closed by more than that too, only unrecorded.
const QUEUE: usize = 256;

/// A stop that has closed the gate.
#[derive(Debug)]
pub(super) struct IncomingStop {
    pub(super) request: StopRequest,
    pub(super) received: MonoTime,
    pub(super) closing: Closing,
    /// Whether the request could be read.
    pub(super) readable: bool,
    /// Where to answer, if it came as a query.
    pub(super) query: Option<Query>,
}

/// Keeps the stop keys open until dropped.
#[derive(Debug)]
pub(super) struct StopIntake {
    _cell: Subscriber<()>,
    _own: Subscriber<()>,
    _queryable: Queryable<()>,
}

/// What the callbacks share.
#[derive(Debug)]
struct Intake {
    robot: RobotName,
    gate: Arc<StopGate>,
    desk: mpsc::Sender<IncomingStop>,
}

impl StopIntake {
    /// Opens the stop keys of a robot.
    ///
    /// # Errors
    /// Zenoh's error if a key cannot be declared.
    pub(super) async fn open(
        session: &Session,
        robot: &RobotName,
        gate: Arc<StopGate>,
    ) -> zenoh::Result<(Self, mpsc::Receiver<IncomingStop>)> {
        let (desk, incoming) = mpsc::channel(QUEUE);
        let intake = Arc::new(Intake { robot: robot.clone(), gate, desk });
        let (for_cell, for_own, for_query) = (intake.clone(), intake.clone(), intake);
        let cell = session
            .declare_subscriber(keys::CELL_STOP.any())
            .callback(move |sample| {
                for_cell.take(Some(sample.payload()), Some(sample.encoding()), None);
            })
            .await?;
        let own = session
            .declare_subscriber(keys::ROBOT_STOP.of(robot))
            .callback(move |sample| {
                for_own.take(Some(sample.payload()), Some(sample.encoding()), None);
            })
            .await?;
        let queryable = session
            .declare_queryable(keys::ROBOT_STOP.of(robot))
            .complete(true)
            .callback(move |query| {
                let (payload, encoding) = (query.payload().cloned(), query.encoding().cloned());
                for_query.take(payload.as_ref(), encoding.as_ref(), Some(query));
            })
            .await?;
        Ok((Self { _cell: cell, _own: own, _queryable: queryable }, incoming))
    }
}

impl Intake {
    fn take(&self, payload: Option<&ZBytes>, encoding: Option<&Encoding>, query: Option<Query>) {
        let received = monotonic();
        let read = payload.and_then(|payload| read(payload, encoding));
        let readable = read.is_some();
        let request = read.unwrap_or_else(unreadable);
        if !request.scope.includes(&self.robot) {
            return;
        }
        let closing = self.gate.close(request.level);
        let stop = IncomingStop { request, received, closing, readable, query };
        // When the desk is flooded the robot stops all the same; repetitions are recorded later.
        drop(self.desk.try_send(stop));
    }
}

fn read(payload: &ZBytes, encoding: Option<&Encoding>) -> Option<StopRequest> {
    let encoding = encoding.map_or(Ok(WireEncoding::Json), WireEncoding::from_zenoh).ok()?;
    encoding.decode(&payload.to_bytes(), MAX_STOP_BYTES).ok()
}

fn unreadable() -> StopRequest {
    StopRequest {
        stop_id: Uuid::now_v7(),
        source: "unreadable request".to_owned(),
        level: StopLevel::L2,
        scope: StopScope::Cell,
        reason: "something that is no stop request came in on a stop key".to_owned(),
        seq: 0,
    }
}
