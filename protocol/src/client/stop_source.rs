//! The end of a stop source: it answers every challenge from its real input.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;
use tracing::debug;
use zenoh::Wait as _;
use zenoh::query::{Query, Queryable};

use super::{Client, ClientError, now};
use crate::RobotName;
use crate::codec::{MAX_REQUEST_BYTES, WireEncoding};
use crate::keys;
use crate::messages::{Denial, DenialCode, StopChallenge, StopCheckIn};
use crate::signature::SigningKey;

/// Who has asked, and when last.
type Asking = Arc<Mutex<BTreeMap<RobotName, Instant>>>;

/// A source of stops that answers until this is dropped; silence is a press then.
#[derive(Debug)]
pub struct AnsweredStopSource {
    asking: Asking,
    _queryable: Queryable<()>,
}

impl AnsweredStopSource {
    /// The robots that have asked, each with the time since it did last.
    #[must_use]
    pub fn asking(&self) -> Vec<(RobotName, Duration)> {
        let asking = self.asking.lock().unwrap_or_else(PoisonError::into_inner);
        asking.iter().map(|(robot, last)| (robot.clone(), now() - *last)).collect()
    }
}

impl Client {
    /// Answers the challenges of robots for the stop source `name`: `read` tells whether it is
    /// pressed *now*.
    ///
    /// It is asked once for every challenge, at least ten times a second for each robot, and has to
    /// be quick. It has to look at a real input: a value that stays when the input dies would be an
    /// answer that nobody gave. If it panics nothing is answered, which is a press. There is no
    /// other way to answer, so that no program can stand in for an input.
    ///
    /// # Errors
    /// [`ClientError::Denied`] if `name` is not of the form of a robot's name,
    /// [`ClientError::Zenoh`] if the key cannot be declared.
    pub async fn answer_stop_source(
        &self,
        name: &str,
        key: Option<SigningKey>,
        read: impl Fn() -> bool + Send + Sync + 'static,
    ) -> Result<AnsweredStopSource, ClientError> {
        if name.parse::<RobotName>().is_err() {
            let text = format!("{name:?} is not the name of a stop source: a-z, 0-9 and _");
            return Err(Denial::new(DenialCode::InvalidArgument, text)
                .with("field", "name")
                .into());
        }
        let asking = Asking::default();
        let (asked, source) = (Arc::clone(&asking), name.to_owned());
        let own_key = keys::CELL_STOP_SOURCE.with(&[name]);
        let reply_key = own_key.clone();
        let queryable = self
            .session
            .declare_queryable(own_key)
            .complete(true)
            .callback(move |query| {
                let Some(challenge) = challenge_of(&query) else { return };
                let (source, nonce, pressed) = (source.clone(), challenge.nonce, read());
                let check_in = StopCheckIn { source, nonce, pressed, signature: None };
                let check_in = match &key {
                    Some(key) => key.sign_check_in(&challenge, check_in),
                    None => check_in,
                };
                let mut asking = asked.lock().unwrap_or_else(PoisonError::into_inner);
                asking.insert(challenge.robot, now());
                drop(asking);
                answer(&query, &reply_key, &check_in);
            })
            .await
            .map_err(ClientError::zenoh)?;
        Ok(AnsweredStopSource { asking, _queryable: queryable })
    }
}

fn challenge_of(query: &Query) -> Option<StopChallenge> {
    let encoding =
        query.encoding().map_or(Ok(WireEncoding::Json), WireEncoding::from_zenoh).ok()?;
    encoding.decode(&query.payload()?.to_bytes(), MAX_REQUEST_BYTES).ok()
}

fn answer(query: &Query, key: &str, check_in: &StopCheckIn) {
    let Ok(bytes) = WireEncoding::Json.encode(check_in) else { return };
    let reply = query.reply(key, bytes).encoding(WireEncoding::Json.to_zenoh());
    if let Err(error) = reply.wait() {
        debug!(%error, "check-in not sent");
    }
}
