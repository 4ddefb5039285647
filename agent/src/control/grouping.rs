//! The motion of this robot as a part of one of several: between the loop and its [`GroupMachine`].

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{ActionStatus, Coupling, GroupQuality};
use arrayvec::ArrayVec;
use uuid::Uuid;

use super::group::{BEAT, Decision, GroupMachine, GroupReport, GroupWord, MAX_SAID, Own};
use super::io::{FollowOrder, GroupSay, LoopEvent, Refusal};
use super::motion::{End, Motion, Source};
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
        let Some(group) = &mut self.group else { return };
        let Some(motion) = self.motion.as_mut().filter(|motion| motion.id == group.id()) else {
            return;
        };
        let Source::Trajectory(trajectory) = &mut motion.source else { return };
        let phase_s = trajectory.phase_s(period.as_secs_f64());
        let error = self.condition.feedback().map_or(0.0, |f| self.tracking.share(tick.params, f));
        let own = Own { phase_s, rate: trajectory.rate(), error, period };
        match group.guide(tick.now, &own) {
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
        let phase_s = match &self.motion {
            Some(Motion { id, source: Source::Trajectory(trajectory), .. })
                if *id == group.id() =>
            {
                trajectory.phase_s(period.as_secs_f64())
            }
            _ => group.phase_s(),
        };
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
        under_way && group.is_some_and(|group| group.leave(why))
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

/// Status of a motion whose pace others share.
pub(super) const fn status_of(paused: bool, has_begun: bool) -> ActionStatus {
    match (paused, has_begun) {
        (true, _) => ActionStatus::Paused,
        (false, true) => ActionStatus::Running,
        (false, false) => ActionStatus::Queued,
    }
}
