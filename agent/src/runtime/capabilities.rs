//! What a robot can do, derived from what its driver and its file give.

use armada_protocol::messages::{Capability, ParameterInfo, ParameterType, SignalInfo};
use armada_protocol::method::{Method, robot};

use super::requests::names;
use crate::control::{LoopAbilities, Params, ValueSlot};
use crate::drivers::Abilities;

/// How far the controller may be from a number it was given, as a share of the number's range.
const ROUNDING: f64 = 1e-3;

/// What the loop is told of the controller's abilities.
pub(super) const fn loop_abilities(abilities: &Abilities) -> LoopAbilities {
    LoopAbilities {
        homing: abilities.homing,
        move_joint: abilities.move_joint,
        move_pose: abilities.move_pose,
        move_linear: abilities.move_linear,
        pause: abilities.pause,
        load: abilities.load,
    }
}

/// What every robot can do, since the loop does it, and what its controller adds.
pub(super) fn capabilities(abilities: &Abilities) -> Vec<Capability> {
    let own = [
        Capability::JogCommand,
        Capability::TrajectoryCommand,
        Capability::PositionCommand,
        Capability::VelocityCommand,
        Capability::SoftwareResetErrors,
        Capability::SoftwareEnable,
        Capability::InterpolatedTrajectory,
        Capability::TrajectoryQueueing,
        Capability::SpeedRatio,
    ];
    let added = [
        (abilities.homing, Capability::HomingCommand),
        (abilities.move_joint, Capability::DelegatedMoveJoint),
        (abilities.move_pose, Capability::DelegatedMovePose),
        (abilities.move_linear, Capability::DelegatedMoveLinear),
        (abilities.load, Capability::LoadSetting),
    ];
    let added = added.into_iter().filter_map(|(has, capability)| has.then_some(capability));
    own.into_iter().chain(added).collect()
}

/// The methods that can succeed with this robot: one that never could is not named.
pub(super) fn methods(abilities: &Abilities, params: &Params, chains: usize) -> Vec<String> {
    let has_home = params.home.iter().all(Option::is_some);
    let lacking = [
        (chains == 0, robot::AttachTool::NAME),
        (chains == 0, robot::DetachTool::NAME),
        (chains == 0, robot::AttachPayload::NAME),
        (chains == 0, robot::DetachPayload::NAME),
        (chains == 0, robot::ForwardKinematics::NAME),
        (chains == 0, robot::InverseKinematics::NAME),
        (chains == 0, robot::JogCartesian::NAME),
        (chains == 0, robot::MovePose::NAME),
        (chains == 0, robot::MoveLinear::NAME),
        (!has_home, robot::MoveHome::NAME),
        (!has_home && !abilities.homing, robot::Home::NAME),
        (abilities.signals.is_empty(), robot::GetSignal::NAME),
        (abilities.signals.is_empty(), robot::SetSignal::NAME),
        (abilities.parameters.is_empty(), robot::GetParam::NAME),
        (abilities.parameters.is_empty(), robot::SetParam::NAME),
    ];
    let can = |name: &&str| !lacking.iter().any(|(lacks, lacking)| *lacks && lacking == name);
    names().into_iter().filter(can).map(str::to_owned).collect()
}

/// Where the feedback shows each signal: one after the other, each with its size.
pub(super) fn signal_slots(signals: &[SignalInfo]) -> Vec<ValueSlot> {
    let mut first = 0;
    let slot = |signal: &SignalInfo| {
        let len = usize::from(signal.size);
        let slot = ValueSlot { first, len, tolerance: rounding(signal.min, signal.max) };
        first += len;
        slot
    };
    signals.iter().map(slot).collect()
}

/// Where the feedback shows each parameter: one number each.
pub(super) fn parameter_slots(parameters: &[ParameterInfo]) -> Vec<ValueSlot> {
    let slot = |(first, parameter): (usize, &ParameterInfo)| {
        let tolerance = match parameter.parameter_type {
            ParameterType::Number => rounding(parameter.min, parameter.max),
            ParameterType::Bool | ParameterType::Integer | ParameterType::Choice => 0.0,
        };
        ValueSlot { first, len: 1, tolerance }
    };
    parameters.iter().enumerate().map(slot).collect()
}

/// Numbers without a range are taken as they are, but for single precision.
fn rounding(min: Option<f64>, max: Option<f64>) -> f64 {
    match (min, max) {
        (Some(min), Some(max)) => ROUNDING * (max - min).abs(),
        _ => 1e-6,
    }
}
