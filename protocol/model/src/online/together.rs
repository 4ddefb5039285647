//! One step of several joints towards wanted velocities, as one body.

use arrayvec::ArrayVec;

use super::axis::{AxisMotion, AxisPoint};
use super::request::OnlineState;
use crate::{AxisLimits, JointVector, MAX_JOINTS, MotionLimits};

/// Room before a position limit that counts as none \[rad or m\]: rounding, no more.
const NO_ROOM: f64 = 1e-9;

/// Halvings of the velocities with which all joints can just still stop before a position limit.
/// Coarse: what is left is used up in the next steps.
const SPEED_HALVINGS: u32 = 10;

/// Halvings of the share of its limits with which a joint takes the time that all joints take.
const SHARE_HALVINGS: u32 = 24;

/// A joint of the body, with limits whose jerk is reached in the same time by all.
#[derive(Clone, Copy)]
struct Member {
    joint: usize,
    point: AxisPoint,
    limits: AxisLimits,
    /// Highest jerk of the joint by itself \[1/s³\].
    jerk: f64,
    wanted: f64,
}

type Body = ArrayVec<Member, MAX_JOINTS>;

impl OnlineState {
    /// The state `dt_s` \[s\] later, `joints` on their way to the velocities `wanted` \[1/s\] of them
    /// together: they arrive at the same time, so from rest they move in proportion. The other
    /// joints stay as they are.
    ///
    /// As [`toward_velocity`](Self::toward_velocity), but what limits one joint holds up all:
    /// where one is wanted above its velocity limit all are wanted slower, and where one can only
    /// just stop before its position limit all slow down, and rest as long as the velocity points
    /// there.
    ///
    /// Allocates nothing.
    #[must_use]
    pub fn toward_velocity_together(
        &self,
        wanted: &JointVector,
        joints: &[usize],
        limits: &MotionLimits,
        dt_s: f64,
    ) -> Self {
        let body = self.body(wanted, joints, limits);
        let next = steer(&body, dt_s);
        Self::from_axes(self.position.len(), |joint| {
            let found = body.iter().zip(&next).find(|(member, _)| member.joint == joint);
            found.map_or_else(|| self.axis(joint), |(_, point)| *point)
        })
    }

    fn body(&self, wanted: &JointVector, joints: &[usize], limits: &MotionLimits) -> Body {
        let known = joints.iter().filter(|&&joint| joint < self.position.len());
        let mut body: Body = known
            .filter_map(|&joint| {
                let wanted = wanted.get(joint).copied().unwrap_or(0.0);
                let limits = *limits.get(joint)?;
                Some(Member { joint, point: self.axis(joint), limits, jerk: limits.jerk, wanted })
            })
            .take(MAX_JOINTS)
            .collect();
        let finite = body.iter().all(|member| member.wanted.is_finite());
        let excess = body.iter().map(|member| member.wanted.abs() / member.limits.velocity);
        let scale = if finite { 1.0 / excess.fold(1.0, f64::max) } else { 0.0 };
        // The slowest to reach its acceleration sets the shape for all.
        let jerk_s = body.iter().map(|member| member.limits.acceleration / member.limits.jerk);
        let jerk_s = jerk_s.fold(0.0, f64::max);
        for member in &mut body {
            member.limits.jerk = member.limits.acceleration / jerk_s;
            member.wanted = if finite { member.wanted * scale } else { 0.0 };
        }
        body
    }
}

