//! Sources of stops elsewhere: challenge, check-in, and silence as a press.
//!
//! ```text
//!                 released                      pressed, or silent for 500 ms
//! unheard -----------------------> up -------------------------------------------> down
//!    |                             ^                                                |
//!    |                             +------------------- released -------------------+
//!    +---- pressed, or 500 ms after the start -----------------------------------> down
//! ```
//!
//! * A source is `up` only by proof: it answered a challenge of the last 500 ms that it is
//!   released. Time counts from when the challenge was *sent*, so whatever the network does, a
//!   source that is pressed or dies is down 500 ms later at the latest.
//! * A press needs no proof: one with a wrong number or signature counts as well. A release needs
//!   number and signature, and its number must have been sent after the last press came in.
//! * Going down is one press and one stop. It takes a release in between until there is another.
//!
//! This is pure: numbers and time come in, presses go out.

use std::collections::VecDeque;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{StopCheckIn, StopLevel, StopSourceStatus};
use armada_protocol::signature::SigningKey;
use uuid::Uuid;

/// How often each source is asked.
pub const ASK_EVERY: Duration = Duration::from_millis(100);
/// Silence that is a press.
pub const SILENCE: Duration = Duration::from_millis(500);
/// Most challenges that wait for an answer: more than are sent in the time they are good for.
const MAX_OPEN: usize = 16;

/// A source that has to check in.
#[derive(Clone, Debug)]
pub struct StopSourceSetting {
    /// Its name.
    pub name: String,
    /// How hard it stops.
    pub level: StopLevel,
    /// What its check-ins have to be signed with, if they do.
    pub key: Option<SigningKey>,
}

/// A source went down: the robot has to stop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Press {
    /// Name of the source.
    pub source: String,
    /// How hard to stop.
    pub level: StopLevel,
    /// Why it counts as pressed.
    pub cause: PressCause,
}

/// Why a source counts as pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PressCause {
    /// It said so.
    #[error("pressed")]
    Pressed,
    /// It has not answered for too long.
    #[error("silent for more than {} ms", SILENCE.as_millis())]
    Silent,
    /// It has never answered.
    #[error("never heard")]
    NeverHeard,
}

/// Why a check-in was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CheckInError {
    /// No source has this name.
    #[error("no such source")]
    UnknownSource,
    /// Its number was not asked for, was answered before, or is too old.
    #[error("number not asked for, or too old")]
    Nonce,
    /// It is not signed as it should be.
    #[error("not signed with the key of the source")]
    Signature,
}

/// Why a source does not let a stop be reset.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stop source {source_name} is {cause}")]
pub struct NotReleased {
    /// Name of the source.
    pub source_name: String,
    /// What it is.
    pub cause: PressCause,
}

/// The sources of one robot.
#[derive(Clone, Debug)]
pub struct StopSources {
    robot: RobotName,
    sources: Vec<Source>,
}

#[derive(Clone, Debug)]
struct Source {
    setting: StopSourceSetting,
    place: Place,
    /// Challenges without an answer, oldest first.
    open: VecDeque<(Uuid, MonoTime)>,
    /// When the newest challenge was sent that proved it released; the start before the first.
    proven: MonoTime,
    heard: Option<MonoTime>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Unheard,
    Up,
    Down(PressCause),
}

impl StopSources {
    /// The sources of `robot`, none of them heard at `now`.
    #[must_use]
    pub fn new(robot: RobotName, settings: Vec<StopSourceSetting>, now: MonoTime) -> Self {
        let source = |setting| Source {
            setting,
            place: Place::Unheard,
            open: VecDeque::new(),
            proven: now,
            heard: None,
        };
        Self { robot, sources: settings.into_iter().map(source).collect() }
    }

