//! The sending end of streamed commands.

use armada_model::{JointVector, Twist};
use serde::{Deserialize, Serialize};
use tokio::sync::watch;
use uuid::Uuid;
use zenoh::pubsub::Subscriber;

use super::{Client, ClientError, VALUE_TIMEOUT};
use crate::RobotName;
use crate::codec::{MAX_MESSAGE_BYTES, WireEncoding};
use crate::keys::{self, Key};
use crate::messages::{JogFrame, JointCommand, StreamCommand, StreamHeader, StreamTwist};
use crate::publish::{Latest, PublishError};

/// Streams commands to a robot under a lease, in mode `position_command` or `velocity_command`.
///
/// It numbers the samples and says with each the newest state that it has seen. Put a sample at
/// least every 20 ms: after 40 ms without one (as its robot file says) the robot decelerates.
/// Nothing waits here, and nothing tells whether a sample was followed: the robot's state and status
/// do.
#[derive(Debug)]
pub struct Stream {
    lease: Uuid,
    epoch: u64,
    seq: u64,
    position: Latest,
    velocity: Latest,
    twist: Latest,
    command: Latest,
    newest: watch::Receiver<Option<u64>>,
    _states: Subscriber<()>,
}

/// What a stream reads of a state.
#[derive(Deserialize)]
struct Numbered {
    seqno: u64,
}

impl Client {
    /// Begins to stream to a robot under `lease` in `epoch`, as soon as a state of it has come.
    ///
    /// # Errors
    /// [`ClientError::Zenoh`] if a key cannot be declared, [`ClientError::Timeout`] if the robot
    /// publishes no state.
    pub async fn stream(
        &self,
        robot: &RobotName,
        lease: Uuid,
        epoch: u64,
    ) -> Result<Stream, ClientError> {
        let (told, mut newest) = watch::channel(None);
        let key = keys::ROBOT_STATE.of(robot);
        let states = self
            .session()
            .declare_subscriber(&key)
            .callback(move |sample| {
                let bytes = sample.payload().to_bytes();
                let read = WireEncoding::from_zenoh(sample.encoding())
                    .and_then(|encoding| encoding.decode::<Numbered>(&bytes, MAX_MESSAGE_BYTES));
                if let Ok(Numbered { seqno }) = read {
                    told.send_replace(Some(seqno));
                }
            })
            .await
            .map_err(ClientError::zenoh)?;
        let declare = async |key: &Key| {
            let name = key.of(robot);
            let encoding = WireEncoding::MessagePack;
            Latest::declare(self.session(), name, key.channel, encoding)
                .await
                .map_err(ClientError::zenoh)
        };
        let stream = Stream {
            lease,
            epoch,
            seq: 0,
            position: declare(&keys::ROBOT_STREAM_POSITION).await?,
            velocity: declare(&keys::ROBOT_STREAM_VELOCITY).await?,
            twist: declare(&keys::ROBOT_STREAM_TWIST).await?,
            command: declare(&keys::ROBOT_COMMAND).await?,
            newest: newest.clone(),
            _states: states,
        };
        let first = newest.wait_for(Option::is_some);
        match tokio::time::timeout(VALUE_TIMEOUT, first).await {
            Ok(Ok(_)) => Ok(stream),
            _ => Err(ClientError::Timeout { key, timeout: VALUE_TIMEOUT }),
        }
    }
}

impl Stream {
    /// Positions of all joints \[rad or m\] and, if they are known, the speeds at them \[1/s\]; the
    /// robot finds those from the samples otherwise. Returns the number of the sample.
    ///
    /// # Errors
    /// [`ClientError::Zenoh`] if the session is closed.
    pub fn position(
        &mut self,
        position: &JointVector,
        velocity: Option<&JointVector>,
    ) -> Result<u64, ClientError> {
        let StreamHeader { lease, epoch, seq, state_seqno } = self.next();
        let (values, velocity) = (*position, velocity.copied());
        let sample = StreamCommand { lease, epoch, seq, state_seqno, values, velocity };
        put(&self.position, &sample, seq)
    }

    /// Speeds of all joints \[1/s\]. Returns the number of the sample.
    ///
    /// # Errors
    /// As [`Self::position`].
    pub fn velocity(&mut self, velocity: &JointVector) -> Result<u64, ClientError> {
        let StreamHeader { lease, epoch, seq, state_seqno } = self.next();
        let values = *velocity;
        let sample = StreamCommand { lease, epoch, seq, state_seqno, values, velocity: None };
        put(&self.velocity, &sample, seq)
    }

    /// Speed of the tool centre point of a chain, in the axes of `frame`. Returns the number of the
    /// sample.
    ///
    /// # Errors
    /// As [`Self::position`].
    pub fn twist(
        &mut self,
        chain: &str,
        twist: &Twist,
        frame: JogFrame,
    ) -> Result<u64, ClientError> {
        let StreamHeader { lease, epoch, seq, state_seqno } = self.next();
        let (chain, twist) = (chain.to_owned(), *twist);
        let sample = StreamTwist { lease, epoch, seq, state_seqno, chain, twist, frame };
        put(&self.twist, &sample, seq)
    }

    /// Positions \[rad or m\] or speeds \[1/s\] of some joints by name; the one that is not commanded
    /// is empty. Returns the number of the sample.
    ///
    /// # Errors
    /// As [`Self::position`].
    pub fn joints(
        &mut self,
        name: &[&str],
        position: &[f64],
        velocity: &[f64],
    ) -> Result<u64, ClientError> {
        let StreamHeader { lease, epoch, seq, state_seqno } = self.next();
        let name = name.iter().map(|&name| name.to_owned()).collect();
        let (position, velocity) = (position.to_vec(), velocity.to_vec());
        let sample = JointCommand { lease, epoch, seq, state_seqno, name, position, velocity };
        put(&self.command, &sample, seq)
    }

    /// Goes on in another epoch, such as that of the newest mode.
    pub const fn set_epoch(&mut self, epoch: u64) {
        self.epoch = epoch;
    }

    fn next(&mut self) -> StreamHeader {
        self.seq += 1;
        let state_seqno = self.newest.borrow().unwrap_or_default();
        StreamHeader { lease: self.lease, epoch: self.epoch, seq: self.seq, state_seqno }
    }
}

fn put<T: Serialize>(publisher: &Latest, sample: &T, seq: u64) -> Result<u64, ClientError> {
    match publisher.put(sample) {
        Ok(()) => Ok(seq),
        Err(PublishError::Codec(error)) => Err(error.into()),
        Err(PublishError::Zenoh(error)) => Err(ClientError::Zenoh(error)),
    }
}
