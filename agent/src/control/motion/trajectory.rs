//! Timed trajectories.
//!
//! ```text
//! waiting --start is near--> lead-in --at the first waypoint--> clock 0, 1, .. --> last waypoint
//! ```
//!
//! **The clock counts ticks, not time.** It advances by exactly one period per set-point sent, times
//! the speed ratio. So a late wake, or a whole period missed, delays the motion and cannot make it
//! jump: every difference of set-points is one that the trajectory was validated for. A late wake
//! is legal by construction, and nothing needs to catch up.
//!
//! At full speed the set-points are plain samples. The first order to pause, to go slower or to go
//! over to another trajectory puts the motion on an [`OnPath`], which then makes them at whatever
//! rate is asked for, jerk-limited, without ever leaving the curve. Resumed at full speed, its
//! clock is again that of the ticks.
//!
//! In operational mode `manual_reduced_speed` the rate is at most the one at which no joint is
//! faster than its reduced limits, taken from the exact highest speeds and accelerations of the
//! whole trajectory: the lower of that and the speed ratio counts.
//!
//! A start at an instant is at the tick nearest to it. One with partners is at the first tick from it on,
//! at the phase that has passed by then: so robots whose ticks fall at different times are at one
//! phase all the same, if they begin at full speed. No set-point is farther from the first waypoint
//! for that, nor faster, than that of the second tick would be. If the position held is not exactly the
//! first waypoint, since it was taken from a measurement, a slow move there comes before. It is
//! planned when the order is taken and begun early enough that clock zero falls on the instant:
//! robots that start together do so, whatever small distance each had to go. If there is no
//! time for it, or the tick comes more than a period late, the start is missed and nothing moves.
//! With partners that wait for each other it may be as late as their phases may be apart.
//!
//! The last set-point is the last waypoint, bit for bit; then the motion is complete, and the
//! position is held.

mod changeover;
mod opening;

use serde::{Deserialize, Serialize};
use std::time::Duration;

use armada_model::{JointVector, MonoTime, MotionLimits, MotionState, OnPath};
use armada_protocol::messages::{Coupling, MotionKind, ReducedLimits};

use self::opening::Opening;
pub(super) use self::opening::{StartPoint, check_near, check_suits};
use super::Next;
use super::course::{Course, Leg};
use super::lead_in::whole_ticks;
use crate::control::io::Refusal;
use crate::control::state::Tick;

/// A trajectory being followed, or waiting for its start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct TrajectoryMotion {
    pub(super) course: Course,
    kind: MotionKind,
    start: Option<MonoTime>,
    opening: Opening,
    pace: Pace,
    /// The rate that is asked for.
    ratio: f64,
    /// The highest rate that is allowed.
    cap: f64,
    paused: bool,
    /// Whether it and its partners are paused together.
    held: bool,
    /// How closely it is tied to its partners, if it has any.
    coupling: Option<Coupling>,
    /// How late it may start.
    patience: Duration,
    /// Phase at which it began \[s\]: time that had passed since its instant, below a period.
    head_s: f64,
    hint: usize,
    waypoint: usize,
    /// Places at which a way into the next trajectory was looked for.
    pub(super) attempts: u8,
}

/// How the phase goes on.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "the loop allocates nothing")]
enum Pace {
    /// Not yet.
    Before,
    /// By one period a tick: set-points sent after the first.
    Ticks(u64),
    /// At a rate that changes.
    Path(OnPath),
}

/// How fast trajectories may be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Speed<'a> {
    /// Of all motions.
    pub(super) ratio: f64,
    /// Limits of joints at reduced speed, where they are in force.
    pub(super) reduced: Option<&'a [ReducedLimits]>,
}

impl Speed<'_> {
    fn cap(&self, leg: &Leg) -> f64 {
        self.reduced.map_or(1.0, |reduced| leg.reduced_rate(reduced))
    }

    fn lead_in(&self, share: f64, limits: &MotionLimits) -> f64 {
        let joints = self.reduced.unwrap_or_default().iter().zip(limits.iter());
        joints.fold(share, |share, (reduced, axis)| share.min(reduced.velocity / axis.velocity))
    }
}

impl TrajectoryMotion {
    /// Begun already, on a path that leads onto `leg` at the phase it is at.
    fn under_way(leg: Leg, kind: MotionKind, speed: &Speed<'_>, path: OnPath) -> Self {
        Self { pace: Pace::Path(path), ..Self::on(leg, kind, speed) }
    }

    fn on(leg: Leg, kind: MotionKind, speed: &Speed<'_>) -> Self {
        Self {
            kind,
            start: None,
            opening: Opening::Planned(None),
            pace: Pace::Before,
            ratio: speed.ratio,
            cap: speed.cap(&leg),
            paused: false,
            held: false,
            coupling: None,
            patience: Duration::ZERO,
            head_s: 0.0,
            hint: 0,
            waypoint: 0,
            attempts: 0,
            course: Course::new(leg),
        }
    }

