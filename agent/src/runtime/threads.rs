//! The threads of one robot: its control loop and its publisher.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle, Thread};

use armada_protocol::messages::SchedulingPolicy;
use tracing::Span;

use super::loop_thread::LoopThread;
use super::processor::{Follower, Processor};
use super::publisher::Publisher;
use super::realtime::{self, RealtimeReport};
use crate::config::{RealtimeConfig, RobotConfig};

/// How much less urgent than the loop the publisher is, which hands a fresh state to Zenoh.
const BELOW_LOOP: u8 = 10;

/// The threads of a robot; they have ended when this is dropped.
#[derive(Debug)]
pub(super) struct Threads {
    shutdown: Arc<AtomicBool>,
    handles: Vec<JoinHandle<()>>,
}

impl Threads {
    /// None yet; all that follow end when `shutdown` is set.
    pub(super) const fn new(shutdown: Arc<AtomicBool>) -> Self {
        Self { shutdown, handles: Vec::new() }
    }

    /// Starts the publisher; returns how the loop wakes it. What it logs is within `span`.
    ///
    /// It goes where the loop runs (`runs_on`) if it may go before all ordinary threads there, and
    /// the loop was not given a processor of its own.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(super) fn publish(
        &mut self,
        publisher: Publisher,
        config: &RobotConfig,
        runs_on: Arc<Processor>,
        span: Span,
    ) -> io::Result<Thread> {
        let name = format!("publish-{}", config.robot);
        let priority = config.control.realtime.priority;
        let priority = priority.map(|priority| priority.saturating_sub(BELOW_LOOP).max(1));
        let scheduling = RealtimeConfig { priority, cpu: None, lock_memory: false };
        let loop_is_alone = config.control.realtime.cpu.is_some();
        let run = move || {
            // Refused where it is refused to the loop, which says so.
            let report = realtime::enter(&scheduling);
            let follows = report.policy != SchedulingPolicy::Other && !loop_is_alone;
            let follower = follows.then(|| Follower::of(runs_on));
            span.in_scope(|| publisher.run(follower));
        };
        let handle = Builder::new().name(name).spawn(run)?;
        let thread = handle.thread().clone();
        self.handles.push(handle);
        Ok(thread)
    }

    /// Starts the control loop; returns how it is scheduled.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(super) fn control(&mut self, control: LoopThread) -> io::Result<RealtimeReport> {
        let running = control.start()?;
        self.handles.push(running.thread);
        Ok(running.realtime)
    }

    /// Ends them, which takes about a period of the loop; returns whether none had panicked.
    pub(super) fn end(&mut self) -> bool {
        self.shutdown.store(true, Ordering::Relaxed);
        for handle in &self.handles {
            handle.thread().unpark();
        }
        // Each is waited for, whatever the others ended with.
        self.handles.drain(..).map(JoinHandle::join).filter(Result::is_err).count() == 0
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        // A panic has been printed by the thread itself.
        self.end();
    }
}
