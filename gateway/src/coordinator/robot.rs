//! What the coordinator knows of one robot.
//!
//! ```text
//! never seen --token--> online <--token-- lost        a boot id not seen before is a new run
//!                         '------no token----^
//! ```

use std::collections::VecDeque;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{
    ActionStatus, CellRobotStatus, CommandMode, ControllerState, LatchedStop, Presence, RobotInfo,
    RobotState, RobotStatus, TcpState,
};
use uuid::Uuid;

use super::clock_offset::ClockOffset;

/// Runs that are remembered, so that late messages of them are known as such.
const PAST_RUNS: usize = 8;
/// Time over which the rate of states is measured.
const RATE_WINDOW: Duration = Duration::from_secs(1);

/// Which run a message belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Run {
    /// The one that is going on.
    Current,
    /// One that was not heard of before; what was known of the last one is forgotten.
    New,
    /// One that is over: the message is of no use.
    Past,
}

/// What is known of one robot.
#[derive(Clone, Debug, Default)]
pub(super) struct RobotRecord {
    pub(super) presence: Presence,
    run: Option<Uuid>,
    past_runs: VecDeque<Uuid>,
    pub(super) joints: Option<Vec<String>>,
    /// Revision of its description, tools and payloads.
    pub(super) model_rev: Option<u64>,
    /// Period of its control loop.
    pub(super) period: Duration,
    /// Within what time of a stop it is measured to stand, as it declares; kept when it is gone.
    pub(super) stop_time: Option<Duration>,
    pub(super) status: Option<Box<RobotStatus>>,
    state: Option<StateView>,
    rate: RateMeter,
    pub(super) clock: ClockOffset,
    /// When the clock is measured next; `None` while it is not there or being measured.
    pub(super) next_clock: Option<MonoTime>,
    /// When info and status are asked for, as long as one of them is missing.
    pub(super) next_refresh: Option<MonoTime>,
}

/// What is kept of the newest state.
#[derive(Clone, Debug)]
struct StateView {
    arrived: MonoTime,
    tcp: Vec<TcpState>,
}

impl RobotRecord {
    pub(super) fn is_online(&self) -> bool {
        self.presence == Presence::Online
    }

    /// The run that is going on, if any was heard of.
    pub(super) const fn run(&self) -> Option<Uuid> {
        self.run
    }

    /// Sorts a message into its run.
    pub(super) fn admit(&mut self, boot_id: Uuid) -> Run {
        if self.run == Some(boot_id) {
            return Run::Current;
        }
        if self.past_runs.contains(&boot_id) {
            return Run::Past;
        }
        if let Some(past) = self.run.replace(boot_id) {
            if self.past_runs.len() == PAST_RUNS {
                self.past_runs.pop_front();
            }
            self.past_runs.push_back(past);
            self.joints = None;
            self.model_rev = None;
            self.status = None;
            self.state = None;
            self.rate = RateMeter::default();
            self.clock = ClockOffset::default();
        }
        Run::New
    }

    /// Takes a state of the current run.
    pub(super) fn take_state(&mut self, state: RobotState, arrived: MonoTime, arrivals: u32) {
        self.state = Some(StateView { arrived, tcp: state.tcp });
        self.rate.add(arrived, arrivals);
    }

    /// Takes a status of the current run; returns whether something changed that others should
    /// know at once.
    pub(super) fn take_status(&mut self, status: Box<RobotStatus>) -> bool {
        let newer = self.status.as_ref().is_none_or(|old| old.seqno <= status.seqno);
        if !newer {
            return false;
        }
        let changed = self.status.as_ref().is_none_or(|old| differs(old, &status));
        self.status = Some(status);
        changed
    }

    /// Takes the description of the current run.
    pub(super) fn take_info(&mut self, info: &RobotInfo) {
        self.joints = Some(info.joints.iter().map(|joint| joint.name.clone()).collect());
        self.model_rev = Some(info.model_rev);
        // A period that makes no sense is none.
        self.period = Duration::try_from_secs_f64(1e-3 * info.period_ms).unwrap_or_default();
        self.stop_time = Duration::try_from_secs_f64(info.stop_time_s).ok();
    }

    /// Whether info or status is still unknown.
    pub(super) const fn is_incomplete(&self) -> bool {
        self.joints.is_none() || self.status.is_none()
    }

    /// The stops that keep the robot stopped, as far as known.
    pub(super) fn latched_stops(&self) -> &[LatchedStop] {
        let stop = self.status.as_ref().and_then(|status| status.stop.as_ref());
        stop.map_or(&[], |latch| latch.stops.as_slice())
    }

    /// Whether the agent reports a motion in progress.
    pub(super) fn is_moving(&self) -> bool {
        let motion = self.status.as_ref().and_then(|status| status.motion.as_ref());
        motion.is_some_and(|motion| motion.status == ActionStatus::Running)
    }

