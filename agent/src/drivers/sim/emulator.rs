//! The controller's side of the protocol: clients, delays, injected faults.
//!
//! One client holds the controller. Another is refused as long as the first is heard, and takes
//! over once that has been silent for `client_timeout_ms`: two programs never command one robot,
//! and an agent that died is replaced without anybody's help. The same run of a client may come
//! back from another address at any time. Faults may be injected by anybody, who thereby neither
//! takes the controller nor gets the status stream.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::time::Duration;

use armada_model::MonoTime;

use super::controller::{Controller, Measurement};
use super::safety::StopSource;
use super::wire::{Body, Header, Power, RequestBody, Status, VERSION, WireError, decode, encode};
use super::{Config, EmulatorConfig, Fault};
use crate::config::millis;
use crate::drivers::{
    DriverSetup, Emulator, Endpoint, LinkCounters, LinkRefusal, SetPoint, SetupError, Transmit,
};

/// Packets under way in one direction at most; the newest are lost when there are more.
const MAX_UNDER_WAY: usize = 2048;
/// Packets under way in one direction for which there is room from the start.
const ROOM: usize = 32;
/// Answers that wait to be sent at most; the newest are lost when there are more.
const MAX_ANSWERS: usize = 16;
/// Longest time that is caught up with; after a longer pause the emulated robot just goes on,
/// as if it had been stopped in between.
const MAX_CATCH_UP: Duration = Duration::from_secs(1);

/// An emulated controller with the robot behind it.
#[derive(Debug)]
pub struct SimEmulator {
    endpoints: [Endpoint; 1],
    controller: Controller,
    nonce: u64,
    sequence: u64,
    cycle: Duration,
    next_cycle: Option<MonoTime>,
    client: Option<Client>,
    client_timeout: Duration,
    command_latency: Duration,
    status_latency: Duration,
    extra_latency: Duration,
    silent_until: MonoTime,
    frozen: bool,
    last_measurement: Option<Measurement>,
    inbox: VecDeque<Inbound>,
    outbox: VecDeque<Outbound>,
    answers: VecDeque<Answer>,
    counters: LinkCounters,
}

/// The client that holds the controller.
#[derive(Clone, Copy, Debug)]
struct Client {
    nonce: u64,
    peer: SocketAddr,
    heard: MonoTime,
    last_command: u64,
    last_power_id: u32,
    last_reset_id: u32,
    last_order_id: u32,
}

/// What is on its way from the client.
#[derive(Clone, Copy, Debug)]
struct Inbound {
    due: MonoTime,
    sender: u64,
    order: ClientOrder,
}

#[derive(Clone, Copy, Debug)]
enum ClientOrder {
    Command { sequence: u64, set_point: SetPoint },
    Request(RequestBody),
}

/// A report on its way to the client.
#[derive(Clone, Copy, Debug)]
struct Outbound {
    due: MonoTime,
    peer: SocketAddr,
    header: Header,
    status: Status,
}

/// An answer to a single packet.
#[derive(Clone, Copy, Debug)]
struct Answer {
    peer: SocketAddr,
    receiver: u64,
    body: Body,
}

impl SimEmulator {
    pub(super) fn new(config: &Config, setup: &DriverSetup) -> Result<Self, SetupError> {
        config.check().map_err(|problem| SetupError::Config {
            vendor: "sim",
            field: problem.field,
            problem: problem.text,
        })?;
        let EmulatorConfig { cycle_ms, client_timeout_ms, .. } = config.emulator;
        Ok(Self {
            endpoints: [Endpoint::UdpAt { local: config.address }],
            controller: Controller::new(&config.emulator, setup)?,
            nonce: setup.boot_nonce.get(),
            sequence: 0,
            cycle: cycle_ms.map_or(setup.period, millis),
            next_cycle: None,
            client: None,
            client_timeout: millis(client_timeout_ms),
            command_latency: millis(config.emulator.command_latency_ms),
            status_latency: millis(config.emulator.status_latency_ms),
            extra_latency: Duration::ZERO,
            silent_until: MonoTime::ZERO,
            frozen: false,
            last_measurement: None,
            inbox: VecDeque::with_capacity(ROOM),
            outbox: VecDeque::with_capacity(ROOM),
            answers: VecDeque::with_capacity(MAX_ANSWERS),
            counters: LinkCounters::default(),
        })
    }

