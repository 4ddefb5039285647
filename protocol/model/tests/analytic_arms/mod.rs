//! Arms to test closed-form inverse kinematics with: real ones, and invented ones written as URDF.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
#![allow(non_snake_case, reason = "X_BT is the pose of the tip T in the base B")]
#![allow(dead_code, reason = "each test binary uses a part of this module")]

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

use armada_model::RobotModel;
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};

/// A robot with the links of an arm in it.
pub(crate) struct Subject {
    pub(crate) name: String,
    pub(crate) model: RobotModel,
    pub(crate) base: usize,
    pub(crate) tip: usize,
    /// The arm's joints in the robot's position vector.
    pub(crate) variables: Vec<usize>,
}

impl Subject {
    pub(crate) fn new(model: RobotModel, base: &str, tip: &str, variables: &[usize]) -> Self {
        let index = |link| model.link_index(link).unwrap_or_else(|| panic!("no {link}"));
        Self {
            name: format!("{} {tip}", model.name()),
            base: index(base),
            tip: index(tip),
            variables: variables.to_vec(),
            model,
        }
    }

    /// Pose of the tip in the base; the robot's other joints stand somewhere.
    pub(crate) fn pose(&self, q: &[f64]) -> Isometry3<f64> {
        let mut positions = vec![0.2; self.model.variable_count()];
        for (&variable, &value) in self.variables.iter().zip(q) {
            positions[variable] = value;
        }
        let X_RT = self.model.link_pose(&positions, self.tip).expect("positions fit");
        self.model.link_pose(&positions, self.base).expect("positions fit").inverse() * X_RT
    }

    /// By how much joints at `q` miss `target`: the larger of \[m\] and \[rad\].
    pub(crate) fn error(&self, q: &[f64], target: &Isometry3<f64>) -> f64 {
        let X_BT = self.pose(q);
        let turn = 2.0 * (target.rotation * X_BT.rotation.inverse()).imag().norm();
        (X_BT.translation.vector - target.translation.vector).norm().max(turn)
    }
}

/// Largest difference of two angles, whole turns apart \[rad\].
pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    let wrapped = |angle: f64| angle - TAU * (angle / TAU).round();
    a.iter().zip(b).map(|(a, b)| wrapped(a - b).abs()).fold(0.0, f64::max)
}

/// Runs `check` on random values.
pub(crate) fn for_random<S: Strategy>(
    cases: u32,
    strategy: S,
    check: impl Fn(S::Value) -> Result<(), TestCaseError>,
) {
    let rng_seed = RngSeed::Fixed(20_261_122);
    let config =
        ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() };
    let result = TestRunner::new(config).run(&strategy, check);
    result.unwrap_or_else(|error| panic!("{error}"));
}

/// Positions of `N` joints within half a turn of zero.
pub(crate) fn angles<const N: usize>() -> impl Strategy<Value = [f64; N]> {
    prop::array::uniform(-PI..PI)
}

pub(crate) fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

pub(crate) fn pose(size: f64) -> impl Strategy<Value = Isometry3<f64>> {
    (vector(size), vector(1.5)).prop_map(|(shift, turn)| Isometry3::new(shift, turn))
}

/// The axes of an invented arm: direction and point, and the tip, at position zero.
#[derive(Clone, Debug)]
pub(crate) struct Axes {
    pub(crate) lines: Vec<(Vector3<f64>, Vector3<f64>)>,
    pub(crate) tip: Isometry3<f64>,
}

/// How an invented arm is described: what must not matter.
#[derive(Clone, Debug)]
pub(crate) struct Convention {
    /// Base in the world.
    pub(crate) mount: Isometry3<f64>,
    /// Where the joints are when they are said to be at zero.
    pub(crate) offsets: [f64; 7],
    /// Sign of each axis.
    pub(crate) signs: [bool; 7],
    /// Orientation of each link's frame, and its shift along the axis.
    pub(crate) frames: [(Vector3<f64>, f64); 7],
    /// Tip in the flange.
    pub(crate) tool: Isometry3<f64>,
}

impl Convention {
    /// Frames along the base, nothing shifted.
    pub(crate) fn plain() -> Self {
        Self {
            mount: Isometry3::identity(),
            offsets: [0.0; 7],
            signs: [true; 7],
            frames: [(Vector3::zeros(), 0.0); 7],
            tool: Isometry3::identity(),
        }
    }

    pub(crate) fn any() -> impl Strategy<Value = Self> {
        let frame = || (vector(1.5), -0.5..0.5);
        let frames = prop::array::uniform7(frame());
        (pose(1.0), angles::<7>(), prop::array::uniform7(any::<bool>()), frames, pose(0.3))
            .prop_map(|(mount, offsets, signs, frames, tool)| Self {
                mount,
                offsets,
                signs,
                frames,
                tool,
            })
    }
}

