//! What may be asked of the loop.

use std::sync::Arc;
use std::time::Duration;

use armada_model::{CompiledTrajectory, JointVector, MAX_JOINTS, MonoTime};
use armada_protocol::messages::{
    CommandMode, HomeMethod, LeaseLoss, LeaseScope, MotionKind, Queue, Role,
};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::TwistTarget;
use crate::control::equipment::{Equipment, MAX_CHAINS};
use crate::control::group::GroupOrder;
use crate::drivers::{DelegatedMove, JointSet, LoadSetting, Values};

/// A request to the loop; it is answered in exactly one [`LoopEvent::Answer`](super::LoopEvent::Answer) with its
/// ticket.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LoopRequest {
    /// Chosen by the asker, returned with the answer.
    pub ticket: u64,
    /// The lease it is asked under.
    pub lease: Option<Uuid>,
    /// Until when somebody waits for the answer: nothing is begun after that, though ended it is.
    pub until: Option<MonoTime>,
    /// What is asked.
    pub order: Order,
}

/// What may be asked of the loop.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Order {
    /// Change the command mode.
    SetMode(CommandMode),
    /// Ramp to standstill and stay in halt.
    Halt,
    /// Switch the drives on.
    Enable,
    /// Ramp to standstill, then switch the drives off.
    Disable,
    /// Clear latched faults whose cause is gone, here and at the controller.
    ResetErrors,
    /// Move all joints to a position.
    Jog(JogOrder),
    /// Follow a trajectory, at once or at an instant.
    Follow(FollowOrder),
    /// End this motion with a ramp to standstill.
    Cancel(Uuid),
    /// Give the right to command to this lease, if it is free.
    AcquireLease {
        /// The new lease.
        lease: Uuid,
        /// How long it lasts without being renewed.
        ttl: Duration,
        /// As what its holder commands.
        role: Role,
    },
    /// Give the right to command to this lease, whoever holds it in a role that is not higher.
    TakeLease {
        /// The new lease.
        lease: Uuid,
        /// How long it lasts without being renewed.
        ttl: Duration,
        /// As what its holder commands: operator or supervisor.
        role: Role,
    },
    /// Let a sub-lease command as well, while the lease of whoever asks is in force.
    DelegateLease {
        /// The lease in force.
        parent: Uuid,
        /// The new sub-lease.
        lease: Uuid,
        /// What it gives the right to.
        scope: LeaseScope,
        /// How long it lasts without being renewed.
        ttl: Duration,
    },
    /// Keep the lease or a sub-lease for another while.
    RenewLease {
        /// Which.
        lease: Uuid,
        /// How long it lasts from now on; as before if `None`.
        ttl: Option<Duration>,
    },
    /// Give the lease or a sub-lease back.
    ReleaseLease(Uuid),
    /// Home joints.
    Home(HomeOrder),
    /// Move joints at a speed.
    JogJoint(JogJointOrder),
    /// Move tools at a speed.
    JogCartesian(JogCartesianOrder),
    /// Let the controller make a move of its own.
    Delegate(DelegateOrder),
    /// Bring this motion to rest on its path.
    Pause(Uuid),
    /// Go on with this motion.
    Resume(Uuid),
    /// Change the speed of all motions, 0.01 to 1.
    SetSpeedRatio(f64),
    /// Go on with other tools and payloads.
    SetEquipment(EquipmentOrder),
    /// Set a signal of the controller.
    SetSignal {
        /// Its index.
        signal: u8,
        /// Its values.
        values: Values<MAX_JOINTS>,
        /// Whether it may be set only while the robot does not move.
        restricted: bool,
        /// Whether it may be set while a stop is latched.
        while_stopped: bool,
    },
    /// Set a parameter of the controller.
    SetParameter {
        /// Its index.
        parameter: u8,
        /// Its value.
        value: f64,
        /// Whether it may be set only while the robot does not move.
        restricted: bool,
    },
}

/// Homing of groups of joints, one group after the other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HomeOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// The groups, each of one joint or more; those after the last are empty.
    pub groups: [JointSet; MAX_JOINTS],
    /// How.
    pub method: HomeMethod,
}

