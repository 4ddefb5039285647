//! The client's side of the emulated controller's protocol.

use std::time::Duration;

use armada_model::MonoTime;
use arrayvec::ArrayVec;

use super::Config;
use super::settings::{parameter_infos, signal_infos};
use super::wire::{Body, Header, Power, RequestBody, Status, decode, encode};
use crate::drivers::{
    Abilities, DelegatedGoal, Driver, DriverRequest, DriverSetup, Endpoint, Feedback, LinkCounters,
    Pacing, SetPoint, SetupError, Transmit,
};

/// Silence of either side after which hello is sent again.
const HELLO_INTERVAL: Duration = Duration::from_millis(100);
/// Time between repetitions of a request that the status does not show yet.
const REQUEST_INTERVAL: Duration = Duration::from_millis(10);
/// Most orders that wait for the controller: one for every signal and parameter, and moves.
const MAX_ORDERS: usize = 64;

/// Driver of the emulated controller.
///
/// It greets the controller until status comes, and again when status stays away or when it has
/// nothing else to say, so that the controller does not give the robot to another client. Requests
/// are repeated until the status shows them; those made to a run of the controller that has ended
/// are dropped, for a robot must not be switched on by what was asked before it restarted.
///
/// Power and reset are the newest of each. Orders leave one after another, each when the status
/// shows the one before. A stop overtakes them all and takes with it those to move; a new value of a
/// signal, parameter, load, tool or speed takes the place of one that waits. An order for which
/// there is no room, because the controller takes none, is dropped, as one that never arrived.
#[derive(Debug)]
pub struct SimDriver {
    endpoints: [Endpoint; 1],
    pacing: Pacing,
    joints: u8,
    nonce: u64,
    sequence: u64,
    /// Boot nonces of the controller: this run, and the run before it.
    controller: u64,
    retired: u64,
    last_status: u64,
    feedback: Option<Feedback>,
    counters: LinkCounters,
    command: Option<SetPoint>,
    request: RequestBody,
    power_pending: bool,
    reset_pending: bool,
    /// Orders that wait, the next one first.
    orders: ArrayVec<DriverRequest, MAX_ORDERS>,
    /// Whether the next one has left, with the id of [`RequestBody`].
    order_sent: bool,
    abilities: Abilities,
    request_sent: Option<MonoTime>,
    hello_sent: Option<MonoTime>,
    sent: Option<MonoTime>,
}

impl SimDriver {
    pub(super) fn new(config: &Config, setup: &DriverSetup) -> Result<Self, SetupError> {
        let joints = setup.joint_count()?;
        if config.address.port() == 0 {
            return Err(SetupError::Config {
                vendor: "sim",
                field: "address".to_owned(),
                problem: "port 0 cannot be sent to".to_owned(),
            });
        }
        Ok(Self {
            endpoints: [Endpoint::UdpTo { remote: config.address }],
            pacing: Pacing::Every(setup.period),
            joints: joints as u8, // at most MAX_JOINTS
            nonce: setup.boot_nonce.get(),
            sequence: 0,
            controller: 0,
            retired: 0,
            last_status: 0,
            feedback: None,
            counters: LinkCounters::default(),
            command: None,
            request: RequestBody::default(),
            power_pending: false,
            reset_pending: false,
            orders: ArrayVec::new(),
            order_sent: false,
            abilities: abilities(config, setup),
            request_sent: None,
            hello_sent: None,
            sent: None,
        })
    }

    fn take_status(&mut self, now: MonoTime, header: &Header, status: &Status) {
        if status.position.len() != usize::from(self.joints) {
            self.counters.malformed += 1;
            return;
        }
        let restarted = header.sender != self.controller;
        let old = header.sender == self.retired
            || (!restarted && header.sequence <= self.last_status)
            || header.receiver != self.nonce;
        if old {
            self.counters.out_of_order += 1;
            return;
        }
        if restarted {
            self.meet_controller(header.sender);
        }
        self.counters.received += 1;
        self.counters.refusal = None;
        self.last_status = header.sequence;
        self.power_pending &= status.last_power_id < self.request.power_id;
        self.reset_pending &= status.last_reset_id < self.request.reset_id;
        if self.order_sent && status.last_order_id >= self.request.order_id {
            self.orders.pop_at(0);
            self.forget_sent_order();
            self.request_sent = None; // the next one goes at once
        }
        self.feedback = Some(Feedback { session: header.sender, ..feedback(now, status) });
    }

    /// What is next in line has not left yet: it will get a new id.
    const fn forget_sent_order(&mut self) {
        self.order_sent = false;
    }

