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
//! A start at an instant is at the tick nearest to it. If the position held is not exactly the
//! first waypoint, since it was taken from a measurement, a slow move there comes before. It is
//! planned when the order is taken and begun early enough that clock zero falls on the instant:
//! robots that start together do so, whatever small distance each had to go. If there is no
//! time for it, or the tick comes more than a period late, the start is missed and nothing moves.
//! With partners that wait for each other it may be as late as their phases may be apart.
//!
//! The last set-point is the last waypoint, bit for bit; then the motion is complete, and the
//! position is held.

use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;

use armada_model::{
    CompiledTrajectory, JointVector, MonoTime, MotionLimits, MotionState, OnPath, OnlineState,
};
use armada_protocol::messages::{Coupling, MotionKind, ReducedLimits};

use super::Next;
use super::course::{Course, Entry, Exit, Leg};
use super::lead_in::{LeadIn, whole_ticks};
use super::queue::Waiting;
use crate::control::io::{FollowOrder, Params, Refusal};
use crate::control::state::Tick;

/// Speed of the way to the first waypoint, as a share of each joint's limit.
const LEAD_IN_SPEED: f64 = 0.1;
/// The same where the way may be long, since the trajectory took the place of another.
const REPLACING_SPEED: f64 = 0.5;

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
    hint: usize,
    waypoint: usize,
    /// Places at which a way into the next trajectory was looked for.
    pub(super) attempts: u8,
}

/// The way to the first waypoint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "the loop allocates nothing")]
enum Opening {
    /// To be planned when the robot is at rest, at this share of the speed limits.
    Unplanned(f64),
    /// None if there is no distance.
    Planned(Option<LeadIn>),
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

/// Where a trajectory is begun.
#[derive(Clone, Copy, Debug)]
pub(in crate::control) struct StartPoint<'a> {
    /// The set-point held.
    pub(in crate::control) held: &'a MotionState,
    /// Measured positions.
    pub(in crate::control) measured: &'a JointVector,
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
    /// Makes ready to follow, if the robot is where the trajectory begins and in time.
    pub(super) fn plan(
        order: &FollowOrder,
        from: &StartPoint<'_>,
        speed: &Speed<'_>,
        limits: &MotionLimits,
        tick: &Tick<'_>,
    ) -> Result<Self, Refusal> {
        let first = order.trajectory.start();
        let tolerance = &tick.params.start_tolerance;
        check_near(&first, from.measured, tolerance)?;
        check_near(&first, &from.held.position, tolerance)?;
        let period = tick.params.period;
        let share = speed.lead_in(LEAD_IN_SPEED, limits);
        let lead_in = LeadIn::plan(&from.held.position, &first, share, limits, period)?;
        if let Some(start) = order.start {
            let earliest = tick.now + lead_in.as_ref().map_or(Duration::ZERO, |l| l.lead(period));
            check_in_time(start, earliest, period)
                .map_err(|late_s| Refusal::StartMissed { late_s })?;
        }
        let leg = Leg::new(Arc::clone(&order.trajectory));
        let opening = Opening::Planned(lead_in);
        let coupling = order.group.map(|group| group.coupling);
        let (start, patience) = (order.start, patience(order, period));
        let motion = Self::on(leg, order.kind, speed);
        Ok(Self { start, patience, opening, coupling, ..motion })
    }

    /// To be begun when the robot stands, from wherever that is.
    pub(super) fn later(
        trajectory: Arc<CompiledTrajectory>,
        kind: MotionKind,
        speed: &Speed<'_>,
        is_far: bool,
        limits: &MotionLimits,
    ) -> Self {
        let share = if is_far { REPLACING_SPEED } else { LEAD_IN_SPEED };
        let opening = Opening::Unplanned(speed.lead_in(share, limits));
        Self { opening, ..Self::on(Leg::new(trajectory), kind, speed) }
    }

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

