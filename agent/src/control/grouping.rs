//! The motion of this robot as a part of one of several: between the loop and its [`GroupMachine`].

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{ActionStatus, Coupling, GroupQuality};
use arrayvec::ArrayVec;
use uuid::Uuid;

use super::group::{BEAT, Decision, GroupMachine, GroupReport, GroupWord, MAX_SAID, Own};
use super::io::{FollowOrder, GroupSay, LoopEvent, Params, Refusal};
use super::motion::{End, Motion, STOP_ALLOWANCE, Source, TrajectoryMotion};
use super::state::{LoopState, Tick};

impl LoopState {
    /// Takes what partners said.
    pub(super) fn hear_partners(&mut self, words: impl Iterator<Item = GroupWord>) {
        for word in words {
            if let Some(group) = &mut self.group {
                group.hear(&word);
            }
        }
    }

    /// Starts, goes on or stops as the group does; before the set-point is made.
    pub(super) fn keep_together(&mut self, tick: &mut Tick<'_>) {
        let period = tick.params.period;
        let error = self.condition.feedback().map_or(0.0, |f| self.tracking.share(tick.params, f));
        let Some(group) = &mut self.group else { return };
        if let Some(trajectory) = self.ramp.as_mut().and_then(|brake| brake.of_group(group.id())) {
            // Stopped: what it does is to come to rest with its partners.
            let own = own(trajectory, error, period);
            if let Decision::Run { rate, .. } = group.guide(tick.now, &own) {
                trajectory.set_ratio(rate, &self.limits, period.as_secs_f64());
            }
            return;
        }
        let Some(motion) = self.motion.as_mut().filter(|motion| motion.id == group.id()) else {
            return;
        };
        let Source::Trajectory(trajectory) = &mut motion.source else { return };
        match group.guide(tick.now, &own(trajectory, error, period)) {
            Decision::Hold | Decision::Free => {}
            Decision::Run { rate, paused } => {
                trajectory.set_ratio(rate, &self.limits, period.as_secs_f64());
                if trajectory.set_held(paused) {
                    let status = motion.status();
                    let report = motion.report(status, None, period.as_secs_f64());
                    tick.event(LoopEvent::Motion(report));
                }
            }
            Decision::Stop(why) => {
                self.end_motion(tick, End::Failed(why));
                self.decelerate(tick);
            }
            Decision::Rested(why) => {
                let end = match why {
                    Refusal::Cancelled => End::Cancelled(why),
                    why => End::Failed(why),
                };
                self.end_motion(tick, end);
                self.decelerate(tick);
            }
        }
    }

    /// What is to be said to the partners, after the tick.
    pub(super) fn tell_partners(
        &mut self,
        now: MonoTime,
        period: Duration,
    ) -> ArrayVec<GroupSay, MAX_SAID> {
        let Some(group) = &mut self.group else { return ArrayVec::new() };
        let motion = self.motion.as_mut().filter(|motion| motion.id == group.id());
        let followed = match motion.map(|motion| &mut motion.source) {
            Some(Source::Trajectory(trajectory)) => Some(trajectory),
            _ => self.ramp.as_mut().and_then(|brake| brake.of_group(group.id())),
        };
        if followed.is_none() {
            group.rest(now);
        }
        let rests_at_s = group.phase_s();
        let phase_s = followed.map_or(rests_at_s, |t| t.phase_s(period.as_secs_f64()));
        let said = group.poll(now, phase_s);
        if group.is_over(now) {
            self.group = None;
        }
        said
    }

    /// Makes the motion that was just begun a part of one of several, if it is to be.
    pub(super) fn join_group(&mut self, order: &FollowOrder) {
        if let (Some(group), Some(start)) = (&order.group, order.start) {
            self.group = Some(GroupMachine::new(order.id, group, start, self.speed_ratio));
        }
    }

    /// Tells the group that the motion `id` is over, or comes to rest early.
    pub(super) fn leave_group(&mut self, now: MonoTime, id: Uuid, end: End) {
        let group = self.group.as_mut().filter(|group| group.id() == id);
        let why = match end {
            End::Complete => None,
            End::Cancelled(why) | End::Failed(why) => Some(why),
        };
        if let Some(group) = group {
            group.end(now, why);
        }
    }

