//! The chains of the robot with what they carry.
//!
//! ```text
//! book (outside) --Order::SetEquipment--> at rest? --yes--> in force, load owed to the controller
//!                                            +--no--> refused, nothing changed
//! ```
//!
//! The loop swaps all chains at once, between two ticks, and only while the robot stands and
//! nothing waits to move it: no motion ever sees its tool change. What the controller is to know of
//! the load is owed to it until it was told, and again whenever it was not heard for a while, since
//! it may have been switched off and on, or says that it is another run than before.

use armada_model::{Chain, JointLimits, JointVector, KinematicsError, Pose, RobotModel, Twist};
use armada_protocol::messages::CommandMode;
use serde::{Deserialize, Serialize};

use super::io::{EquipmentOrder, Refusal, Retired};
use super::state::{LoopState, Tick};
use crate::drivers::{DriverRequest, LoadSetting, ReportedTip, TipFrame};

/// Most chains of a robot that tools can be moved by.
pub const MAX_CHAINS: usize = 4;

/// The chains of a robot with their tools, made outside the loop and never changed.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Equipment {
    /// Revision: raised by each change of a tool or payload.
    pub config_seqno: u64,
    /// The chains in the order of the robot file, at most [`MAX_CHAINS`].
    pub chains: Vec<EquippedChain>,
}

/// A chain with its tool.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EquippedChain {
    /// From its base link to its flange, without the tool; limits as the robot file narrows them.
    pub chain: Chain,
    /// Tool centre point in the flange.
    pub tcp: Pose,
    /// Pose of the chain's base link in the world at the robot's zero position.
    pub base_in_world: Pose,
    /// For each variable of the chain, the joint of the robot that drives it.
    pub joints: Vec<usize>,
    /// Tool and payload together, at the flange.
    pub load: LoadSetting,
}

/// Why two links make no [`EquippedChain`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EquippedChainError {
    /// The links make no chain.
    #[error(transparent)]
    Chain(#[from] armada_model::ChainError),
    /// A joint of the chain is not driven by this robot, so nobody knows where its tip is.
    #[error("joint {joint:?} moves the tip, but is not among the joints of this robot")]
    ForeignJoint {
        /// Name of the joint.
        joint: String,
    },
}

/// Where the tip of a chain is and how it moves, in the axes of the chain's base link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipState {
    /// Pose of the tool centre point.
    pub tcp: Pose,
    /// Its speed; `None` if the joints' speeds are not known.
    pub tcp_twist: Option<Twist>,
    /// Pose of the flange.
    pub flange: Pose,
    /// Its speed.
    pub flange_twist: Option<Twist>,
}

impl EquippedChain {
    /// The chain of `model` from the link `base` to the link `tip`, without a tool, for a robot
    /// whose `joints` are named and limited so, in the order of its vectors.
    ///
    /// `base_in_world` is the pose of `base` in the world.
    ///
    /// # Errors
    /// [`EquippedChainError::Chain`] if the links make no chain,
    /// [`EquippedChainError::ForeignJoint`] if a joint on the way is not one of `joints`.
    pub fn new(
        model: &RobotModel,
        (base, tip): (&str, &str),
        joints: &[(&str, JointLimits)],
        base_in_world: Pose,
    ) -> Result<Self, EquippedChainError> {
        let chain = Chain::new(model, base, tip)?;
        let mut driven = Vec::new();
        for variable in chain.variables() {
            let found = joints.iter().position(|(name, _)| *name == variable.name);
            driven.push(found.ok_or_else(|| EquippedChainError::ForeignJoint {
                joint: variable.name.clone(),
            })?);
        }
        let limits =
            driven.iter().filter_map(|&joint| joints.get(joint)).map(|(_, limits)| *limits);
        let chain = chain.with_limits(&limits.collect::<Vec<_>>());
        let load = LoadSetting::default();
        Ok(Self { chain, tcp: Pose::default(), base_in_world, joints: driven, load })
    }

    /// The chain to the tool centre point instead of the flange. It allocates.
    #[must_use]
    pub fn to_tcp(&self) -> Chain {
        self.chain.clone().with_tool(&self.tcp)
    }

    /// The chain's part of a vector of all joints; joints that it lacks count as zero.
    #[must_use]
    pub fn gather(&self, all: &JointVector) -> JointVector {
        let own = JointVector::zeros(self.joints.len()).unwrap_or_default();
        let joint = |index: usize| self.joints.get(index).and_then(|&joint| all.get(joint));
        own.map_indexed(|index, zero| joint(index).copied().unwrap_or(zero))
    }

    /// `all`, a vector of all joints, with the chain's part replaced by `own`.
    #[must_use]
    pub fn scatter(&self, own: &JointVector, all: &JointVector) -> JointVector {
        all.map_indexed(|joint, value| {
            let index = self.joints.iter().position(|&driven| driven == joint);
            index.and_then(|index| own.get(index)).copied().unwrap_or(value)
        })
    }

