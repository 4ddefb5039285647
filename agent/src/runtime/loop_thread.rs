//! The control loop's thread: packets in, one step, packets out, at absolute deadlines.
//!
//! A late wake-up runs one tick for the newest deadline that has passed and skips those before,
//! so the phase is kept and set-points stay one period apart: the motion is delayed, never
//! hurried. A tick that panics, in the driver or in the step, is counted, told to the next step as
//! a loop error, and sends nothing more; the controller's own watchdog covers a loop that panics
//! again and again.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle, Thread};
use std::time::Duration;
use std::{io, mem};

use armada_model::MonoTime;
use armada_protocol::messages::StopLevel;
use arrayvec::ArrayVec;

use super::clock::{monotonic, sleep_until};
use super::link::Link;
use super::mailbox::{Latest, LoopEnd};
use super::meter::Meter;
use super::processor::Processor;
use super::realtime::{self, RealtimeReport};
use super::stop_gate::{Closing, GateState, StopGate};
use super::stop_watch::StopWatch;
use super::wake_log::WakeLog;
use crate::config::RealtimeConfig;
use crate::control::{Input, LoopEvent, LoopState, MAX_REQUESTS, Output, Params, Refusal, step};
use crate::drivers::{Driver, Feedback, Pacing};
use crate::recorder::Tape;

/// Everything the loop thread owns or shares.
pub(super) struct LoopThread {
    pub(super) name: String,
    pub(super) params: Params,
    pub(super) state: LoopState,
    pub(super) driver: Box<dyn Driver>,
    pub(super) link: Link,
    pub(super) mailbox: LoopEnd,
    pub(super) gate: Arc<StopGate>,
    /// Until when the sources of stops are known to be released.
    pub(super) watch: Arc<StopWatch>,
    pub(super) meter: Arc<Meter>,
    /// Told at every tick.
    pub(super) runs_on: Arc<Processor>,
    pub(super) realtime: RealtimeConfig,
    /// A sample of the state falls due every so many ticks.
    pub(super) ticks_per_sample: u64,
    /// The same for each of the classes of lower rates.
    pub(super) ticks_per_class: Vec<u64>,
    /// Woken when there is something to publish.
    pub(super) publisher: Thread,
    pub(super) shutdown: Arc<AtomicBool>,
    /// Writes the ticks down.
    pub(super) tape: Option<Tape>,
    /// Set by whoever wants what is written down to be saved.
    pub(super) save: Arc<AtomicBool>,
    /// For who measures this loop.
    pub(super) wake_log: Option<WakeLog>,
    /// Whether the controller's emergency stop was pressed when it was looked at last.
    pub(super) emergency_stop: bool,
}

/// A running loop.
pub(super) struct RunningLoop {
    pub(super) thread: JoinHandle<()>,
    pub(super) realtime: RealtimeReport,
}

impl LoopThread {
    /// Starts the thread and waits until it has set up its scheduling.
    pub(super) fn start(mut self) -> io::Result<RunningLoop> {
        let (report, reported) = std::sync::mpsc::sync_channel(1);
        let thread = Builder::new().name(format!("loop-{}", self.name)).spawn(move || {
            let realtime = realtime::enter(&self.realtime);
            // The starter waits for it; if it has gone there is nobody to tell.
            let _ = report.send(realtime);
            self.run();
        })?;
        let realtime = reported.recv().unwrap_or_default();
        Ok(RunningLoop { thread, realtime })
    }

