//! Every robot's events in one ordered stream with the gateway's own.
//!
//! An event keeps what it says; its number and run become the gateway's, and those it had are in
//! its details as `robot_seqno` and `robot_boot_id`. Numbers that were skipped are told as an event.

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{Event, EventKind, Severity};
use serde_json::{Map, Value};
use uuid::Uuid;

use super::Coordinator;
use super::outbox::Happening;

/// Detail of an event that was a robot's: its number there.
pub const ROBOT_SEQNO: &str = "robot_seqno";

/// The run of a robot's agent that events come from, and the number of the next one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heard {
    boot_id: Uuid,
    next: u64,
}

impl Coordinator {
    pub(super) fn on_robot_event(&mut self, event: Event, now: MonoTime) {
        let Some(robot) = event.robot.clone() else { return };
        if self.admitted(&robot, event.boot_id, now).is_none() {
            return;
        }
        let expected = match self.heard_events.get(&robot) {
            Some(heard) if heard.boot_id == event.boot_id => heard.next,
            // It was restarted under the eyes of this gateway: its first event is missing if this
            // is another one.
            Some(_) => 0,
            // What it said before this gateway was there is nobody's loss.
            None => event.seqno,
        };
        if event.seqno < expected {
            return;
        }
        if event.seqno > expected {
            self.note_missed_events(&robot, expected, event.seqno, now);
        }
        let heard = Heard { boot_id: event.boot_id, next: event.seqno + 1 };
        self.heard_events.insert(robot, heard);
        self.outbox.publish_event(forwarded(event, now));
    }

    fn note_missed_events(&mut self, robot: &RobotName, first: u64, next: u64, now: MonoTime) {
        let count = next - first;
        let message = format!("{robot}: {count} of its events were lost, from number {first} on");
        let details = Map::from_iter([
            ("first_seqno".to_owned(), Value::from(first)),
            ("count".to_owned(), Value::from(count)),
        ]);
        let (severity, kind) = (Severity::Warning, EventKind::EventsLost);
        let robot = Some(robot);
        self.outbox.record(now, Happening { severity, kind, robot, message, details });
    }
}

fn forwarded(mut event: Event, now: MonoTime) -> Event {
    event.details.insert(ROBOT_SEQNO.to_owned(), Value::from(event.seqno));
    event.details.insert("robot_boot_id".to_owned(), Value::from(event.boot_id.to_string()));
    event.details.insert("robot_stamp_ns".to_owned(), Value::from(event.stamp_ns.as_nanos()));
    event.stamp_ns = now;
    event
}
