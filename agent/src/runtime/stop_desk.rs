//! The desk's part in stops: recorded, acknowledged, kept. The gate is closed long before.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::client::{Client, StopOptions};
use armada_protocol::messages::{
    EventKind, LatchedStop, Severity, StopAck, StopLevel, StopRequest, StopScope, StopStage,
    StopVerdict,
};
use serde_json::json;
use tracing::{debug, info, warn};
use uuid::Uuid;

use super::board::Board;
use super::clock::monotonic;
use super::desk::{Desk, map};
use super::stop_gate::Closing;
use super::stop_intake::IncomingStop;
use super::stop_latch::{CONTROLLER, ReceivedStop, StopRecord, untold_stop};

/// Most stops that are written down one by one; those beyond are one more together.
const MAX_STOPS: usize = 256;
/// What is said of a closing of the gate that nobody has told of.
const UNTOLD: &str = "a stop that was not written down: in a flood of them, or because nobody asks the \
                      sources of stops any more";
/// How long the whole cell gets to stand still when an emergency stop of one robot stops it.
const CELL_PATIENCE: Duration = Duration::from_secs(5);

impl Desk {
    /// Records a stop whose gate is closed already, and acknowledges what has been reached.
    pub(super) async fn take_stop(&mut self, stop: IncomingStop) {
        let IncomingStop { request, received, closing, readable, query } = stop;
        if !readable {
            self.board.lock().count_dropped("unreadable_stop");
        }
        let latched = LatchedStop {
            stop_id: request.stop_id,
            source: request.source,
            level: request.level,
            reason: request.reason,
        };
        let (acks, is_new) = self.record(latched.clone(), received, closing);
        if let (Some(query), Some(highest)) = (query, acks.last()) {
            self.answer(&query, highest).await;
        }
        if is_new {
            self.tell_stop(&latched, received).await;
        }
    }

    /// Records the emergency stop of the controller, for which the loop has closed the gate, and
    /// stops the cell if it is to.
    pub(super) async fn take_emergency_stop(&mut self, stamp: MonoTime, closing: Closing) {
        let latched = LatchedStop {
            stop_id: Uuid::now_v7(),
            source: CONTROLLER.to_owned(),
            level: StopLevel::L1,
            reason: "the emergency stop of the controller was pressed".to_owned(),
        };
        self.record(latched.clone(), stamp, closing);
        if self.estop_stops_cell {
            self.stop_cell(latched.stop_id);
        }
        self.tell_stop(&latched, stamp).await;
    }

    /// Notes that the loop stops harder, since standstill was not measured in time.
    pub(super) async fn take_raise(&mut self, stamp: MonoTime, level: StopLevel) {
        {
            let mut board = self.board.lock();
            // What was reached before was reached at the lower level.
            board.stages.retain(|(_, reached)| *reached >= stamp);
            let Some(record) = &mut board.stop else { return };
            record.level = record.level.max(level);
            (record.stage, record.nonce) = (StopStage::Received, Uuid::new_v4());
            self.keeper.keep(board.kept());
        }
        warn!(?level, "no standstill in time: stopping harder");
        let message = format!("no standstill was measured in time: stop raised to {level:?}");
        let details = map(json!({ "level": level }));
        self.event(stamp, Severity::Error, EventKind::Stop, message, details).await;
    }

    pub(super) async fn take_stage(&mut self, stamp: MonoTime, stage: StopStage) {
        let acks = {
            let mut board = self.board.lock();
            board.stages.push((stage, stamp));
            match &mut board.stop {
                Some(record) => {
                    record.stage = stage;
                    let stops = record.stops.clone();
                    stops.iter().map(|stop| ack(&board, stop, stage, stamp)).collect::<Vec<_>>()
                }
                None => Vec::new(),
            }
        };
        for ack in &acks {
            self.acknowledge(ack);
        }
        info!(?stage, "stop");
        let message = format!("stop reached {stage:?}").to_lowercase();
        let details = map(json!({ "stage": stage }));
        self.event(stamp, Severity::Info, EventKind::Stop, message, details).await;
    }

