//! Why a request was refused.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A refused request: what a person needs to put it right.
///
/// It is the payload of the reply's error channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[error("{code}: {message}")]
pub struct Denial {
    /// The reason, stable over versions.
    pub code: DenialCode,
    /// What was refused, why, and what to do next; lower case, no full stop.
    pub message: String,
    /// The same as data: field, joint, value, limit, holder.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub details: Map<String, Value>,
}

impl Denial {
    /// A denial without details.
    #[must_use]
    pub fn new(code: DenialCode, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), details: Map::new() }
    }

    /// The same with one more detail.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.details.insert(name.to_owned(), value.into());
        self
    }
}

/// Reason of a [`Denial`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DenialCode {
    /// A field has a value that makes no sense.
    InvalidArgument,
    /// A number lies outside its limits.
    OutOfRange,
    /// The command mode does not allow it.
    WrongMode,
    /// The controller does not take commands now.
    NotReady,
    /// The drives are off.
    NotEnabled,
    /// A fault is latched.
    Faulted,
    /// A stop is latched.
    Stopped,
    /// Somebody else holds the lease, or nobody does and one is needed.
    LeaseRequired,
    /// The lease or epoch is of the past.
    LeaseStale,
    /// The sequence number is of the past.
    StaleSequence,
    /// The request was made for another revision of the model.
    StaleModel,
    /// This robot or this version cannot do it.
    NotSupported,
    /// There is no tool or payload to detach, or no such motion.
    NotAttached,
    /// There is a tool or payload already.
    AlreadyAttached,
    /// No joint position reaches the pose, or no such robot answers.
    Unreachable,
    /// Bodies would touch.
    Collision,
    /// The robot is too far from where the motion begins, or left its path.
    Tolerance,
    /// Another motion or request is in progress.
    Busy,
    /// No answer in time.
    Timeout,
    /// The driver refused or failed.
    DriverError,
    /// The controller or agent does not answer.
    CommunicationLost,
    /// The message is larger than allowed.
    TooLarge,
    /// The payload is not in an encoding that is understood.
    BadEncoding,
    /// There is no such method.
    UnknownMethod,
    /// A defect of Armada.
    Internal,
}

impl DenialCode {
    /// Every code, in the order of the contract.
    pub const ALL: [Self; 25] = [
        Self::InvalidArgument,
        Self::OutOfRange,
        Self::WrongMode,
        Self::NotReady,
        Self::NotEnabled,
        Self::Faulted,
        Self::Stopped,
        Self::LeaseRequired,
        Self::LeaseStale,
        Self::StaleSequence,
        Self::StaleModel,
        Self::NotSupported,
        Self::NotAttached,
        Self::AlreadyAttached,
        Self::Unreachable,
        Self::Collision,
        Self::Tolerance,
        Self::Busy,
        Self::Timeout,
        Self::DriverError,
        Self::CommunicationLost,
        Self::TooLarge,
        Self::BadEncoding,
        Self::UnknownMethod,
        Self::Internal,
    ];

    /// The code as it is on the wire.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::InvalidArgument => "invalid_argument",
            Self::OutOfRange => "out_of_range",
            Self::WrongMode => "wrong_mode",
            Self::NotReady => "not_ready",
            Self::NotEnabled => "not_enabled",
            Self::Faulted => "faulted",
            Self::Stopped => "stopped",
            Self::LeaseRequired => "lease_required",
            Self::LeaseStale => "lease_stale",
            Self::StaleSequence => "stale_sequence",
            Self::StaleModel => "stale_model",
            Self::NotSupported => "not_supported",
            Self::NotAttached => "not_attached",
            Self::AlreadyAttached => "already_attached",
            Self::Unreachable => "unreachable",
            Self::Collision => "collision",
            Self::Tolerance => "tolerance",
            Self::Busy => "busy",
            Self::Timeout => "timeout",
            Self::DriverError => "driver_error",
            Self::CommunicationLost => "communication_lost",
            Self::TooLarge => "too_large",
            Self::BadEncoding => "bad_encoding",
            Self::UnknownMethod => "unknown_method",
            Self::Internal => "internal",
        }
    }
}

impl fmt::Display for DenialCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_is_written_as_it_is_displayed() {
        for code in DenialCode::ALL {
            let value = serde_json::to_value(code).expect("a name");
            assert_eq!(value, code.as_str());
        }
    }
}