    fn take_packet(&mut self, now: MonoTime, peer: SocketAddr, header: Header, body: Body) {
        if let Body::Inject(fault) = body {
            let accepted = self.inject(now, fault);
            self.answer(peer, header.sender, Body::InjectAnswer { fault, accepted });
            return;
        }
        if now < self.silent_until {
            return;
        }
        let stale = header.receiver != 0 && header.receiver != self.nonce;
        match body {
            // A hello after our restart names our run before; it is meant for whoever is here.
            Body::Hello { joints } => self.greet(now, peer, header.sender, joints),
            Body::Command(_) | Body::Request(_) if stale => self.counters.out_of_order += 1,
            Body::Command(set_point) => {
                let order = ClientOrder::Command { sequence: header.sequence, set_point };
                self.take_order(now, peer, header.sender, order);
            }
            Body::Request(request) => {
                self.take_order(now, peer, header.sender, ClientOrder::Request(request));
            }
            // What only a controller sends.
            Body::Status(_) | Body::Refused(_) | Body::InjectAnswer { .. } | Body::Inject(_) => {
                self.counters.malformed += 1;
            }
        }
    }

    fn greet(&mut self, now: MonoTime, peer: SocketAddr, sender: u64, joints: u8) {
        let own = self.controller.joint_count() as u8; // at most MAX_JOINTS
        if joints != own {
            let refusal = LinkRefusal::JointCount { controller: own, client: joints };
            self.refuse(peer, sender, refusal);
            return;
        }
        let timeout = self.client_timeout;
        match &mut self.client {
            Some(client) if client.nonce == sender => {
                client.peer = peer;
                client.heard = now;
            }
            Some(client) if now.saturating_since(client.heard) < timeout => {
                self.refuse(peer, sender, LinkRefusal::Busy);
                return;
            }
            Some(_) | None => {
                self.client = Some(Client::new(sender, peer, now));
                // Nobody is left who asked for what it does on its own.
                self.controller.client_is_silent();
                self.controller.forget_report();
            }
        }
        self.counters.received += 1;
    }

    fn take_order(&mut self, now: MonoTime, peer: SocketAddr, sender: u64, order: ClientOrder) {
        match &mut self.client {
            Some(client) if client.nonce == sender => {
                client.peer = peer;
                client.heard = now;
            }
            Some(_) => return self.refuse(peer, sender, LinkRefusal::Busy),
            // It has not greeted yet; the silence makes it do so.
            None => {
                self.counters.out_of_order += 1;
                return;
            }
        }
        self.counters.received += 1;
        if self.inbox.len() < MAX_UNDER_WAY {
            let due = now + self.command_latency + self.extra_latency;
            self.inbox.push_back(Inbound { due, sender, order });
        }
    }

    fn refuse(&mut self, peer: SocketAddr, receiver: u64, refusal: LinkRefusal) {
        self.counters.refused += 1;
        self.counters.refusal = Some(refusal);
        self.answer(peer, receiver, Body::Refused(refusal));
    }

    fn answer(&mut self, peer: SocketAddr, receiver: u64, body: Body) {
        if self.answers.len() < MAX_ANSWERS {
            self.answers.push_back(Answer { peer, receiver, body });
        }
    }

