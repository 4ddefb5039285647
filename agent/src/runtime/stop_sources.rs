//! Asks the sources of stops whether they are pressed; see [`crate::stop_sources`].

use std::sync::Arc;

use armada_protocol::codec::{MAX_MESSAGE_BYTES, WireEncoding};
use armada_protocol::keys;
use armada_protocol::messages::{StopChallenge, StopCheckIn, StopRequest, StopScope};
use armada_protocol::qos::Channel;
use tokio::sync::{Notify, mpsc};
use tokio::time::MissedTickBehavior;
use tracing::debug;
use uuid::Uuid;
use zenoh::Session;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};

use super::board::SharedBoard;
use super::clock::monotonic;
use super::stop_gate::StopGate;
use super::stop_intake::IncomingStop;
use super::stop_watch::StopWatch;
use crate::stop_sources::{ASK_EVERY, Press, SILENCE};

/// How often it is looked whether one has been silent for too long.
const LOOK_EVERY: std::time::Duration = std::time::Duration::from_millis(20);
/// Answers that wait to be looked at; more are lost, as on the network.
const QUEUE: usize = 256;

/// Asks the sources of one robot.
pub(super) struct StopSourceAsker {
    pub(super) session: Session,
    pub(super) board: Arc<SharedBoard>,
    pub(super) gate: Arc<StopGate>,
    /// What the control loop knows of them.
    pub(super) watch: Arc<StopWatch>,
    /// Where stops are recorded; when it is closed the robot ends.
    pub(super) desk: mpsc::Sender<IncomingStop>,
    pub(super) changed: Arc<Notify>,
}

impl StopSourceAsker {
    /// Asks until the robot ends.
    pub(super) async fn run(self) {
        let names: Vec<String> =
            self.board.lock().stop_sources.names().map(str::to_owned).collect();
        if names.is_empty() {
            return;
        }
        let (replies, mut replied) = mpsc::channel(QUEUE);
        let mut ask = tokio::time::interval(ASK_EVERY);
        let mut look = tokio::time::interval(LOOK_EVERY);
        ask.set_missed_tick_behavior(MissedTickBehavior::Delay);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                biased;
                () = self.desk.closed() => return,
                // Before the answers: however many come, a silence is seen.
                _ = look.tick() => self.look(),
                _ = ask.tick() => {
                    for name in &names {
                        self.challenge(name, replies.clone()).await;
                    }
                }
                Some(reply) = replied.recv() => self.take(&reply),
            }
        }
    }

    async fn challenge(&self, name: &str, replies: mpsc::Sender<Reply>) {
        let nonce = Uuid::new_v4();
        let robot = {
            let mut board = self.board.lock();
            board.stop_sources.note_challenge(name, nonce, monotonic());
            board.vocabulary.robot.clone()
        };
        let Ok(payload) = WireEncoding::Json.encode(&StopChallenge { robot, nonce }) else {
            return;
        };
        let asked = self
            .session
            .get(keys::CELL_STOP_SOURCE.with(&[name]))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .payload(payload)
            .encoding(WireEncoding::Json.to_zenoh())
            .priority(Channel::Stop.priority())
            .congestion_control(Channel::Stop.congestion_control())
            .express(Channel::Stop.express())
            .timeout(SILENCE)
            // One that finds no room is as good as lost: silence stops.
            .callback(move |reply| drop(replies.try_send(reply)));
        if let Err(error) = asked.await {
            debug!(name, %error, "a stop source could not be asked");
        }
    }

    fn take(&self, reply: &Reply) {
        // An error is nobody's word that anything is released.
        let Ok(sample) = reply.result() else { return };
        let read = WireEncoding::from_zenoh(sample.encoding()).ok().and_then(|encoding| {
            encoding.decode::<StopCheckIn>(&sample.payload().to_bytes(), MAX_MESSAGE_BYTES).ok()
        });
        let now = monotonic();
        let (taken, changed) = {
            let mut board = self.board.lock();
            let Some(check_in) = read else { return board.count_dropped("unreadable_check_in") };
            let before = board.stop_sources.check_released(now).is_ok();
            let taken = board.stop_sources.handle_check_in(&check_in, now);
            if taken.is_err() {
                board.count_dropped("stop_source_check_in");
            }
            self.watch.note(&board.stop_sources);
            (taken, board.stop_sources.check_released(now).is_ok() != before)
        };
        match taken {
            Ok(Some(press)) => self.stop(press),
            Ok(None) => {}
            Err(error) => debug!(%error, "check-in of a stop source not taken"),
        }
        if changed {
            self.changed.notify_one();
        }
    }

    fn look(&self) {
        loop {
            let press = self.board.lock().stop_sources.poll_silence(monotonic());
            let Some(press) = press else { return };
            self.stop(press);
            self.changed.notify_one();
        }
    }

    /// Closes the gate, then has it recorded.
    fn stop(&self, press: Press) {
        let received = monotonic();
        let closing = self.gate.close(press.level);
        let robot = self.board.lock().vocabulary.robot.clone();
        let request = StopRequest {
            stop_id: Uuid::now_v7(),
            reason: format!("stop source {} is {}", press.source, press.cause),
            source: press.source,
            level: press.level,
            scope: StopScope::Robots(vec![robot]),
            seq: 0,
        };
        let stop = IncomingStop { request, received, closing, readable: true, query: None };
        // When the desk is flooded the robot stops all the same, and the desk finds out.
        drop(self.desk.try_send(stop));
    }
}
