//! From one trajectory to the next in motion, on one path.

use std::sync::Arc;

use armada_model::{MotionLimits, OnlineState};

use super::{Pace, Speed, TrajectoryMotion};
use crate::control::io::FollowOrder;
use crate::control::motion::course::{Course, Entry, Exit, Leg};
use crate::control::motion::waiting::Waiting;

impl TrajectoryMotion {
    /// The state on the course as at full speed, and its phase; none while the rate changes, when
    /// the course ahead is not free to be changed.
    pub(in crate::control::motion) fn steady_state(
        &mut self,
        period_s: f64,
    ) -> Option<(f64, OnlineState)> {
        let phase_s = self.phase_s(period_s);
        let steady = match &self.pace {
            Pace::Before => false,
            Pace::Ticks(_) => true,
            Pace::Path(path) => path.committed_s() <= phase_s,
        };
        steady.then(|| (phase_s, self.course.state(phase_s, &mut self.hint)))
    }

    /// Up to which phase \[s\] the course must stay what it is.
    pub(in crate::control::motion) fn committed_s(&self, period_s: f64) -> f64 {
        match &self.pace {
            Pace::Path(path) => path.committed_s(),
            _ => self.phase_s(period_s),
        }
    }

    /// Lets the next motion follow without a rest; gives it back if it is too late for that.
    pub(in crate::control::motion) fn attach(
        &mut self,
        exit: Exit,
        speed: &Speed<'_>,
        limits: &MotionLimits,
        period_s: f64,
    ) -> Option<Exit> {
        let reduced = speed.reduced.map_or(1.0, |reduced| {
            exit.entry.reduced_rate(reduced).min(exit.next.leg().reduced_rate(reduced))
        });
        if self.committed_s(period_s) > exit.leave_s || self.path(limits, period_s).is_none() {
            return Some(exit);
        }
        self.course.exit = Some(exit);
        self.cap = self.cap.min(reduced);
        self.refit();
        self.demand(limits, period_s);
        None
    }

    /// Takes the next motion off again, if it is not too late for that.
    pub(in crate::control::motion) fn detach(
        &mut self,
        speed: &Speed<'_>,
        period_s: f64,
    ) -> Option<Waiting> {
        let committed_s = self.committed_s(period_s);
        self.course.exit.as_ref().filter(|exit| committed_s <= exit.leave_s)?;
        let exit = self.course.exit.take()?;
        self.cap = speed.cap(&self.course.leg);
        self.refit();
        Some(exit.next)
    }

    /// The motion after this one, on the way into which the path is now, and what this one leaves.
    pub(in crate::control::motion) fn go_over(
        self,
        speed: &Speed<'_>,
    ) -> Option<(Waiting, Self, Course)> {
        let Self { mut course, pace: Pace::Path(mut path), paused, .. } = self else {
            return None;
        };
        let Exit { leave_s, next, entry } = course.exit.take()?;
        let leg = Leg { entry: Some(entry), ..next.leg() };
        let after_s = (path.phase_s() - leave_s).max(0.0);
        let kind = next.kind;
        path.go_over(&Course::new(leg.clone()), after_s).ok()?;
        let mut motion = Self::under_way(leg, kind, speed, path);
        motion.paused = paused;
        // What limited both limits no longer.
        motion.follow_demand();
        Some((next, motion, course))
    }

    /// A motion that takes the place of this one from where it is, in motion. This one is over.
    pub(in crate::control::motion) fn give_way(
        &mut self,
        entry: Entry,
        order: &FollowOrder,
        speed: &Speed<'_>,
        limits: &MotionLimits,
        period_s: f64,
    ) -> Option<Self> {
        let leg = Leg { trajectory: Arc::clone(&order.trajectory), entry: Some(entry) };
        let mut path = self.path(limits, period_s)?.clone();
        path.go_over(&Course::new(leg.clone()), 0.0).ok()?;
        let mut motion = Self::under_way(leg, order.kind, speed, path);
        motion.follow_demand();
        Some(motion)
    }

    /// The course has changed beyond what is committed.
    fn refit(&mut self) {
        if let Pace::Path(path) = &mut self.pace {
            let phase_s = path.phase_s();
            // Never refused: as many joints as before.
            let _ = path.go_over(&self.course, phase_s);
        }
    }
}