    /// Flange and tool centre point at these positions and speeds of all joints of the robot; an
    /// empty `velocity` is one that is not known. It allocates nothing.
    ///
    /// # Errors
    /// [`KinematicsError::NotFinite`] if a position is infinite or not a number.
    #[allow(non_snake_case, reason = "X_BF is the pose of the flange in the base, V_BF its twist")]
    pub fn tip(
        &self,
        position: &JointVector,
        velocity: &JointVector,
    ) -> Result<TipState, KinematicsError> {
        let (X_BF, jacobian) = self.chain.forward_and_jacobian(&self.gather(position))?;
        let V_BF = (!velocity.is_empty()).then(|| jacobian.twist(&self.gather(velocity)));
        let lever = X_BF.rotation * self.tcp.position();
        let flange = Pose::from_isometry(X_BF);
        Ok(TipState {
            tcp: flange * self.tcp,
            tcp_twist: V_BF.map(|twist| twist.shifted(&lever)),
            flange,
            flange_twist: V_BF,
        })
    }

    /// `tip` with the pose that the controller reports instead of the calculated one: that of a
    /// flange gets the tool added, that of a tool centre point is taken as it is. Speeds stay
    /// calculated, since no controller reports them with its poses.
    #[must_use]
    pub fn reported(&self, tip: TipState, reported: &ReportedTip) -> TipState {
        let (flange, tcp) = match reported.frame {
            TipFrame::Flange => (reported.pose, reported.pose * self.tcp),
            TipFrame::Tcp => (reported.pose * self.tcp.inverse(), reported.pose),
        };
        TipState { tcp, flange, ..tip }
    }
}

/// Of which chains the controller is still to be told something, one bit for each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Owed(u8);

impl Owed {
    /// All of them.
    pub(super) const ALL: Self = Self(u8::MAX);

    const fn add(&mut self, chain: u8) {
        self.0 |= 1_u8.wrapping_shl(chain as u32);
    }

    /// The chain whose turn it is, of `count`, which is owed nothing more then.
    fn take(&mut self, count: usize) -> Option<u8> {
        let chain = self.0.trailing_zeros() as u8;
        if usize::from(chain) >= count {
            // Higher ones, of which there are none.
            self.0 = 0;
            return None;
        }
        self.0 &= self.0 - 1;
        Some(chain)
    }

    const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl LoopState {
    /// Goes on with other tools and payloads, if the robot stands and nothing waits to move it.
    pub(super) fn set_equipment(
        &mut self,
        tick: &mut Tick<'_>,
        order: EquipmentOrder,
    ) -> Result<(), Refusal> {
        if let Err(refusal) = self.check_equipment(tick, &order) {
            tick.retire(Retired::Equipment(order.equipment));
            return Err(refusal);
        }
        if let Some((chain, _)) = order.load {
            self.owed_loads.add(chain);
        }
        self.owed_tools = Owed::ALL;
        let before = std::mem::replace(&mut self.equipment, order.equipment);
        tick.retire(Retired::Equipment(before));
        Ok(())
    }

    /// The controller is to be told all of it again.
    pub(super) const fn owe_equipment(&mut self) {
        (self.owed_loads, self.owed_tools) = (Owed::ALL, Owed::ALL);
    }

    /// The tool or load that the controller is to be told of now.
    pub(super) fn equipment_request(&mut self, tick: &Tick<'_>) -> Option<DriverRequest> {
        self.condition.feedback()?;
        let abilities = &tick.params.abilities;
        let (of_tool, of_load) = (abilities.move_pose || abilities.move_linear, abilities.load);
        let chains = &self.equipment.chains;
        if let Some(chain) = self.owed_tools.take(chains.len()).filter(|_| of_tool) {
            let tool = chains.get(usize::from(chain))?.tcp;
            return Some(DriverRequest::SetTool { chain, tool });
        }
        let chain = self.owed_loads.take(chains.len()).filter(|_| of_load)?;
        let load = chains.get(usize::from(chain))?.load;
        Some(DriverRequest::SetLoad { chain, load })
    }

    /// Whether the controller knows every tool: before that, a pose of a tool means another one to
    /// it.
    pub(super) const fn knows_tools(&self) -> bool {
        self.owed_tools.is_empty()
    }

    fn check_equipment(&self, tick: &Tick<'_>, order: &EquipmentOrder) -> Result<(), Refusal> {
        let current = self.equipment.config_seqno;
        if order.replaces != current {
            return Err(Refusal::EquipmentChanged { given: order.replaces, current });
        }
        if self.condition.feedback().is_none() {
            return Err(Refusal::CommunicationLost);
        }
        if let mode @ (CommandMode::PositionCommand
        | CommandMode::VelocityCommand
        | CommandMode::Homing) = self.mode
        {
            return Err(Refusal::WrongMode { mode, needed: CommandMode::Halt });
        }
        self.check_idle(tick)
    }

    /// Refuses while the robot moves or a motion waits.
    pub(super) fn check_idle(&self, tick: &Tick<'_>) -> Result<(), Refusal> {
        if let Some(motion) = &self.motion {
            return Err(Refusal::Busy(motion.id));
        }
        if self.ramp.is_some() || !self.standstill.is_shown(tick.params) {
            return Err(Refusal::StillMoving);
        }
        Ok(())
    }
}
