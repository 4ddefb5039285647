//! How urgent each kind of message is: the Zenoh settings of each channel, in one place.
//!
//! Reasons: an express channel loses most of a burst, so only sparse urgent keys are express; a
//! push never blocks its sender; stops are alone in their priority.

use serde::Serialize;
use zenoh::qos::{CongestionControl, Priority};

/// A kind of message with its own urgency.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Stops and their acknowledgements; nothing else has this priority.
    Stop,
    /// Requests and answers.
    Rpc,
    /// Streamed commands: newest counts.
    Stream,
    /// Latest values at a rate: state, joint states, frames.
    State,
    /// Things that must arrive: status, info, events.
    Report,
    /// Progress of motions.
    Progress,
}

impl Channel {
    /// Priority on the link.
    #[must_use]
    pub const fn priority(self) -> Priority {
        match self {
            Self::Stop => Priority::RealTime,
            Self::Rpc | Self::Stream => Priority::InteractiveHigh,
            Self::State => Priority::InteractiveLow,
            Self::Report => Priority::DataHigh,
            Self::Progress => Priority::DataLow,
        }
    }

    /// What happens when the link is full: only requests wait.
    #[must_use]
    pub const fn congestion_control(self) -> CongestionControl {
        match self {
            Self::Rpc => CongestionControl::Block,
            Self::Stop | Self::Stream | Self::State | Self::Report | Self::Progress => {
                CongestionControl::Drop
            }
        }
    }

    /// Whether a message is sent at once instead of in a batch.
    #[must_use]
    pub const fn express(self) -> bool {
        matches!(self, Self::Stop | Self::Rpc | Self::Stream)
    }
}
