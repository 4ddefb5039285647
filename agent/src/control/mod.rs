//! The abstract-robot loop: one pure step a tick.
//!
//! ```text
//!  feedback --verify--> condition, faults --+
//!  stop gate ---stop--> latched stop -------+--> mode, epoch
//!  requests -->orders--> motion ------------+       |
//!  samples ---stream--------+                       v
//!    motion | stream | ramp | hold --set-point--> limit --> controller
//! ```
//!
//! The phases of [`step`] in this order, one file each: `verify` the feedback, follow the `stop`
//! gate, take the `orders`, what partners said (`grouping`) and the samples of a `stream`, make a set-point (`motion`, or the `ramp`, or hold), `limit` it, ask
//! the `controller` for what it is to switch, and say what happened.
//!
//! Invariants, each a test:
//! * Nothing here allocates, waits, or can fail: what goes wrong becomes a fault and a ramp.
//! * **One stream.** Set-points are sent while the controller is heard, its drives are on, it takes
//!   commands, its pendant has no control, and no stop of level L0 is in force. While nothing moves, the last one is sent
//!   again at every tick, in halt too: the controller's own watchdog sees a live stream. A stream
//!   that broke off begins anew at the measured position, and not in `invalid_state`, unless a
//!   stop is latched: then "stay where you are" is what is to be said.
//! * **One way out.** Every set-point passes the limiter, which knows what was sent before.
//! * **The epoch** is raised by each change of mode, halt, stop, reset, fault, disable, grant and
//!   release of the lease, and by the pendant's taking control, and
//!   raising it ends the motion in progress, in the same call. So no halt between two ticks is
//!   lost, whatever follows it.
//! * A motion ends in a ramp from what was sent last, unless the stream breaks off.
//! * Every request is answered once; every motion has one terminal status.

mod acknowledge;
mod authority;
mod checkpoint;
mod controller;
mod equipment;
mod faults;
mod flags;
mod group;
mod grouping;
mod io;
mod jogging;
mod limit;
mod link_quality;
mod mode;
mod motion;
mod operational;
mod orders;
mod shared;
mod standstill;
mod state;
mod step;
mod stop;
mod stream;
mod tracking;
mod values;
mod verify;

#[cfg(test)]
mod tests;

pub use equipment::{Equipment, EquippedChain, EquippedChainError, MAX_CHAINS, TipState};
pub use faults::clear_by;
pub use group::{
    BEAT, Beat, Decision, GENTLE_SLOPE_S, GroupMachine, GroupOrder, GroupReport, GroupSay,
    GroupWord, LINGER, MAX_PARTNERS, MAX_SAID, MAX_WORDS, Own, PartnerFault, Readiness, Say,
    ScaleStep, StartTravel, Word, stretch_for_slope,
};
pub use io::{
    DelegateOrder, DelegateReport, DroppedSamples, EquipmentOrder, FollowOrder, Granted, HomeOrder,
    Input, JogCartesianOrder, JogJointOrder, JogOrder, LeaseChange, LeaseReport, LinkReport,
    LoopAbilities, LoopEvent, LoopFault, LoopRequest, MAX_DELEGATES, MAX_EVENTS, MAX_QUEUED,
    MAX_REQUESTS, MAX_RETIRED, MAX_SAMPLES, MAX_STOP_TIME, MotionReport, Order, Output, Params,
    REDUCED_SHARE, Refusal, Retired, Snapshot, StreamChange, StreamReport, StreamSample,
    StreamValues, TwistTarget, default_stop_time,
};
pub use state::{LoopState, ParamsError};
pub use step::step;
pub use values::ValueSlot;
