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
/// Stops waiting for the desk; more than that close the gate too, and the desk finds out.
pub(super) const QUEUE: usize = 256;

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
        desk: mpsc::Sender<IncomingStop>,
    ) -> zenoh::Result<Self> {
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
        Ok(Self { _cell: cell, _own: own, _queryable: queryable })
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
        // When the desk is flooded the robot stops all the same, and the desk finds out.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn intake(desk: mpsc::Sender<IncomingStop>) -> Intake {
        let robot = "left_arm".parse().expect("a name");
        Intake { robot, gate: Arc::default(), desk }
    }

    fn payload(level: StopLevel) -> ZBytes {
        let request = StopRequest { level, ..unreadable() };
        WireEncoding::Json.encode(&request).expect("encodes").into()
    }

    #[test]
    fn invariant_02_a_stop_waits_for_nobody_who_records_it() {
        let (desk, mut incoming) = mpsc::channel(1);
        let intake = intake(desk);
        intake.take(Some(&payload(StopLevel::L2)), None, None);
        // Nobody takes it out, so there is no room for the next one.
        intake.take(Some(&payload(StopLevel::L1)), None, None);
        assert_eq!((intake.gate.level(), intake.gate.count()), (Some(StopLevel::L1), 2));
        assert_eq!(incoming.try_recv().expect("the first").request.level, StopLevel::L2);
        drop(incoming);
        intake.take(Some(&payload(StopLevel::L0)), None, None);
        assert_eq!(intake.gate.level(), Some(StopLevel::L0), "whoever recorded stops is dead");
    }

    #[test]
    fn invariant_02_a_stop_of_one_robot_takes_no_lock_of_another() {
        let (desk, _incoming) = mpsc::channel(8);
        let robots: Vec<_> = (0..4).map(|_| intake(desk.clone())).collect();
        let guarded = std::panic::AssertUnwindSafe(|| {
            std::thread::scope(|scope| {
                for (index, robot) in robots.iter().enumerate() {
                    scope.spawn(move || {
                        robot.take(Some(&payload(StopLevel::L1)), None, None);
                        assert_ne!(index, 0, "what panics beside it takes no stop along");
                    });
                }
            });
        });
        assert!(std::panic::catch_unwind(guarded).is_err(), "one of them panicked");
        assert!(robots.iter().all(|robot| robot.gate.level() == Some(StopLevel::L1)));
    }

    #[test]
    fn invariant_03_what_cannot_be_read_stops_too_and_what_is_for_others_does_not() {
        let (desk, mut incoming) = mpsc::channel(8);
        let intake = intake(desk);
        let others = StopRequest {
            scope: StopScope::Robots(vec!["right_arm".parse().expect("a name")]),
            ..unreadable()
        };
        let others = WireEncoding::Json.encode(&others).expect("encodes").into();
        intake.take(Some(&others), None, None);
        assert_eq!(intake.gate.level(), None);
        intake.take(Some(&ZBytes::from("stop!")), None, None);
        assert_eq!(intake.gate.level(), Some(StopLevel::L2));
        assert!(!incoming.try_recv().expect("recorded").readable);
    }
}