    /// Ends the motion in progress together with those of its partners, on the common ramp, if it is
    /// one that does so; else it is to be ended by other means.
    pub(super) fn end_together(&mut self, why: Refusal) -> bool {
        let Some(motion) = self.motion.as_ref() else { return false };
        let group = self.group.as_mut().filter(|group| group.id() == motion.id);
        let under_way = matches!(&motion.source, Source::Trajectory(t) if t.has_begun());
        under_way && group.is_some_and(|group| group.leave(why, BEAT))
    }

    /// Lets what is no fault of the robot bring it to rest on the common ramp of its rigid group, from
    /// here, if it moves and that is in time: how long the ramp takes \[s\]. What the group holds may
    /// break if one robot brakes harder than the other.
    pub(super) fn stop_together(
        &mut self,
        tick: &Tick<'_>,
        motion: &Motion,
        end: End,
    ) -> Option<f64> {
        let why = match end {
            End::Failed(why) if end.is_stop() || why == Refusal::LeaseLost => why,
            End::Cancelled(why) => why,
            End::Complete | End::Failed(_) => return None,
        };
        let last = self.limiter.last().filter(|_| self.ramp.is_none())?;
        let moves = last.velocity.iter().any(|&velocity| velocity != 0.0);
        let under_way = matches!(&motion.source, Source::Trajectory(t) if t.has_begun());
        let ramp_s = self.common_ramp_s(motion.id, tick.params).filter(|_| moves && under_way)?;
        self.group.as_mut()?.leave(why, Duration::ZERO).then_some(ramp_s)
    }

    /// How long the common ramp of this group takes at most from here \[s\], if the robot is measured to
    /// stand after it within its stop time.
    pub(super) fn common_ramp_s(&self, group: Uuid, params: &Params) -> Option<f64> {
        let ramp_s = self.group.as_ref().filter(|known| known.id() == group)?.ramp_s()?;
        let rest = STOP_ALLOWANCE + params.tracking_lag + params.standstill_hold;
        let in_time = ramp_s + rest.as_secs_f64() <= params.stop_time.as_secs_f64();
        in_time.then_some(ramp_s)
    }

    /// The group whose pace the motion in progress follows, if it does.
    pub(super) fn shared_pace(&mut self) -> Option<&mut GroupMachine> {
        let Some(Motion { id, source: Source::Trajectory(trajectory), .. }) = &self.motion else {
            return None;
        };
        let id = trajectory.shares_pace().then_some(*id)?;
        self.group.as_mut().filter(|group| group.id() == id)
    }

    /// How well the motion `id` kept together with its partners, if it has any.
    pub(super) fn group_quality(&self, id: Uuid) -> Option<GroupQuality> {
        let report = self.group.as_ref()?.report();
        (report.id == id).then_some(report.quality)
    }

    /// How the motion of several stands.
    pub(super) fn group_report(&self) -> Option<GroupReport> {
        self.group.as_ref().map(GroupMachine::report)
    }
}

/// Refuses an order whose group cannot be.
pub(super) fn check_group(order: &FollowOrder, now: MonoTime) -> Result<(), Refusal> {
    let Some(group) = &order.group else { return Ok(()) };
    let Some(start) = order.start else {
        return Err(Refusal::NotSupported("motions of several robots without a start"));
    };
    if group.coupling == Coupling::Rigid && group.rate_slope_s <= 0.0 {
        return Err(Refusal::NotSupported("a common ramp, which a rigid group needs"));
    }
    let lead_s = start.saturating_since(now).as_secs_f64();
    let least_s = BEAT.as_secs_f64();
    if lead_s < least_s {
        return Err(Refusal::StartTooSoon { lead_s, least_s });
    }
    Ok(())
}

/// Where the own robot is on its trajectory, and how well it follows it.
fn own(trajectory: &TrajectoryMotion, error: f64, period: Duration) -> Own {
    let phase_s = trajectory.phase_s(period.as_secs_f64());
    Own { phase_s, rate: trajectory.rate(), error, period }
}

/// Status of a motion whose pace others share.
pub(super) const fn status_of(paused: bool, has_begun: bool) -> ActionStatus {
    match (paused, has_begun) {
        (true, _) => ActionStatus::Paused,
        (false, true) => ActionStatus::Running,
        (false, false) => ActionStatus::Queued,
    }
}
