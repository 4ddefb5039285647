//! The motions of several robots that this one is prepared for or takes part in.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{Denial, DenialCode};
use rtrb::Producer;
use tracing::debug;
use uuid::Uuid;
use zenoh::Session;

use super::board::SharedBoard;
use super::clock::monotonic;
use super::group_link::{GroupLink, Speaker};
use crate::control::{GroupSay, GroupWord, Say};

/// How often it is looked whether a motion's keys are still needed.
const LOOK: Duration = Duration::from_millis(250);

/// The keys of all motions of several robots of one robot.
pub(super) struct Groups {
    session: Session,
    speaker: Speaker,
    links: Mutex<HashMap<Uuid, Open>>,
}

/// The keys of one motion.
struct Open {
    link: Arc<GroupLink>,
    /// Until when it may be committed.
    until: MonoTime,
}

impl Groups {
    /// Of a robot, whose loop takes `words`.
    pub(super) fn new(
        session: Session,
        robot: RobotName,
        boot_id: Uuid,
        (board, words): (Arc<SharedBoard>, Producer<GroupWord>),
    ) -> Arc<Self> {
        let words = Arc::new(Mutex::new(words));
        let speaker = Speaker { robot, boot_id, board, words };
        Arc::new(Self { session, speaker, links: Mutex::default() })
    }

    /// Opens the keys of a motion, which may be committed until an instant. They are closed when it
    /// was not, or some time after its end.
    ///
    /// # Errors
    /// An `internal` denial if Zenoh does not open them.
    pub(super) async fn open(
        self: &Arc<Self>,
        group: Uuid,
        partners: &[RobotName],
        until: MonoTime,
    ) -> Result<(), Denial> {
        self.speaker.board.lock().vocabulary.groups.note(group, partners);
        let link = GroupLink::open(&self.session, group, partners.to_vec(), &self.speaker).await;
        let link = link.map_err(|error| {
            Denial::new(DenialCode::Internal, format!("the keys of the group do not open: {error}"))
        })?;
        self.lock().insert(group, Open { link: Arc::new(link), until });
        keep(Arc::downgrade(self), group);
        Ok(())
    }

    /// Closes the keys of a motion that is not going to be.
    pub(super) fn close(&self, group: Uuid) {
        let closed = self.lock().remove(&group);
        // Its keys are closed here, not while the lock is held.
        drop(closed);
    }

    /// Says something to the partners in a motion; in the publisher's thread.
    pub(super) fn say(&self, said: &GroupSay) {
        let link = self.lock().get(&said.group).map(|open| Arc::clone(&open.link));
        let Some(link) = link else { return };
        let result = match &said.say {
            Say::Go => link.go(),
            Say::Heartbeat(beat) => link.heartbeat(beat),
            Say::Abort { why, from_phase_s } => {
                let reason = self.speaker.board.lock().denial(why);
                link.abort(reason, *from_phase_s)
            }
        };
        if let Err(error) = result {
            debug!(%error, "a word to partners was not published");
        }
    }

    fn is_needed(&self, group: Uuid) -> bool {
        let running = self.speaker.board.lock().snapshot.group;
        let open = self.lock().get(&group).is_some_and(|open| monotonic() < open.until);
        open || running.is_some_and(|running| running.id == group)
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Uuid, Open>> {
        self.links.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Closes the keys of a motion when they are not needed any more.
#[expect(clippy::disallowed_methods, reason = "the runtime is where tasks are started")]
fn keep(groups: Weak<Groups>, group: Uuid) {
    drop(tokio::spawn(async move {
        loop {
            tokio::time::sleep(LOOK).await;
            let Some(groups) = groups.upgrade() else { return };
            if !groups.is_needed(group) {
                return groups.close(group);
            }
        }
    }));
}
