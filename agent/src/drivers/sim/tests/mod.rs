//! Driver and emulator back to back in memory, on an invented clock and an unreliable network.

mod board;
mod faults;
mod homing;
mod link;
mod motion;
mod moves;
mod safety;
mod session;
mod stories;
mod wire;

use std::net::SocketAddr;
use std::num::NonZeroU64;
use std::time::Duration;

use armada_model::{JointLimits, JointType, JointVector, MonoTime};
use armada_protocol::messages::{JointInfo, ReducedLimits};

use super::noise::Noise;
use super::{Config, EmulatorConfig, Fault, SimDriver, SimEmulator, decode_inject_answer};
use super::{encode_inject, error_code};
use crate::drivers::{
    Driver, DriverRequest, DriverSetup, Emulator, Feedback, MAX_PACKET, SetPoint, Transmit,
};

const PERIOD: Duration = Duration::from_millis(2);
const SPEED_LIMIT: f64 = 2.0;
const ACCELERATION_LIMIT: f64 = 5.0;

/// A turning joint and a sliding one.
fn setup(nonce: u64) -> DriverSetup {
    let limits = |upper: f64, scale: f64| JointLimits {
        lower: Some(-upper),
        upper: Some(upper),
        velocity: SPEED_LIMIT * scale,
        acceleration: Some(ACCELERATION_LIMIT * scale),
        jerk: None,
        effort: Some(100.0),
    };
    let joint =
        |name: &str, joint_type, limits| JointInfo {
            name: name.into(),
            joint_type,
            limits,
            reduced: ReducedLimits::default(),
            home: None,
        };
    DriverSetup {
        joints: vec![
            joint("turn", JointType::Revolute, limits(3.0, 1.0)),
            joint("slide", JointType::Prismatic, limits(0.5, 0.1)),
        ],
        chains: Vec::new(),
        period: PERIOD,
        boot_nonce: NonZeroU64::new(nonce).expect("nonce is not zero"),
    }
}

/// Without noise, so that tests can compare numbers.
fn quiet() -> EmulatorConfig {
    EmulatorConfig {
        position_noise_rad: 0.0,
        position_noise_m: 0.0,
        velocity_noise_rad_s: 0.0,
        velocity_noise_m_s: 0.0,
        ..EmulatorConfig::default()
    }
}

fn config(emulator: EmulatorConfig) -> Config {
    Config { address: address(47_199), emulator }
}

fn address(port: u16) -> SocketAddr {
    ([127, 0, 0, 1], port).into()
}

/// What the network does to packets.
#[derive(Clone, Copy, Default)]
struct Weather {
    /// Share of packets that are lost.
    loss: f64,
    /// Most ticks a packet is held up; packets overtake each other.
    hold_up: u32,
    /// Share of packets that come twice.
    twice: f64,
}

/// Packets on their way, each with the ticks it still takes.
struct Network {
    weather: Weather,
    dice: Noise,
    under_way: Vec<(u32, Vec<u8>)>,
}

impl Network {
    fn new(weather: Weather, seed: u64) -> Self {
        Self { weather, dice: Noise::new(seed), under_way: Vec::new() }
    }

    fn send(&mut self, bytes: &[u8]) {
        if self.dice.uniform() <= self.weather.loss {
            return;
        }
        let copies = if self.dice.uniform() <= self.weather.twice { 2 } else { 1 };
        for _ in 0..copies {
            let hold_up = (self.dice.uniform() * f64::from(self.weather.hold_up)).round() as u32;
            self.under_way.push((hold_up, bytes.to_vec()));
        }
    }

    /// The packets that arrive in this tick.
    fn arrive(&mut self) -> Vec<Vec<u8>> {
        let (now, later) = std::mem::take(&mut self.under_way)
            .into_iter()
            .partition::<Vec<_>, _>(|(hold_up, _)| *hold_up == 0);
        self.under_way = later.into_iter().map(|(hold_up, bytes)| (hold_up - 1, bytes)).collect();
        now.into_iter().map(|(_, bytes)| bytes).collect()
    }
}

/// A driver and an emulator with a network between them.
struct Pair {
    now: MonoTime,
    driver: SimDriver,
    emulator: SimEmulator,
    /// Where the driver sends from.
    peer: SocketAddr,
    up: Network,
    down: Network,
    /// Packets the emulator sent to others than the driver.
    to_others: Vec<(SocketAddr, Vec<u8>)>,
}

impl Pair {
    fn new(emulator: EmulatorConfig) -> Self {
        Self::in_weather(emulator, Weather::default())
    }

    fn in_weather(emulator: EmulatorConfig, weather: Weather) -> Self {
        Self::of(setup, emulator, weather)
    }

    /// The robot that `setup` gives for the nonces of both sides.
    fn of(setup: fn(u64) -> DriverSetup, emulator: EmulatorConfig, weather: Weather) -> Self {
        let config = config(emulator);
        Self {
            now: MonoTime::from_nanos(1_000_000_000),
            driver: config.driver(&setup(11)).expect("driver"),
            emulator: config.emulator(&setup(22)).expect("emulator"),
            peer: address(50_001),
            up: Network::new(weather, 5),
            down: Network::new(weather, 6),
            to_others: Vec::new(),
        }
    }