    /// Brings a fault about and says whether this robot can have it.
    fn inject(&mut self, now: MonoTime, fault: Fault) -> bool {
        match fault {
            Fault::EmergencyStop => self.controller.press(StopSource::Internal),
            Fault::EmergencyStopButton(button) => self.controller.press(StopSource::Button(button)),
            Fault::EmergencyStopFault => self.controller.press(StopSource::Fault),
            Fault::EmergencyStopOther => self.controller.press(StopSource::Other),
            Fault::EmergencyStopRelease => self.controller.release_emergency_stop(),
            Fault::GuardOpen(guard) => self.controller.set_guard(guard, true),
            Fault::GuardClose(guard) => self.controller.set_guard(guard, false),
            Fault::EnablingHold => self.controller.hold_enabling_switch(true),
            Fault::EnablingRelease => self.controller.hold_enabling_switch(false),
            Fault::KeySwitch(mode) => self.controller.turn_key(mode),
            Fault::LocalOn => self.controller.set_local_control(true),
            Fault::LocalOff => self.controller.set_local_control(false),
            Fault::FatalError(code) => self.controller.fail_fatally(code),
            Fault::FatalClear => self.controller.repair(),
            Fault::HomingFailure => self.controller.break_homing(true),
            Fault::HomingRepair => self.controller.break_homing(false),
            Fault::Input { signal, element, value } => {
                return self.controller.set_input(&signal, element, value);
            }
            Fault::ControllerError(code) => self.controller.fail(code),
            Fault::SilenceMs(ms) => {
                self.silent_until = now + Duration::from_millis(u64::from(ms));
                self.outbox.clear();
            }
            Fault::Freeze => self.frozen = true,
            Fault::Unfreeze => self.frozen = false,
            Fault::DrivesOff => self.controller.power_off(),
            Fault::BlockJoint(index) => return self.controller.block(Some(usize::from(index))),
            Fault::Unblock => return self.controller.block(None),
            Fault::LatencyMs(ms) => self.extra_latency = Duration::from_millis(u64::from(ms)),
        }
        true
    }

    fn run_cycle(&mut self, now: MonoTime) {
        while let Some(inbound) = self.inbox.front().copied().filter(|front| front.due <= now) {
            self.inbox.pop_front();
            self.carry_out(&inbound);
        }
        let silent =
            |client: &Client| now.saturating_since(client.heard) >= self.client_timeout;
        if self.client.as_ref().is_none_or(silent) {
            self.controller.client_is_silent();
        }
        self.controller.advance(now, self.cycle);
        self.report(now);
    }

    /// Does what the client ordered, unless a newer order was done or another client has come.
    fn carry_out(&mut self, inbound: &Inbound) {
        let Some(client) = self.client.as_mut().filter(|client| client.nonce == inbound.sender)
        else {
            self.counters.out_of_order += 1;
            return;
        };
        match inbound.order {
            ClientOrder::Command { sequence, .. } if sequence <= client.last_command => {
                self.counters.out_of_order += 1;
            }
            ClientOrder::Command { sequence, set_point } => {
                client.last_command = sequence;
                self.controller.command(inbound.due, set_point);
            }
            ClientOrder::Request(request) => {
                // Errors first, so that "reset and enable" does both however they arrive.
                if request.reset_id > client.last_reset_id {
                    client.last_reset_id = request.reset_id;
                    self.controller.reset_errors();
                }
                if request.power_id > client.last_power_id {
                    client.last_power_id = request.power_id;
                    match request.power {
                        Some(Power::On) => self.controller.power_on(inbound.due),
                        Some(Power::Off) => self.controller.power_off(),
                        None => {}
                    }
                }
                if request.order_id > client.last_order_id
                    && let Some(order) = &request.order
                {
                    client.last_order_id = request.order_id;
                    self.controller.take_order(order);
                }
            }
        }
    }

