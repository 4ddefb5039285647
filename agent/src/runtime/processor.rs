//! A thread that stays on the processor of the one that wakes it.
//!
//! The scheduler sends a real-time thread that is woken by a more urgent one to another processor,
//! since this one is busy. The loop, though, sleeps a moment after it has woken its publisher. Waking
//! another processor, out of its idle state and with cold caches, takes longer than that moment, and
//! costs more than everything that the publisher does.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use armada_model::MonoTime;
use rustix::thread::sched_getcpu;

use super::realtime::fix_processor;

/// Shortest time between two moves: each costs more than a wake-up elsewhere.
const PAUSE: Duration = Duration::from_secs(1);

/// The processor that a thread runs on.
#[derive(Debug)]
pub(super) struct Processor(AtomicUsize);

impl Default for Processor {
    fn default() -> Self {
        Self(AtomicUsize::new(usize::MAX))
    }
}

impl Processor {
    /// Notes where the calling thread runs; costs about as much as a look at the clock.
    pub(super) fn note(&self) {
        self.0.store(sched_getcpu(), Ordering::Relaxed);
    }

    fn last(&self) -> Option<usize> {
        Some(self.0.load(Ordering::Relaxed)).filter(|&processor| processor != usize::MAX)
    }
}

/// Keeps the calling thread where another one runs.
#[derive(Debug)]
pub(super) struct Follower {
    leader: Arc<Processor>,
    on: Option<usize>,
    looked: MonoTime,
}

impl Follower {
    /// Follows the thread that notes where it runs in `leader`.
    pub(super) const fn of(leader: Arc<Processor>) -> Self {
        Self { leader, on: None, looked: MonoTime::from_nanos(0) }
    }

    /// Moves the calling thread if the other one was elsewhere for long enough.
    pub(super) fn follow(&mut self, now: MonoTime) {
        if now.saturating_since(self.looked) < PAUSE {
            return;
        }
        self.looked = now;
        let leader = self.leader.last();
        if leader == self.on {
            return;
        }
        // Where it is refused, as it may be in a container, the scheduler goes on to decide.
        if leader.is_some_and(|processor| fix_processor(processor).is_ok()) {
            self.on = leader;
        }
    }
}

#[cfg(test)]
mod tests {
    use rustix::thread::sched_getaffinity;

    use super::*;

    #[test]
    fn a_thread_follows_another_to_its_processor_and_not_more_often_than_allowed() {
        let leader = Arc::<Processor>::default();
        let mut follower = Follower::of(Arc::clone(&leader));
        let allowed = || {
            let set = sched_getaffinity(None).expect("one's own");
            (0..1024).filter(|&processor| set.is_set(processor)).collect::<Vec<_>>()
        };
        let (first, others) = (PAUSE, allowed());
        follower.follow(MonoTime::from_nanos(0) + first);
        assert_eq!(allowed(), others, "nobody to follow yet");
        leader.note();
        let here = leader.last().expect("noted");
        follower.follow(MonoTime::from_nanos(0) + first + PAUSE / 2);
        assert_eq!(allowed(), others, "too early");
        follower.follow(MonoTime::from_nanos(0) + first * 2);
        assert_eq!(allowed(), [here]);
    }
}