    fn run(&mut self) {
        let Pacing::Every(period) = self.driver.pacing();
        let mut deadline = monotonic() + period;
        let every = self.ticks_per_sample;
        let mut carry = Carry {
            loop_error: false,
            due: Due { every, left: every, count: 0 },
            asked: ArrayVec::new(),
        };
        while !self.shutdown.load(Ordering::Relaxed) {
            sleep_until(deadline);
            let woke = monotonic();
            let missed = whole_periods(woke.saturating_since(deadline), period);
            let tick = deadline + period * u32::try_from(missed).unwrap_or(u32::MAX);
            self.meter.count_tick(woke.saturating_since(deadline), missed);
            self.runs_on.note();
            if let Some(log) = &mut self.wake_log {
                log.note(tick, woke);
            }
            // Driver and step alike: a panic in either is a fault of this tick, never a silent end.
            let guarded = AssertUnwindSafe(|| self.tick(woke, tick, &mut carry));
            carry.loop_error = catch_unwind(guarded).is_err();
            if carry.loop_error {
                if let Some(tape) = &mut self.tape {
                    tape.cut();
                }
                self.meter.panics.fetch_add(1, Ordering::Relaxed);
                self.answer_for_failed_step(&mut carry.asked);
            }
            deadline = tick + period;
            if monotonic() > deadline {
                self.meter.overruns.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// One tick. What it was asked stands in `carry` until it has ended.
    fn tick(&mut self, woke: MonoTime, deadline: MonoTime, carry: &mut Carry) {
        let driver = &mut self.driver;
        self.link.receive(|endpoint, _, bytes| driver.receive(woke, endpoint, bytes));
        let feedback = driver.feedback().copied();
        self.watch_emergency_stop(feedback.as_ref());
        self.watch_sources(woke);
        let GateState { level, openings } = self.gate.state();
        let mut input = Input {
            now: deadline,
            feedback,
            stop: level,
            resets: openings,
            loop_error: carry.loop_error,
            requests: ArrayVec::new(),
            stream: ArrayVec::new(),
            group: ArrayVec::new(),
        };
        while !input.requests.is_full()
            && let Ok(request) = self.mailbox.requests.pop()
        {
            carry.asked.push(request.ticket);
            input.requests.push(request);
        }
        while !input.stream.is_full()
            && let Ok(sample) = self.mailbox.samples.pop()
        {
            input.stream.push(sample);
        }
        while !input.group.is_full()
            && let Ok(word) = self.mailbox.words.pop()
        {
            input.group.push(word);
        }
        if let Some(tape) = &mut self.tape {
            tape.before(&self.state, &input);
        }
        let mut output = step(&self.params, &mut self.state, &mut input);
        self.record(&input, &output);
        self.send(woke, &output);
        self.report(&mut output, &mut carry.due);
        carry.asked.clear();
    }

    /// Closes the gate when the controller's emergency stop is pressed, before this tick's step
    /// looks at it: no message comes in between.
    fn watch_emergency_stop(&mut self, feedback: Option<&Feedback>) {
        let Some(feedback) = feedback else { return };
        let before = mem::replace(&mut self.emergency_stop, feedback.emergency_stop);
        if before || !feedback.emergency_stop {
            return;
        }
        let Closing { count: closing, raised } = self.gate.close(StopLevel::L1);
        let event = LoopEvent::EmergencyStop { closing, raised };
        if self.mailbox.events.push((monotonic(), event)).is_err() {
            self.meter.lost_events.fetch_add(1, Ordering::Relaxed);
        }
        self.publisher.unpark();
    }

    /// Closes the gate when whoever asks the sources of stops says nothing of them any more. The desk
    /// finds it closed and writes that down.
    fn watch_sources(&self, now: MonoTime) {
        let level = self.watch.overdue(now).filter(|_| self.gate.level().is_none());
        if let Some(level) = level {
            self.gate.close(level);
        }
    }

    /// Answers the requests of a step that panicked. One that it had answered or left to wait may
    /// be answered twice; whoever asked hears the first.
    fn answer_for_failed_step(&mut self, asked: &mut ArrayVec<u64, MAX_REQUESTS>) {
        let said = monotonic();
        for ticket in asked.drain(..) {
            let event = LoopEvent::Answer { ticket, result: Err(Refusal::StepFailed) };
            if self.mailbox.events.push((said, event)).is_err() {
                self.meter.lost_events.fetch_add(1, Ordering::Relaxed);
            }
        }
        self.publisher.unpark();
    }

    fn record(&mut self, input: &Input, output: &Output) {
        let Some(tape) = &mut self.tape else { return };
        let asked = self.save.swap(false, Ordering::Relaxed);
        if asked || output.events.iter().any(|e| matches!(e, LoopEvent::FaultLatched(_))) {
            tape.save();
        }
        tape.after(input, output);
    }

    fn send(&mut self, now: MonoTime, output: &Output) {
        let driver = &mut self.driver;
        if let Some(request) = output.driver_request {
            driver.request(now, request);
        }
        if let Some(set_point) = &output.command {
            driver.command(now, set_point);
        }
        self.link.transmit(|buffer| driver.poll_transmit(now, buffer));
        self.meter.note_link(&driver.counters());
    }

    fn report(&mut self, output: &mut Output, due: &mut Due) {
        let sample = due.tick();
        let said = monotonic();
        let seqno = output.snapshot.seqno;
        let class = self.ticks_per_class.iter().any(|&ticks| seqno.is_multiple_of(ticks.max(1)));
        let said_something = !output.events.is_empty() || !output.group.is_empty();
        let something = sample || class || said_something || !output.retired.is_empty();
        for say in output.group.drain(..) {
            if self.mailbox.says.push(say).is_err() {
                self.meter.lost_events.fetch_add(1, Ordering::Relaxed);
            }
        }
        // Drained in place: moved, each would be copied with all its unused room.
        for event in output.events.drain(..) {
            if let LoopEvent::StopRaised(level) = event {
                self.gate.raise(level);
            }
            if self.mailbox.events.push((said, event)).is_err() {
                self.meter.lost_events.fetch_add(1, Ordering::Relaxed);
            }
        }
        for retired in output.retired.drain(..) {
            if let Err(rtrb::PushError::Full(retired)) = self.mailbox.retired.push(retired) {
                // Freeing it would take the allocator's lock in the loop; losing it is cheaper.
                mem::forget(retired);
            }
        }
        let limited = output.snapshot.limited_setpoints;
        self.meter.limited_setpoints.store(limited, Ordering::Relaxed);
        if something {
            self.mailbox.latest.write(Latest { snapshot: output.snapshot, due: due.count });
            self.publisher.unpark();
        }
    }
}

/// What goes over from one tick to the next.
struct Carry {
    /// Whether the tick before panicked.
    loop_error: bool,
    due: Due,
    /// Tickets of the requests that the tick in progress has taken.
    asked: ArrayVec<u64, MAX_REQUESTS>,
}

/// When samples of the state fall due.
struct Due {
    every: u64,
    left: u64,
    count: u64,
}

impl Due {
    const fn tick(&mut self) -> bool {
        self.left -= 1;
        if self.left > 0 {
            return false;
        }
        self.left = self.every;
        self.count += 1;
        true
    }
}

fn whole_periods(time: Duration, period: Duration) -> u64 {
    u64::try_from(time.as_nanos() / period.as_nanos().max(1)).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use armada_model::JointLimits;
    use armada_protocol::messages::FaultCode;

    use super::super::mailbox::{ClientEnd, PublisherEnd, mailbox};
    use super::*;
    use crate::control::{LoopRequest, Order};
    use crate::drivers::{Abilities, DriverRequest, Endpoint, LinkCounters, SetPoint, Transmit};
    use crate::stop_sources::{SILENCE, StopSourceSetting, StopSources};

    const PERIOD: Duration = Duration::from_millis(1);

    /// A driver that nobody answers, and which may have a defect that shows in a tick.
    #[derive(Default)]
    struct Silent {
        transmissions: u64,
        defect_in: Option<u64>,
    }

    impl Driver for Silent {
        fn endpoints(&self) -> &[Endpoint] {
            &[]
        }

        fn pacing(&self) -> Pacing {
            Pacing::Every(PERIOD)
        }

        fn abilities(&self) -> Abilities {
            Abilities::default()
        }

        fn receive(&mut self, _: MonoTime, _: usize, _: &[u8]) {}

        fn feedback(&self) -> Option<&Feedback> {
            None
        }

        fn request(&mut self, _: MonoTime, _: DriverRequest) {}

        fn command(&mut self, _: MonoTime, _: &SetPoint) {}

        fn poll_transmit(&mut self, _: MonoTime, _: &mut [u8]) -> Option<Transmit> {
            self.transmissions += 1;
            assert_ne!(Some(self.transmissions), self.defect_in, "the defect");
            None
        }

        fn counters(&self) -> LinkCounters {
            LinkCounters::default()
        }
    }

    fn params() -> Params {
        let limits = JointLimits {
            lower: Some(-1.0),
            upper: Some(1.0),
            velocity: 1.0,
            acceleration: Some(1.0),
            jerk: None,
            effort: None,
        };
        Params::for_joints(vec![limits], PERIOD).expect("one joint")
    }

    /// A loop that has not begun, with the ends of its mailbox.
    fn loop_of(
        driver: Silent,
        sources: &[StopSourceSetting],
    ) -> (LoopThread, PublisherEnd, ClientEnd) {
        let params = params();
        let mut state = LoopState::new(&params).expect("valid parameters");
        let mut input = Input::at(monotonic());
        let first = step(&params, &mut state, &mut input).snapshot;
        let (loop_end, publisher, clients) = mailbox(first);
        let name = "silent".parse().expect("a name");
        let sources = StopSources::new(name, sources.to_vec(), monotonic());
        let thread = LoopThread {
            name: "silent".to_owned(),
            state,
            params,
            driver: Box::new(driver),
            link: Link::open(&[]).expect("nothing to open"),
            mailbox: loop_end,
            gate: Arc::default(),
            watch: Arc::new(StopWatch::new(&sources)),
            meter: Arc::default(),
            runs_on: Arc::default(),
            realtime: RealtimeConfig { priority: None, cpu: None, lock_memory: false },
            ticks_per_sample: 1,
            ticks_per_class: Vec::new(),
            publisher: std::thread::current(),
            shutdown: Arc::default(),
            tape: None,
            save: Arc::default(),
            wake_log: None,
            emergency_stop: false,
        };
        (thread, publisher, clients)
    }

    /// Waits for a condition, at most ten seconds.
    fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
        let deadline = monotonic() + Duration::from_secs(10);
        while !condition() {
            assert!(monotonic() < deadline, "{what} did not come");
            std::thread::park_timeout(PERIOD);
        }
    }

    #[test]
    fn a_reset_that_a_stop_follows_at_once_is_seen_by_the_loop() {
        let (thread, mut publisher, _clients) = loop_of(Silent::default(), &[]);
        let (gate, shutdown) = (Arc::clone(&thread.gate), Arc::clone(&thread.shutdown));
        let count = gate.close(StopLevel::L1).count;
        let running = thread.start().expect("a thread");
        wait_until("the stop", || publisher.latest.read().snapshot.epoch > 1);
        let epoch = publisher.latest.read().snapshot.epoch;
        assert!(gate.open(count), "nobody closed it meanwhile");
        gate.close(StopLevel::L1);
        let mut cleared = false;
        wait_until("the reset", || {
            while let Ok((_, event)) = publisher.events.pop() {
                cleared |= event == LoopEvent::StopCleared;
            }
            cleared
        });
        wait_until("the stop anew", || publisher.latest.read().snapshot.epoch >= epoch + 2);
        shutdown.store(true, Ordering::Relaxed);
        running.thread.join().expect("the loop ends in order");
    }

    #[test]
    fn a_loop_stops_by_itself_when_nobody_asks_its_stop_sources() {
        let (name, level) = ("door_1".to_owned(), StopLevel::L1);
        let door = StopSourceSetting { name, level, key: None };
        let begin = monotonic();
        let (thread, _publisher, _clients) = loop_of(Silent::default(), &[door]);
        let (gate, shutdown) = (Arc::clone(&thread.gate), Arc::clone(&thread.shutdown));
        let running = thread.start().expect("a thread");
        wait_until("the stop", || gate.level().is_some());
        assert!(monotonic().saturating_since(begin) >= SILENCE, "it was given its time");
        assert_eq!((gate.level(), gate.count()), (Some(StopLevel::L1), 1));
        shutdown.store(true, Ordering::Relaxed);
        running.thread.join().expect("the loop ends in order");
    }

    #[test]
    fn a_panic_in_a_tick_is_a_latched_fault_and_the_loop_goes_on() {
        let driver = Silent { defect_in: Some(3), ..Silent::default() };
        let (thread, mut publisher, mut clients) = loop_of(driver, &[]);
        // The first tick takes eight, the second eight, and the third panics with the rest.
        for ticket in 1..=20 {
            clients.requests.push(LoopRequest::new(ticket, Order::Halt)).expect("room");
        }
        let (meter, shutdown) = (Arc::clone(&thread.meter), Arc::clone(&thread.shutdown));
        let running = thread.start().expect("a thread");
        let deadline = monotonic() + Duration::from_secs(10);
        let (mut fault, mut answers) = (None, Vec::new());
        while (fault.is_none() || answers.len() < 20) && monotonic() < deadline {
            std::thread::park_timeout(PERIOD);
            while let Ok((_, event)) = publisher.events.pop() {
                match event {
                    LoopEvent::FaultLatched(latched) => fault = Some(latched.code),
                    LoopEvent::Answer { ticket, result } => answers.push((ticket, result)),
                    _ => {}
                }
            }
        }
        shutdown.store(true, Ordering::Relaxed);
        running.thread.join().expect("the loop ends in order");
        assert_eq!(fault, Some(FaultCode::LoopError));
        for (at, (ticket, result)) in (1..).zip(answers) {
            let why = if at > 16 { Refusal::StepFailed } else { Refusal::CommunicationLost };
            assert_eq!((ticket, result), (at, Err(why)), "in their order, none left out");
        }
        assert_eq!(meter.panics.load(Ordering::Relaxed), 1);
        assert!(meter.ticks.load(Ordering::Relaxed) > 3);
    }
}
