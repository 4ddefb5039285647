//! The words of one motion of several robots on the bus.
//!
//! ```text
//! loop --queue--> publisher thread --> go, heartbeat, abort of this robot
//! go, heartbeat, abort of partners --callback: decode, who--> queue --> loop
//! ```
//!
//! A partner's agent that was started anew meanwhile is another one: it counts as one that stops. An
//! abort that cannot be read is an abort.

use std::sync::{Arc, Mutex, PoisonError};

use armada_protocol::RobotName;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys::{self, Key};
use armada_protocol::messages::{GroupAbort, GroupGo, GroupHeartbeat};
use armada_protocol::publish::{Latest, PublishError};
use rtrb::Producer;
use serde::de::DeserializeOwned;
use uuid::Uuid;
use zenoh::Session;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

use super::board::SharedBoard;
use super::clock::monotonic;
use crate::control::{Beat, GroupWord, ScaleStep, Word};

/// Longest word that is read \[bytes\].
const MAX_WORD_BYTES: usize = 16 * 1024;

/// Who says and hears the words of a robot.
#[derive(Clone)]
pub(super) struct Speaker {
    pub(super) robot: RobotName,
    pub(super) boot_id: Uuid,
    pub(super) board: Arc<SharedBoard>,
    /// Words on their way to the loop.
    pub(super) words: Arc<Mutex<Producer<GroupWord>>>,
}

/// The words of one motion of several robots; its keys are open until it is dropped.
#[derive(Debug)]
pub(super) struct GroupLink {
    motion_id: Uuid,
    robot: RobotName,
    boot_id: Uuid,
    go: Latest,
    heartbeat: Latest,
    abort: Latest,
    _subscribers: [Subscriber<()>; 3],
}

/// What the callbacks share.
struct Ear {
    group: Uuid,
    partners: Vec<RobotName>,
    /// The run of each partner's agent that was heard first.
    boots: Mutex<Vec<Option<Uuid>>>,
    speaker: Speaker,
}

impl GroupLink {
    /// Opens the keys of a motion.
    ///
    /// # Errors
    /// Zenoh's error if a key cannot be declared.
    pub(super) async fn open(
        session: &Session,
        group: Uuid,
        partners: Vec<RobotName>,
        speaker: &Speaker,
    ) -> zenoh::Result<Self> {
        let boots = Mutex::new(vec![None; partners.len()]);
        let ear = Arc::new(Ear { group, partners, boots, speaker: speaker.clone() });
        let listen = async |key: &Key, take: fn(&Ear, &Sample)| {
            let ear = Arc::clone(&ear);
            let key = key.with(&[&group.to_string()]);
            session.declare_subscriber(key).callback(move |sample| take(&ear, &sample)).await
        };
        let subscribers = [
            listen(&keys::GROUP_GO, Ear::take_go).await?,
            listen(&keys::GROUP_HEARTBEAT, Ear::take_heartbeat).await?,
            listen(&keys::GROUP_ABORT, Ear::take_abort).await?,
        ];
        let speak = async |key: &Key| {
            let name = key.with(&[&group.to_string(), speaker.robot.as_str()]);
            Latest::declare_everywhere(session, name, key.channel, WireEncoding::Json).await
        };
        Ok(Self {
            motion_id: group,
            robot: speaker.robot.clone(),
            boot_id: speaker.boot_id,
            go: speak(&keys::GROUP_GO).await?,
            heartbeat: speak(&keys::GROUP_HEARTBEAT).await?,
            abort: speak(&keys::GROUP_ABORT).await?,
            _subscribers: subscribers,
        })
    }

    /// Says that this robot is ready.
    pub(super) fn go(&self) -> Result<(), PublishError> {
        let (motion_id, robot, boot_id) = (self.motion_id, self.robot.clone(), self.boot_id);
        self.go.put(&GroupGo { motion_id, robot, boot_id })
    }

    /// Says where this robot is.
    pub(super) fn heartbeat(&self, beat: &Beat) -> Result<(), PublishError> {
        let ScaleStep { before, after, from_s, at_s } = beat.scale;
        self.heartbeat.put(&GroupHeartbeat {
            motion_id: self.motion_id,
            robot: self.robot.clone(),
            boot_id: self.boot_id,
            seq: beat.seq,
            state: beat.state,
            time_s: beat.time_s,
            phase_s: beat.phase_s,
            rate: beat.rate,
            error: beat.error,
            scale: before,
            scale_next: after,
            scale_next_from_s: from_s,
            scale_next_at_s: at_s,
        })
    }

    /// Says that this robot stops.
    pub(super) fn abort(
        &self,
        reason: armada_protocol::messages::Denial,
        from_phase_s: Option<f64>,
    ) -> Result<(), PublishError> {
        let (motion_id, robot, boot_id) = (self.motion_id, self.robot.clone(), self.boot_id);
        self.abort.put(&GroupAbort { motion_id, robot, boot_id, reason, from_phase_s })
    }
}

impl Ear {
    fn take_go(&self, sample: &Sample) {
        let Some(partner) = self.partner(sample) else { return };
        match decode::<GroupGo>(sample) {
            Some(go) if go.motion_id == self.group => self.push(partner, go.boot_id, Word::Go),
            _ => self.malformed(),
        }
    }

