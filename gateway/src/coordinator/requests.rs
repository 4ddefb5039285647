//! Requests of clients, and stops that clients publish for everybody.

use std::collections::BTreeMap;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{Denial, DenialCode, EventKind, Severity, StopRequest};
use uuid::Uuid;

use super::group::{Group, Order};
use super::io::{CellRequest, Ticket};
use super::reset::ResetOperation;
use super::stop::{self, StopOperation};
use super::{Coordinator, own_happening, plan, remember};

/// How long after the last `cell/stop` no motion begins, until the robots themselves report it.
const STOP_HOLD: Duration = Duration::from_millis(500);

impl Coordinator {
    pub(super) fn on_cell_stop(&mut self, request: &StopRequest, now: MonoTime) {
        for robot in self.robots.keys().filter(|robot| request.scope.includes(robot)) {
            self.stop_heard.insert(robot.clone(), now);
        }
        if !self.heard_stops.contains(&request.stop_id) {
            remember(&mut self.heard_stops, request.stop_id);
            let happening = stop::happening(request, Severity::Warning, "heard on the bus");
            self.outbox.record(now, happening);
        }
        self.each_group(now, |group, cx| group.on_stop(request, cx));
    }

    pub(super) fn on_request(
        &mut self,
        ticket: Ticket,
        client: String,
        request: CellRequest,
        now: MonoTime,
    ) {
        match request {
            CellRequest::Stop(request) => self.stop(ticket, request, now),
            CellRequest::Reset(params) => {
                let number = self.next_reset;
                self.next_reset += 1;
                let (records, outbox) = (&self.robots, &mut self.outbox);
                let reset = ResetOperation::begin(number, ticket, client, params, records, outbox);
                self.resets.insert(number, reset);
            }
            CellRequest::ExecuteTrajectory { motion_id: id, trajectory } => {
                let refusal = self.refusal(id);
                let parts = refusal.map_or_else(|| plan::split(&trajectory, &self.robots), Err);
                match parts.and_then(|parts| self.free(parts, now)) {
                    Ok(parts) => {
                        let order = Order { id, client, ticket, parts };
                        let group = Group::begin(order, &mut self.context(now));
                        self.groups.insert(id, group);
                    }
                    Err(denial) => self.deny(ticket, &client, denial, now),
                }
            }
            CellRequest::Cancel { motion_id } => {
                if !self.with_group(motion_id, now, |group, cx| group.cancel(ticket, cx)) {
                    let message = format!("no motion {motion_id} of several robots is in progress");
                    let denial = Denial::new(DenialCode::NotAttached, message);
                    self.deny(ticket, &client, denial, now);
                }
            }
        }
    }

    fn deny(&mut self, ticket: Ticket, client: &str, denial: Denial, now: MonoTime) {
        let message = format!("request of {client} refused: {denial}");
        let happening = own_happening(EventKind::Denied, Severity::Warning, message);
        self.outbox.record(now, happening);
        self.outbox.answer(ticket, Err(denial));
    }

    /// Whether the identity of a motion was used before.
    fn refusal(&self, id: Uuid) -> Option<Denial> {
        let used = self.groups.contains_key(&id) || self.ended.contains(&id);
        used.then(|| {
            let message = format!("motion_id {id} was used before");
            Denial::new(DenialCode::InvalidArgument, message).with("field", "motion_id")
        })
    }

    /// Refuses robots that another motion or a stop has in its hands.
    fn free<T>(
        &self,
        parts: BTreeMap<RobotName, T>,
        now: MonoTime,
    ) -> Result<BTreeMap<RobotName, T>, Denial> {
        for robot in parts.keys() {
            let heard = self.stop_heard.get(robot);
            if self.stops.values().any(|stop| stop.concerns(robot))
                || heard.is_some_and(|heard| now.saturating_since(*heard) < STOP_HOLD)
            {
                return Err(plan::of(robot, DenialCode::Stopped, "a stop is in progress"));
            }
            if let Some((id, _)) = self.groups.iter().find(|(_, group)| group.has(robot)) {
                let message = format!("it takes part in motion {id}");
                let denial = plan::of(robot, DenialCode::Busy, &message);
                return Err(denial.with("motion_id", id.to_string()));
            }
        }
        Ok(parts)
    }

    fn stop(&mut self, ticket: Ticket, request: StopRequest, now: MonoTime) {
        if let Some(stop) = self.stops.get_mut(&request.stop_id) {
            return stop.join(ticket);
        }
        let robots = self.robots.keys();
        let stop = StopOperation::begin(request.clone(), ticket, robots, now, &mut self.outbox);
        self.stops.insert(request.stop_id, stop);
        self.each_group(now, |group, cx| group.on_stop(&request, cx));
    }
}
