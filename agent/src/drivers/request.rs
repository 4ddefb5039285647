//! What a controller is asked to do besides following set-points, and what it reports of it.

use armada_model::{JointVector, MAX_JOINTS, Pose};
use arrayvec::ArrayVec;
use serde::{Deserialize, Serialize};

/// Most chains of which a controller may report the tip.
pub const MAX_REPORTED_TIPS: usize = 2;

/// Something a controller is asked to do besides moving to set-points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum DriverRequest {
    /// Switch the drives on.
    Enable,
    /// Switch the drives off.
    Disable,
    /// Clear errors whose cause is gone.
    ResetErrors,
    /// Search the references of these joints, at the same time.
    Home(JointSet),
    /// Make a move of its own; it replaces one in progress only if it connects to it.
    Move(DelegatedMove),
    /// Come to rest and forget moves of its own and homing.
    StopMotion,
    /// Come to rest on the path of the move in progress.
    PauseMotion,
    /// Go on with it.
    ResumeMotion,
    /// Make moves of its own at this share of their speed, 0.01 to 1.
    SetSpeedRatio(f64),
    /// Set a signal, by its index in the abilities.
    SetSignal {
        /// Which signal.
        signal: u8,
        /// Its values, as many as its size; 0 and 1 for off and on.
        values: Values<MAX_JOINTS>,
    },
    /// Set a parameter, by its index in the abilities.
    SetParameter {
        /// Which parameter.
        parameter: u8,
        /// Its value; 0 and 1 for off and on, a choice by its place.
        value: f64,
    },
    /// Take this load at the flange of a chain.
    SetLoad {
        /// Which chain, in the order of the robot file.
        chain: u8,
        /// Tool and payload together.
        load: LoadSetting,
    },
    /// Take this tool at the flange of a chain: poses of moves are those of its tool centre point.
    /// Without it they are those of the flange.
    SetTool {
        /// Which chain, in the order of the robot file.
        chain: u8,
        /// Pose of the tool centre point in the flange.
        tool: Pose,
    },
}

/// A move that the controller plans and executes itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DelegatedMove {
    /// Number of the move, rising within a run of the agent.
    pub number: u32,
    /// Where to, and on which way.
    pub goal: DelegatedGoal,
    /// Speed over the limits, above 0 to 1.
    pub speed: f64,
    /// How far from the goal the tool may leave the path for the next move \[m\].
    pub blend_radius_m: f64,
    /// Another move follows, to be planned together with this one.
    pub connect: bool,
}

/// Where a delegated move goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum DelegatedGoal {
    /// Joint positions \[rad or m\].
    Joint(JointVector),
    /// A pose of the tool centre point in the base link of a chain, on any way.
    Pose {
        /// Which chain, in the order of the robot file.
        chain: u8,
        /// The pose.
        pose: Pose,
    },
    /// A pose of the tool centre point in the base link of a chain, on a straight line.
    Linear {
        /// Which chain, in the order of the robot file.
        chain: u8,
        /// The pose.
        pose: Pose,
    },
}

/// What has become of a delegated move.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DelegatedReport {
    /// Number of the newest move that was taken.
    pub number: u32,
    /// Where it stands.
    pub status: DelegatedStatus,
    /// How much of the way is done, 0 to 1.
    pub progress: f64,
}

/// Where a delegated move stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum DelegatedStatus {
    /// Taken, and waiting for those that it is connected to.
    Waiting,
    /// In progress.
    Running,
    /// At rest on its path, or on the way to rest.
    Paused,
    /// At its goal.
    Done,
    /// Given up because of a request to stop.
    Stopped,
    /// Refused or given up, with the controller's own error.
    Failed {
        /// The error, in the controller's numbering.
        code: u32,
    },
}

/// Mass, centre of mass and inertia at a flange.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoadSetting {
    /// Mass \[kg\].
    pub mass: f64,
    /// Centre of mass in the flange \[m\].
    pub com: [f64; 3],
    /// Inertia about the centre of mass, axes of the flange, xx xy xz yy yz zz \[kg m²\].
    pub inertia: [f64; 6],
}

/// A pose that the controller reports.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportedTip {
    /// Which chain, in the order of the robot file.
    pub chain: u8,
    /// What it is the pose of.
    pub frame: TipFrame,
    /// The pose in the chain's base link.
    pub pose: Pose,
}

/// What a [`ReportedTip`] is the pose of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TipFrame {
    /// The flange: the tool is still to be added.
    Flange,
    /// The tool centre point: the controller has added the tool.
    Tcp,
}

/// A set of joints, by their place in the robot's joint order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct JointSet(u16);

impl JointSet {
    /// No joint.
    pub const NONE: Self = Self(0);

    /// The first `count` joints, at most [`MAX_JOINTS`].
    #[must_use]
    pub const fn first(count: usize) -> Self {
        if count >= MAX_JOINTS { Self(u16::MAX) } else { Self((1 << count) - 1) }
    }

    /// The set with these bits: the lowest is the first joint.
    #[must_use]
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// The set as bits: the lowest is the first joint.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Whether `joint` is in it.
    #[must_use]
    pub const fn contains(self, joint: usize) -> bool {
        joint < MAX_JOINTS && self.0 & (1 << joint) != 0
    }

    /// Whether every joint of `other` is in it.
    #[must_use]
    pub const fn contains_all(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether no joint is in it.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The set with `joint`; one beyond [`MAX_JOINTS`] is left out.
    #[must_use]
    pub const fn with(self, joint: usize) -> Self {
        if joint < MAX_JOINTS { Self(self.0 | (1 << joint)) } else { self }
    }
}

/// Up to `N` numbers, without a heap.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "ArrayVec<f64, N>", into = "ArrayVec<f64, N>")]
pub struct Values<const N: usize> {
    values: [f64; N],
    len: usize,
}

impl<const N: usize> Values<N> {
    /// No numbers.
    pub const EMPTY: Self = Self { values: [0.0; N], len: 0 };

    /// These numbers, if there are no more than `N`.
    #[must_use]
    pub fn from_slice(values: &[f64]) -> Option<Self> {
        let mut all = Self::EMPTY;
        all.values.get_mut(..values.len())?.copy_from_slice(values);
        all.len = values.len();
        Some(all)
    }

    /// The numbers.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        self.values.get(..self.len).unwrap_or_default()
    }

    /// The numbers, to be changed.
    #[must_use]
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        self.values.get_mut(..self.len).unwrap_or_default()
    }
}

impl<const N: usize> From<ArrayVec<f64, N>> for Values<N> {
    fn from(values: ArrayVec<f64, N>) -> Self {
        Self::from_slice(&values).unwrap_or_default()
    }
}

impl<const N: usize> From<Values<N>> for ArrayVec<f64, N> {
    fn from(values: Values<N>) -> Self {
        values.as_slice().iter().copied().collect()
    }
}

impl<const N: usize> Default for Values<N> {
    fn default() -> Self {
        Self::EMPTY
    }
}
