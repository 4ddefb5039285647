//! The task that turns what the loop and the stop keys say into messages.

mod dropped;
mod streams;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::{Event, EventKind, MotionStatus, Severity, StopAck};
use armada_protocol::publish::{Cached, Latest};
use armada_protocol::qos::Channel;
use armada_protocol::serve;
use serde_json::{Map, Value, json};
use tokio::sync::{Notify, mpsc, watch};
use tokio::time::MissedTickBehavior;
use tracing::{debug, info, warn};
use uuid::Uuid;
use zenoh::Session;
use zenoh::query::Query;

use super::board::{Board, SharedBoard};
use super::clock::{monotonic, utc_ns};
use super::leases::LeaseNews;
use super::mailbox::StampedEvent;
use super::meter::{Meter, MeterReader};
use super::stop_gate::{Closing, StopGate};
use super::stop_intake::IncomingStop;
use super::stop_keeper::StopKeeper;
use super::words::{name, operational_name};
use crate::control::{LeaseChange, LoopEvent, Refusal};

pub(super) use dropped::DroppedCommands;
pub(super) use streams::Flapping;

/// How often progress of a motion is published.
const PROGRESS: Duration = Duration::from_millis(100);
/// The status is published at least every so many periods of [`PROGRESS`].
const STATUS_EVERY: u32 = 10;

/// What happened, from outside the loop, to be recorded as an event.
#[derive(Debug)]
pub(super) struct Remark {
    pub(super) severity: Severity,
    pub(super) kind: EventKind,
    pub(super) message: String,
    pub(super) details: Map<String, Value>,
}

/// The senders of the desk.
pub(super) struct Desk {
    pub(super) session: Session,
    pub(super) board: Arc<SharedBoard>,
    pub(super) meter: Arc<Meter>,
    pub(super) reader: MeterReader,
    pub(super) status: Cached,
    pub(super) events: Cached,
    pub(super) stop_acks: Latest,
    pub(super) boot_id: Uuid,
    pub(super) event_seqno: u64,
    pub(super) flapping: Flapping,
    pub(super) dropped_commands: DroppedCommands,
    /// Counts the resets that have reached the loop.
    pub(super) cleared: watch::Sender<u64>,
    pub(super) gate: Arc<StopGate>,
    pub(super) keeper: Arc<StopKeeper>,
    /// Whether an emergency stop of the controller stops the cell.
    pub(super) estop_stops_cell: bool,
    /// A count of the gate that no record is known of.
    pub(super) untold: Option<u64>,
}

/// What the desk listens to.
pub(super) struct Inboxes {
    pub(super) loop_events: mpsc::Receiver<StampedEvent>,
    pub(super) stops: mpsc::Receiver<IncomingStop>,
    pub(super) remarks: mpsc::Receiver<Remark>,
    /// The robot's condition has changed, with or without an event.
    pub(super) changed: Arc<Notify>,
}

impl Desk {
    /// Works until the loop's events end.
    pub(super) async fn run(mut self, mut inboxes: Inboxes) {
        let mut clock = tokio::time::interval(PROGRESS);
        clock.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let mut beats = 0;
        loop {
            tokio::select! {
                biased;
                Some(stop) = inboxes.stops.recv() => self.take_stop(stop).await,
                event = inboxes.loop_events.recv() => match event {
                    Some((stamp, event)) => self.take_event(stamp, event).await,
                    None => break,
                },
                Some(remark) = inboxes.remarks.recv() => self.remark(remark).await,
                () = inboxes.changed.notified() => self.publish_status().await,
                _ = clock.tick() => {
                    self.progress().await;
                    beats += 1;
                    if beats % STATUS_EVERY == 0 {
                        self.publish_status().await;
                    }
                }
            }
        }
        while let Ok(stop) = inboxes.stops.try_recv() {
            self.take_stop(stop).await;
        }
        while let Ok(remark) = inboxes.remarks.try_recv() {
            self.remark(remark).await;
        }
    }