impl Axes {
    /// An arm with ortho-parallel basis and spherical wrist: a1, a2, b, c1, c2, c3, c4 \[m\].
    ///
    /// Source: Brandstötter, Angerer, Hofbaur, "An Analytical Solution of the Inverse Kinematics
    /// Problem of Industrial Serial Manipulators with an Ortho-parallel Basis and a Spherical
    /// Wrist", 2014.
    pub(crate) fn ortho_parallel([a1, a2, b, c1, c2, c3, c4]: [f64; 7]) -> Self {
        let wrist = Vector3::new(a1 + a2, b, c1 + c2 + c3);
        let (y, z) = (Vector3::y(), Vector3::z());
        Self {
            lines: vec![
                (z, Vector3::zeros()),
                (y, Vector3::new(a1, 0.0, c1)),
                (y, Vector3::new(a1, 0.0, c1 + c2)),
                (z, wrist),
                (y, wrist),
                (z, wrist),
            ],
            tip: Isometry3::translation(wrist.x, wrist.y, wrist.z + c4),
        }
    }

    /// An arm as those of Universal Robots: d1, a2, a3, d4, d5, d6 \[m\], stretched along x.
    pub(crate) fn three_parallel([d1, a2, a3, d4, d5, d6]: [f64; 6]) -> Self {
        let (y, z) = (Vector3::y(), Vector3::z());
        let wrist = Vector3::new(a2 + a3, d4, d1 - d5);
        Self {
            lines: vec![
                (z, Vector3::zeros()),
                (y, Vector3::new(0.0, 0.0, d1)),
                (y, Vector3::new(a2, 0.0, d1)),
                (y, Vector3::new(a2 + a3, 0.0, d1)),
                (-z, wrist),
                (y, wrist),
            ],
            tip: Isometry3::translation(wrist.x, wrist.y + d6, wrist.z),
        }
    }

    /// An arm with spherical shoulder and wrist, upright: to the shoulder, to the elbow, to the
    /// wrist, to the flange, and the elbow's offset forth and back \[m\].
    pub(crate) fn seven([d1, d3, d5, d7, a4]: [f64; 5]) -> Self {
        let (y, z) = (Vector3::y(), Vector3::z());
        let (shoulder, elbow) = (z * d1, Vector3::new(a4, 0.0, d1 + d3));
        let wrist = z * (d1 + d3 + d5);
        Self {
            lines: vec![
                (z, shoulder),
                (y, shoulder),
                (z, shoulder),
                (-y, elbow),
                (z, wrist),
                (y, wrist),
                (z, wrist),
            ],
            tip: Isometry3::translation(0.0, 0.0, wrist.z + d7),
        }
    }

    /// The arm as a URDF with links `base`, `link1` and so on, and `tool`; joints `joint1` and so on.
    pub(crate) fn model(&self, convention: &Convention) -> RobotModel {
        let mut moved = Isometry3::identity();
        let mut text = String::from("<robot name=\"arm\"><link name=\"world\"/>");
        write_link(&mut text, "base", "fixed", "world", &convention.mount, &Vector3::x());
        let (mut parent, mut X_BP) = ("base".to_owned(), Isometry3::identity());
        for (index, (direction, point)) in self.lines.iter().enumerate() {
            let (turn, shift) = convention.frames[index];
            let place = moved * Isometry3::new(point + direction * shift, turn);
            let axis = place.rotation.inverse() * (moved * direction);
            let axis = if convention.signs[index] { axis } else { -axis };
            let link = format!("link{}", index + 1);
            write_link(&mut text, &link, "revolute", &parent, &(X_BP.inverse() * place), &axis);
            (parent, X_BP) = (link, place);
            let by = UnitQuaternion::from_axis_angle(
                &Unit::new_normalize(*direction),
                convention.offsets[index],
            );
            moved *= Translation3::from(*point) * by * Translation3::from(-point);
        }
        let place = moved * self.tip * convention.tool;
        write_link(&mut text, "tool", "fixed", &parent, &(X_BP.inverse() * place), &Vector3::x());
        text.push_str("</robot>");
        RobotModel::from_urdf(&text, "arm").unwrap_or_else(|error| panic!("{error}"))
    }
}

fn write_link(
    text: &mut String,
    link: &str,
    kind: &str,
    parent: &str,
    origin: &Isometry3<f64>,
    axis: &Vector3<f64>,
) {
    let (p, (roll, pitch, yaw)) = (origin.translation.vector, origin.rotation.euler_angles());
    let joint = link.replace("link", "joint");
    write!(
        text,
        "<link name=\"{link}\"/><joint name=\"{joint}\" type=\"{kind}\">\
         <parent link=\"{parent}\"/><child link=\"{link}\"/>\
         <origin xyz=\"{} {} {}\" rpy=\"{roll} {pitch} {yaw}\"/><axis xyz=\"{} {} {}\"/>\
         <limit lower=\"-3.2\" upper=\"3.2\" velocity=\"1\" effort=\"1\"/></joint>",
        p.x, p.y, p.z, axis.x, axis.y, axis.z
    )
    .expect("a string takes text");
}
