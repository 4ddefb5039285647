//! Requests of clients, and stops that clients publish for everybody.

use std::collections::BTreeMap;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    CellExecuteTrajectory, Denial, DenialCode, EventKind, Severity, StopRequest,
};
use uuid::Uuid;

use super::control::{ControlOperation, ControlOrder};
use super::group::{Group, Order};
use super::io::{CellRequest, Control, Ticket};
use super::lease::{LeaseOperation, LeaseOrder};
use super::reset::{ResetOperation, ResetOrder};
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
                let number = self.next_number();
                let order = ResetOrder { number, ticket, client, params };
                let reset = ResetOperation::begin(order, &self.robots, &mut self.outbox);
                self.resets.insert(number, reset);
            }
            CellRequest::ExecuteTrajectory { motion_id, params } => {
                self.execute(ticket, client, motion_id, *params, now);
            }
            CellRequest::Control { motion_id, lease, control } => {
                let begun = self.control(ticket, &client, (motion_id, lease), control);
                self.answer_refusal(ticket, &client, begun, now);
            }
            CellRequest::AcquireLease(params) => {
                let begun = self.present(params.robots).and_then(|robots| {
                    let (ttl_ms, role) = (params.ttl_ms, params.role);
                    let order = LeaseOrder::Acquire { robots, ttl_ms, role };
                    self.begin_lease(ticket, &client, order, now)
                });
                self.answer_refusal(ticket, &client, begun, now);
            }
            CellRequest::RenewLease(params) => {
                let begun = self.known(params.leases.keys()).and_then(|()| {
                    self.begin_lease(ticket, &client, LeaseOrder::Renew(params.leases), now)
                });
                self.answer_refusal(ticket, &client, begun, now);
            }
            CellRequest::ReleaseLease(params) => {
                let begun = self.known(params.leases.keys()).and_then(|()| {
                    self.begin_lease(ticket, &client, LeaseOrder::Release(params.leases), now)
                });
                self.answer_refusal(ticket, &client, begun, now);
            }
            CellRequest::CheckClearance(params) => {
                self.check_clearance(ticket, client, &params, now);
            }
            CellRequest::Cancel { motion_id } => {
                if !self.with_group(motion_id, now, |group, cx| group.cancel(ticket, cx)) {
                    self.deny(ticket, &client, no_motion(motion_id), now);
                }
            }
        }
    }

    fn execute(
        &mut self,
        ticket: Ticket,
        client: String,
        id: Uuid,
        params: CellExecuteTrajectory,
        now: MonoTime,
    ) {
        let refusal = self.refusal(id);
        let parts = refusal.map_or_else(|| plan::split(&params.trajectory, &self.robots), Err);
        let parts = parts.and_then(|parts| {
            plan::check_terms(&params, &parts, &self.robots)?;
            self.free(parts, now)
        });
        match parts {
            Ok(parts) => {
                let CellExecuteTrajectory { coupling, leases, on_lease_loss, model_revs, .. } =
                    params;
                let order = Order {
                    id,
                    client,
                    ticket,
                    parts,
                    coupling,
                    leases,
                    on_lease_loss,
                    model_revs,
                };
                let group = Group::begin(order, &mut self.context(now));
                self.groups.insert(id, group);
            }
            Err(denial) => self.deny(ticket, &client, denial, now),
        }
    }

    fn control(
        &mut self,
        ticket: Ticket,
        client: &str,
        (motion_id, lease): (Uuid, Option<Uuid>),
        control: Control,
    ) -> Result<(), Denial> {
        let group = self.groups.get(&motion_id).ok_or_else(|| no_motion(motion_id))?;
        let robots = group.controlled(lease, control)?;
        let number = self.next_number();
        let order = ControlOrder { ticket, client, motion_id, control, robots };
        let operation = ControlOperation::begin(number, order, &mut self.outbox);
        self.controls.insert(number, operation);
        Ok(())
    }

    fn begin_lease(
        &mut self,
        ticket: Ticket,
        client: &str,
        order: LeaseOrder,
        now: MonoTime,
    ) -> Result<(), Denial> {
        let (number, outbox) = (self.next_number(), &mut self.outbox);
        let operation = LeaseOperation::begin(number, ticket, client, order, now, outbox)?;
        self.leases.insert(number, operation);
        Ok(())
    }

    /// The robots, all of the cell if none is named; each has to be on the bus.
    fn present(&self, robots: Vec<RobotName>) -> Result<Vec<RobotName>, Denial> {
        let robots = if robots.is_empty() { self.robots.keys().cloned().collect() } else { robots };
        self.known(robots.iter())?;
        let is_absent =
            |robot: &&RobotName| self.robots.get(*robot).is_none_or(|record| !record.is_online());
        match robots.iter().find(is_absent) {
            Some(robot) => Err(plan::offline(robot)),
            None => Ok(robots),
        }
    }

    fn known<'r>(&self, mut robots: impl Iterator<Item = &'r RobotName>) -> Result<(), Denial> {
        match robots.find(|robot| !self.robots.contains_key(*robot)) {
            Some(robot) => {
                Err(plan::of(robot, DenialCode::InvalidArgument, "the cell has no such robot"))
            }
            None => Ok(()),
        }
    }

    fn answer_refusal(
        &mut self,
        ticket: Ticket,
        client: &str,
        begun: Result<(), Denial>,
        now: MonoTime,
    ) {
        if let Err(denial) = begun {
            self.deny(ticket, client, denial, now);
        }
    }

    pub(super) fn deny(&mut self, ticket: Ticket, client: &str, denial: Denial, now: MonoTime) {
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
        let robots = self.robots.iter().map(|(robot, record)| (robot, record.stop_time));
        let stop = StopOperation::begin(request.clone(), ticket, robots, now, &mut self.outbox);
        self.stops.insert(request.stop_id, stop);
        self.each_group(now, |group, cx| group.on_stop(&request, cx));
    }
}

fn no_motion(id: Uuid) -> Denial {
    let message = format!("no motion {id} of several robots is in progress");
    Denial::new(DenialCode::NotAttached, message)
}
