//! Why the asking end has no answer.

use std::time::Duration;

use crate::codec::CodecError;
use crate::messages::Denial;
use crate::session::SessionError;

/// Why a request has no good answer.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// It was refused.
    #[error(transparent)]
    Denied(#[from] Denial),
    /// Nobody answers at the key: no such robot, or its agent is not running.
    #[error("nobody answers at {key}: is the name right, and does the agent or gateway run?")]
    NoReply {
        /// Key that was asked.
        key: String,
    },
    /// The answer did not come in time; whether the request was done is not known.
    #[error("no answer from {key} within {} ms", timeout.as_millis())]
    Timeout {
        /// Key that was asked.
        key: String,
        /// How long was waited.
        timeout: Duration,
    },
    /// The answer is not of the expected form: versions differ.
    #[error("the answer is not understood: {0}")]
    Codec(#[from] CodecError),
    /// The session could not be opened.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Nobody listens at any of the endpoints.
    #[error("no cell answers at {}: is it running (`armada up`)?", endpoints.join(", "))]
    NobodyThere {
        /// Endpoints that were dialled.
        endpoints: Vec<String>,
    },
    /// Zenoh failed.
    #[error("zenoh: {0}")]
    Zenoh(String),
}

impl ClientError {
    pub(super) fn zenoh(error: zenoh::Error) -> Self {
        Self::Zenoh(error.to_string())
    }
}