    /// Goes on with another run of the controller than before.
    fn meet_controller(&mut self, controller: u64) {
        if self.controller != 0 {
            self.retired = self.controller;
            self.power_pending = false;
            self.reset_pending = false;
            self.command = None;
            self.orders.clear();
            self.forget_sent_order();
        }
        self.controller = controller;
    }

    fn next_body(&mut self, now: MonoTime) -> Option<Body> {
        if self.controller != 0 {
            let pending = self.power_pending || self.reset_pending || !self.orders.is_empty();
            if pending && due(self.request_sent, now, REQUEST_INTERVAL) {
                self.request_sent = Some(now);
                return Some(Body::Request(self.next_request()));
            }
            if let Some(set_point) = self.command.take() {
                return Some(Body::Command(set_point));
            }
        }
        let silent = due(self.feedback.map(|feedback| feedback.stamp), now, HELLO_INTERVAL)
            || due(self.sent, now, HELLO_INTERVAL);
        if silent && due(self.hello_sent, now, HELLO_INTERVAL) {
            self.hello_sent = Some(now);
            return Some(Body::Hello { joints: self.joints });
        }
        None
    }

    /// What the status does not show yet, and nothing else: a run of the controller that has just
    /// begun must not be told what an earlier one has done.
    fn next_request(&mut self) -> RequestBody {
        let mut body = RequestBody::default();
        if self.power_pending {
            (body.power_id, body.power) = (self.request.power_id, self.request.power);
        }
        if self.reset_pending {
            body.reset_id = self.request.reset_id;
        }
        if let Some(&order) = self.orders.first() {
            if !self.order_sent {
                self.order_sent = true;
                self.request.order_id = self.request.order_id.saturating_add(1);
            }
            (body.order_id, body.order) = (self.request.order_id, Some(order));
        }
        body
    }

    /// Puts an order in line.
    fn add_order(&mut self, order: DriverRequest) {
        if order == DriverRequest::StopMotion {
            self.orders.retain(|waiting| !is_of_motion(waiting));
            // What had left may or may not have been done; what stays of it is a value, and goes again.
            self.forget_sent_order();
            // Motion is gone, so there is room for a stop unless values alone fill the line.
            if self.orders.is_full() {
                self.orders.pop();
            }
            let _ = self.orders.try_insert(0, order);
            return;
        }
        let first = usize::from(self.order_sent);
        let same = |waiting: &&mut DriverRequest| replaces(&order, waiting);
        match self.orders.iter_mut().skip(first).find(same) {
            Some(waiting) => *waiting = order,
            None => {
                let _ = self.orders.try_push(order);
            }
        }
    }

    /// Whether the controller can do it.
    fn can(&self, order: &DriverRequest) -> bool {
        let Abilities { homing, move_joint, move_pose, move_linear, pause, load, .. } =
            self.abilities;
        match order {
            DriverRequest::Home(_) => homing,
            DriverRequest::Move(wanted) => match wanted.goal {
                DelegatedGoal::Joint(_) => move_joint,
                DelegatedGoal::Pose { .. } => move_pose,
                DelegatedGoal::Linear { .. } => move_linear,
            },
            DriverRequest::PauseMotion
            | DriverRequest::ResumeMotion
            | DriverRequest::SetSpeedRatio(_) => pause,
            DriverRequest::StopMotion => homing || move_joint,
            DriverRequest::SetLoad { .. } | DriverRequest::SetTool { .. } => load,
            DriverRequest::SetSignal { signal, .. } => {
                usize::from(*signal) < self.abilities.signals.len()
            }
            DriverRequest::SetParameter { parameter, .. } => {
                usize::from(*parameter) < self.abilities.parameters.len()
            }
            DriverRequest::Enable | DriverRequest::Disable | DriverRequest::ResetErrors => true,
        }
    }
}

impl Driver for SimDriver {
    fn endpoints(&self) -> &[Endpoint] {
        &self.endpoints
    }

    fn pacing(&self) -> Pacing {
        self.pacing
    }

    fn abilities(&self) -> Abilities {
        self.abilities.clone()
    }

    fn receive(&mut self, now: MonoTime, _endpoint: usize, bytes: &[u8]) {
        match decode(bytes) {
            Ok((header, Body::Status(status))) => self.take_status(now, &header, &status),
            Ok((header, Body::Refused(refusal))) => {
                if header.receiver == self.nonce || header.receiver == 0 {
                    self.counters.refused += 1;
                    self.counters.refusal = Some(refusal);
                } else {
                    self.counters.out_of_order += 1;
                }
            }
            // What only a client sends, an answer nobody here asked for, or no packet at all.
            Ok(_) | Err(_) => self.counters.malformed += 1,
        }
    }

