//! Samples of a key expression as messages.

use std::marker::PhantomData;

use serde::de::DeserializeOwned;
use zenoh::Session;
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

use super::ClientError;
use crate::codec::{MAX_MESSAGE_BYTES, WireEncoding};

/// Messages of one type as they come.
#[derive(Debug)]
pub struct Subscription<T> {
    subscriber: Subscriber<RingChannelHandler<Sample>>,
    message: PhantomData<fn() -> T>,
}

impl<T: DeserializeOwned> Subscription<T> {
    pub(super) async fn declare(
        session: &Session,
        key: &str,
        capacity: usize,
    ) -> Result<Self, ClientError> {
        let subscriber = session
            .declare_subscriber(key)
            .with(RingChannel::new(capacity))
            .await
            .map_err(ClientError::zenoh)?;
        Ok(Self { subscriber, message: PhantomData })
    }

    /// Waits for the next message; returns it with its key.
    ///
    /// # Errors
    /// [`ClientError::Codec`] if a sample is not such a message, [`ClientError::Zenoh`] if the
    /// session was closed.
    pub async fn next(&self) -> Result<(String, T), ClientError> {
        let sample = self.subscriber.recv_async().await.map_err(ClientError::zenoh)?;
        Self::decode(&sample)
    }

    /// The next message if one has come already.
    ///
    /// # Errors
    /// As [`Self::next`].
    pub fn try_next(&self) -> Result<Option<(String, T)>, ClientError> {
        match self.subscriber.try_recv().map_err(ClientError::zenoh)? {
            Some(sample) => Self::decode(&sample).map(Some),
            None => Ok(None),
        }
    }

    fn decode(sample: &Sample) -> Result<(String, T), ClientError> {
        let encoding = WireEncoding::from_zenoh(sample.encoding())?;
        let message = encoding.decode(&sample.payload().to_bytes(), MAX_MESSAGE_BYTES)?;
        Ok((sample.key_expr().to_string(), message))
    }
}
