//! A switch for Ethernet frames, with links that can be delayed, lossy or cut.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use anyhow::Result;
use tun_rs::SyncDevice;

/// Largest frame: an Ethernet header and the usual 1500 bytes, with a reserve.
const MAX_FRAME: usize = 2048;

/// How good a link is, in one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quality {
    /// Time that every frame takes.
    pub delay: Duration,
    /// Most that is added to it at random; frames keep their order.
    pub jitter: Duration,
    /// Share of frames that are lost, 0 to 1.
    pub loss: f64,
    /// Whether nothing passes.
    pub cut: bool,
}

impl Quality {
    /// Nothing passes.
    pub const CUT: Self =
        Self { delay: Duration::ZERO, jitter: Duration::ZERO, loss: 0.0, cut: true };

    /// So many of a hundred frames are lost.
    #[must_use]
    pub fn losing(percent: u8) -> Self {
        Self { loss: f64::from(percent) / 100.0, ..Self::default() }
    }

    /// Every frame takes so long.
    #[must_use]
    pub fn slow(delay: Duration, jitter: Duration) -> Self {
        Self { delay, jitter, ..Self::default() }
    }
}

/// Joins the network cards of all hosts.
#[derive(Clone, Debug)]
pub(super) struct Switch(Arc<Shared>);

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Switch")
    }
}

#[derive(Default)]
struct State {
    ports: BTreeMap<u8, Arc<SyncDevice>>,
    qualities: BTreeMap<(u8, u8), Quality>,
    /// When the last frame of each link arrives: none overtakes another.
    last: BTreeMap<(u8, u8), Instant>,
    waiting: BinaryHeap<Reverse<Frame>>,
    count: u64,
    random: u64,
}

/// A frame on its way; ordered by when it arrives, then by when it was sent.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Frame {
    due: Instant,
    number: u64,
    to: u8,
    bytes: Vec<u8>,
}

/// The address of the card of host `index`.
pub(super) fn mac(index: u8) -> [u8; 6] {
    [0x02, 0xa0, 0, 0, 0, index]
}

impl Switch {
    /// A switch without ports; its thread ends with its last handle.
    pub(super) fn new() -> Self {
        let state = State { random: 0x9e37_79b9_7f4a_7c15, ..State::default() };
        let shared = Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new() });
        let weak = Arc::downgrade(&shared);
        start("switch".to_owned(), move || deliver(&weak));
        Self(shared)
    }

    /// Joins a card; its frames are taken by a thread of its own until the card is gone.
    pub(super) fn plug(&self, index: u8, card: SyncDevice) {
        let card = Arc::new(card);
        self.0.lock().ports.insert(index, Arc::clone(&card));
        let weak = Arc::downgrade(&self.0);
        start(format!("port-{index}"), move || take_frames(index, &card, &weak));
    }

    /// Takes a card out.
    pub(super) fn unplug(&self, index: u8) {
        self.0.lock().ports.remove(&index);
    }

    /// Sets how good the link from one host to another is.
    pub(super) fn set(&self, from: u8, to: u8, quality: Quality) {
        self.0.lock().qualities.insert((from, to), quality);
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// A number from 0 to 1 (xorshift64*).
    fn chance(&mut self) -> f64 {
        self.random ^= self.random >> 12;
        self.random ^= self.random << 25;
        self.random ^= self.random >> 27;
        (self.random.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn send(&mut self, from: u8, bytes: &[u8]) {
        let Some(target) = bytes.get(..6) else { return };
        let all: Vec<u8> = self.ports.keys().copied().filter(|port| *port != from).collect();
        for to in all {
            let is_meant = target[0] & 1 == 1 || target == mac(to);
            if is_meant {
                self.send_to(from, to, bytes);
            }
        }
    }

    fn send_to(&mut self, from: u8, to: u8, bytes: &[u8]) {
        let quality = self.qualities.get(&(from, to)).copied().unwrap_or_default();
        if quality.cut || (quality.loss > 0.0 && self.chance() < quality.loss) {
            return;
        }
        let jitter = if quality.jitter.is_zero() {
            Duration::ZERO
        } else {
            quality.jitter.mul_f64(self.chance())
        };
        let due = now() + quality.delay + jitter;
        let last = self.last.entry((from, to)).or_insert(due);
        *last = due.max(*last);
        let due = *last;
        self.count += 1;
        let frame = Frame { due, number: self.count, to, bytes: bytes.to_vec() };
        self.waiting.push(Reverse(frame));
    }
}

fn take_frames(index: u8, card: &SyncDevice, switch: &Weak<Shared>) {
    let mut buffer = [0; MAX_FRAME];
    while let Ok(length) = card.recv(&mut buffer) {
        let Some(switch) = switch.upgrade() else { return };
        let mut state = switch.lock();
        if !state.ports.contains_key(&index) {
            return;
        }
        if let Some(frame) = buffer.get(..length) {
            state.send(index, frame);
        }
        drop(state);
        switch.changed.notify_one();
    }
}

/// Delivers frames when they are due, until the switch is gone.
fn deliver(switch: &Weak<Shared>) {
    while let Some(switch) = switch.upgrade() {
        let mut state = switch.lock();
        let wait = match state.waiting.peek() {
            Some(Reverse(frame)) => frame.due.saturating_duration_since(now()),
            None => Duration::from_millis(20),
        };
        if !wait.is_zero() {
            let wait = wait.min(Duration::from_millis(20));
            drop(switch.changed.wait_timeout(state, wait));
            continue;
        }
        let Some(Reverse(frame)) = state.waiting.pop() else { continue };
        let card = state.ports.get(&frame.to).cloned();
        drop(state);
        if let Some(card) = card {
            // A card that is down takes nothing, as a pulled cable would.
            let _ = card.send(&frame.bytes);
        }
    }
}

/// Starts a thread; without it the link is cut, which the test will tell.
fn start(name: String, work: impl FnOnce() + Send + 'static) {
    drop(std::thread::Builder::new().name(name).spawn(work));
}

#[expect(clippy::disallowed_methods, reason = "a link takes real time")]
fn now() -> Instant {
    Instant::now()
}

/// A network card of the namespace that the calling thread is in.
pub(super) fn card(name: &str) -> Result<SyncDevice> {
    Ok(tun_rs::DeviceBuilder::new().name(name).layer(tun_rs::Layer::L2).build_sync()?)
}