    fn feedback(&self) -> Option<&Feedback> {
        self.feedback.as_ref()
    }

    fn request(&mut self, _now: MonoTime, request: DriverRequest) {
        match request {
            DriverRequest::Enable | DriverRequest::Disable => {
                let on = request == DriverRequest::Enable;
                self.request.power = Some(if on { Power::On } else { Power::Off });
                self.request.power_id = self.request.power_id.saturating_add(1);
                self.power_pending = true;
            }
            DriverRequest::ResetErrors => {
                self.request.reset_id = self.request.reset_id.saturating_add(1);
                self.reset_pending = true;
            }
            order if self.controller != 0 && self.can(&order) => self.add_order(order),
            // Not among its abilities, or there is nobody yet and later it would be old.
            _ => return,
        }
        self.request_sent = None;
    }

    fn command(&mut self, _now: MonoTime, set_point: &SetPoint) {
        let joints = usize::from(self.joints);
        if self.controller == 0 {
            return; // nobody to send it to, and later it would be old
        }
        if set_point.joint_position.len() == joints && set_point.joint_velocity.len() == joints {
            self.command = Some(*set_point);
        }
    }

    fn poll_transmit(&mut self, now: MonoTime, buffer: &mut [u8]) -> Option<Transmit> {
        let body = self.next_body(now)?;
        self.sequence += 1;
        let header =
            Header { sender: self.nonce, receiver: self.controller, sequence: self.sequence };
        let len = encode(&header, &body, buffer);
        self.sent = Some(now);
        (len > 0).then_some(Transmit { endpoint: 0, peer: None, len })
    }

    fn counters(&self) -> LinkCounters {
        self.counters
    }
}

/// Whether `interval` has passed since `last`, or it has never been.
fn due(last: Option<MonoTime>, now: MonoTime, interval: Duration) -> bool {
    last.is_none_or(|last| now.saturating_since(last) >= interval)
}

fn feedback(now: MonoTime, status: &Status) -> Feedback {
    Feedback {
        joint_velocity: status.velocity,
        joint_effort: status.effort,
        enabled: status.enabled,
        ready: status.ready,
        emergency_stop: status.emergency_stop,
        error_code: status.error,
        operational_mode: status.operational_mode,
        guard_stop: status.guard_stop,
        local_control: status.local_control,
        conditions: status.conditions,
        homed: status.homed,
        homing: status.homing,
        delegated: status.delegated,
        signals: status.signals,
        parameters: status.parameters,
        tips: status.tips,
        ..Feedback::of(now, status.position)
    }
}

/// What the emulated controller can do, as a vendor's manual would tell.
fn abilities(config: &Config, setup: &DriverSetup) -> Abilities {
    let emulator = &config.emulator;
    let moves = emulator.own_moves;
    let to_poses = moves && setup.chains.iter().any(Option::is_some);
    Abilities {
        homing: emulator.homing.required,
        move_joint: moves,
        move_pose: to_poses,
        move_linear: to_poses,
        pause: moves,
        load: true,
        signals: signal_infos(&emulator.signals),
        parameters: parameter_infos(&emulator.parameters),
    }
}

/// Whether an order moves the robot, or is about what moves it.
const fn is_of_motion(order: &DriverRequest) -> bool {
    matches!(
        order,
        DriverRequest::Home(_)
            | DriverRequest::Move(_)
            | DriverRequest::StopMotion
            | DriverRequest::PauseMotion
            | DriverRequest::ResumeMotion
    )
}

/// Whether `order` makes one that waits pointless: another value of the same thing.
fn replaces(order: &DriverRequest, waiting: &DriverRequest) -> bool {
    match (order, waiting) {
        (
            DriverRequest::SetSignal { signal: a, .. },
            DriverRequest::SetSignal { signal: b, .. },
        ) => a == b,
        (
            DriverRequest::SetParameter { parameter: a, .. },
            DriverRequest::SetParameter { parameter: b, .. },
        ) => a == b,
        (DriverRequest::SetLoad { chain: a, .. }, DriverRequest::SetLoad { chain: b, .. })
        | (DriverRequest::SetTool { chain: a, .. }, DriverRequest::SetTool { chain: b, .. }) => {
            a == b
        }
        (DriverRequest::SetSpeedRatio(_), DriverRequest::SetSpeedRatio(_)) => true,
        _ => false,
    }
}