/// Where the joints are `dt_s` later.
fn steer(body: &Body, dt_s: f64) -> ArrayVec<AxisPoint, MAX_JOINTS> {
    let full = step(body, 1.0, dt_s);
    if excess(body, &full) <= 0.0 {
        return full;
    }
    let mut best = step(body, 0.0, dt_s);
    for (member, point) in body.iter().zip(best.iter_mut()) {
        // By itself a joint can stop in less room.
        if member.own_excess(*point) > NO_ROOM {
            *point = member.point.toward_velocity(0.0, &member.own_limits(), dt_s);
        }
    }
    let here: ArrayVec<_, MAX_JOINTS> = body.iter().map(|member| member.point).collect();
    if excess(body, &here) > -NO_ROOM {
        return best;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..SPEED_HALVINGS {
        let middle = 0.5 * (low + high);
        let points = step(body, middle, dt_s);
        if excess(body, &points) <= 0.0 {
            (low, best) = (middle, points);
        } else {
            high = middle;
        }
    }
    best
}

/// Where the joints are `dt_s` later on their way to `scale` times the velocities wanted.
fn step(body: &Body, scale: f64, dt_s: f64) -> ArrayVec<AxisPoint, MAX_JOINTS> {
    let way = |member: &Member| (member.point, scale * member.wanted);
    let time_s = common_time(body.iter().map(|member| (member, way(member))));
    body.iter()
        .map(|member| {
            let (point, velocity) = way(member);
            let limits = member.slowed(point, velocity, time_s);
            AxisMotion::to_velocity(point, velocity, &limits).after(dt_s)
        })
        .collect()
}

/// How far the joint that goes furthest out of its position limits does so, when all stop from
/// `points`, together and each by itself.
fn excess(body: &Body, points: &[AxisPoint]) -> f64 {
    let members = || body.iter().zip(points.iter());
    let time_s = common_time(members().map(|(member, point)| (member, (*point, 0.0))));
    members()
        .map(|(member, point)| {
            let limits = member.slowed(*point, 0.0, time_s);
            member.excess(&AxisMotion::stop(*point, &limits)).max(member.own_excess(*point))
        })
        .fold(f64::NEG_INFINITY, f64::max)
}

/// The time of the joint that needs the longest to its velocity.
fn common_time<'a>(ways: impl Iterator<Item = (&'a Member, (AxisPoint, f64))>) -> f64 {
    ways.map(|(member, (point, velocity))| {
        AxisMotion::time_to_velocity(point, velocity, &member.limits)
    })
    .fold(0.0, f64::max)
}

impl Member {
    /// The limits with which the joint takes `time_s` from `point` to `velocity`; higher ones where
    /// its acceleration would bring it above its velocity limit by then.
    fn slowed(&self, point: AxisPoint, velocity: f64, time_s: f64) -> AxisLimits {
        let limits = |share: f64| AxisLimits {
            acceleration: share.min(1.0) * self.limits.acceleration,
            jerk: (share * self.limits.jerk).min(self.jerk),
            ..self.limits
        };
        let AxisPoint { velocity: v, acceleration: a, .. } = point;
        let room = self.limits.velocity - v * a.signum();
        // Until it is zero, an acceleration adds a² / 2J.
        let least = if a == 0.0 { 0.0 } else { a * a / (2.0 * self.limits.jerk * room.max(0.0)) };
        if least >= 1.0 {
            return limits(least);
        }
        let (mut low, mut high) = (least, 1.0);
        for _ in 0..SHARE_HALVINGS {
            let middle = 0.5 * (low + high);
            if AxisMotion::time_to_velocity(point, velocity, &limits(middle)) <= time_s {
                high = middle;
            } else {
                low = middle;
            }
        }
        limits(high)
    }

    /// The limits of the joint by itself.
    fn own_limits(&self) -> AxisLimits {
        AxisLimits { jerk: self.jerk, ..self.limits }
    }

    fn own_excess(&self, point: AxisPoint) -> f64 {
        self.excess(&AxisMotion::stop(point, &self.own_limits()))
    }

