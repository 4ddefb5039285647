//! Wake-ups of a loop, and the loop that does nothing else.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use armada_agent::config::RealtimeConfig;
use armada_agent::runtime::{Wake, WakeLog, enter, monotonic, sleep_until};
use armada_model::MonoTime;
use serde::{Deserialize, Serialize};

/// How regularly loops woke.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Regularity {
    /// `|wake_k - wake_(k-1) - period|` of each pair of wake-ups in a row \[µs\].
    pub(super) errors_us: Vec<f64>,
    /// Deadlines for which there was no tick, because the one before came too late.
    pub(super) missed: u64,
}

impl Regularity {
    /// Of loops of one period over `time`, each with its wake-ups in their order. A loop that woke
    /// less than twice has missed everything.
    pub(super) fn of_all(loops: &[Vec<Wake>], period: Duration, time: Duration) -> Self {
        let mut all = Self::default();
        for wakes in loops {
            let one = Self::of(wakes, period);
            let lost = one.errors_us.is_empty();
            all.errors_us.extend(one.errors_us);
            all.missed += if lost { whole_periods(time, period) } else { one.missed };
        }
        all
    }

    /// Share of the periods without a tick, 0 to 1; 0 of no periods.
    #[expect(clippy::cast_precision_loss, reason = "periods of a measurement are few")]
    pub(super) fn missed_share(&self) -> f64 {
        let missed = self.missed as f64;
        let periods = missed + self.errors_us.len() as f64;
        if periods > 0.0 { missed / periods } else { 0.0 }
    }

    /// Of wake-ups in their order.
    pub(super) fn of(wakes: &[Wake], period: Duration) -> Self {
        let mut regularity = Self::default();
        for (last, this) in wakes.iter().zip(wakes.iter().skip(1)) {
            let error = this.woke.saturating_since(last.woke).abs_diff(period);
            regularity.errors_us.push(error.as_secs_f64() * 1e6);
            let periods = whole_periods(this.deadline.saturating_since(last.deadline), period);
            regularity.missed += periods.saturating_sub(1);
        }
        regularity
    }
}

/// A thread that sleeps to absolute deadlines and does as little as can be.
#[derive(Debug)]
pub(super) struct BareLoop {
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// What the thread was given.
    pub(super) scheduling: String,
}

impl BareLoop {
    /// Starts a loop that calls `tick(deadline, woke)`.
    pub(super) fn start(
        period: Duration,
        priority: Option<u8>,
        mut tick: impl FnMut(MonoTime, MonoTime) + Send + 'static,
    ) -> io::Result<Self> {
        let ended = Arc::new(AtomicBool::new(false));
        let (report, reported) = std::sync::mpsc::sync_channel(1);
        let end = Arc::clone(&ended);
        let thread = Builder::new().name("bare-loop".to_owned()).spawn(move || {
            let realtime = RealtimeConfig { priority, cpu: None, lock_memory: true };
            // The starter waits for it.
            let _ = report.send(enter(&realtime).to_string());
            let mut deadline = monotonic() + period;
            while !end.load(Ordering::Relaxed) {
                sleep_until(deadline);
                let woke = monotonic();
                let missed = whole_periods(woke.saturating_since(deadline), period);
                deadline = deadline + period * u32::try_from(missed).unwrap_or(u32::MAX);
                tick(deadline, woke);
                deadline = deadline + period;
            }
        })?;
        let scheduling = reported.recv().unwrap_or_default();
        Ok(Self { ended, thread: Some(thread), scheduling })
    }

    /// A loop that only notes when it woke, as the control loop does.
    pub(super) fn noting(
        period: Duration,
        priority: Option<u8>,
        mut log: WakeLog,
    ) -> io::Result<Self> {
        Self::start(period, priority, move |deadline, woke| log.note(deadline, woke))
    }
}

impl Drop for BareLoop {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic has been printed by the thread itself.
            drop(thread.join());
        }
    }
}

fn whole_periods(time: Duration, period: Duration) -> u64 {
    u64::try_from(time.as_nanos() / period.as_nanos().max(1)).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(1);

    fn wake(deadline_us: u64, late_us: u64) -> Wake {
        let deadline = MonoTime::from_nanos(deadline_us * 1000);
        Wake { deadline, woke: deadline + Duration::from_micros(late_us) }
    }

    #[test]
    fn a_period_error_is_of_two_wake_ups_in_a_row() {
        let wakes = [wake(1000, 10), wake(2000, 30), wake(3000, 5), wake(4000, 5)];
        let regularity = Regularity::of(&wakes, PERIOD);
        let rounded: Vec<_> = regularity.errors_us.iter().map(|us| us.round()).collect();
        assert_eq!(rounded, [20.0, 25.0, 0.0]);
        assert_eq!(regularity.missed, 0);
    }

    #[test]
    fn deadlines_without_a_tick_are_missed() {
        let wakes = [wake(1000, 0), wake(5000, 200), wake(6000, 0)];
        let regularity = Regularity::of(&wakes, PERIOD);
        assert_eq!(regularity.missed, 3);
        let rounded: Vec<_> = regularity.errors_us.iter().map(|us| us.round()).collect();
        assert_eq!(rounded, [3200.0, 200.0]);
    }

    #[test]
    fn the_missed_share_is_of_all_loops_and_a_dead_one_has_missed_everything() {
        let sound = vec![wake(1000, 0), wake(2000, 0), wake(4000, 0)];
        let time = PERIOD * 6;
        let one = Regularity::of_all(std::slice::from_ref(&sound), PERIOD, time);
        assert_eq!((one.missed, one.missed_share()), (1, 1.0 / 3.0));
        let two = Regularity::of_all(&[sound, vec![wake(1000, 0)]], PERIOD, time);
        assert_eq!((two.missed, two.missed_share()), (7, 7.0 / 9.0));
        assert_eq!(Regularity::of_all(&[], PERIOD, time).missed_share(), 0.0);
    }

    #[test]
    fn a_bare_loop_never_wakes_before_its_deadline() {
        let (sender, receiver) = std::sync::mpsc::channel();
        let bare = BareLoop::start(PERIOD, None, move |deadline, woke| {
            let _ = sender.send((deadline, woke));
        });
        let ticks: Vec<_> = receiver.iter().take(20).collect();
        drop(bare);
        assert!(ticks.iter().all(|(deadline, woke)| woke >= deadline));
        let steps = ticks.iter().zip(ticks.iter().skip(1));
        for ((last, _), (this, _)) in steps {
            let step = this.saturating_since(*last).as_nanos();
            assert!(step > 0 && step.is_multiple_of(PERIOD.as_nanos()), "{step}");
        }
    }
}
