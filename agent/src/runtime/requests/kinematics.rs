//! Forward and inverse kinematics.

use std::sync::Arc;

use armada_model::{InverseCause, JointVector};
use armada_protocol::messages::{
    Denial, DenialCode, ForwardKinematicsAnswer, ForwardKinematicsParams, InverseKinematicsAnswer,
    InverseKinematicsParams,
};

use super::equipment::equipment_denial;
use super::{Asker, Requests};
use crate::control::Equipment;
use crate::moves::{MovePlanner, MoveProblem};

impl Requests {
    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn forward_kinematics(
        &self,
        _: Asker,
        params: ForwardKinematicsParams,
    ) -> Result<ForwardKinematicsAnswer, Denial> {
        let (chain, name) = self.chain(params.chain.as_deref())?;
        let position = self.positions(params.joint_position_rad, "joint_position_rad")?;
        let equipment = self.equipment_in_force()?;
        let tip = equipment
            .chains
            .get(chain)
            .and_then(|chain| chain.tip(&position, &JointVector::EMPTY).ok());
        let tip = tip.ok_or_else(|| Denial::new(DenialCode::Internal, "no pose of the chain"))?;
        Ok(ForwardKinematicsAnswer { chain: name, tcp: tip.tcp, flange: tip.flange })
    }

    pub(super) async fn inverse_kinematics(
        &self,
        _: Asker,
        params: InverseKinematicsParams,
    ) -> Result<InverseKinematicsAnswer, Denial> {
        let (chain, name) = self.chain(params.chain.as_deref())?;
        let seed = self.positions(params.seed_rad, "seed_rad")?;
        let equipment = self.equipment_in_force()?;
        let (limits, names, pose) = (self.limits, self.joint_names.clone(), params.pose);
        // A cold search may take many milliseconds.
        let solved = tokio::task::spawn_blocking(move || {
            MovePlanner { equipment: &equipment, limits: &limits, names: &names }
                .solve(chain, &pose, &seed)
        });
        let solved = solved.await.map_err(|_| Denial::new(DenialCode::Internal, "no answer"))?;
        let joint_position_rad = solved.map_err(|problem| self.problem_denial(&problem))?;
        Ok(InverseKinematicsAnswer { chain: name, joint_position_rad })
    }

    /// Number and name of the chain asked for, or of the only one.
    pub(super) fn chain(&self, name: Option<&str>) -> Result<(usize, String), Denial> {
        self.equipment.chain(name).map_err(|error| equipment_denial(&error))
    }

    /// The chains with the tools that the loop has in force.
    pub(super) fn equipment_in_force(&self) -> Result<Arc<Equipment>, Denial> {
        let config_seqno = self.board.lock().snapshot.config_seqno;
        self.equipment.of_revision(config_seqno).ok_or_else(|| {
            Denial::new(DenialCode::Busy, "tools are being changed: ask again in a moment")
        })
    }