    fn take_heartbeat(&self, sample: &Sample) {
        let Some(partner) = self.partner(sample) else { return };
        let beat = decode::<GroupHeartbeat>(sample).filter(|beat| beat.motion_id == self.group);
        match beat.map(|beat| (beat.boot_id, read(&beat))) {
            Some((boot_id, Some(beat))) => self.push(partner, boot_id, Word::Heartbeat(beat)),
            _ => self.malformed(),
        }
    }

    fn take_abort(&self, sample: &Sample) {
        let Some(partner) = self.partner(sample) else { return };
        let Some(abort) = decode::<GroupAbort>(sample) else {
            self.malformed();
            self.send(partner, Word::Abort { from_phase_s: None });
            return;
        };
        // Before the loop hears it: the end of the motion says why.
        let from_phase_s = abort.from_phase_s.filter(|phase_s| phase_s.is_finite());
        {
            let mut board = self.speaker.board.lock();
            board.vocabulary.groups.note_reason(self.group, partner, abort.reason);
        }
        self.send(partner, Word::Abort { from_phase_s });
    }

    /// Which partner says something at this key; none if it is the own robot, or nobody's.
    fn partner(&self, sample: &Sample) -> Option<u8> {
        let key = sample.key_expr().as_str();
        let name = key.rsplit('/').next()?;
        let found = self.partners.iter().position(|partner| partner.as_str() == name);
        found.and_then(|index| u8::try_from(index).ok())
    }

    fn push(&self, partner: u8, boot_id: Uuid, word: Word) {
        let mut boots = self.boots.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(known) = boots.get_mut(usize::from(partner)) else { return };
        let same = *known.get_or_insert(boot_id) == boot_id;
        drop(boots);
        self.send(partner, if same { word } else { Word::Abort { from_phase_s: None } });
    }

    fn send(&self, partner: u8, word: Word) {
        let word = GroupWord { group: self.group, partner, at: monotonic(), word };
        let mut words = self.speaker.words.lock().unwrap_or_else(PoisonError::into_inner);
        let pushed = words.push(word).is_ok();
        drop(words);
        if !pushed {
            self.speaker.board.lock().count_dropped("group_overflow");
        }
    }

    fn malformed(&self) {
        self.speaker.board.lock().count_dropped("group_malformed");
    }
}

/// A heartbeat as the loop knows it; none if a number in it makes no sense.
fn read(beat: &GroupHeartbeat) -> Option<Beat> {
    let at_s = beat.scale_next_at_s;
    let numbers = [beat.time_s, beat.phase_s, beat.scale_next_from_s, at_s.unwrap_or_default()];
    let shares = [beat.rate, beat.error, beat.scale, beat.scale_next];
    let usable = numbers.iter().all(|number| number.is_finite())
        && shares.iter().all(|share| (0.0..=1.0).contains(share));
    usable.then_some(Beat {
        seq: beat.seq,
        state: beat.state,
        time_s: beat.time_s,
        phase_s: beat.phase_s,
        rate: beat.rate,
        error: beat.error,
        scale: ScaleStep {
            before: beat.scale,
            after: beat.scale_next,
            from_s: beat.scale_next_from_s,
            at_s,
        },
    })
}

fn decode<T: DeserializeOwned>(sample: &Sample) -> Option<T> {
    let encoding = WireEncoding::from_zenoh(sample.encoding()).ok()?;
    encoding.decode(&sample.payload().to_bytes(), MAX_WORD_BYTES).ok()
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::GroupState;

    use super::*;

    fn heartbeat() -> GroupHeartbeat {
        GroupHeartbeat {
            motion_id: Uuid::from_u128(1),
            robot: "left_arm".parse().expect("a name"),
            boot_id: Uuid::from_u128(2),
            seq: 3,
            state: GroupState::Running,
            time_s: 0.5,
            phase_s: 0.4,
            rate: 0.9,
            error: 0.1,
            scale: 1.0,
            scale_next: 0.0,
            scale_next_from_s: 0.6,
            scale_next_at_s: Some(0.7),
        }
    }

    #[test]
    fn a_heartbeat_is_read_as_it_was_said() {
        let beat = read(&heartbeat()).expect("usable");
        let scale = ScaleStep { before: 1.0, after: 0.0, from_s: 0.6, at_s: Some(0.7) };
        assert_eq!((beat.seq, beat.state, beat.scale), (3, GroupState::Running, scale));
        assert_eq!((beat.time_s, beat.phase_s, beat.rate, beat.error), (0.5, 0.4, 0.9, 0.1));
    }

    #[test]
    fn a_heartbeat_with_numbers_that_make_no_sense_is_not_read() {
        let wrong: [fn(&mut GroupHeartbeat); 6] = [
            |beat| beat.time_s = f64::NAN,
            |beat| beat.phase_s = f64::INFINITY,
            |beat| beat.rate = -0.1,
            |beat| beat.scale = 1.5,
            |beat| beat.scale_next = f64::NAN,
            |beat| beat.scale_next_at_s = Some(f64::NAN),
        ];
        for change in wrong {
            let mut beat = heartbeat();
            change(&mut beat);
            assert_eq!(read(&beat), None, "{beat:?}");
        }
    }
}
