//! The sending end of published keys, with the urgency that the table of keys gives them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use serde::Serialize;
use zenoh::matching::MatchingStatus;
use zenoh::pubsub::Publisher;
use zenoh::sample::Locality;
use zenoh::{Session, Wait};
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

use crate::codec::{CodecError, WireEncoding};
use crate::qos::Channel;

/// How often a publisher of kept samples tells the newest number, so that a gap is noticed.
const GAP_HEARTBEAT: Duration = Duration::from_millis(500);

/// How much longer than the last a message may be without a second allocation \[bytes\].
const ROOM_TO_GROW: usize = 128;

/// Why a message was not published.
#[derive(Debug, thiserror::Error)]
pub enum PublishError {
    /// It cannot be encoded.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// Zenoh refuses it: the session is closed.
    #[error("zenoh: {0}")]
    Zenoh(String),
}

/// Publishes samples of which the newest counts.
#[derive(Debug)]
pub struct Latest {
    publisher: Publisher<'static>,
    encoding: WireEncoding,
    /// Kept by Zenoh, which would walk its tables anew if it were asked at every sample.
    has_subscribers: Arc<AtomicBool>,
    /// Size of the last message \[bytes\], which the next will be close to.
    last_size: AtomicUsize,
}

impl Latest {
    /// A publisher at `key`.
    ///
    /// # Errors
    /// Zenoh's error if it cannot be declared.
    pub async fn declare(
        session: &Session,
        key: String,
        channel: Channel,
        encoding: WireEncoding,
    ) -> zenoh::Result<Self> {
        // A subscriber of the same session would run inside `put`, in the caller's thread.
        Self::declare_for(session, key, (channel, encoding), Locality::Remote).await
    }

    /// A publisher at `key` for subscribers of its own session too: robots of one agent that talk to
    /// each other. Their callbacks run inside [`put`](Self::put), and must be as quick as it.
    ///
    /// # Errors
    /// Zenoh's error if it cannot be declared.
    pub async fn declare_everywhere(
        session: &Session,
        key: String,
        channel: Channel,
        encoding: WireEncoding,
    ) -> zenoh::Result<Self> {
        Self::declare_for(session, key, (channel, encoding), Locality::Any).await
    }

    async fn declare_for(
        session: &Session,
        key: String,
        (channel, encoding): (Channel, WireEncoding),
        locality: Locality,
    ) -> zenoh::Result<Self> {
        let publisher = session
            .declare_publisher(key)
            .priority(channel.priority())
            .congestion_control(channel.congestion_control())
            .express(channel.express())
            .encoding(encoding.to_zenoh())
            .allowed_destination(locality)
            .await?;
        let has_subscribers = Arc::<AtomicBool>::default();
        let told = Arc::clone(&has_subscribers);
        let tell = move |status: MatchingStatus| told.store(status.matching(), Ordering::Relaxed);
        // Tells how it stands now, and ends with the publisher.
        publisher.matching_listener().callback(tell).background().await?;
        Ok(Self { publisher, encoding, has_subscribers, last_size: AtomicUsize::new(0) })
    }

    /// Publishes a message; never waits for the network.
    ///
    /// # Errors
    /// [`PublishError`].
    pub fn put<T: Serialize>(&self, message: &T) -> Result<(), PublishError> {
        let room = self.last_size.load(Ordering::Relaxed) + ROOM_TO_GROW;
        let bytes = self.encoding.encode_with_room(message, room)?;
        self.last_size.store(bytes.len(), Ordering::Relaxed);
        self.publisher.put(bytes).wait().map_err(|error| PublishError::Zenoh(error.to_string()))
    }

    /// Whether anybody subscribes, so that work for nobody can be left out; costs next to nothing.
    /// A subscription that has just come shows a moment later.
    #[must_use]
    pub fn has_subscribers(&self) -> bool {
        self.has_subscribers.load(Ordering::Relaxed)
    }
}

/// Publishes samples that late joiners get and whose gaps are noticed.
#[derive(Debug)]
pub struct Cached {
    publisher: AdvancedPublisher<'static>,
    encoding: WireEncoding,
}

impl Cached {
    /// A publisher at `key` that keeps the last `samples`.
    ///
    /// # Errors
    /// Zenoh's error if it cannot be declared.
    pub async fn declare(
        session: &Session,
        key: String,
        channel: Channel,
        samples: usize,
    ) -> zenoh::Result<Self> {
        let encoding = WireEncoding::Json;
        let publisher = session
            .declare_publisher(key)
            .priority(channel.priority())
            .congestion_control(channel.congestion_control())
            .express(channel.express())
            .encoding(encoding.to_zenoh())
            .advanced()
            .allowed_destination(Locality::Remote)
            .cache(CacheConfig::default().max_samples(samples))
            .sample_miss_detection(MissDetectionConfig::default().heartbeat(GAP_HEARTBEAT))
            .publisher_detection()
            .await?;
        Ok(Self { publisher, encoding })
    }

    /// Publishes a message.
    ///
    /// # Errors
    /// [`PublishError`].
    pub async fn put<T: Serialize>(&self, message: &T) -> Result<(), PublishError> {
        let bytes = self.encoding.encode(message)?;
        self.publisher.put(bytes).await.map_err(|error| PublishError::Zenoh(error.to_string()))
    }
}