    /// What a move or a pose is refused for.
    pub(super) fn problem_denial(&self, problem: &MoveProblem) -> Denial {
        let text = problem.to_string();
        let name = |joint: usize| self.joint_names.get(joint).cloned().unwrap_or_default();
        match problem {
            MoveProblem::BeyondLimit { joint, value, limit } => {
                let text = format!("{}: {value} is beyond the limit {limit}", name(*joint));
                Denial::new(DenialCode::OutOfRange, text)
                    .with("joint", name(*joint))
                    .with("value", *value)
                    .with("limit", *limit)
            }
            MoveProblem::Unreachable { joints, failure } => {
                let denial = Denial::new(DenialCode::Unreachable, text)
                    .with("field", "pose")
                    .with("residual_m", failure.residual.position)
                    .with("residual_rad", failure.residual.orientation);
                match failure.cause {
                    InverseCause::Target => Denial { code: DenialCode::InvalidArgument, ..denial },
                    InverseCause::OutOfReach { excess } => {
                        denial.with("cause", "out_of_reach").with("excess_m", excess)
                    }
                    InverseCause::JointLimit { joint, value, limit, .. } => {
                        let joint = joints.get(joint).copied().unwrap_or_default();
                        denial
                            .with("cause", "joint_limit")
                            .with("joint", name(joint))
                            .with("value", value)
                            .with("limit", limit)
                    }
                    InverseCause::Singular { .. } => denial.with("cause", "singular"),
                    InverseCause::Seed(_) | InverseCause::Iterations { .. } => {
                        denial.with("cause", "not_found")
                    }
                }
            }
            MoveProblem::Line { joints, error } => line_denial(error, joints, name),
            MoveProblem::WrongLength { given, expected } => {
                Denial::new(DenialCode::InvalidArgument, text)
                    .with("field", "joint_position_rad")
                    .with("given", *given)
                    .with("expected", *expected)
            }
            MoveProblem::NoSuchChain { .. } => {
                Denial::new(DenialCode::InvalidArgument, text).with("field", "chain")
            }
            MoveProblem::MixedBlend | MoveProblem::NoToolToBlend => {
                Denial::new(DenialCode::NotSupported, text).with("field", "options.blend_radius_m")
            }
            MoveProblem::BlendedSpeed { .. } => {
                Denial::new(DenialCode::NotSupported, text).with("field", "options.speed")
            }
            MoveProblem::Limits(_)
            | MoveProblem::Way(_)
            | MoveProblem::Retime(_)
            | MoveProblem::Waypoints(_)
            | MoveProblem::Trajectory(_) => Denial::new(DenialCode::Unreachable, text),
        }
    }

    /// The positions given, or those that were measured.
    fn positions(&self, given: Option<JointVector>, field: &str) -> Result<JointVector, Denial> {
        let expected = self.joint_names.len();
        match given {
            Some(given) if given.len() == expected => Ok(given),
            Some(given) => {
                let text = format!("{field}: {} values, expected {expected}", given.len());
                Err(Denial::new(DenialCode::InvalidArgument, text).with("field", field))
            }
            None => {
                let measured = self.board.lock().snapshot.joint_position;
                if measured.len() == expected {
                    return Ok(measured);
                }
                let text = format!("{field} was left out, and no positions are measured");
                Err(Denial::new(DenialCode::CommunicationLost, text).with("field", field))
            }
        }
    }
}

fn line_denial(
    error: &armada_model::CartesianError,
    joints: &[usize],
    name: impl Fn(usize) -> String,
) -> Denial {
    use armada_model::{BlockReason, CartesianError as E};
    let robot_joint = |joint: usize| name(joints.get(joint).copied().unwrap_or_default());
    let block = match error {
        E::Path(_) => {
            return Denial::new(DenialCode::InvalidArgument, error.to_string())
                .with("field", "pose");
        }
        E::Blocked(block) => block,
        _ => return Denial::new(DenialCode::Unreachable, error.to_string()),
    };
    let (code, cause) = match block.reason {
        BlockReason::JointLimit { .. } => (DenialCode::OutOfRange, "joint_limit"),
        BlockReason::JointJump { .. } => (DenialCode::Unreachable, "joint_jump"),
        BlockReason::Singular { .. } => (DenialCode::Unreachable, "singular"),
        BlockReason::JointRate { .. } => (DenialCode::Unreachable, "joint_rate"),
        BlockReason::Unreachable => (DenialCode::Unreachable, "out_of_reach"),
        BlockReason::Deviation { .. } => (DenialCode::Unreachable, "deviation"),
    };
    let denial = Denial::new(code, format!("the tool cannot go straight to the pose: {block}"))
        .with("field", "pose")
        .with("fraction", block.fraction)
        .with("cause", cause)
        .with("residual_m", block.position_residual)
        .with("residual_rad", block.angle_residual);
    match block.reason {
        BlockReason::JointLimit { joint, limit } => {
            denial.with("joint", robot_joint(joint)).with("limit", limit)
        }
        BlockReason::JointJump { joint, .. } | BlockReason::JointRate { joint, .. } => {
            denial.with("joint", robot_joint(joint))
        }
        _ => denial,
    }
}