/// Joints at a speed, for a time after the newest order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JogJointOrder {
    /// Identity of the motion; the same as that of the jog in progress to keep it going.
    pub id: Uuid,
    /// Speed of each joint \[1/s\].
    pub joint_velocity: JointVector,
    /// How long to move without another order.
    pub timeout: Duration,
    /// Whether it only keeps a jog going: refused if that has ended.
    pub renews: bool,
}

/// Tools at a speed, for a time after the newest order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JogCartesianOrder {
    /// Identity of the motion; the same as that of the jog in progress to keep it going.
    pub id: Uuid,
    /// Speeds, one for each chain that is to move.
    pub twists: [Option<TwistTarget>; MAX_CHAINS],
    /// How long to move without another order.
    pub timeout: Duration,
    /// Whether it only keeps a jog going: refused if that has ended.
    pub renews: bool,
}

/// A move that the controller makes itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DelegateOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// What kind of move.
    pub kind: MotionKind,
    /// The move; its number is given by the loop.
    pub order: DelegatedMove,
    /// What to do if a motion is in progress: refuse or append.
    pub queue: Queue,
    /// What to do if the lease is lost.
    pub on_lease_loss: LeaseLoss,
}

/// Other tools and payloads.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EquipmentOrder {
    /// The chains with them.
    #[serde(with = "crate::control::shared")]
    pub equipment: Arc<Equipment>,
    /// Revision that they were made from, which must still be in force.
    pub replaces: u64,
    /// The chain whose load changed, and the load that the controller is to be told.
    pub load: Option<(u8, LoadSetting)>,
}

/// A move of all joints to a position.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct JogOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// Goal \[rad or m\].
    pub joint_position: JointVector,
    /// Highest speed of each joint, at most its limit in force \[1/s\]; empty for that limit.
    pub max_velocity: JointVector,
}

/// A trajectory to follow.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FollowOrder {
    /// Identity of the motion.
    pub id: Uuid,
    /// The validated trajectory.
    #[serde(with = "crate::control::shared")]
    pub trajectory: Arc<CompiledTrajectory>,
    /// When to start; at once if `None`.
    pub start: Option<MonoTime>,
    /// If given, the epoch that must still be in force.
    pub epoch: Option<u64>,
    /// What it is to be called: a trajectory, or a move that was planned outside the loop.
    pub kind: MotionKind,
    /// What to do if a motion is in progress.
    pub queue: Queue,
    /// What to do if the lease is lost.
    pub on_lease_loss: LeaseLoss,
    /// How it is followed together with other robots, if it is; it has a start then.
    pub group: Option<GroupOrder>,
}

impl FollowOrder {
    /// The trajectory at once, refused if a motion is in progress.
    #[must_use]
    pub const fn at_once(id: Uuid, trajectory: Arc<CompiledTrajectory>) -> Self {
        Self {
            id,
            trajectory,
            start: None,
            epoch: None,
            kind: MotionKind::Trajectory,
            queue: Queue::Refuse,
            on_lease_loss: LeaseLoss::StopOnPath,
            group: None,
        }
    }
}

impl Order {
    /// Whether it brings things to an end only: never too late.
    #[must_use]
    pub const fn is_end(&self) -> bool {
        matches!(
            self,
            Self::Halt | Self::Disable | Self::Cancel(_) | Self::Pause(_) | Self::ReleaseLease(_)
        )
    }

    /// Identity of the motion that it begins or keeps going, if it does.
    #[must_use]
    pub const fn motion_id(&self) -> Option<Uuid> {
        match self {
            Self::Jog(order) => Some(order.id),
            Self::Follow(order) => Some(order.id),
            Self::Home(order) => Some(order.id),
            Self::JogJoint(order) => Some(order.id),
            Self::JogCartesian(order) => Some(order.id),
            Self::Delegate(order) => Some(order.id),
            _ => None,
        }
    }
}

impl LoopRequest {
    /// A request under no lease.
    #[must_use]
    pub const fn new(ticket: u64, order: Order) -> Self {
        Self { ticket, lease: None, until: None, order }
    }
}