    /// Records a stop for closings of the gate that nobody has told of for two looks in a row: their
    /// messages were lost in a flood, and without a record no reset could open the gate again.
    pub(super) async fn record_untold(&mut self) {
        let (count, level) = (self.gate.count(), self.gate.level());
        let told = self.board.lock().stop.as_ref().map(|stop| stop.gate_count);
        let untold = level.filter(|_| told < Some(count));
        let seen = std::mem::replace(&mut self.untold, untold.map(|_| count));
        let Some(level) = untold.filter(|_| seen.is_some()) else { return };
        self.untold = None;
        let latched = untold_stop(level, UNTOLD);
        let now = monotonic();
        self.record(latched.clone(), now, Closing { count, raised: false });
        self.tell_stop(&latched, now).await;
    }

    /// Writes a stop onto the board, has it kept, and acknowledges what has been reached; returns
    /// these stages, and whether it was not known before.
    fn record(
        &self,
        latched: LatchedStop,
        received: MonoTime,
        closing: Closing,
    ) -> (Vec<StopAck>, bool) {
        let (acks, is_new) = {
            // A reset opens the gate under the same lock.
            let mut board = self.board.lock();
            let closing = match self.gate.level() {
                Some(_) => closing,
                // It was opened by a reset that could not know of this stop, which is never lost.
                None => self.gate.close(latched.level),
            };
            let before = board.stop.as_ref().map(|stop| (stop.level, stop.stops.len()));
            let recorded = record_stop(&mut board, latched, received, closing);
            let after = board.stop.as_ref().map(|stop| (stop.level, stop.stops.len()));
            if before != after {
                self.keeper.keep(board.kept());
            }
            recorded
        };
        for ack in &acks {
            self.acknowledge(ack);
        }
        (acks, is_new)
    }

    async fn tell_stop(&mut self, stop: &LatchedStop, received: MonoTime) {
        let LatchedStop { stop_id, source, level, reason } = stop;
        warn!(%stop_id, source, ?level, reason, "stop");
        let message = format!("stop {level:?} by {source}: {reason}");
        let details = map(json!({ "stop_id": stop_id, "level": level }));
        self.event(received, Severity::Warning, EventKind::Stop, message, details).await;
        self.publish_status().await;
    }

    /// Stops the whole cell because of a stop of this robot, whose own gate is closed already.
    fn stop_cell(&self, cause: Uuid) {
        let robot = self.board.lock().vocabulary.robot.clone();
        let client = Client::on_session(self.session.clone(), robot.as_str());
        let request = StopRequest {
            stop_id: Uuid::now_v7(),
            source: robot.to_string(),
            level: StopLevel::L1,
            scope: StopScope::Cell,
            reason: format!("emergency stop of the controller of {robot} (stop {cause})"),
            seq: 0,
        };
        start(async move {
            let options = StopOptions { expected: Vec::new(), timeout: CELL_PATIENCE };
            match client.stop(request, options).await {
                Ok(report) if report.verdict == StopVerdict::Complete => info!("the cell stands"),
                Ok(report) => warn!(missing = ?report.missing, "stop of the cell INCOMPLETE"),
                Err(error) => warn!(%error, "stop of the cell not sent"),
            }
        });
    }

    fn acknowledge(&self, ack: &StopAck) {
        if let Err(error) = self.stop_acks.put(ack) {
            debug!(%error, "stop not acknowledged");
        }
    }
}

/// Writes a stop onto the board; returns the stages it has reached, lowest first, and whether it
/// was not known before.
fn record_stop(
    board: &mut Board,
    latched: LatchedStop,
    received: MonoTime,
    closing: Closing,
) -> (Vec<StopAck>, bool) {
    if board.stop.is_none() || closing.raised {
        // Stages of before the closing are of an older stop or a lower level.
        board.stages.retain(|(_, stamp)| *stamp >= received);
    }
    let reached = board.stages.clone();
    let stage = reached.last().map_or(StopStage::Received, |(stage, _)| *stage);
    let record = board.stop.get_or_insert_with(|| StopRecord {
        level: latched.level,
        stops: Vec::new(),
        stage,
        gate_count: closing.count,
        nonce: Uuid::new_v4(),
    });
    record.level = record.level.max(latched.level);
    record.gate_count = record.gate_count.max(closing.count);
    record.stage = stage;
    let at = record.stops.iter().position(|known| known.stop.stop_id == latched.stop_id);
    let is_new = at.is_none();
    if is_new && record.stops.len() >= MAX_STOPS {
        return (crowded(board, latched, received, &reached), false);
    }
    let known = at.and_then(|at| record.stops.get_mut(at));
    let stop = if let Some(known) = known {
        known.stop.level = known.stop.level.max(latched.level);
        known.clone()
    } else {
        let stop = ReceivedStop { stop: latched, received };
        record.stops.push(stop.clone());
        record.nonce = Uuid::new_v4();
        stop
    };
    (acks_of(board, &stop, &reached), is_new)
}