    fn excess(&self, motion: &AxisMotion) -> f64 {
        self.limits.excess(motion.position_range(), self.point.position)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;
    use crate::JointLimits;

    const PERIOD_S: f64 = 0.002;

    fn limits() -> MotionLimits {
        let joint = |velocity, acceleration, jerk| JointLimits {
            lower: Some(-1.0),
            upper: Some(2.0),
            velocity,
            acceleration: Some(acceleration),
            jerk: Some(jerk),
            effort: None,
        };
        let joints = [joint(1.5, 4.0, 80.0), joint(1.0, 6.0, 40.0), joint(2.0, 3.0, 100.0)];
        MotionLimits::new(&joints).expect("complete limits")
    }

    fn vector(values: [f64; 3]) -> JointVector {
        JointVector::from_slice(&values).expect("finite")
    }

    fn follow(start: [f64; 3], orders: &[([f64; 3], usize)]) -> Vec<OnlineState> {
        let mut states = vec![OnlineState::at_rest(vector(start))];
        for &(speed, ticks) in orders {
            for _ in 0..ticks {
                let last = states[states.len() - 1];
                let wanted = vector(speed);
                let next = last.toward_velocity_together(&wanted, &[0, 1, 2], &limits(), PERIOD_S);
                states.push(next);
            }
        }
        states
    }

    /// Sine of the angle between two vectors.
    fn sine(a: &[f64], b: &[f64]) -> f64 {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        (1.0 - dot(a, b).powi(2) / (dot(a, a) * dot(b, b))).max(0.0).sqrt()
    }

    #[test]
    fn from_rest_and_to_rest_the_joints_move_in_proportion() {
        let wanted = [0.9, -0.4, 0.05];
        let states = follow([0.0; 3], &[(wanted, 200), ([0.0; 3], 400)]);
        for state in &states[1..500] {
            if state.velocity[0].abs() > 1e-3 {
                assert!(sine(&state.velocity, &wanted) < 1e-4, "{state:?}");
            }
        }
        assert_eq!(states[200].velocity, vector(wanted));
        assert!(states[states.len() - 1].is_at_rest());
    }

    #[test]
    fn one_joint_above_its_velocity_limit_slows_all() {
        let states = follow([0.0; 3], &[([3.0, 0.6, -0.3], 300)]);
        let reached = states[300].velocity;
        assert!(reached.max_abs_difference(&vector([1.5, 0.3, -0.15])) < 1e-12, "{reached:?}");
    }

    #[test]
    fn one_joint_at_its_position_limit_holds_all_on_their_line_until_it_may_go_back() {
        let wanted = [1.0, -0.2, 0.1];
        let states = follow([1.0, 0.0, 0.0], &[(wanted, 2000), ([-0.5, 0.1, 0.1], 200)]);
        let there = states[2000];
        assert!(there.is_at_rest() && (there.position[0] - 2.0).abs() < 1e-6, "{there:?}");
        let way = there.position.map_indexed(|joint, x| x - states[0].position[joint]);
        assert!(sine(&way, &wanted) < 1e-4, "{way:?}");
        assert!(states[states.len() - 1].position[0] < 1.9);
    }

    #[test]
    fn joints_that_are_not_named_stay() {
        let start = OnlineState::at_rest(vector([0.1, 0.2, 0.3]));
        let next = start.toward_velocity_together(&vector([1.0; 3]), &[2, 7], &limits(), 0.1);
        assert_eq!(next.position[..2], [0.1, 0.2]);
        assert!(next.position[2] > 0.3);
    }

    #[test]
    fn one_value_that_is_no_velocity_brakes_all() {
        let moving = follow([0.0; 3], &[([0.5; 3], 300)])[300];
        let braked = |wanted: JointVector| {
            moving.toward_velocity_together(&wanted, &[0, 1, 2], &limits(), PERIOD_S)
        };
        let wrong = vector([0.5; 3]).map_indexed(|joint, x| if joint == 1 { f64::NAN } else { x });
        assert_eq!(braked(wrong), braked(vector([0.0; 3])));
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(32),
            failure_persistence: None,
            ..ProptestConfig::with_cases(60)
        })]

        #[test]
        fn whatever_is_wanted_all_limits_hold_in_differences(
            start in prop::array::uniform3(-1.0..2.0f64),
            orders in prop::collection::vec(
                (prop::array::uniform3(-2.0..2.0f64), 1..300usize), 1..8),
        ) {
            let states = follow(start, &orders);
            let limits = limits();
            for (joint, axis) in limits.iter().enumerate() {
                let x: Vec<f64> = states.iter().map(|state| state.position[joint]).collect();
                let slopes = |values: &[f64]| -> Vec<f64> {
                    values.windows(2).map(|pair| (pair[1] - pair[0]) / PERIOD_S).collect()
                };
                let peak = |values: &[f64]| values.iter().fold(0.0, |p: f64, v| p.max(v.abs()));
                let (low, high) = (axis.lower - 1e-8, axis.upper + 1e-8);
                prop_assert!(x.iter().all(|x| (low..=high).contains(x)));
                let v = slopes(&x);
                prop_assert!(peak(&v) <= axis.velocity * (1.0 + 1e-9));
                let a = slopes(&v);
                prop_assert!(peak(&a) <= axis.acceleration * (1.0 + 1e-6));
                prop_assert!(peak(&slopes(&a)) <= axis.jerk * (1.0 + 1e-3));
            }
        }
    }
}
