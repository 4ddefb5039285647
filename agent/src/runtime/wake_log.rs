//! When the control loop woke, for who measures it.

use armada_model::MonoTime;
use rtrb::{Consumer, Producer, RingBuffer};

/// One wake-up of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wake {
    /// The newest deadline that had passed: the tick it woke for.
    pub deadline: MonoTime,
    /// When it woke.
    pub woke: MonoTime,
}

/// Where a loop writes its wake-ups: wait-free; what its reader does not take in time is lost.
#[derive(Debug)]
pub struct WakeLog(Producer<Wake>);

/// Where the wake-ups are read.
#[derive(Debug)]
pub struct WakeReader(Consumer<Wake>);

/// Both ends of a log that holds up to `capacity` wake-ups.
#[must_use]
pub fn wake_log(capacity: usize) -> (WakeLog, WakeReader) {
    let (log, reader) = RingBuffer::new(capacity);
    (WakeLog(log), WakeReader(reader))
}

impl WakeLog {
    /// Writes down a wake-up.
    pub fn note(&mut self, deadline: MonoTime, woke: MonoTime) {
        // A reader that is late sees a gap in the deadlines.
        let _ = self.0.push(Wake { deadline, woke });
    }
}

impl WakeReader {
    /// The oldest wake-up that was not taken yet.
    pub fn pop(&mut self) -> Option<Wake> {
        self.0.pop().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_log_keeps_the_oldest_and_never_waits() {
        let (mut log, mut reader) = wake_log(2);
        for at in [1, 2, 3].map(MonoTime::from_nanos) {
            log.note(at, at);
        }
        let kept: Vec<_> = std::iter::from_fn(|| reader.pop()).map(|wake| wake.woke).collect();
        assert_eq!(kept, [1, 2].map(MonoTime::from_nanos));
    }
}
