//! An emulated controller on real sockets.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};

use super::clock::{monotonic, sleep_until};
use super::link::{Link, LinkError};
use super::realtime;
use crate::config::RealtimeConfig;
use crate::drivers::Emulator;

/// Why an emulation could not be started.
#[derive(Debug, thiserror::Error)]
pub enum EmulationError {
    /// A socket could not be set up.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The system gives no thread.
    #[error("no thread for the emulator: {0}")]
    Thread(#[from] std::io::Error),
}

/// A running emulator; it ends when this is dropped.
#[derive(Debug)]
pub struct Emulation {
    shutdown: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    addresses: Vec<SocketAddr>,
}

impl Emulation {
    /// Starts an emulator on the sockets it asks for, with a thread of its own.
    ///
    /// # Errors
    /// [`EmulationError::Link`] if an address is taken, [`EmulationError::Thread`] if the system
    /// gives no thread.
    pub fn start(
        mut emulator: Box<dyn Emulator>,
        scheduling: RealtimeConfig,
    ) -> Result<Self, EmulationError> {
        let link = Link::open(emulator.endpoints())?;
        let addresses = link.local_addresses();
        let shutdown = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&shutdown);
        let thread = Builder::new().name("emulator".to_owned()).spawn(move || {
            realtime::enter(&scheduling);
            run(&mut *emulator, &link, &ended);
        })?;
        Ok(Self { shutdown, thread: Some(thread), addresses })
    }

    /// Addresses it listens on.
    #[must_use]
    pub fn addresses(&self) -> &[SocketAddr] {
        &self.addresses
    }
}

impl Drop for Emulation {
    fn drop(&mut self) {
        self.shutdown.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of the emulator has been printed by its own thread.
            drop(thread.join());
        }
    }
}

fn run(emulator: &mut dyn Emulator, link: &Link, shutdown: &AtomicBool) {
    while !shutdown.load(Ordering::Relaxed) {
        sleep_until(emulator.next_deadline());
        let now = monotonic();
        link.receive(|endpoint, peer, bytes| emulator.receive(now, endpoint, peer, bytes));
        emulator.advance(now);
        link.transmit(|buffer| emulator.poll_transmit(now, buffer));
    }
}