    /// Names of the sources.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.sources.iter().map(|source| source.setting.name.as_str())
    }

    /// Highest level that a source asks for; none without sources.
    #[must_use]
    pub fn level(&self) -> Option<StopLevel> {
        self.sources.iter().map(|source| source.setting.level).max()
    }

    /// Until when all sources are known to be released, if nothing else is heard; none without
    /// sources.
    #[must_use]
    pub fn released_until(&self) -> Option<MonoTime> {
        self.sources.iter().map(|source| source.proven + SILENCE).min()
    }

    /// Notes that `source` is asked with `nonce`, which nobody can guess.
    pub fn note_challenge(&mut self, source: &str, nonce: Uuid, now: MonoTime) {
        if let Some(source) = self.sources.iter_mut().find(|known| known.setting.name == source) {
            if source.open.len() >= MAX_OPEN {
                source.open.pop_front();
            }
            source.open.push_back((nonce, now));
        }
    }

    /// Takes an answer; returns the press that it is, if it is a new one.
    ///
    /// # Errors
    /// [`CheckInError`]: it proves nothing.
    pub fn handle_check_in(
        &mut self,
        check_in: &StopCheckIn,
        now: MonoTime,
    ) -> Result<Option<Press>, CheckInError> {
        let robot = &self.robot;
        let named = |source: &&mut Source| source.setting.name == check_in.source;
        let source = self.sources.iter_mut().find(named).ok_or(CheckInError::UnknownSource)?;
        if check_in.pressed {
            // What was asked before is no proof of what comes after.
            source.open.clear();
            source.heard = Some(now);
            return Ok(source.press(PressCause::Pressed));
        }
        let young = |(nonce, sent): &(Uuid, MonoTime)| {
            *nonce == check_in.nonce && now.saturating_since(*sent) <= SILENCE
        };
        let at = source.open.iter().position(young).ok_or(CheckInError::Nonce)?;
        let key = source.setting.key.as_ref();
        if key.is_some_and(|key| !key.has_signed_check_in(robot, check_in)) {
            return Err(CheckInError::Signature);
        }
        if let Some((_, sent)) = source.open.drain(..=at).next_back() {
            source.proven = sent;
        }
        source.heard = Some(now);
        source.place = Place::Up;
        Ok(None)
    }

    /// The next source that has been silent for too long, once for each time.
    pub fn poll_silence(&mut self, now: MonoTime) -> Option<Press> {
        self.sources.iter_mut().find_map(|source| {
            if source.is_fresh(now) {
                return None;
            }
            let heard = source.heard.is_some();
            source.press(if heard { PressCause::Silent } else { PressCause::NeverHeard })
        })
    }

    /// How each source is at `now`.
    #[must_use]
    pub fn status(&self, now: MonoTime) -> Vec<StopSourceStatus> {
        let status = |source: &Source| StopSourceStatus {
            source: source.setting.name.clone(),
            pressed: source.check_released(now).is_err(),
            age_ms: source.heard.map(|heard| now.saturating_since(heard).as_secs_f64() * 1e3),
        };
        self.sources.iter().map(status).collect()
    }

    /// Whether every source is known to be released.
    ///
    /// # Errors
    /// [`NotReleased`] of the first that is not.
    pub fn check_released(&self, now: MonoTime) -> Result<(), NotReleased> {
        self.sources.iter().try_for_each(|source| {
            let named = |cause| NotReleased { source_name: source.setting.name.clone(), cause };
            source.check_released(now).map_err(named)
        })
    }
}

impl Source {
    fn is_fresh(&self, now: MonoTime) -> bool {
        now.saturating_since(self.proven) <= SILENCE
    }

    fn check_released(&self, now: MonoTime) -> Result<(), PressCause> {
        match self.place {
            Place::Up if self.is_fresh(now) => Ok(()),
            Place::Up => Err(PressCause::Silent),
            Place::Unheard => Err(PressCause::NeverHeard),
            Place::Down(cause) => Err(cause),
        }
    }

    /// Goes down; a press if it was not before.
    fn press(&mut self, cause: PressCause) -> Option<Press> {
        let before = std::mem::replace(&mut self.place, Place::Down(cause));
        let new = !matches!(before, Place::Down(_));
        new.then(|| Press { source: self.setting.name.clone(), level: self.setting.level, cause })
    }
}

#[cfg(test)]
mod tests;
