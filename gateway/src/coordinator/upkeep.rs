//! What is done because time has passed: questions, timers, publication.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;

use super::cell_status::{self, Head};
use super::group::Group;
use super::io::{Action, AgentCall};
use super::outbox::{Purpose, Question};
use super::{Coordinator, remember};

const CLOCK_TIMEOUT: Duration = Duration::from_millis(1_000);
/// Period of asking for info and status that are missing.
const REFRESH_PERIOD: Duration = Duration::from_millis(500);
pub(super) const REFRESH_TIMEOUT: Duration = Duration::from_millis(1_000);
/// Name under which the gateway asks on its own behalf.
const OWN_NAME: &str = "gateway";

impl Coordinator {
    pub(super) fn on_time(&mut self, now: MonoTime) {
        self.each_group(now, |group, cx| group.on_time(cx));
        for stop in self.stops.values_mut() {
            stop.on_time(now, &mut self.outbox);
        }
        for reset in self.resets.values_mut() {
            reset.conclude(now, &mut self.outbox);
        }
        let mut questions = Vec::new();
        for (robot, record) in self.robots.iter_mut().filter(|(_, record)| record.is_online()) {
            if record.next_clock.is_some_and(|at| at <= now) {
                record.next_clock = None;
                questions.push((robot.clone(), AgentCall::Clock, CLOCK_TIMEOUT));
            }
            if record.next_refresh.is_some_and(|at| at <= now) {
                record.next_refresh = record.is_incomplete().then(|| now + REFRESH_PERIOD);
                if record.joints.is_none() {
                    questions.push((robot.clone(), AgentCall::Info, REFRESH_TIMEOUT));
                }
                if record.status.is_none() {
                    questions.push((robot.clone(), AgentCall::Status, REFRESH_TIMEOUT));
                }
            }
        }
        for (robot, call, timeout) in questions {
            self.ask_for_record(&robot, call, timeout);
        }
    }

    pub(super) fn ask_for_record(&mut self, robot: &RobotName, call: AgentCall, timeout: Duration) {
        let (client, purpose) = (OWN_NAME, Purpose::Record);
        self.outbox.ask(Question { robot, client, lease: None, call, timeout, purpose });
    }

    /// Removes what is over, and publishes the status if it is due.
    pub(super) fn tidy(&mut self, now: MonoTime) {
        self.stops.retain(|_, stop| !stop.is_over());
        self.resets.retain(|_, reset| !reset.is_over());
        self.controls.retain(|_, control| !control.is_over());
        self.leases.retain(|_, lease| !lease.is_over());
        let over = self.groups.iter().filter(|(_, group)| group.is_over());
        for id in over.map(|(id, _)| *id).collect::<Vec<_>>() {
            self.groups.remove(&id);
            remember(&mut self.ended, id);
            self.schedule.note_change();
        }
        // Each is asked: what is news must not stay.
        let news = self.groups.values_mut().map(Group::take_news).filter(|news| *news).count();
        if news > 0 {
            self.schedule.note_change();
        }
        if self.schedule.due() <= now {
            let boot_id = self.outbox.boot_id();
            let accepted = self.groups.values().filter(|group| group.is_accepted());
            let motions = accepted.map(|group| group.report(boot_id, now)).collect();
            let seqno = self.schedule.publish(now);
            let head = Head { cell: &self.cell, boot_id, seqno, now };
            let status = cell_status::report(&head, &self.robots, motions);
            self.outbox.push(Action::PublishStatus(Box::new(status)));
        }
    }
}
