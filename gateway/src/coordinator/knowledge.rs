//! What is learned of robots: presence, runs, status, clocks.

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    Denial, EventKind, MotionStatus, Presence, RobotInfo, Severity, StopAck,
};
use serde_json::Map;
use std::time::Duration;
use uuid::Uuid;

use super::Coordinator;
use super::io::AgentAnswer;
use super::outbox::{CallKind, Happening};
use super::robot::{RobotRecord, Run};

/// Period of the measurement of each agent's clock.
const CLOCK_PERIOD: Duration = Duration::from_secs(1);
/// The same for the first round trips, so that a motion can start soon.
const FIRST_CLOCK_PERIOD: Duration = Duration::from_millis(20);
const FIRST_CLOCKS: usize = 5;

impl Coordinator {
    pub(super) fn on_presence(&mut self, robot: &RobotName, online: bool, now: MonoTime) {
        let Some(record) = self.robots.get_mut(robot) else { return };
        if record.is_online() == online || (!online && record.presence == Presence::NeverSeen) {
            return;
        }
        self.schedule.note_change();
        let (severity, what) = if online {
            record.presence = Presence::Online;
            record.next_clock = Some(now);
            record.next_refresh = Some(now);
            (Severity::Info, "its agent is on the bus")
        } else {
            record.presence = Presence::Lost;
            (Severity::Error, "its agent is gone")
        };
        let (kind, message) = (EventKind::PresenceChanged, format!("{robot}: {what}"));
        let (named, details) = (Some(robot), Map::new());
        self.outbox.record(now, Happening { severity, kind, robot: named, message, details });
        self.each_group(now, |group, cx| {
            if online {
                group.on_back(robot, cx);
            } else {
                group.on_lost(robot, "its agent is gone", cx);
            }
        });
    }

    /// The record of a robot, if the message is of its current run or begins a new one.
    pub(super) fn admitted(
        &mut self,
        robot: &RobotName,
        boot_id: Uuid,
        now: MonoTime,
    ) -> Option<&mut RobotRecord> {
        let record = self.robots.get_mut(robot)?;
        let had_run = record.run().is_some();
        match record.admit(boot_id) {
            Run::Past => return None,
            Run::Current => {}
            Run::New => {
                record.next_clock = Some(now);
                record.next_refresh = Some(now);
                self.schedule.note_change();
                if had_run {
                    self.on_restart(robot, boot_id, now);
                }
            }
        }
        self.robots.get_mut(robot)
    }

    fn on_restart(&mut self, robot: &RobotName, boot_id: Uuid, now: MonoTime) {
        let (severity, kind) = (Severity::Warning, EventKind::PresenceChanged);
        let message = format!("{robot}: its agent was restarted");
        let (named, details) = (Some(robot), Map::new());
        self.outbox.record(now, Happening { severity, kind, robot: named, message, details });
        self.each_group(now, |group, cx| group.on_restart(robot, boot_id, cx));
    }

    pub(super) fn on_info(&mut self, info: &RobotInfo, now: MonoTime) {
        if let Some(record) = self.admitted(&info.robot, info.boot_id, now) {
            record.take_info(info);
        }
    }

    pub(super) fn on_motion(&mut self, status: &MotionStatus, now: MonoTime) {
        if self.admitted(&status.robot, status.boot_id, now).is_some() {
            self.with_group(status.id, now, |group, cx| group.on_motion(status, cx));
        }
    }

    pub(super) fn on_stop_ack(&mut self, ack: &StopAck, now: MonoTime) {
        if self.admitted(&ack.robot, ack.boot_id, now).is_some()
            && let Some(stop) = self.stops.get_mut(&ack.stop_id)
        {
            stop.on_ack(ack, now, &mut self.outbox);
        }
    }

    /// Takes from an answer what it says about the robot, whatever it was asked for.
    pub(super) fn learn(
        &mut self,
        robot: &RobotName,
        call: CallKind,
        result: &Result<AgentAnswer, Denial>,
        now: MonoTime,
    ) {
        match result {
            Ok(AgentAnswer::Status(status)) => {
                let record = self.admitted(robot, status.boot_id, now);
                if record.is_some_and(|record| record.take_status(status.clone())) {
                    self.schedule.note_change();
                }
            }
            Ok(AgentAnswer::Info(info)) => self.on_info(info, now),
            Ok(AgentAnswer::Motion(status)) => self.on_motion(status, now),
            Ok(AgentAnswer::Stop(ack)) => self.on_stop_ack(ack, now),
            Ok(AgentAnswer::Clock { sample, sent, received }) => {
                if let Some(record) = self.admitted(robot, sample.boot_id, now) {
                    record.clock.add(sample.boot_id, sample.stamp_ns, *sent, *received);
                }
            }
            Ok(_) | Err(_) => {}
        }
        if call == CallKind::Clock
            && let Some(record) = self.robots.get_mut(robot)
        {
            let first = result.is_ok() && record.clock.count() < FIRST_CLOCKS;
            let period = if first { FIRST_CLOCK_PERIOD } else { CLOCK_PERIOD };
            record.next_clock = Some(now + period);
        }
    }
}
