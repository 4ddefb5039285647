//! Random trajectories: compiling agrees with dense sampling, and what it takes is legal.

use proptest::prelude::*;

use super::*;

const JOINTS: usize = 3;

/// How a random trajectory is interpolated, and which rows it has.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Spline,
    Hermite,
    Natural,
    Quintic,
    QuinticWithVelocities,
    QuinticWithAccelerations,
}

impl Kind {
    const ALL: [Self; 6] = [
        Self::Spline,
        Self::Hermite,
        Self::Natural,
        Self::Quintic,
        Self::QuinticWithVelocities,
        Self::QuinticWithAccelerations,
    ];

    const fn interpolation(self) -> Interpolation {
        match self {
            Self::Spline | Self::Hermite => Interpolation::CubicSpline,
            Self::Natural => Interpolation::CubicSplineNatural,
            Self::Quintic | Self::QuinticWithVelocities | Self::QuinticWithAccelerations => {
                Interpolation::QuinticHermite
            }
        }
    }

    const fn has_velocities(self) -> bool {
        !matches!(self, Self::Spline | Self::Natural | Self::Quintic)
    }

    const fn has_accelerations(self) -> bool {
        matches!(self, Self::QuinticWithAccelerations)
    }
}

/// Random spacings and rows of every kind.
fn random() -> impl Strategy<Value = JointTrajectory> {
    let row = || prop::array::uniform3(-2.0..2.0_f64);
    let rows = prop::collection::vec((0.05..1.0_f64, row(), row(), row()), 2..9);
    (rows, prop::sample::select(&Kind::ALL[..])).prop_map(|(rows, kind)| {
        let last = rows.len() - 1;
        let mut time_from_start_s = 0.0;
        let waypoints = rows.into_iter().enumerate().map(|(index, row)| {
            let (spacing, position, velocity, acceleration) = row;
            time_from_start_s += if index > 0 { spacing } else { 0.0 };
            let is_end = index == 0 || index == last;
            let velocity = if is_end { [0.0; JOINTS] } else { velocity };
            let given = |is_given: bool, row: [f64; JOINTS]| {
                if is_given { row.to_vec() } else { Vec::new() }
            };
            Waypoint {
                time_from_start_s,
                joint_position: position.to_vec(),
                joint_velocity: given(kind.has_velocities(), velocity),
                joint_acceleration: given(kind.has_accelerations(), acceleration),
                ..Waypoint::default()
            }
        });
        JointTrajectory {
            joint_names: names(JOINTS),
            waypoints: waypoints.collect(),
            interpolation: kind.interpolation(),
            ..JointTrajectory::default()
        }
    })
}

/// Compiles what may end in motion if it can do nothing else.
fn compile(
    asked: &JointTrajectory,
    limits: &MotionLimits,
) -> Result<CompiledTrajectory, TrajectoryError> {
    let is_natural = asked.interpolation == Interpolation::CubicSplineNatural;
    let options = if is_natural { IN_MOTION } else { TrajectoryOptions::default() };
    compile_with(asked, limits, &options)
}

fn anything_goes() -> MotionLimits {
    MotionLimits::new(&[joint_limits(1e6, 1e6, 1e9); JOINTS]).expect("complete limits")
}

/// The tightest limits that dense sampling of every segment finds, by differences of position.
fn brute_force(asked: &JointTrajectory) -> [AxisLimits; JOINTS] {
    const PIECES: u32 = 2000;
    let compiled = compile(asked, &anything_goes()).expect("only limits can refuse it");
    let mut found = [AxisLimits {
        lower: f64::INFINITY,
        upper: f64::NEG_INFINITY,
        velocity: 0.0,
        acceleration: 0.0,
        jerk: 0.0,
    }; JOINTS];
    for ends in asked.waypoints.windows(2) {
        let from = ends[0].time_from_start_s;
        let step = (ends[1].time_from_start_s - from) / f64::from(PIECES);
        // The last point belongs to the next segment, whose differences are others.
        let at = |piece: u32| compiled.sample(from + f64::from(piece) * step, &mut 0).position;
        let points: Vec<JointVector> = (0..PIECES).map(at).collect();
        for (joint, axis) in found.iter_mut().enumerate() {
            for x in points.windows(3).map(|points| [points[0], points[1], points[2]]) {
                let [a, b, c] = x.map(|point| point[joint]);
                axis.lower = axis.lower.min(a).min(c);
                axis.upper = axis.upper.max(a).max(c);
                axis.velocity = axis.velocity.max(((c - a) / (2.0 * step)).abs());
                axis.acceleration = axis.acceleration.max(((c - 2.0 * b + a) / step / step).abs());
            }
        }
    }
    found
}

