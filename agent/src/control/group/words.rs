//! What robots of a group say to each other, as the loop knows it.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{Coupling, GroupState};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::scale::ScaleStep;
use crate::control::io::Refusal;

/// How a trajectory is followed together with others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupOrder {
    /// How closely the robots are tied together.
    pub coupling: Coupling,
    /// Number of partners, 1 to [`MAX_PARTNERS`](super::MAX_PARTNERS).
    pub partners: u8,
    /// Silence of a partner after which all stop.
    pub loss: Duration,
    /// How far the phases of two robots may be apart \[s\].
    pub max_divergence_s: f64,
    /// Change of the common rate \[1/s\], the same for all robots; 0 if each goes as it can.
    pub rate_slope_s: f64,
}

/// Something a partner said.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupWord {
    /// The motion it is about.
    pub group: Uuid,
    /// Who said it, in the order of the partners.
    pub partner: u8,
    /// When it came in.
    pub at: MonoTime,
    /// What it is.
    pub word: Word,
}

/// What a partner can say.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Word {
    /// It will start if all others are ready.
    Go,
    /// Where it is.
    Heartbeat(Beat),
    /// It stops.
    Abort {
        /// Phase at which the common ramp begins \[s\]; at once if none.
        from_phase_s: Option<f64>,
    },
}

/// Where a robot is on the common path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beat {
    /// Number of the heartbeat of this motion.
    pub seq: u64,
    /// Where the sender stands.
    pub state: GroupState,
    /// Time since the common start by the sender's clock \[s\]; below 0 before it.
    pub time_s: f64,
    /// Phase it was at then \[s\].
    pub phase_s: f64,
    /// How fast its phase runs.
    pub rate: f64,
    /// Largest tracking error over its tolerance, 0 to 1.
    pub error: f64,
    /// The rate it allows.
    pub scale: ScaleStep,
}

/// Something to be said to all partners.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupSay {
    /// The motion it is about.
    pub group: Uuid,
    /// What it is.
    pub say: Say,
}

/// What a robot says to its partners.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Say {
    /// It will start if all others are ready.
    Go,
    /// Where it is.
    Heartbeat(Beat),
    /// It stops, and they are to do the same.
    Abort {
        /// Why.
        why: Refusal,
        /// Phase at which the common ramp begins \[s\]; at once if none.
        from_phase_s: Option<f64>,
    },
}

/// What a partner did that ends the motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum PartnerFault {
    /// It said that it stops.
    Aborted,
    /// It was not heard for so long \[s\].
    Silent(f64),
    /// It did not say that it is ready.
    NotReady,
    /// Its phase is so far from the own one \[s\].
    Diverged(f64),
}