/// What is to be said of a stop: that it was received, and the stages that have been reached.
fn acks_of(board: &Board, stop: &ReceivedStop, reached: &[(StopStage, MonoTime)]) -> Vec<StopAck> {
    let received = std::iter::once((StopStage::Received, stop.received));
    let stages = received.chain(reached.iter().copied());
    stages.map(|(stage, stamp)| ack(board, stop, stage, stamp.max(stop.received))).collect()
}

/// Takes a stop that there is no room for: it is acknowledged, and its level counts.
fn crowded(
    board: &mut Board,
    latched: LatchedStop,
    received: MonoTime,
    reached: &[(StopStage, MonoTime)],
) -> Vec<StopAck> {
    if let Some(record) = board.stop.as_mut().filter(|record| record.stops.len() == MAX_STOPS) {
        let stop =
            untold_stop(latched.level, "more stops came in than are written down one by one");
        record.stops.push(ReceivedStop { stop, received });
        record.nonce = Uuid::new_v4();
    }
    acks_of(board, &ReceivedStop { stop: latched, received }, reached)
}

fn ack(board: &Board, stop: &ReceivedStop, stage: StopStage, stamp: MonoTime) -> StopAck {
    StopAck {
        stop_id: stop.stop.stop_id,
        robot: board.vocabulary.robot.clone(),
        boot_id: board.boot_id,
        stage,
        stamp_ns: stamp,
        since_received_ms: stamp.saturating_since(stop.received).as_secs_f64() * 1e3,
    }
}

#[expect(clippy::disallowed_methods, reason = "the runtime is where tasks are started")]
fn start(task: impl Future<Output = ()> + Send + 'static) {
    tokio::spawn(task);
}

#[cfg(test)]
mod tests {
    use armada_model::JointLimits;
    use armada_protocol::messages::{DenialCode, ResetZone};

    use super::super::words::Vocabulary;
    use super::*;
    use crate::control::{Input, LoopState, Params, step};

    fn board() -> Board {
        let limits = JointLimits {
            lower: Some(-1.0),
            upper: Some(1.0),
            velocity: 1.0,
            acceleration: Some(1.0),
            jerk: None,
            effort: None,
        };
        let params = Params::for_joints(vec![limits], Duration::from_millis(2)).expect("one joint");
        let mut state = LoopState::new(&params).expect("sensible");
        let snapshot = step(&params, &mut state, &mut Input::at(at(0))).snapshot;
        let robot = "left_arm".parse().expect("a name");
        Board::new(Vocabulary::new(robot, Vec::new()), Uuid::nil(), snapshot)
    }

    fn at(ms: u64) -> MonoTime {
        MonoTime::from_nanos(1_000_000_000 + ms * 1_000_000)
    }

    fn stop(number: u128, level: StopLevel) -> LatchedStop {
        let (stop_id, source) = (Uuid::from_u128(number), "test".to_owned());
        LatchedStop { stop_id, source, level, reason: String::new() }
    }

    fn record(board: &mut Board, number: u128, level: StopLevel) -> (Vec<StopAck>, bool) {
        let count = board.stop.as_ref().map_or(0, |stop| stop.gate_count) + 1;
        record_stop(board, stop(number, level), at(10), Closing { count, raised: false })
    }

