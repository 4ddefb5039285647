//! What the gateway decides: presence, status, motions of several robots, stops, resets.
//!
//! ```text
//! samples, requests, answers --Input--> handle(now) --Action--> questions, answers, publications
//!                                 next_deadline --> Input::Timer
//! ```
//! Pure: no clock, no socket, no order of a hash map. One executor task owns a [`Coordinator`],
//! performs its actions at once and feeds back what becomes of them.
//!
//! | part | concern |
//! |---|---|
//! | `knowledge`, `robot`, `clock_offset` | what is known of each robot, and of its agent's clock |
//! | `requests`, `plan` | taking a request apart, and what refuses it |
//! | `group` | one motion of several robots, from request to terminal status |
//! | `control` | pause, resume and speed of one |
//! | `clearance` | whether robots come too near, worked out elsewhere |
//! | `lease` | leases of several robots, all or none |
//! | `stop`, `reset` | one stop or reset of the cell |
//! | `fan_in` | every robot's events in one stream |
//! | `upkeep`, `cell_status`, `outbox` | what time asks for, and what goes out |
//!
//! Invariants: every request is answered once; nothing is committed before all parts are
//! prepared and found clear of each other; an accepted motion has one terminal status; a part that
//! is known to have failed ends all others; of several leases all are granted or none; events have
//! no gap in their numbers; a stop is never refused and waits for nothing.
//!
//! Who may command is decided by each agent alone: the gateway passes on the leases that clients
//! give it, holds none, and on a new start adopts nothing of what goes on.

mod cell_status;
mod clearance;
mod clock_offset;
mod control;
mod fan_in;
mod group;
mod io;
mod knowledge;
mod lease;
mod outbox;
mod plan;
mod requests;
mod reset;
mod robot;
mod stop;
mod upkeep;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, VecDeque};

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{Denial, EventKind, Severity};
use serde_json::Map;
use uuid::Uuid;

pub use fan_in::ROBOT_SEQNO;
pub use io::{
    Action, AgentAnswer, AgentCall, AskId, CellAnswer, CellRequest, CheckId, Control, Input, Ticket,
};

use crate::config::{ClearanceConfig, MotionTimers};
use cell_status::StatusSchedule;
use control::ControlOperation;
use fan_in::Heard;
use group::{Context, Group};
use lease::LeaseOperation;
use outbox::{CallKind, Happening, Outbox, Pending, Purpose};
use reset::ResetOperation;
use robot::RobotRecord;
use stop::StopOperation;
use upkeep::REFRESH_TIMEOUT;

/// Identities of ended motions and heard stops that are remembered.
const REMEMBERED: usize = 1_024;
/// Which cell a coordinator is for.
#[derive(Clone, Debug)]
pub struct CoordinatorConfig {
    /// Name of the cell.
    pub cell: String,
    /// Run of the gateway.
    pub boot_id: Uuid,
    /// The robots of the cell.
    pub robots: Vec<RobotName>,
    /// Timers of motions.
    pub timers: MotionTimers,
    /// How near robots may come to each other.
    pub clearance: ClearanceConfig,
}

/// The deciding part of a gateway.
#[derive(Debug)]
pub struct Coordinator {
    cell: String,
    timers: MotionTimers,
    clearance: ClearanceConfig,
    robots: BTreeMap<RobotName, RobotRecord>,
    groups: BTreeMap<Uuid, Group>,
    /// Motions that are over, oldest first.
    ended: VecDeque<Uuid>,
    stops: BTreeMap<Uuid, StopOperation>,
    /// Stops that others published, oldest first.
    heard_stops: VecDeque<Uuid>,
    /// When a stop for each robot was heard last.
    stop_heard: BTreeMap<RobotName, MonoTime>,
    resets: BTreeMap<u64, ResetOperation>,
    controls: BTreeMap<u64, ControlOperation>,
    leases: BTreeMap<u64, LeaseOperation>,
    /// Number of the next reset, control or lease.
    next_number: u64,
    heard_events: BTreeMap<RobotName, Heard>,
    schedule: StatusSchedule,
    outbox: Outbox,
}

impl Coordinator {
    /// A coordinator that has heard of nobody yet; the first [`Self::handle`] says that it began.
    #[must_use]
    pub fn new(config: CoordinatorConfig, now: MonoTime) -> Self {
        let mut outbox = Outbox::new(config.boot_id);
        let robots = config.robots.iter().map(RobotName::as_str).collect::<Vec<_>>().join(", ");
        let message = format!("gateway of {} with {robots}", config.cell);
        outbox.record(now, own_happening(EventKind::Started, Severity::Info, message));
        Self {
            cell: config.cell,
            timers: config.timers,
            clearance: config.clearance,
            robots: config.robots.into_iter().map(|r| (r, RobotRecord::default())).collect(),
            groups: BTreeMap::new(),
            ended: VecDeque::new(),
            stops: BTreeMap::new(),
            heard_stops: VecDeque::new(),
            stop_heard: BTreeMap::new(),
            resets: BTreeMap::new(),
            controls: BTreeMap::new(),
            leases: BTreeMap::new(),
            next_number: 0,
            heard_events: BTreeMap::new(),
            schedule: StatusSchedule::new(),
            outbox,
        }
    }

