//! The control loop's own look at the sources of stops.
//!
//! They are asked by a task beside the loop, which sees a press or a silence. If that task does not
//! run any more nobody would: so it tells the loop until when every source is known to be released,
//! and the loop stops the robot when that is over.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::StopLevel;

use crate::stop_sources::StopSources;

/// What the task gets to see a silence itself, which it does with the name of the source.
const GRACE: Duration = Duration::from_millis(100);

/// Until when every source of a robot is known to be released.
#[derive(Debug)]
pub(super) struct StopWatch {
    /// Highest level that a source asks for; none without sources.
    level: Option<StopLevel>,
    until_ns: AtomicU64,
}

impl StopWatch {
    /// Of these sources, as they are.
    pub(super) fn new(sources: &StopSources) -> Self {
        let watch = Self { level: sources.level(), until_ns: AtomicU64::default() };
        watch.note(sources);
        watch
    }

    /// Notes what is known of the sources now.
    pub(super) fn note(&self, sources: &StopSources) {
        if let Some(until) = sources.released_until() {
            self.until_ns.store(until.as_nanos(), Ordering::Release);
        }
    }

    /// With which level the robot is to be stopped, if nothing was heard for too long.
    pub(super) fn overdue(&self, now: MonoTime) -> Option<StopLevel> {
        let until = MonoTime::from_nanos(self.until_ns.load(Ordering::Acquire));
        self.level.filter(|_| now.saturating_since(until) > GRACE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stop_sources::{SILENCE, StopSourceSetting};

    fn at(ms: u64) -> MonoTime {
        MonoTime::from_nanos(ms * 1_000_000)
    }

    fn sources(levels: &[StopLevel]) -> StopSources {
        let setting = |(index, &level): (usize, &StopLevel)| StopSourceSetting {
            name: format!("door_{index}"),
            level,
            key: None,
        };
        let settings = levels.iter().enumerate().map(setting).collect();
        StopSources::new("left_arm".parse().expect("a name"), settings, at(1000))
    }

    #[test]
    fn without_a_word_of_the_task_the_robot_is_stopped_with_the_highest_level() {
        let watch = StopWatch::new(&sources(&[StopLevel::L2, StopLevel::L1]));
        let silent_ms = 1000 + u64::try_from(SILENCE.as_millis()).expect("few");
        assert_eq!(watch.overdue(at(silent_ms + 100)), None, "the task has the first word");
        assert_eq!(watch.overdue(at(silent_ms + 101)), Some(StopLevel::L1));
        let fresh = StopSources::new(
            "left_arm".parse().expect("a name"),
            vec![StopSourceSetting { name: "door_0".to_owned(), level: StopLevel::L2, key: None }],
            at(5000),
        );
        watch.note(&fresh);
        assert_eq!(watch.overdue(at(5600)), None);
    }

    #[test]
    fn a_robot_without_sources_is_never_stopped_for_their_silence() {
        assert_eq!(StopWatch::new(&sources(&[])).overdue(at(1_000_000)), None);
    }
}
