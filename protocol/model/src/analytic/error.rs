//! Why there is no closed form, or no answer.

use arrayvec::ArrayVec;

use super::branch::{Configuration, MAX_BRANCHES};

/// Why an arm has no closed form here.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AnalyticError {
    /// No link has that name.
    #[error("there is no link {link}")]
    UnknownLink {
        /// The name.
        link: String,
    },
    /// The tip does not hang on the base, nor on a link that the base is fixed to.
    #[error("link {tip} is not carried by link {base}")]
    NotAChain {
        /// Name of the base link.
        base: String,
        /// Name of the tip link.
        tip: String,
    },
    /// A joint on the way follows another joint.
    #[error("joint {joint} mimics another, but each joint of the arm must be driven")]
    JointMimics {
        /// Name of the joint.
        joint: String,
    },
    /// A joint on the way slides.
    #[error("joint {joint} slides, but each joint of the arm must turn")]
    JointSlides {
        /// Name of the joint.
        joint: String,
    },
    /// The chain has too few or too many joints.
    #[error("{given} joints move between base and tip, expected {expected}")]
    JointCount {
        /// Number of joints that have a closed form.
        expected: usize,
        /// Number of joints between base and tip.
        given: usize,
    },
    /// The limits given do not fit the arm.
    #[error("limits of {given} joints, but the arm has {expected}")]
    LimitCount {
        /// Number of the arm's joints.
        expected: usize,
        /// Number of limits.
        given: usize,
    },
    /// The six axes stand neither as a UR's nor as those of an arm with a spherical wrist.
    #[error(
        "not an arm with three parallel axes: {three_parallel}; \
         nor one with a spherical wrist: {spherical_wrist}"
    )]
    SixAxes {
        /// What an arm with axes 2, 3 and 4 parallel would need.
        three_parallel: Box<Mismatch>,
        /// What an arm with a spherical wrist would need.
        spherical_wrist: Box<Mismatch>,
    },
    /// The seven axes do not form a spherical shoulder, an elbow and a spherical wrist.
    #[error("not an arm with spherical shoulder and wrist: {mismatch}")]
    SevenAxes {
        /// What is missing.
        mismatch: Box<Mismatch>,
    },
}

/// The geometric condition that an arm does not meet; the joints are named.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Mismatch {
    /// Two axes should be parallel.
    #[error("axes of {first} and {second} are {angle_rad} rad from parallel")]
    AxesNotParallel {
        /// Name of the first joint.
        first: String,
        /// Name of the second joint.
        second: String,
        /// Angle between the axes \[rad\], at most π/2.
        angle_rad: f64,
    },
    /// Two axes should not be parallel.
    #[error("axes of {first} and {second} are only {angle_rad} rad from parallel")]
    AxesParallel {
        /// Name of the first joint.
        first: String,
        /// Name of the second joint.
        second: String,
        /// Angle between the axes \[rad\], at most π/2.
        angle_rad: f64,
    },
    /// Axes should meet in one point.
    #[error("axes of {first} to {last} miss their common point, {joint} most, by {offset_m} m")]
    AxesDoNotMeet {
        /// Name of the first joint whose axis should.
        first: String,
        /// Name of the last joint whose axis should.
        last: String,
        /// Name of the joint whose axis is farthest from the point nearest to all.
        joint: String,
        /// Its distance \[m\].
        offset_m: f64,
    },
    /// An upper arm or a forearm has no length across the elbow's axis.
    #[error("{length_m} m between the axes of {first} and {second} are too short for an elbow")]
    TooShort {
        /// Name of the joint at one end.
        first: String,
        /// Name of the joint at the other end.
        second: String,
        /// Distance \[m\].
        length_m: f64,
    },
}

/// A joint that cannot be where a posture needs it.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("joint {joint}: {value_rad} rad is beyond the limit {limit_rad} rad")]
pub struct BeyondLimit {
    /// The joint's place in the arm, from zero.
    pub joint: usize,
    /// The value that comes nearest to the limits, whole turns included \[rad\].
    pub value_rad: f64,
    /// The limit that it passes \[rad\].
    pub limit_rad: f64,
}

/// Why no posture could be selected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(clippy::large_enum_variant, reason = "on the stack: selecting must not allocate")]
pub enum BranchError {
    /// The reference position does not fit the arm.
    #[error("a reference of {given} joints, but the arm has {expected}")]
    ReferenceLength {
        /// Number of the arm's joints.
        expected: usize,
        /// Length of the reference.
        given: usize,
    },
    /// The weights do not fit the arm.
    #[error("weights of {given} joints, but the arm has {expected}")]
    WeightLength {
        /// Number of the arm's joints.
        expected: usize,
        /// Number of weights.
        given: usize,
    },
    /// The target, the arm angle or the reference is infinite or not a number.
    #[error("the {field} is not finite")]
    NotFinite {
        /// Which of them.
        field: &'static str,
    },
    /// No posture reaches the pose.
    #[error("the pose is out of reach by {excess_m} m")]
    OutOfReach {
        /// By how much, as [`Branches::out_of_reach_m`](super::Branches::out_of_reach_m).
        excess_m: f64,
    },
    /// Postures reach the pose, but each needs a joint beyond its limits.
    #[error("each of {} postures is beyond the limits, the first by: {}", .beyond.len(), First(.beyond))]
    BeyondLimits {
        /// Each posture with the first joint that is beyond.
        beyond: ArrayVec<(Configuration, BeyondLimit), MAX_BRANCHES>,
    },
    /// The posture wanted does not reach the pose.
    #[error("posture {wanted} does not reach the pose, {} do: {}", .available.len(), Names(.available))]
    NotAvailable {
        /// The posture wanted.
        wanted: Configuration,
        /// The postures that reach it.
        available: ArrayVec<Configuration, MAX_BRANCHES>,
    },
}

struct First<'a>(&'a [(Configuration, BeyondLimit)]);

impl std::fmt::Display for First<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.first().map_or(Ok(()), |(posture, beyond)| write!(f, "{posture}, {beyond}"))
    }
}

struct Names<'a>(&'a [Configuration]);

impl std::fmt::Display for Names<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (index, posture) in self.0.iter().enumerate() {
            write!(f, "{}{posture}", if index == 0 { "" } else { ", " })?;
        }
        Ok(())
    }
}
