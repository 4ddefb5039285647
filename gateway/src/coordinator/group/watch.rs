//! What becomes of a motion that runs, as far as the gateway can tell.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{Denial, DenialCode, EventKind, Severity};
use uuid::Uuid;

use super::part::{POLL_AFTER, Part};
use super::{Context, Group, Phase, STATUS_TIMEOUT};
use crate::config::MotionTimers;
use crate::coordinator::io::{AgentAnswer, AgentCall};
use crate::coordinator::plan;

/// A round trip that is older says nothing of how well a clock can be measured now.
const FRESH: Duration = Duration::from_secs(3);

impl Group {
    /// The agent of `robot` is gone. Its partners watch it, if it has any; else the motion ends.
    pub(in crate::coordinator) fn on_lost(
        &mut self,
        robot: &RobotName,
        why: &str,
        cx: &mut Context<'_>,
    ) {
        let may_go_on = self.phase == Phase::Running && self.has_partners();
        let Some(part) = self.parts.get_mut(robot) else { return };
        if part.status.is_terminal() {
            return;
        }
        self.changed = true;
        if may_go_on {
            part.is_lost = true;
            let message = format!("{robot}: {why}, its partners watch it");
            self.record(EventKind::Group, Severity::Warning, message, cx);
            let is_heard = |part: &Part| part.is_open() && !part.is_lost;
            if self.parts.values().any(is_heard) {
                return self.go_on(cx);
            }
        }
        self.part_is_over(robot, why, cx);
    }

    /// The agent of `robot` is there again.
    pub(in crate::coordinator) fn on_back(&mut self, robot: &RobotName, cx: &mut Context<'_>) {
        if let Some(part) = self.parts.get_mut(robot).filter(|part| part.is_lost) {
            part.is_lost = false;
            part.heard = cx.now;
            part.next_poll = cx.now;
            self.ask(robot, AgentCall::Motion(self.id), STATUS_TIMEOUT, cx);
        }
    }

    /// Ends the motion if its part of `robot` belongs to another run of the agent than `boot_id`.
    pub(in crate::coordinator) fn on_restart(
        &mut self,
        robot: &RobotName,
        boot_id: Uuid,
        cx: &mut Context<'_>,
    ) {
        let part = self.parts.get(robot).filter(|part| !part.status.is_terminal());
        if part.and_then(|part| part.boot_id).is_some_and(|run| run != boot_id) {
            self.part_is_over(robot, "its agent was restarted", cx);
        }
    }

    fn part_is_over(&mut self, robot: &RobotName, why: &str, cx: &mut Context<'_>) {
        let denial = plan::of(robot, DenialCode::CommunicationLost, why);
        if let Some(part) = self.parts.get_mut(robot) {
            part.give_up(denial.clone());
        }
        self.changed = true;
        self.fail(denial, cx);
        self.go_on(cx);
    }

    /// The gateway ends: what runs goes on without it, anything else does not begin.
    pub(in crate::coordinator) fn on_ending(&mut self, cx: &mut Context<'_>) {
        if self.phase == Phase::Running {
            let message = format!("motion of {} goes on without the gateway", self.client);
            self.record(EventKind::Group, Severity::Warning, message, cx);
            self.phase = Phase::Ended;
        } else {
            self.fail(Denial::new(DenialCode::CommunicationLost, "the gateway ends"), cx);
            self.go_on(cx);
        }
    }

    /// When nothing will have been heard of any part for too long; `None` if nothing is expected.
    pub(super) fn silence_time(&self, timers: &MotionTimers) -> Option<MonoTime> {
        self.parts.values().filter_map(|part| part.silence_time(timers.silence)).max()
    }

    /// Watches a motion that runs.
    pub(super) fn listen(&mut self, cx: &mut Context<'_>) {
        if let Some(denial) = self.clock_refusal(Some(FRESH), cx) {
            self.record(EventKind::Group, Severity::Error, denial.message.clone(), cx);
            return self.fail(denial, cx);
        }
        match self.silence_time(cx.timers) {
            Some(at) if at <= cx.now => {}
            Some(_) => return self.poll(cx),
            None => {
                let mut open = self.parts.iter().filter(|(_, part)| part.is_open());
                let Some((robot, _)) = open.clone().next().filter(|_| open.all(|(_, p)| p.is_lost))
                else {
                    return self.poll(cx);
                };
                // All that is left of it is out of sight, and may never come back.
                let denial = plan::of(robot, DenialCode::CommunicationLost, "its agent is gone");
                return self.fail(denial, cx);
            }
        }
        let open = self.parts.iter().filter(|(_, part)| part.is_open() && !part.is_lost);
        let silent: Vec<_> = open.map(|(robot, _)| robot.as_str()).collect();
        let after = cx.timers.silence.as_millis();
        let message = format!("nothing was heard of {} for {after} ms", silent.join(", "));
        let denial = Denial::new(DenialCode::CommunicationLost, message).with("robots", silent);
        self.fail(denial, cx);
    }

    pub(super) fn give_up_lost_parts(&mut self) {
        for (robot, part) in self.parts.iter_mut().filter(|(_, part)| part.is_lost) {
            part.give_up(plan::of(robot, DenialCode::CommunicationLost, "its agent is gone"));
        }
    }

    /// Asks for the status of parts that are silent.
    pub(super) fn poll(&mut self, cx: &mut Context<'_>) {
        let mut due = Vec::new();
        for (robot, part) in &mut self.parts {
            if part.poll_time().is_some_and(|at| at <= cx.now) {
                part.next_poll = cx.now + POLL_AFTER;
                due.push(robot.clone());
            }
        }
        for robot in due {
            self.ask(&robot, AgentCall::Motion(self.id), STATUS_TIMEOUT, cx);
        }
    }

    pub(super) fn poll_answered(
        &mut self,
        robot: &RobotName,
        result: Result<AgentAnswer, Denial>,
        cx: &mut Context<'_>,
    ) {
        let Some(part) = self.parts.get_mut(robot) else { return };
        if let Err(denial) = result
            && denial.code == DenialCode::NotAttached
        {
            part.give_up(denial.clone());
            self.changed = true;
            self.fail(plan::by(robot, denial), cx);
        }
    }
}