/// `limits` wider (or narrower, below one) by a factor, positions about their middle.
fn scaled(limits: &[AxisLimits], factor: f64) -> Vec<AxisLimits> {
    let scale = |axis: &AxisLimits| {
        let middle = 0.5 * (axis.lower + axis.upper);
        AxisLimits {
            lower: middle + factor * (axis.lower - middle),
            upper: middle + factor * (axis.upper - middle),
            velocity: factor * axis.velocity,
            acceleration: factor * axis.acceleration,
            jerk: axis.jerk,
        }
    };
    limits.iter().map(scale).collect()
}

proptest! {
    #![proptest_config(seeded(64))]

    #[test]
    fn compiling_takes_what_dense_sampling_finds_legal(asked in random()) {
        let limits = limits_of(&scaled(&brute_force(&asked), 1.01));
        prop_assert!(compile(&asked, &limits).is_ok(), "{:?}", compile(&asked, &limits));
    }

    #[test]
    fn compiling_refuses_what_dense_sampling_finds_illegal(
        asked in random(),
        joint in 0..JOINTS,
        quantity in 0..4,
    ) {
        let found = brute_force(&asked);
        let (mut axes, tight) = (scaled(&found, 1.01), scaled(&found, 0.99));
        let expected = match quantity {
            0 => { axes[joint].lower = tight[joint].lower; LimitedQuantity::Position }
            1 => { axes[joint].upper = tight[joint].upper; LimitedQuantity::Position }
            2 => { axes[joint].velocity = tight[joint].velocity; LimitedQuantity::Velocity }
            _ => {
                axes[joint].acceleration = tight[joint].acceleration;
                LimitedQuantity::Acceleration
            }
        };
        match compile(&asked, &limits_of(&axes)) {
            Err(TrajectoryError::BeyondLimit { quantity, joint: name, time_s, segment, .. }) => {
                prop_assert_eq!(quantity, expected);
                prop_assert_eq!(&name, &names(JOINTS)[joint]);
                let times = [segment, segment + 1].map(|at| asked.waypoints[at].time_from_start_s);
                prop_assert!(times[0] <= time_s && time_s <= times[1]);
            }
            other => prop_assert!(false, "{expected} of joint {joint}: {other:?}"),
        }
    }

    #[test]
    fn every_kind_is_smooth_and_keeps_its_bounds(asked in random()) {
        let compiled = compile(&asked, &anything_goes()).expect("only limits can refuse it");
        assert_smooth(&compiled);
        let has_jumps = asked.interpolation == Interpolation::CubicSpline
            && !asked.waypoints[0].joint_velocity.is_empty();
        if !has_jumps {
            assert_acceleration_is_continuous(&compiled);
        }
    }

    #[test]
    fn set_points_at_any_period_and_phase_are_legal(
        asked in random(),
        period_s in 1e-3..0.05_f64,
        phase in 0.0..1.0_f64,
    ) {
        let limits = limits_of(&scaled(&brute_force(&asked), 1.01));
        let compiled = compile(&asked, &limits).expect("wider than dense sampling");
        // What ends in motion is for something else to go on with.
        prop_assume!(asked.interpolation != Interpolation::CubicSplineNatural);
        let ticks = (compiled.duration_s() / period_s) as u32 + 4;
        let mut hint = 0;
        let sent: Vec<JointVector> = (0..ticks)
            .map(|tick| (f64::from(tick) + phase - 2.0) * period_s)
            .map(|t_s| compiled.sample(t_s, &mut hint).position)
            .collect();
        prop_assert_eq!(sent[sent.len() - 1], compiled.end());
        assert_legal(&sent, period_s, &limits);
    }
}