    pub(super) const fn kind(&self) -> MotionKind {
        self.kind
    }

    pub(super) fn into_course(self) -> Course {
        self.course
    }

    /// Whether it makes the set-points.
    pub(super) fn is_under_way(&self) -> bool {
        self.has_begun()
            || matches!(&self.opening, Opening::Planned(Some(lead_in)) if lead_in.has_begun())
    }

    /// Whether its clock runs.
    pub(in crate::control) const fn has_begun(&self) -> bool {
        !matches!(self.pace, Pace::Before)
    }

    /// Whether it began, or begins, at an instant with other robots that would not go slower with it:
    /// their pace it has to keep.
    pub(super) const fn is_common(&self) -> bool {
        self.start.is_some() && !self.shares_pace()
    }

    /// Whether it is followed together with other robots.
    pub(super) const fn has_partners(&self) -> bool {
        self.coupling.is_some()
    }

    /// Whether its pace is that of all its partners.
    pub(in crate::control) const fn shares_pace(&self) -> bool {
        matches!(self.coupling, Some(Coupling::TimeSynced | Coupling::Rigid))
    }

    pub(super) const fn is_paused(&self) -> bool {
        self.paused || self.held
    }

    /// Notes whether it and its partners are paused together; returns whether that is a change.
    pub(in crate::control) const fn set_held(&mut self, held: bool) -> bool {
        let before = self.held;
        self.held = held;
        before != held
    }

    /// How fast the clock runs.
    pub(in crate::control) const fn rate(&self) -> f64 {
        match &self.pace {
            Pace::Before => 0.0,
            Pace::Ticks(_) => 1.0,
            Pace::Path(path) => path.rate(),
        }
    }

    /// Where it is on its course \[s\].
    pub(in crate::control) fn phase_s(&self, period_s: f64) -> f64 {
        match &self.pace {
            Pace::Before => 0.0,
            Pace::Ticks(clock) => self.clock_s(*clock, period_s),
            Pace::Path(path) => path.phase_s(),
        }
    }

    pub(super) fn elapsed_s(&self, period_s: f64) -> f64 {
        match &self.pace {
            Pace::Before => 0.0,
            _ => self.course.leg.clock_s(self.phase_s(period_s)),
        }
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.course.leg.trajectory.duration_s()
    }

    pub(super) fn waypoint(&self) -> u32 {
        u32::try_from(self.waypoint).unwrap_or(u32::MAX)
    }

    /// What the waypoint passed last asks for, position and velocity; nothing on the way to the
    /// first one.
    pub(super) fn tolerance(&self, period_s: f64) -> (JointVector, JointVector) {
        if !self.has_begun() || self.course.leg.is_entry(self.phase_s(period_s)) {
            return (JointVector::EMPTY, JointVector::EMPTY);
        }
        let asked = self.course.leg.trajectory.tolerance(self.waypoint);
        // Finite and one per joint, since it was compiled.
        let row = |row| JointVector::from_slice(row).unwrap_or_default();
        (row(asked.position), row(asked.velocity))
    }

    /// Changes the speed of this motion; at once if it has not begun, else jerk-limited.
    pub(in crate::control) fn set_ratio(
        &mut self,
        ratio: f64,
        limits: &MotionLimits,
        period_s: f64,
    ) {
        self.ratio = ratio;
        if self.has_begun() && (self.rate_asked() < 1.0 || self.is_on_path()) {
            self.demand(limits, period_s);
        }
    }

    /// Comes to rest on the path, or goes on; returns whether that is a change.
    pub(super) fn set_paused(
        &mut self,
        paused: bool,
        limits: &MotionLimits,
        period_s: f64,
    ) -> bool {
        if self.paused == paused {
            return false;
        }
        self.paused = paused;
        if self.has_begun() {
            self.demand(limits, period_s);
        }
        true
    }

    /// Stops for good on the path, if it can: on a path, and in motion on it.
    pub(super) fn stop(&mut self, limits: &MotionLimits, period_s: f64) -> bool {
        self.has_begun() && self.path(limits, period_s).map(OnPath::stop).is_some()
    }

    /// Whether it is in motion on a path, which it is put on if it was not yet.
    pub(super) fn has_path(&mut self, limits: &MotionLimits, period_s: f64) -> bool {
        self.has_begun() && self.path(limits, period_s).is_some()
    }

    /// The next state of a motion that was stopped, and whether it rests there.
    pub(super) fn stopping(&mut self, period_s: f64) -> Option<(MotionState, bool)> {
        let Pace::Path(path) = &mut self.pace else { return None };
        let state = path.tick(&self.course, period_s);
        self.waypoint = self.course.leg.waypoint_at(state.phase_s, &mut self.hint);
        Some((state.state.motion_state(), path.is_at_rest()))
    }