    async fn take_event(&mut self, stamp: MonoTime, event: LoopEvent) {
        match event {
            LoopEvent::Answer { ticket, result } => {
                let asker = self.board.lock().tickets.remove(&ticket);
                // An asker that gave up has been told so already.
                if let Some(asker) = asker {
                    let _ = asker.send(result);
                }
                return;
            }
            LoopEvent::Mode { from, to } => {
                let message = format!("mode {} -> {}", name(from), name(to));
                info!(from = ?from, to = ?to, "mode changed");
                let details = map(json!({ "from": name(from), "to": name(to) }));
                self.event(stamp, Severity::Info, EventKind::ModeChanged, message, details).await;
            }
            LoopEvent::Motion(report) => self.take_motion(stamp, &report).await,
            LoopEvent::FaultLatched(fault) => {
                let fault = self.board.lock().vocabulary.fault(&fault);
                warn!(code = ?fault.code, message = %fault.message, "fault latched");
                self.board.lock().faults.push(fault.clone());
                let details = map(json!({ "code": fault.code }));
                self.event(stamp, Severity::Error, EventKind::FaultLatched, fault.message, details)
                    .await;
            }
            LoopEvent::FaultsCleared => {
                self.board.lock().faults.clear();
                info!("faults cleared");
                let message = "faults cleared".to_owned();
                self.event(stamp, Severity::Info, EventKind::FaultsCleared, message, Map::new())
                    .await;
            }
            LoopEvent::Lease(change) => self.take_lease(stamp, change).await,
            LoopEvent::LocalControl(local) => self.take_local_control(stamp, local).await,
            LoopEvent::OperationalMode { from, to } => {
                let (from, to) = (operational_name(from), operational_name(to));
                warn!(from, to, "key switch turned");
                let message = format!("operational mode {from} -> {to}");
                let details = map(json!({ "from": from, "to": to }));
                let kind = EventKind::OperationalModeChanged;
                self.event(stamp, Severity::Warning, kind, message, details).await;
            }
            LoopEvent::Stream(change) => self.take_stream(stamp, change).await,
            LoopEvent::StopRaised(level) => self.take_raise(stamp, level).await,
            LoopEvent::EmergencyStop { closing: count, raised } => {
                self.take_emergency_stop(stamp, Closing { count, raised }).await;
            }
            LoopEvent::StopStage(stage) => self.take_stage(stamp, stage).await,
            LoopEvent::StopCleared => {
                info!("stop reset");
                self.cleared.send_modify(|count| *count += 1);
                let reset_by = self.board.lock().reset_by.take();
                let (client, stop_ids) = reset_by.unwrap_or_default();
                let message = format!("stop reset by {client}: nothing moves, nothing was enabled");
                let details = map(json!({ "client": client, "stop_ids": stop_ids }));
                self.event(stamp, Severity::Info, EventKind::Reset, message, details).await;
            }
        }
        self.publish_status().await;
    }

    /// Says who may command now; a lease itself is a secret of its holder.
    async fn take_lease(&mut self, stamp: MonoTime, change: LeaseChange) {
        let LeaseNews { severity, message, details } = {
            let mut board = self.board.lock();
            let Board { leases, snapshot, .. } = &mut *board;
            leases.take(stamp, change, snapshot)
        };
        info!("{message}");
        self.event(stamp, severity, EventKind::Lease, message, details).await;
    }

    async fn take_local_control(&mut self, stamp: MonoTime, local: bool) {
        self.board.lock().local_since = local.then_some(stamp);
        let (change, message) = match local {
            true => ("local", "the pendant has control: nobody else may command"),
            false => ("free", "the pendant gave control back: nothing resumes by itself"),
        };
        warn!(change, "{message}");
        let details = map(json!({ "change": change, "holder": "pendant" }));
        let message = message.to_owned();
        self.event(stamp, Severity::Warning, EventKind::Lease, message, details).await;
    }

    async fn take_motion(&mut self, stamp: MonoTime, report: &crate::control::MotionReport) {
        let status = {
            let mut board = self.board.lock();
            let reason = report.reason.as_ref().map(|refusal| board.denial(refusal));
            board.motions.take(stamp, report, reason)
        };
        let Some(status) = status else { return };
        self.publish_motion(&status).await;
        self.follow_parts(stamp, &status).await;
        if status.status.is_terminal() {
            info!(motion = %status.id, status = ?status.status, "motion ended");
            let why =
                status.reason.as_ref().map(|d| format!(": {}", d.message)).unwrap_or_default();
            let message = format!("motion {:?}{why}", status.status).to_lowercase();
            let details = map(json!({ "id": status.id, "status": status.status }));
            let severity = match status.status {
                armada_protocol::messages::ActionStatus::Failed => Severity::Warning,
                _ => Severity::Info,
            };
            self.event(stamp, severity, EventKind::MotionEnded, message, details).await;
        }
    }

