//! The generator of the `rsruckig` crate; no other file names it.
//!
//! Its solvers for one joint are used, not its planner for many: they work for any number of joints
//! without heap, also when they fail, and tell which joint failed.
//!
//! Source: L. Berscheid, T. Kröger, Jerk-limited Real-time Trajectory Generation with Arbitrary
//! Target States, Robotics: Science and Systems 2021, sections III and IV.

use rsruckig::block::{Block, Interval};
use rsruckig::position_third_step1::PositionThirdOrderStep1;
use rsruckig::position_third_step2::PositionThirdOrderStep2;
use rsruckig::profile::Profile;

use super::axis::{AxisMotion, AxisPoint};
use super::generator::{AxisDurations, AxisRequest, OnlineGenerator};
use crate::MAX_JOINTS;

/// How near a duration must be to that of a known profile to take that one \[s\].
const SAME_DURATION_S: f64 = 1e-15;

/// How near to its target a stop has to end to be taken for the way there \[rad or m\].
const NEAR: f64 = 1e-9;

/// How much later than asked for it may end then \[s\].
const LATE_S: f64 = 1e-6;

/// How much lower limits are tried where a state has no profile under its own: by rounding, at the
/// border between two kinds of profile. A little off the border there is one.
const SHRINKS: [f64; 4] = [0.0, 1e-9, 1e-7, 1e-5];

/// Time-optimal profiles of up to seven phases of constant jerk, from any state to any state.
///
/// It holds the profiles of all joints between the two calls of a plan: some 30 kB.
#[derive(Debug)]
pub struct RuckigGenerator {
    solved: [Option<Solved>; MAX_JOINTS],
    blocks: [Block; MAX_JOINTS],
    solver: PositionThirdOrderStep1,
}

/// What a joint was asked for last, and how it gets there.
#[derive(Clone, Copy, Debug)]
enum Solved {
    Profile(AxisRequest),
    /// By its stop: it is so near that there is no profile for rounding.
    Stop(AxisRequest),
}

/// A clone begins empty: nothing that is kept outlives a plan.
impl Clone for RuckigGenerator {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Default for RuckigGenerator {
    fn default() -> Self {
        Self {
            solved: [None; MAX_JOINTS],
            blocks: std::array::from_fn(|_| Block::default()),
            solver: PositionThirdOrderStep1::default(),
        }
    }
}

impl OnlineGenerator for RuckigGenerator {
    fn durations(&mut self, joint: usize, request: &AxisRequest) -> Option<AxisDurations> {
        let block = self.blocks.get_mut(joint)?;
        let slot = self.solved.get_mut(joint)?;
        let found = SHRINKS
            .iter()
            .map(|&shrink| shrunk(request, shrink))
            .find(|request| solve(&mut self.solver, request, block) && block.t_min.is_finite());
        let Some(request) = found else {
            let stop = stop_there(request);
            *slot = stop.as_ref().map(|_| Solved::Stop(*request));
            return stop.map(|stop| AxisDurations { least_s: stop.rest_s(), gaps: [None; 2] });
        };
        *slot = Some(Solved::Profile(request));
        let gap = |interval: &Interval| (interval.left, interval.right);
        let gaps = [block.a.as_ref().map(gap), block.b.as_ref().map(gap)];
        Some(AxisDurations { least_s: block.t_min, gaps })
    }

    fn motion(&mut self, joint: usize, duration_s: f64) -> Option<AxisMotion> {
        let block = self.blocks.get(joint)?;
        let request = match self.solved.get(joint)?.as_ref()? {
            Solved::Profile(request) => request,
            Solved::Stop(request) => return stop_there(request),
        };
        let near = |t_s: f64| (duration_s - t_s).abs() <= SAME_DURATION_S;
        if near(block.t_min) {
            return taken(&block.p_min, request);
        }
        for gap in [&block.a, &block.b].into_iter().flatten() {
            if near(gap.right) {
                return taken(&gap.profile, request);
            }
        }
        let mut profile = block.p_min;
        let AxisRequest { to, limits, .. } = *request;
        let mut solver = PositionThirdOrderStep2::new(
            duration_s - profile.brake.duration,
            profile.p[0],
            profile.v[0],
            profile.a[0],
            to.position,
            to.velocity,
            to.acceleration,
            limits.velocity,
            -limits.velocity,
            limits.acceleration,
            -limits.acceleration,
            limits.jerk,
        );
        if solver.get_profile(&mut profile) {
            return taken(&profile, request);
        }
        stop_there(request).filter(|stop| stop.rest_s() <= duration_s + LATE_S)
    }
}

/// The stop, where it ends at the target but for rounding.
fn stop_there(request: &AxisRequest) -> Option<AxisMotion> {
    let stop = AxisMotion::stop(request.from, &request.limits);
    let distance = (stop.end().position - request.to.position).abs();
    (request.to.is_at_rest() && distance <= NEAR).then_some(stop)
}

/// `request` under limits that are lower by about this share, each by another.
fn shrunk(request: &AxisRequest, share: f64) -> AxisRequest {
    let AxisRequest { mut limits, .. } = *request;
    limits.velocity *= 1.0 - share;
    limits.acceleration *= 1.0 - 2.0 * share;
    limits.jerk *= 1.0 - 3.0 * share;
    AxisRequest { limits, ..*request }
}

/// Finds all extremal profiles for `request`: the fastest, and those at the ends of gaps.
fn solve(solver: &mut PositionThirdOrderStep1, request: &AxisRequest, block: &mut Block) -> bool {
    let profile = bring_inside(request);
    let AxisRequest { to, limits, .. } = request;
    solver.reset(
        profile.p[0],
        profile.v[0],
        profile.a[0],
        to.position,
        to.velocity,
        to.acceleration,
        limits.velocity,
        -limits.velocity,
        limits.acceleration,
        -limits.acceleration,
        limits.jerk,
    );
    solver.get_profile(&profile, block)
}

/// The boundary of a profile: the start, after what brings it inside the limits, and the target.
fn bring_inside(request: &AxisRequest) -> Profile {
    let AxisRequest { from, to, limits } = request;
    let mut profile = Profile::default();
    profile.brake.get_position_brake_trajectory(
        from.velocity,
        from.acceleration,
        limits.velocity,
        -limits.velocity,
        limits.acceleration,
        -limits.acceleration,
        limits.jerk,
    );
    profile.set_boundary(
        from.position,
        from.velocity,
        from.acceleration,
        to.position,
        to.velocity,
        to.acceleration,
    );
    let Profile { p, v, a, brake, .. } = &mut profile;
    brake.finalize(&mut p[0], &mut v[0], &mut a[0]);
    profile
}

/// The phases of `profile`, integrated anew so that they join without a gap.
fn taken(profile: &Profile, request: &AxisRequest) -> Option<AxisMotion> {
    let AxisPoint { position, velocity, acceleration } = request.from;
    let mut motion = AxisMotion::from_point(AxisPoint { position, velocity, acceleration });
    let brake = profile.brake.t.into_iter().zip(profile.brake.j);
    let way = profile.t.into_iter().zip(profile.j);
    let mut fits = true;
    if profile.brake.duration > 0.0 {
        for (length_s, jerk) in brake {
            fits &= motion.push(length_s, jerk);
        }
    }
    for (length_s, jerk) in way {
        fits &= motion.push(length_s, jerk);
    }
    fits.then_some(motion)
}