    /// Takes what happened at `now` and returns what is to be done, in this order.
    pub fn handle(&mut self, now: MonoTime, input: Input) -> Vec<Action> {
        match input {
            Input::Presence { robot, online } => self.on_presence(&robot, online, now),
            Input::State { robot, state, arrived, arrivals } => {
                if let Some(record) = self.admitted(&robot, state.boot_id, now) {
                    record.take_state(*state, arrived, arrivals);
                }
            }
            Input::Status(status) => {
                let robot = status.robot.clone();
                let record = self.admitted(&robot, status.boot_id, now);
                if record.is_some_and(|record| record.take_status(status)) {
                    self.schedule.note_change();
                }
            }
            Input::Info(info) => self.on_info(&info, now),
            Input::Motion(status) => self.on_motion(&status, now),
            Input::StopAck(ack) => self.on_stop_ack(&ack, now),
            Input::CellStop(request) => self.on_cell_stop(&request, now),
            Input::Request { ticket, client, request } => {
                self.on_request(ticket, client, request, now);
            }
            Input::Answer { ask, result } => self.on_answer(ask, result, now),
            Input::Clearance { check, result } => self.on_clearance(check, result, now),
            Input::RobotEvent(event) => self.on_robot_event(*event, now),
            Input::ModelRejected { robot, message } => {
                let (severity, kind) = (Severity::Error, EventKind::ModelRejected);
                let (robot, details) = (Some(&robot), Map::new());
                self.outbox.record(now, Happening { severity, kind, robot, message, details });
            }
            Input::Ending => self.on_ending(now),
            Input::Timer => {}
        }
        self.on_time(now);
        self.tidy(now);
        self.outbox.take_actions()
    }

    /// When [`Input::Timer`] is due.
    #[must_use]
    pub fn next_deadline(&self) -> MonoTime {
        let online = || self.robots.values().filter(|robot| robot.is_online());
        let clocks = online().filter_map(|robot| robot.next_clock);
        let refreshes = online().filter_map(|robot| robot.next_refresh);
        let groups = self.groups.values().filter_map(|group| group.next_deadline(&self.timers));
        let stops = self.stops.values().map(StopOperation::next_deadline);
        let others = clocks.chain(refreshes).chain(groups).chain(stops).min();
        others.into_iter().fold(self.schedule.due(), MonoTime::min)
    }

    /// Whether nothing is in progress that a client or a robot waits for.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.groups.is_empty()
            && self.stops.is_empty()
            && self.resets.is_empty()
            && self.controls.is_empty()
            && self.leases.is_empty()
    }

    fn on_answer(&mut self, ask: AskId, result: Result<AgentAnswer, Denial>, now: MonoTime) {
        let Some(Pending { robot, purpose, call }) = self.outbox.settle(ask) else { return };
        self.learn(&robot, call, &result, now);
        match purpose {
            Purpose::Record => {}
            Purpose::Stop(id) => {
                if let Some(stop) = self.stops.get_mut(&id) {
                    stop.on_answer(&robot);
                }
            }
            Purpose::Reset(number) => {
                if let Some(reset) = self.resets.get_mut(&number) {
                    reset.on_answer(&robot, result);
                }
            }
            Purpose::Control(number) => {
                if let Some(control) = self.controls.get_mut(&number) {
                    control.on_answer(&robot, result, &mut self.outbox);
                }
            }
            Purpose::Lease(number) => {
                if let Some(lease) = self.leases.get_mut(&number) {
                    lease.on_answer(&robot, call, result, now, &mut self.outbox);
                }
            }
            Purpose::Group(id) => {
                let took_on =
                    matches!(call, CallKind::Prepare | CallKind::Commit) && result.is_ok();
                let found = self.with_group(id, now, |group, cx| {
                    group.on_answer(&robot, call, result, cx);
                });
                if !found && took_on {
                    // The motion is over; what the agent took on since must go as well.
                    self.ask_for_record(&robot, AgentCall::Abort(id), REFRESH_TIMEOUT);
                }
            }
        }
    }

    fn on_ending(&mut self, now: MonoTime) {
        let message = format!("gateway of {} ends", self.cell);
        self.outbox.record(now, own_happening(EventKind::Ending, Severity::Info, message));
        // What runs goes on: its robots watch each other.
        self.each_group(now, |group, cx| group.on_ending(cx));
    }

    const fn next_number(&mut self) -> u64 {
        let number = self.next_number;
        self.next_number += 1;
        number
    }

    const fn context(&mut self, now: MonoTime) -> Context<'_> {
        let (robots, timers, clearance) = (&self.robots, &self.timers, &self.clearance);
        Context { now, robots, timers, clearance, outbox: &mut self.outbox }
    }

    fn each_group(&mut self, now: MonoTime, mut act: impl FnMut(&mut Group, &mut Context<'_>)) {
        let (robots, timers, clearance) = (&self.robots, &self.timers, &self.clearance);
        let mut cx = Context { now, robots, timers, clearance, outbox: &mut self.outbox };
        for group in self.groups.values_mut() {
            act(group, &mut cx);
        }
    }

    /// Returns whether there is such a group.
    fn with_group(
        &mut self,
        id: Uuid,
        now: MonoTime,
        act: impl FnOnce(&mut Group, &mut Context<'_>),
    ) -> bool {
        let (robots, timers, clearance) = (&self.robots, &self.timers, &self.clearance);
        let Some(group) = self.groups.get_mut(&id) else { return false };
        act(group, &mut Context { now, robots, timers, clearance, outbox: &mut self.outbox });
        true
    }
}

/// An event of the gateway itself.
fn own_happening(kind: EventKind, severity: Severity, message: String) -> Happening<'static> {
    Happening { severity, kind, robot: None, message, details: Map::new() }
}

fn remember(ids: &mut VecDeque<Uuid>, id: Uuid) {
    if ids.len() == REMEMBERED {
        ids.pop_front();
    }
    ids.push_back(id);
}