    async fn remark(&mut self, remark: Remark) {
        let Remark { severity, kind, message, details } = remark;
        self.event(monotonic(), severity, kind, message, details).await;
        self.publish_status().await;
    }

    async fn progress(&mut self) {
        let now = monotonic();
        let statistics = self.reader.read(&self.meter, now);
        let refusal = self.meter.link_refusal();
        let (status, changed) = {
            let mut board = self.board.lock();
            let changed = std::mem::replace(&mut board.link_refusal, refusal) != refusal;
            board.statistics = statistics;
            board.panics = self.meter.panics.load(Ordering::Relaxed);
            for (what, counter) in [
                ("malformed_packet", &self.meter.malformed_packets),
                ("refused_by_controller", &self.meter.refused),
                ("lost_loop_event", &self.meter.lost_events),
            ] {
                let count = counter.load(Ordering::Relaxed);
                if count > 0 {
                    board.dropped.insert(what.to_owned(), count);
                }
            }
            let snapshot = board.snapshot;
            (board.motions.progress(&snapshot), changed)
        };
        if changed {
            self.publish_status().await;
        }
        if let Some(status) = status {
            self.publish_motion(&status).await;
            self.follow_parts(now, &status).await;
        }
        self.forget_collected(now).await;
        self.settle_streams(now).await;
        self.settle_dropped(now).await;
        self.record_untold().await;
    }

    /// Publishes what a status means for the moves that are parts of the motion.
    async fn follow_parts(&self, stamp: MonoTime, whole: &MotionStatus) {
        let ended = {
            let mut board = self.board.lock();
            let Board { connected, motions, .. } = &mut *board;
            connected.follow(motions, stamp, whole)
        };
        for status in &ended {
            self.publish_motion(status).await;
        }
    }

    /// Ends collected moves that will never be made.
    async fn forget_collected(&self, stamp: MonoTime) {
        let ended = {
            let mut board = self.board.lock();
            let Board { connected, motions, vocabulary, snapshot, .. } = &mut *board;
            connected.forget(motions, (stamp, snapshot.epoch), |cancelled| {
                let why = if cancelled { Refusal::Cancelled } else { Refusal::ModeLeft };
                vocabulary.denial(&why)
            })
        };
        for status in &ended {
            self.publish_motion(status).await;
        }
    }

    pub(super) async fn publish_status(&mut self) {
        let status = self.board.lock().status(monotonic());
        if let Err(error) = self.status.put(&status).await {
            debug!(%error, "status not published");
        }
    }

    /// Motions come and go, so their keys are not declared.
    async fn publish_motion(&self, status: &MotionStatus) {
        let id = status.id.to_string();
        let key = keys::ROBOT_MOTION.with(&[status.robot.as_str(), &id]);
        let Ok(bytes) = WireEncoding::Json.encode(status) else { return };
        let put = self
            .session
            .put(key, bytes)
            .encoding(WireEncoding::Json.to_zenoh())
            .priority(Channel::Progress.priority())
            .congestion_control(Channel::Progress.congestion_control());
        if let Err(error) = put.await {
            debug!(%error, "motion status not published");
        }
    }

    pub(super) async fn event(
        &mut self,
        stamp: MonoTime,
        severity: Severity,
        kind: EventKind,
        message: String,
        details: Map<String, Value>,
    ) {
        let seqno = self.event_seqno;
        self.event_seqno += 1;
        let event = Event {
            robot: Some(self.board.lock().vocabulary.robot.clone()),
            boot_id: self.boot_id,
            seqno,
            stamp_ns: stamp,
            utc_ns: utc_ns(),
            severity,
            kind,
            message,
            details,
        };
        if let Err(error) = self.events.put(&event).await {
            debug!(%error, "event not published");
        }
    }

    pub(super) async fn answer(&self, query: &Query, ack: &StopAck) {
        let encoding = query
            .encoding()
            .and_then(|label| WireEncoding::from_zenoh(label).ok())
            .unwrap_or_default();
        serve::reply(query, &keys::ROBOT_STOP.of(&ack.robot), encoding, ack).await;
    }
}

pub(super) fn map(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}