    fn report(&mut self, now: MonoTime) {
        let fresh = self.controller.measure();
        let measurement = match self.last_measurement {
            Some(last) if self.frozen => last,
            _ => fresh,
        };
        self.last_measurement = Some(measurement);
        let Some(client) = self.client else { return };
        let heard = now.saturating_since(client.heard) < self.client_timeout;
        if !heard || now < self.silent_until || self.outbox.len() >= MAX_UNDER_WAY {
            return;
        }
        let header = self.next_header(client.nonce);
        let due = now + self.status_latency + self.extra_latency;
        let status = self.status(now, &client, &measurement);
        self.outbox.push_back(Outbound { due, peer: client.peer, header, status });
    }

    fn status(&self, now: MonoTime, client: &Client, measurement: &Measurement) -> Status {
        let [homed, homing] = self.controller.homed_and_homing();
        Status {
            time_ns: now.as_nanos(),
            last_command: client.last_command,
            last_power_id: client.last_power_id,
            last_reset_id: client.last_reset_id,
            last_order_id: client.last_order_id,
            enabled: self.controller.enabled(),
            ready: self.controller.ready(),
            emergency_stop: self.controller.emergency_stop(),
            guard_stop: self.controller.guard_stop(),
            local_control: self.controller.local_control(),
            conditions: self.controller.conditions(),
            operational_mode: self.controller.operational_mode(),
            error: self.controller.error(),
            homed,
            homing,
            delegated: self.controller.report(),
            signals: self.controller.board().signals(),
            parameters: self.controller.board().parameters(),
            tips: self.controller.tips(&measurement.position),
            position: measurement.position,
            velocity: measurement.velocity,
            effort: measurement.effort,
        }
    }

    const fn next_header(&mut self, receiver: u64) -> Header {
        self.sequence += 1;
        Header { sender: self.nonce, receiver, sequence: self.sequence }
    }
}

impl Emulator for SimEmulator {
    fn endpoints(&self) -> &[Endpoint] {
        &self.endpoints
    }

    fn receive(&mut self, now: MonoTime, _endpoint: usize, peer: SocketAddr, bytes: &[u8]) {
        match decode(bytes) {
            Ok((header, body)) => self.take_packet(now, peer, header, body),
            Err(WireError::Version { sender, .. }) => {
                self.counters.malformed += 1;
                self.refuse(peer, sender, LinkRefusal::Version { controller: VERSION });
            }
            Err(_) => self.counters.malformed += 1,
        }
    }

    fn advance(&mut self, now: MonoTime) {
        let mut next = self.next_cycle.unwrap_or(now);
        if now.saturating_since(next) > MAX_CATCH_UP {
            next = now;
        }
        while next <= now {
            self.run_cycle(next);
            next = next + self.cycle;
        }
        self.next_cycle = Some(next);
    }

    fn poll_transmit(&mut self, now: MonoTime, buffer: &mut [u8]) -> Option<Transmit> {
        if let Some(answer) = self.answers.pop_front() {
            let header = self.next_header(answer.receiver);
            let len = encode(&header, &answer.body, buffer);
            return Some(Transmit { endpoint: 0, peer: Some(answer.peer), len });
        }
        let Outbound { peer, header, status, .. } =
            self.outbox.front().copied().filter(|front| front.due <= now)?;
        self.outbox.pop_front();
        let len = encode(&header, &Body::Status(status), buffer);
        Some(Transmit { endpoint: 0, peer: Some(peer), len })
    }

    fn next_deadline(&self) -> MonoTime {
        let cycle = self.next_cycle.unwrap_or(MonoTime::ZERO);
        self.outbox.front().map_or(cycle, |front| front.due.min(cycle))
    }

    fn counters(&self) -> LinkCounters {
        self.counters
    }
}

impl Client {
    const fn new(nonce: u64, peer: SocketAddr, heard: MonoTime) -> Self {
        Self {
            nonce,
            peer,
            heard,
            last_command: 0,
            last_power_id: 0,
            last_reset_id: 0,
            last_order_id: 0,
        }
    }
}
