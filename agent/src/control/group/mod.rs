//! Motions of several robots that watch each other: each agent's side of it, without a clock.
//!
//! ```text
//!          start, every go held,              own goal
//! ARMED ------------------------> RUNNING ---------------> DONE
//!   |     all heartbeats fresh       |                       | until all are, at most 1 s
//!   | a go or a heartbeat is         | own end, a partner's abort or silence, divergence
//!   | missing, own end, an abort     v                       v
//!   +---------------------------> ABORTING --said 3 times--> over
//! ```
//!
//! [`GroupMachine`] is told what partners said and where its own robot is, and says when to start,
//! how fast to go and when to stop. It moves nothing itself.
//!
//! * **Nobody starts alone.** A robot starts only if it holds the go of every partner and has heard
//!   each within the loss time. The last go may be lost: then its receiver says abort, and those
//!   that started hear that, or nothing, and stop within the loss time.
//! * **Silence counts by content.** A heartbeat carries the time at which it was said, so one that
//!   was held up on the way does not make its sender look alive.
//! * **One pace.** Each robot announces what it allows as a step at a place of the path that nobody
//!   reaches before the announcement is heard, or the loss of it noticed. The group's rate is the
//!   least of all steps at a phase, and falls by a formula of the phase alone: all robots have the
//!   same rate at the same place and come to rest at the same place. While all rest a step counts
//!   at a time instead of a place.
//! * **Who is ahead waits.** A robot whose clock lost ticks is behind; those ahead of it go up to a
//!   tenth slower until they are level.
//! * A `rigid` group ends as it pauses: on one ramp from one place, the first that any robot names; so it
//!   does when it is stopped with L2 or L1, halted or taken over, if the ramp is within the robot's stop
//!   time. A robot that cannot follow it (fault, L0, drives off) stops as it can, and one that is
//!   stopped where its own path rests for a while stays there: nothing begins to move under a stop.

mod machine;
mod pace;
mod partner;
mod readiness;
mod scale;
mod trace;
mod words;

#[cfg(test)]
mod tests;

pub use machine::{Decision, GroupMachine, GroupReport, Own};
pub use readiness::{GENTLE_SLOPE_S, Readiness, StartTravel, stretch_for_slope};
pub use scale::ScaleStep;
pub use words::{Beat, GroupOrder, GroupSay, GroupWord, PartnerFault, Say, Word};

use std::time::Duration;

/// Most partners of a robot.
pub const MAX_PARTNERS: usize = 15;
/// Most words of partners that one tick takes; the rest wait for the next.
pub const MAX_WORDS: usize = 16;
/// Most that is said in one tick: go and heartbeat, or abort and heartbeat.
pub const MAX_SAID: usize = 2;
/// How often a robot tells its partners where it is.
pub const BEAT: Duration = Duration::from_millis(20);
/// How long a robot at its goal waits for partners that are not.
pub const LINGER: Duration = Duration::from_secs(1);