    /// Whether it began, or begins, at an instant with other robots that it cannot tell anything:
    /// their pace it has to keep.
    pub(super) const fn is_common(&self) -> bool {
        self.start.is_some() && self.coupling.is_none()
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
            Pace::Ticks(clock) => *clock as f64 * period_s,
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

    /// The next state of a motion that was stopped, and whether it rests there.
    pub(super) fn stopping(&mut self, period_s: f64) -> Option<(MotionState, bool)> {
        let Pace::Path(path) = &mut self.pace else { return None };
        let state = path.tick(&self.course, period_s);
        self.waypoint = self.course.leg.waypoint_at(state.phase_s, &mut self.hint);
        Some((state.state.motion_state(), path.is_at_rest()))
    }

    /// The state on the course as at full speed, and its phase; none while the rate changes, when
    /// the course ahead is not free to be changed.
    pub(super) fn steady_state(&mut self, period_s: f64) -> Option<(f64, OnlineState)> {
        let phase_s = self.phase_s(period_s);
        let steady = match &self.pace {
            Pace::Before => false,
            Pace::Ticks(_) => true,
            Pace::Path(path) => path.committed_s() <= phase_s,
        };
        steady.then(|| (phase_s, self.course.state(phase_s, &mut self.hint)))
    }

    /// Up to which phase \[s\] the course must stay what it is.
    pub(super) fn committed_s(&self, period_s: f64) -> f64 {
        match &self.pace {
            Pace::Path(path) => path.committed_s(),
            _ => self.phase_s(period_s),
        }
    }

    /// Lets the next motion follow without a rest; gives it back if it is too late for that.
    pub(super) fn attach(
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
    pub(super) fn detach(&mut self, speed: &Speed<'_>, period_s: f64) -> Option<Waiting> {
        let committed_s = self.committed_s(period_s);
        self.course.exit.as_ref().filter(|exit| committed_s <= exit.leave_s)?;
        let exit = self.course.exit.take()?;
        self.cap = speed.cap(&self.course.leg);
        self.refit();
        Some(exit.next)
    }

    /// The motion after this one, on the way into which the path is now, and what this one leaves.
    pub(super) fn go_over(self, speed: &Speed<'_>) -> Option<(Waiting, Self, Course)> {
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
    pub(super) fn give_way(
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

    pub(super) fn next(
        &mut self,
        tick: &Tick<'_>,
        held: &MotionState,
        limits: &MotionLimits,
    ) -> Next {
        let (now, period) = (tick.now, tick.params.period);
        match &mut self.pace {
            Pace::Before => match self.before_start(now, period, held, limits) {
                Some(next) => next,
                None => self.begin(limits),
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

    /// Clock zero.
    fn begin(&mut self, limits: &MotionLimits) -> Next {
        if self.rate_asked() == 1.0 {
            self.pace = Pace::Ticks(0);
            return self.sampled(0, 1.0);
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

    fn sampled(&mut self, clock: u64, period_s: f64) -> Next {
        let trajectory = &self.course.leg.trajectory;
        let last = whole_ticks(trajectory.duration_s(), period_s);
        // Exactly the end, not where rounding of the clock has it.
        let ended = clock > 0 && clock >= last;
        let time_s = if ended { trajectory.duration_s() } else { clock as f64 * period_s };
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

    /// What is to be done before clock zero, unless that is now.
    fn before_start(
        &mut self,
        now: MonoTime,
        period: Duration,
        held: &MotionState,
        limits: &MotionLimits,
    ) -> Option<Next> {
        if let Opening::Unplanned(share) = self.opening {
            let first = self.course.leg.trajectory.start();
            match LeadIn::plan(&held.position, &first, share, limits, period) {
                Ok(lead_in) => self.opening = Opening::Planned(lead_in),
                Err(refusal) => return Some(Next::Failed(refusal)),
            }
        }
        let under_way = self.is_under_way();
        let Opening::Planned(lead_in) = &mut self.opening else { return None };
        if !under_way {
            let lead = lead_in.as_ref().map_or(Duration::ZERO, |lead_in| lead_in.lead(period));
            if self.start.is_some_and(|start| now + lead + period / 2 < start) {
                return Some(Next::Waiting);
            }
        }
        if let Some(state) = lead_in.as_mut().and_then(|lead_in| lead_in.next(period)) {
            return Some(Next::Approaching(state));
        }
        let missed = self.start.and_then(|start| check_in_time(start, now, self.patience).err());
        missed.map(|late_s| Next::Failed(Refusal::StartMissed { late_s }))
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
            let at_s = clock as f64 * period_s;
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

    /// The course has changed beyond what is committed.
    fn refit(&mut self) {
        if let Pace::Path(path) = &mut self.pace {
            let phase_s = path.phase_s();
            // Never refused: as many joints as before.
            let _ = path.go_over(&self.course, phase_s);
        }
    }
}

impl Leg {
    fn waypoint_at(&self, phase_s: f64, hint: &mut usize) -> usize {
        self.trajectory.waypoint_at(self.clock_s(phase_s), hint)
    }
}

/// How late a start may be: those ahead of it wait, if it has partners.
fn patience(order: &FollowOrder, period: Duration) -> Duration {
    let apart_s = order.group.map_or(0.0, |group| group.max_divergence_s);
    Duration::try_from_secs_f64(apart_s).unwrap_or_default().max(period)
}

/// How late \[s\] a start at `now` would be for `start`, if that is too late.
fn check_in_time(start: MonoTime, now: MonoTime, patience: Duration) -> Result<(), f64> {
    let late = now.saturating_since(start);
    if late > patience { Err(late.as_secs_f64()) } else { Ok(()) }
}

pub(super) fn check_near(
    first: &JointVector,
    actual: &JointVector,
    limits: &JointVector,
) -> Result<(), Refusal> {
    let joints = first.iter().zip(actual.iter()).zip(limits.iter());
    for (joint, ((first, actual), &limit)) in joints.enumerate() {
        let value = (first - actual).abs();
        if value > limit {
            return Err(Refusal::StartTolerance { joint, value, limit });
        }
    }
    Ok(())
}

/// Refuses a trajectory that does not suit the robot.
pub(super) fn check_suits(
    order: &FollowOrder,
    params: &Params,
    measures_velocity: bool,
) -> Result<(), Refusal> {
    let (given, expected) = (order.trajectory.joint_count(), params.limits.len());
    if given != expected {
        return Err(Refusal::WrongLength { given, expected });
    }
    if order.trajectory.has_velocity_tolerance() && !measures_velocity {
        return Err(Refusal::NotSupported("measured speeds, which velocity_tolerance needs"));
    }
    Ok(())
}
