//! What closed-form inverse kinematics answers.

use std::fmt;
use std::ops::Deref;

use arrayvec::ArrayVec;

use crate::JointVector;

/// Most postures in which an arm reaches one pose.
pub const MAX_BRANCHES: usize = 8;

/// On which side of its first axis an arm works.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shoulder {
    /// The wrist is where a positive turn of joint 2 leans the upright arm.
    ///
    /// That is along (axis of joint 2) × (axis of joint 1). Of a seven-axis arm: joint 2 is turned
    /// positively from where axes 1 and 3 are parallel.
    Front,
    /// The wrist is on the other side: the arm reaches back over its shoulder.
    Back,
}

/// To which side an elbow is bent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Elbow {
    /// Above the line from shoulder to wrist, where "up" is along the axis of joint 1.
    ///
    /// Of a seven-axis arm, whose elbow may be anywhere around that line: bent by a positive turn
    /// of joint 4.
    Up,
    /// To the other side.
    Down,
}

/// How the last three axes stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wrist {
    /// The wrist's second joint is turned positively from where its neighbours are parallel and
    /// alike in direction at the model's zero position or half a turn from it.
    NoFlip,
    /// It is turned negatively.
    Flip,
}

/// Which of the postures for one pose: the same letters in two poses mean that the arm can go from
/// one to the other without passing a singularity, within a region around them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Configuration {
    /// Side of the shoulder.
    pub shoulder: Shoulder,
    /// Bend of the elbow.
    pub elbow: Elbow,
    /// Turn of the wrist.
    pub wrist: Wrist,
}

impl fmt::Display for Configuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shoulder = match self.shoulder {
            Shoulder::Front => "front",
            Shoulder::Back => "back",
        };
        let elbow = match self.elbow {
            Elbow::Up => "up",
            Elbow::Down => "down",
        };
        let wrist = match self.wrist {
            Wrist::NoFlip => "no-flip",
            Wrist::Flip => "flip",
        };
        write!(f, "{shoulder}-{elbow}-{wrist}")
    }
}

/// Where postures meet. There the letter of that part says nothing, and fewer branches exist.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Singularities {
    /// Front and back meet: the wrist is as near to axis 1 as the arm allows. If it is on the axis,
    /// joint 1 can be anything and keeps the reference's value. Of a seven-axis arm: axes 1 and 3
    /// are parallel and joint 1 keeps the reference's value.
    pub shoulder: bool,
    /// Up and down meet: the arm is stretched or folded.
    pub elbow: bool,
    /// Flip and no-flip meet: the wrist's outer axes are parallel. A joint keeps the reference's
    /// value: the first of a spherical wrist, joint 6 of an arm with three parallel axes, or the
    /// nearest that leaves the elbow within reach.
    pub wrist: bool,
}

impl Singularities {
    /// Whether there is any.
    #[must_use]
    pub const fn any(&self) -> bool {
        self.shoulder || self.elbow || self.wrist
    }
}

/// One posture in which an arm reaches a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Branch {
    /// Positions of the arm's joints in its order, each in [-π, π] \[rad\] until limits are applied.
    pub joint_position: JointVector,
    /// Which posture it is.
    pub configuration: Configuration,
    /// Where it meets others.
    pub singular: Singularities,
}

impl Branch {
    /// Whether it is the posture `wanted`, or may stand for it where postures meet.
    #[must_use]
    pub fn is(&self, wanted: &Configuration) -> bool {
        let own = &self.configuration;
        (self.singular.shoulder || own.shoulder == wanted.shoulder)
            && (self.singular.elbow || own.elbow == wanted.elbow)
            && (self.singular.wrist || own.wrist == wanted.wrist)
    }
}

/// All postures in which an arm reaches a pose, on the stack; a slice of [`Branch`].
#[derive(Clone, Debug, PartialEq)]
pub struct Branches {
    branches: ArrayVec<Branch, MAX_BRANCHES>,
    excess_m: f64,
}

impl Branches {
    pub(super) const fn none() -> Self {
        Self { branches: ArrayVec::new_const(), excess_m: f64::INFINITY }
    }

    /// How far the wrist is out of reach \[m\], if there is no posture.
    ///
    /// The least distance by which a posture failed: how much longer the arm, or how much further
    /// from axis 1 the wrist, would have to be. Infinite if the pose is not finite, or if it is not
    /// the distance that fails, as with a wrist that cannot turn everywhere.
    #[must_use]
    pub fn out_of_reach_m(&self) -> Option<f64> {
        self.branches.is_empty().then_some(self.excess_m)
    }

    /// Adds `branch`, unless it is there.
    pub(super) fn add(&mut self, branch: Branch) {
        let same = |other: &&mut Branch| {
            let mut pairs = other.joint_position.iter().zip(branch.joint_position.iter());
            pairs.all(|(a, b)| super::wrapped(a - b).abs() < SAME_RAD)
        };
        if let Some(other) = self.branches.iter_mut().find(same) {
            other.singular.shoulder |= branch.singular.shoulder;
            other.singular.elbow |= branch.singular.elbow;
            other.singular.wrist |= branch.singular.wrist;
        } else {
            // Two shoulders, two elbows, two wrists: there is room.
            let _ = self.branches.try_push(branch);
        }
    }

    /// Notes that one posture fails by `excess_m`.
    pub(super) fn miss(&mut self, excess_m: f64) {
        self.excess_m = self.excess_m.min(excess_m);
    }
}

/// Postures that differ less than this in every joint \[rad\] are one.
const SAME_RAD: f64 = 1e-6;

impl Deref for Branches {
    type Target = [Branch];

    fn deref(&self) -> &[Branch] {
        &self.branches
    }
}
