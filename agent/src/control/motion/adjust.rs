//! Orders about a motion in progress: cancel, pause, resume, another speed.

use uuid::Uuid;

use super::trajectory::Speed;
use super::{End, Motion, Source};
use crate::control::io::{LoopEvent, Refusal};
use crate::control::state::{LoopState, Tick};

impl LoopState {
    /// Takes a motion off, in progress or waiting.
    pub(in crate::control) fn cancel(
        &mut self,
        tick: &mut Tick<'_>,
        id: Uuid,
    ) -> Result<(), Refusal> {
        if let Some(at) = self.queue.iter().position(|waiting| waiting.id() == id) {
            self.drop_waiting(tick, at, Refusal::Cancelled);
            return Ok(());
        }
        if self.attached() == Some(id) {
            return match self.detach(tick) {
                true => self.cancel(tick, id),
                false => Err(Refusal::StillMoving),
            };
        }
        let motion = self.motion.as_mut().filter(|motion| motion.id == id);
        let motion = motion.ok_or(Refusal::NoSuchMotion)?;
        if motion.cancelling {
            return Ok(());
        }
        motion.cancelling = true;
        if self.end_together(Refusal::Cancelled) {
            self.drop_waiting(tick, 0, Refusal::QueueBroken);
            return Ok(());
        }
        let handed_over = self.motion.as_ref().is_some_and(Motion::is_handed_over);
        self.drop_waiting(tick, 0, Refusal::QueueBroken);
        if handed_over {
            // Ends when the controller has shown that it stopped.
            self.stop_own_motion();
            return Ok(());
        }
        self.brake_motion(tick);
        if self.ramp.is_none() {
            self.end_motion(tick, End::Cancelled(Refusal::Cancelled));
        }
        Ok(())
    }

    /// Brings the motion in progress to rest on its path, or lets it go on.
    pub(in crate::control) fn set_paused(
        &mut self,
        tick: &mut Tick<'_>,
        id: Uuid,
        paused: bool,
    ) -> Result<(), Refusal> {
        if self.queue.iter().any(|waiting| waiting.id() == id) || self.attached() == Some(id) {
            return Err(Refusal::NotPausable);
        }
        let motion = self.motion.as_mut().filter(|motion| motion.id == id);
        let motion = motion.ok_or(Refusal::NoSuchMotion)?;
        if motion.cancelling {
            return Err(Refusal::StillMoving);
        }
        if let Some(group) = self.shared_pace() {
            // Said to be paused when all are to be.
            group.set_paused(paused);
            return Ok(());
        }
        let motion = self.motion.as_mut().ok_or(Refusal::NoSuchMotion)?;
        let period_s = tick.period_s();
        match &mut motion.source {
            Source::Trajectory(trajectory) if !trajectory.is_common() => {
                if !trajectory.set_paused(paused, &self.limits, period_s) {
                    return Ok(());
                }
            }
            Source::Jog(jog) => {
                if !jog.set_paused(paused) {
                    return Ok(());
                }
            }
            Source::Delegated(delegated) if tick.params.abilities.pause => {
                if std::mem::replace(&mut delegated.wants_pause, paused) == paused {
                    return Ok(());
                }
            }
            _ => return Err(Refusal::NotPausable),
        }
        let report = motion.report(motion.status(), None, period_s);
        tick.event(LoopEvent::Motion(report));
        Ok(())
    }

    /// Changes the speed of all motions.
    pub(in crate::control) fn set_speed_ratio(
        &mut self,
        tick: &Tick<'_>,
        ratio: f64,
    ) -> Result<(), Refusal> {
        if !(0.01..=1.0).contains(&ratio) {
            return Err(Refusal::NotSupported("speed ratios beyond 0.01 to 1"));
        }
        if let Some(Motion { id, source: Source::Trajectory(trajectory), .. }) = &self.motion
            && trajectory.is_common()
        {
            // Its partners would go on at their own speed.
            return Err(Refusal::Busy(*id));
        }
        self.speed_ratio = ratio;
        if let Some(group) = self.shared_pace() {
            group.set_ratio(ratio);
            return Ok(());
        }
        if let Some(Motion { source: Source::Trajectory(trajectory), .. }) = &mut self.motion {
            trajectory.set_ratio(ratio, &self.limits, tick.period_s());
        }
        Ok(())
    }

    /// How fast trajectories may be now.
    pub(super) fn speed<'a>(&self, tick: &Tick<'a>) -> Speed<'a> {
        Speed { ratio: self.speed_ratio, reduced: self.reduced_in_force(tick.params) }
    }
}
