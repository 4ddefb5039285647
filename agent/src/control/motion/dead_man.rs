//! Jogs at a speed: they go on for a while after the newest order, then brake to rest.
//!
//! ```text
//! order --> moving --another order of the same id--> moving, until a later instant
//!              |                                        |
//!              +------------ the instant passes --------+--> braking --at rest--> complete
//!                                                              |
//!                        moving <--another order of the same id-+
//! ```
//!
//! An order of another motion takes over in the state of the last tick. A speed of zero brakes and
//! keeps the motion alive. A joint that is told to go on rests at its position limit: a jog of
//! joints goes on with the others; a jog of tools keeps the direction of the tool, so all joints of
//! the chain rest with it, until it is told another way or its time has passed.

use serde::{Deserialize, Serialize};
use std::time::Duration;

use armada_model::{JointVector, MonoTime, OnlineState};

use super::twist::joint_velocity;
use super::{Drive, Next, SpeedFollower};
use crate::control::equipment::MAX_CHAINS;
use crate::control::io::TwistTarget;

/// A jog of joints or tools at a speed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct DeadManJog {
    follower: SpeedFollower,
    wanted: Wanted,
    /// When it begins to brake.
    until: MonoTime,
    /// Set-points sent.
    ticks: u64,
    /// What the newest order has it take in all, but for braking \[s\].
    duration_s: f64,
}

/// What is wanted to move, and how fast.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::control) enum Wanted {
    /// Each joint \[1/s\].
    Joints(JointVector),
    /// Tools.
    Tools([Option<TwistTarget>; MAX_CHAINS]),
}

impl DeadManJog {
    /// Goes on from `state`.
    pub(in crate::control) const fn new(state: &OnlineState) -> Self {
        let wanted = Wanted::Tools([None; MAX_CHAINS]);
        let follower = SpeedFollower::new(state);
        Self { follower, wanted, until: MonoTime::from_nanos(0), ticks: 0, duration_s: 0.0 }
    }

    /// Takes another order.
    pub(in crate::control) fn order(
        &mut self,
        wanted: &Wanted,
        now: MonoTime,
        timeout: Duration,
        period_s: f64,
    ) {
        self.wanted = *wanted;
        self.until = now + timeout;
        self.duration_s = self.elapsed_s(period_s) + timeout.as_secs_f64();
    }

    pub(in crate::control) const fn state(&self) -> &OnlineState {
        self.follower.state()
    }

    /// Whether it moves tools.
    pub(in crate::control) const fn moves_tools(&self) -> bool {
        matches!(self.wanted, Wanted::Tools(_))
    }

    pub(super) fn elapsed_s(&self, period_s: f64) -> f64 {
        self.ticks as f64 * period_s
    }

    pub(super) fn duration_s(&self, period_s: f64) -> f64 {
        self.duration_s.max(self.elapsed_s(period_s))
    }

    pub(super) fn next(&mut self, drive: &Drive<'_>) -> Next {
        self.ticks += 1;
        let over = drive.now >= self.until;
        let ratio = if over { 0.0 } else { drive.speed_ratio };
        match &self.wanted {
            Wanted::Joints(velocity) => {
                let wanted = velocity.map_indexed(|_, velocity| ratio * velocity);
                self.follower.tick(&wanted, &drive.limits, drive.period_s);
            }
            Wanted::Tools(twists) => {
                let (position, limits) = (self.follower.state().position, &drive.limits);
                let mut wanted = position.map_indexed(|_, _| 0.0);
                let chains = &drive.equipment.chains;
                let chain_of = |target: &TwistTarget| chains.get(usize::from(target.chain));
                for target in twists.iter().flatten() {
                    let slower = TwistTarget { twist: target.twist.scaled(ratio), ..*target };
                    // No two of the chains have a joint in common.
                    let speeds = joint_velocity(&slower, drive.equipment, &position, limits);
                    wanted = wanted.map_indexed(|joint, speed| {
                        speed + speeds.get(joint).copied().unwrap_or(0.0)
                    });
                }
                let moved = twists.iter().flatten().filter_map(chain_of);
                let groups = moved.map(|chain| chain.joints.as_slice());
                self.follower.tick_together(&wanted, groups, limits, drive.period_s);
            }
        }
        let state = self.follower.state().motion_state();
        if over && self.follower.is_at_rest() { Next::Last(state) } else { Next::Moving(state) }
    }
}