    /// A pair with drives on and joints at zero.
    fn enabled(emulator: EmulatorConfig) -> Self {
        let mut pair = Self::new(emulator);
        pair.enable();
        pair
    }

    fn enable(&mut self) {
        self.until("first status", 1.0, |feedback| !feedback.joint_position.is_empty());
        self.driver.request(self.now, DriverRequest::Enable);
        self.until("enabled", 2.0, |feedback| feedback.enabled && feedback.ready);
    }

    /// One period: the driver sends, the emulator advances and reports.
    fn tick(&mut self) {
        self.now = self.now + PERIOD;
        let mut buffer = [0; MAX_PACKET];
        while let Some(Transmit { len, peer, .. }) =
            self.driver.poll_transmit(self.now, &mut buffer)
        {
            assert_eq!(peer, None, "the driver's endpoint has a fixed remote");
            self.up.send(&buffer[..len]);
        }
        for bytes in self.up.arrive() {
            self.emulator.receive(self.now, 0, self.peer, &bytes);
        }
        self.advance_emulator();
        for bytes in self.down.arrive() {
            self.driver.receive(self.now, 0, &bytes);
        }
    }

    fn advance_emulator(&mut self) {
        let mut buffer = [0; MAX_PACKET];
        self.emulator.advance(self.now);
        while let Some(Transmit { len, peer, .. }) =
            self.emulator.poll_transmit(self.now, &mut buffer)
        {
            let peer = peer.expect("the emulator names the peer");
            if peer == self.peer {
                self.down.send(&buffer[..len]);
            } else {
                self.to_others.push((peer, buffer[..len].to_vec()));
            }
        }
    }

    fn run(&mut self, seconds: f64) {
        let end = self.now + Duration::from_secs_f64(seconds);
        while self.now < end {
            self.tick();
        }
    }

    /// Runs until the newest feedback is as wanted, and gives the seconds it took.
    fn until(&mut self, what: &str, patience_s: f64, wanted: impl Fn(&Feedback) -> bool) -> f64 {
        let begin = self.now;
        loop {
            self.tick();
            let passed = self.now.saturating_since(begin).as_secs_f64();
            if self.driver.feedback().is_some_and(&wanted) {
                return passed;
            }
            assert!(
                passed < patience_s,
                "{what}: not within {patience_s} s: {:?}",
                self.feedback()
            );
        }
    }

    /// Sends set-points each tick, `seconds` long: position and speed of both joints at a time.
    fn command(&mut self, seconds: f64, at: impl Fn(f64) -> [(f64, f64); 2]) {
        let begin = self.now;
        loop {
            let time = self.now.saturating_since(begin).as_secs_f64();
            if time >= seconds {
                return;
            }
            let [(a, va), (b, vb)] = at(time);
            self.driver.command(self.now, &set_point([a, b], [va, vb]));
            self.tick();
        }
    }

    /// Moves the turning joint from rest to a steady speed, the last set-point at that speed.
    fn accelerate_to(&mut self, speed: f64) {
        let ramp = speed / ACCELERATION_LIMIT;
        self.command(ramp + 0.1, |t| {
            let ramped = t.min(ramp);
            let position = 0.5 * ACCELERATION_LIMIT * ramped * ramped + speed * (t - ramped);
            [(position, ACCELERATION_LIMIT * ramped), (0.0, 0.0)]
        });
    }

    fn request(&mut self, request: DriverRequest) {
        self.driver.request(self.now, request);
    }

    fn inject(&mut self, text: &str) -> bool {
        let fault: Fault = text.parse().expect("a fault");
        let mut buffer = [0; MAX_PACKET];
        let len = encode_inject(&fault, &mut buffer);
        let peer = address(60_000);
        self.emulator.receive(self.now, 0, peer, &buffer[..len]);
        self.advance_emulator();
        let (to, answer) = self.to_others.pop().expect("an answer");
        assert_eq!(to, peer);
        let (answered, accepted) = decode_inject_answer(&answer).expect("an answer");
        assert_eq!(answered, fault);
        accepted
    }

    fn feedback(&self) -> &Feedback {
        self.driver.feedback().expect("feedback")
    }

    fn position(&self) -> f64 {
        self.feedback().joint_position[0]
    }
}

fn set_point(position: [f64; 2], velocity: [f64; 2]) -> SetPoint {
    SetPoint { joint_position: vector(position), joint_velocity: vector(velocity) }
}

fn vector(values: [f64; 2]) -> JointVector {
    JointVector::from_slice(&values).expect("two finite values")
}

/// A smooth move that takes `time`: position and speed at `t` as shares of the way.
fn blend(time: f64, t: f64) -> (f64, f64) {
    let s = (t / time).clamp(0.0, 1.0);
    (s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / time)
}