    #[test]
    fn invariant_06_a_repetition_at_a_higher_level_raises_the_stop_and_a_lower_one_does_not() {
        let mut board = board();
        assert!(record(&mut board, 1, StopLevel::L2).1);
        assert!(!record(&mut board, 1, StopLevel::L0).1, "the same stop");
        assert!(!record(&mut board, 1, StopLevel::L1).1);
        let latch = board.latch(at(20)).expect("latched");
        assert_eq!((latch.level, latch.stops.len()), (StopLevel::L0, 1));
        assert_eq!(latch.stops[0].level, StopLevel::L0);
    }

    #[test]
    fn a_flood_of_stops_is_acknowledged_one_by_one_and_does_not_grow_for_ever() {
        let mut board = board();
        for number in 1..=2_000 {
            let (acks, _) = record(&mut board, number, StopLevel::L2);
            assert_eq!(acks[0].stop_id, Uuid::from_u128(number));
            let stands = acks.last().is_some_and(|ack| ack.stage == StopStage::Standstill);
            assert_eq!(stands, number > 1, "that it stands is told of each");
            board.stages = vec![(StopStage::Standstill, at(12))];
        }
        record(&mut board, 3_000, StopLevel::L1);
        let latch = board.latch(at(20)).expect("latched");
        assert_eq!((latch.level, latch.stops.len()), (StopLevel::L1, MAX_STOPS + 1));
        let params = latch.reset_params();
        let record = board.stop.take().expect("latched");
        assert_eq!(board.check_reset(&record, &params, at(20)), Ok(()), "all that is listed");
    }

    #[test]
    fn a_nonce_is_new_after_each_stop_and_stays_for_a_repetition() {
        let mut board = board();
        record(&mut board, 1, StopLevel::L2);
        let nonce = |board: &Board| board.latch(at(20)).expect("latched").reset.nonce;
        let first = nonce(&board);
        record(&mut board, 1, StopLevel::L2);
        assert_eq!(nonce(&board), first);
        record(&mut board, 2, StopLevel::L2);
        assert_ne!(nonce(&board), first);
    }

    #[test]
    fn an_acknowledgement_is_good_for_ten_seconds_after_the_last_stop() {
        let mut board = board();
        board.reset_rules.zone = ResetZone::Manual;
        record(&mut board, 1, StopLevel::L2);
        let acknowledged =
            |board: &Board, now| board.latch(at(now)).expect("latched").reset.acknowledged;
        assert!(!acknowledged(&board, 20));
        board.snapshot.acknowledged = Some(at(10));
        assert!(!acknowledged(&board, 20), "not after the stop");
        board.snapshot.acknowledged = Some(at(11));
        assert!(acknowledged(&board, 20) && acknowledged(&board, 10_011));
        assert!(!acknowledged(&board, 10_012), "too long ago");
    }

    #[test]
    fn an_emergency_stop_that_cannot_be_seen_any_more_counts_as_pressed() {
        let mut board = board();
        let controller = LatchedStop { source: CONTROLLER.to_owned(), ..stop(1, StopLevel::L1) };
        board.stages = vec![(StopStage::Standstill, at(10))];
        record_stop(&mut board, controller, at(10), Closing { count: 1, raised: true });
        let params = board.latch(at(20)).expect("latched").reset_params();
        let record = board.stop.take().expect("latched");
        let mut check = |pressed| {
            board.snapshot.emergency_stop = pressed;
            board.check_reset(&record, &params, at(20)).map_err(|denial| denial.code)
        };
        assert_eq!(check(None), Err(DenialCode::NotReady));
        assert_eq!(check(Some(true)), Err(DenialCode::NotReady));
        assert_eq!(check(Some(false)), Ok(()));
    }

    #[test]
    fn a_robot_that_was_not_measured_to_stand_is_not_reset() {
        for (reached, granted) in [
            (None, false),
            (Some(StopStage::Commanded), false),
            (Some(StopStage::Standstill), true),
        ] {
            let mut board = board();
            board.stages = reached.map(|stage| (stage, at(12))).into_iter().collect();
            record(&mut board, 1, StopLevel::L1);
            let params = board.latch(at(20)).expect("latched").reset_params();
            let record = board.stop.take().expect("latched");
            let checked = board.check_reset(&record, &params, at(20));
            assert_eq!(checked.is_ok(), granted, "{reached:?}: {checked:?}");
        }
    }
}