    /// The robot's part of the cell's status.
    pub(super) fn report(&self, now: MonoTime) -> CellRobotStatus {
        let online = self.is_online();
        let status = self.status.as_deref();
        let present = status.filter(|_| online);
        let offset = self.clock.best(now).filter(|_| online);
        CellRobotStatus {
            presence: self.presence,
            command_mode: present.map(|status| status.command_mode),
            controller_state: present.map(|status| status.controller_state),
            // What keeps a robot from moving is shown even when its agent is gone.
            stop: status.and_then(|status| status.stop.clone()),
            faults: status.map(|status| status.faults.clone()).unwrap_or_default(),
            authority: present.map(|status| status.authority),
            lease: present.and_then(|status| status.lease.clone()),
            why: present.map(|status| status.why.clone()).unwrap_or_default(),
            queued: present
                .map_or(0, |status| u32::try_from(status.queued.len()).unwrap_or(u32::MAX)),
            speed_ratio: present.map(|status| status.speed_ratio),
            tcp: self.state.as_ref().map(|state| state.tcp.clone()).unwrap_or_default(),
            state_age_ms: self
                .state
                .as_ref()
                .map(|state| now.saturating_since(state.arrived).as_secs_f64() * 1e3),
            state_rate_hz: self.rate.hz(now),
            control_loop: present.map(|status| status.control_loop),
            clock_offset_ns: offset.map(|offset| offset.offset_ns),
            clock_bound_ns: offset.map(|offset| offset.bound_ns),
        }
    }

    /// Whether the robot could be commanded now, but for a stop: present, known, without fault, in a
    /// valid mode, with its drives on.
    pub(super) fn is_sound(&self) -> bool {
        let sound = |status: &RobotStatus| {
            let commandable = status.command_mode != CommandMode::InvalidState
                && status.controller_state == ControllerState::MotorOn;
            status.faults.is_empty() && (commandable || status.stop.is_some())
        };
        self.is_online() && self.status.as_deref().is_some_and(sound)
    }
}

/// Whether two statuses differ in more than times and counters.
fn differs(old: &RobotStatus, new: &RobotStatus) -> bool {
    let motion = |status: &RobotStatus| status.motion.as_ref().map(|m| (m.id, m.status));
    let holder = |status: &RobotStatus| {
        status.lease.as_ref().map(|lease| (lease.holder.clone(), lease.role, lease.stale))
    };
    let why = |status: &RobotStatus| status.why.iter().map(|why| why.code).collect::<Vec<_>>();
    old.command_mode != new.command_mode
        || old.operational_mode != new.operational_mode
        || old.controller_state != new.controller_state
        || old.flags != new.flags
        || old.stop != new.stop
        || old.faults != new.faults
        || motion(old) != motion(new)
        || holder(old) != holder(new)
        || old.authority != new.authority
        || old.speed_ratio != new.speed_ratio
        || old.queued.len() != new.queued.len()
        || why(old) != why(new)
}

/// Counts what came in over the last second.
#[derive(Clone, Debug, Default)]
struct RateMeter {
    counts: VecDeque<(MonoTime, u32)>,
}

impl RateMeter {
    fn add(&mut self, at: MonoTime, count: u32) {
        self.counts.push_back((at, count));
        // One more than the window is kept: its time is where the oldest interval begins.
        while self
            .counts
            .get(1)
            .is_some_and(|(second, _)| at.saturating_since(*second) > RATE_WINDOW)
        {
            self.counts.pop_front();
        }
    }

    fn hz(&self, now: MonoTime) -> f64 {
        let (Some((first, _)), Some((last, _))) = (self.counts.front(), self.counts.back()) else {
            return 0.0;
        };
        let span = last.saturating_since(*first).as_secs_f64();
        if span <= 0.0 || now.saturating_since(*last) > RATE_WINDOW {
            return 0.0;
        }
        self.counts.iter().skip(1).map(|(_, count)| f64::from(*count)).sum::<f64>() / span
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> MonoTime {
        MonoTime::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn a_late_message_of_a_past_run_does_not_bring_it_back() {
        let mut record = RobotRecord::default();
        let [first, second] = [1, 2].map(Uuid::from_u128);
        assert_eq!(record.admit(first), Run::New);
        assert_eq!(record.admit(first), Run::Current);
        assert_eq!(record.admit(second), Run::New);
        assert_eq!(record.admit(first), Run::Past);
        assert_eq!(record.run(), Some(second));
    }

    #[test]
    fn the_rate_is_that_of_the_last_second_and_zero_in_silence() {
        let mut rate = RateMeter::default();
        for tick in 0..120 {
            rate.add(ms(tick * 33), 3);
        }
        let hz = rate.hz(ms(119 * 33));
        assert!((hz - 90.9).abs() < 0.1, "{hz} Hz");
        assert!(rate.counts.len() < 40, "{} counts are kept", rate.counts.len());
        assert_eq!(rate.hz(ms(6_000)), 0.0);
    }
}