    pub(super) fn next(
        &mut self,
        tick: &Tick<'_>,
        held: &MotionState,
        limits: &MotionLimits,
    ) -> Next {
        let period = tick.params.period;
        match &mut self.pace {
            Pace::Before => match self.before_start(tick, held, limits) {
                Some(next) => next,
                None => self.begin(tick, limits),
            },
            Pace::Ticks(clock) => {
                *clock += 1;
                let clock = *clock;
                self.sampled(clock, period.as_secs_f64())
            }
            Pace::Path(path) => {
                let state = path.tick(&self.course, period.as_secs_f64());
                let finished = path.is_finished();
                self.on_path(state.phase_s, state.state.motion_state(), finished)
            }
        }
    }

    /// Clock zero, or a little after it.
    fn begin(&mut self, tick: &Tick<'_>, limits: &MotionLimits) -> Next {
        if self.rate_asked() == 1.0 {
            self.pace = Pace::Ticks(0);
            self.head_s = self.passed_s(tick);
            return self.sampled(0, tick.params.period.as_secs_f64());
        }
        // Never refused: the trajectory has as many joints as the robot.
        let Ok(path) = OnPath::start(&self.course, limits) else {
            return Next::Failed(Refusal::NotReady);
        };
        self.pace = Pace::Path(path);
        self.follow_demand();
        let start = self.course.state(0.0, &mut self.hint);
        Next::Moving(start.motion_state())
    }

    /// How much of the path has passed at the first tick, if partners begin at the same instant \[s\].
    fn passed_s(&self, tick: &Tick<'_>) -> f64 {
        let Some(start) = self.start.filter(|_| self.has_partners()) else { return 0.0 };
        // Of one that begins late the others are ahead, and wait.
        let passed = tick.now.saturating_since(start).min(tick.params.period);
        passed.as_secs_f64().min(0.5 * self.duration_s())
    }

    fn clock_s(&self, clock: u64, period_s: f64) -> f64 {
        self.head_s + clock as f64 * period_s
    }

    fn sampled(&mut self, clock: u64, period_s: f64) -> Next {
        let clock_s = self.clock_s(clock, period_s);
        let trajectory = &self.course.leg.trajectory;
        let last = whole_ticks(trajectory.duration_s() - self.head_s, period_s);
        // Exactly the end, not where rounding of the clock has it.
        let ended = clock > 0 && clock >= last;
        let time_s = if ended { trajectory.duration_s() } else { clock_s };
        let sample = trajectory.sample(time_s, &mut self.hint);
        self.waypoint = sample.waypoint;
        let state = MotionState { position: sample.position, velocity: sample.velocity };
        if ended { Next::Last(state) } else { Next::Moving(state) }
    }

    fn on_path(&mut self, phase_s: f64, state: MotionState, finished: bool) -> Next {
        if self.course.exit.as_ref().is_some_and(|exit| phase_s >= exit.leave_s) {
            return Next::Over(state);
        }
        self.waypoint = self.course.leg.waypoint_at(phase_s, &mut self.hint);
        if finished { Next::Last(state) } else { Next::Moving(state) }
    }

    fn rate_asked(&self) -> f64 {
        if self.paused { 0.0 } else { self.ratio.min(self.cap) }
    }

    const fn is_on_path(&self) -> bool {
        matches!(self.pace, Pace::Path(_))
    }

    /// The path, which it is put on if it was not yet; none before clock zero.
    fn path(&mut self, limits: &MotionLimits, period_s: f64) -> Option<&mut OnPath> {
        if let Pace::Ticks(clock) = self.pace {
            let at_s = self.clock_s(clock, period_s);
            self.pace = Pace::Path(OnPath::join(&self.course, limits, at_s).ok()?);
        }
        match &mut self.pace {
            Pace::Path(path) => Some(path),
            _ => None,
        }
    }

    fn demand(&mut self, limits: &MotionLimits, period_s: f64) {
        if self.path(limits, period_s).is_some() {
            self.follow_demand();
        }
    }

    fn follow_demand(&mut self) {
        let (ratio, paused) = (self.ratio.min(self.cap), self.paused);
        if let Pace::Path(path) = &mut self.pace {
            // Refused for a stopped path only, which nobody asks anything of.
            let _ = path.set_speed_ratio(ratio);
            let _ = if paused { path.pause() } else { path.resume() };
        }
    }
}

impl Leg {
    fn waypoint_at(&self, phase_s: f64, hint: &mut usize) -> usize {
        self.trajectory.waypoint_at(self.clock_s(phase_s), hint)
    }
}
