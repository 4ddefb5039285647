//! Refusals and faults in words a person can act on.

use armada_model::TrajectoryError;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    ClearBy, CommandMode, Denial, DenialCode, Fault, FaultCode, JointInfo, LeaseScope,
    OperationalMode, Role, StopLevel,
};
use serde_json::Value;
use uuid::Uuid;

use super::group_names::GroupNames;
use super::leases::title;
use crate::control::{LoopFault, PartnerFault, Refusal, clear_by};

/// Who and what the words are about.
#[derive(Clone, Debug)]
pub(super) struct Vocabulary {
    pub(super) robot: RobotName,
    pub(super) joints: Vec<JointInfo>,
    /// The partners in motions of several robots.
    pub(super) groups: GroupNames,
}

impl Vocabulary {
    /// The words about a robot with these joints.
    pub(super) fn new(robot: RobotName, joints: Vec<JointInfo>) -> Self {
        Self { robot, joints, groups: GroupNames::default() }
    }

    fn joint(&self, index: usize) -> &str {
        self.joints.get(index).map_or("an unknown joint", |joint| joint.name.as_str())
    }

    fn unit(&self, index: usize) -> &'static str {
        use armada_model::JointType::Prismatic;
        let slides = self.joints.get(index).is_some_and(|joint| joint.joint_type == Prismatic);
        if slides { "m" } else { "rad" }
    }

    /// The denial that a refusal of the loop means.
    #[expect(clippy::too_many_lines, reason = "one arm for each refusal and nothing else")]
    pub(super) fn denial(&self, refusal: &Refusal) -> Denial {
        match *refusal {
            Refusal::WrongMode { mode, needed } => self.wrong_mode(mode, needed),
            Refusal::ThroughHalt { mode, wanted } => Denial::new(
                DenialCode::WrongMode,
                format!(
                    "{} is in {}: set mode halt before {}",
                    self.robot,
                    name(mode),
                    name(wanted)
                ),
            )
            .with("command_mode", name(mode)),
            Refusal::ModeNotSupported(mode) => Denial::new(
                DenialCode::NotSupported,
                format!("mode {} does not exist for {}", name(mode), self.robot),
            )
            .with("mode", name(mode)),
            Refusal::Stopped(level) => self.stopped(level),
            Refusal::Faulted(code) => self.faulted(code),
            Refusal::CauseRemains(code) => Denial::new(
                DenialCode::Faulted,
                format!("{}: the cause of {} is still there", self.robot, fault_name(code)),
            )
            .with("fault", fault_name(code)),
            Refusal::CommunicationLost => Denial::new(
                DenialCode::CommunicationLost,
                format!("the controller of {} does not answer", self.robot),
            ),
            Refusal::NotEnabled => Denial::new(
                DenialCode::NotEnabled,
                format!("the drives of {} are off: enable them first", self.robot),
            ),
            Refusal::NotReady => Denial::new(
                DenialCode::NotReady,
                format!("the controller of {} does not take commands", self.robot),
            ),
            Refusal::Busy(id) => Denial::new(
                DenialCode::Busy,
                format!("{} is in motion {id}: cancel it or wait for its end", self.robot),
            )
            .with("motion_id", id.to_string()),
            Refusal::StillMoving => Denial::new(
                DenialCode::Busy,
                format!("{} is still decelerating: ask again in a moment", self.robot),
            ),
            Refusal::NoSuchMotion => Denial::new(
                DenialCode::NotAttached,
                format!("{} has no such motion in progress", self.robot),
            ),
            Refusal::OutOfRange { joint, value, limit } => self.out_of_range(joint, value, limit),
            Refusal::StartTolerance { joint, value, limit } => Denial::new(
                DenialCode::Tolerance,
                format!(
                    "{} of {} is {value:.4} {unit} from where the motion begins, limit {limit} \
                     {unit}: move there first",
                    self.joint(joint),
                    self.robot,
                    unit = self.unit(joint),
                ),
            )
            .with("joint", self.joint(joint))
            .with("value", value)
            .with("limit", limit),
            Refusal::WrongLength { given, expected } => Denial::new(
                DenialCode::InvalidArgument,
                format!("{given} values, but {} has {expected} joints", self.robot),
            )
            .with("given", given)
            .with("expected", expected),
            Refusal::EpochPassed { given, current } => Denial::new(
                DenialCode::LeaseStale,
                format!("epoch {given} has passed, {} is in epoch {current}", self.robot),
            )
            .with("epoch", current),
            Refusal::StartMissed { late_s } => Denial::new(
                DenialCode::Timeout,
                format!("the start was {:.1} ms ago", late_s * 1e3),
            )
            .with("late_ms", late_s * 1e3),
            Refusal::Cancelled => self.ended("cancelled by request"),
            Refusal::ModeLeft => self.ended("the mode was left"),
            Refusal::Disabled => Denial::new(
                DenialCode::NotEnabled,
                format!("the drives of {} were switched off", self.robot),
            ),
            Refusal::StillEnabled => Denial::new(
                DenialCode::DriverError,
                format!("the drives of {} stayed on", self.robot),
            ),
            Refusal::TooManyPending => Denial::new(
                DenialCode::Busy,
                format!("too many requests wait for the controller of {}", self.robot),
            ),
            Refusal::NotSupported(what) => Denial::new(
                DenialCode::NotSupported,
                format!("{} does not have {what}", self.robot),
            ),
            Refusal::LeaseRequired { remaining_s } => {
                self.driven_by(("somebody else", Role::Program), remaining_s)
            }
            Refusal::NoLease => Denial::new(
                DenialCode::LeaseRequired,
                format!(
                    "{0} is commanded under a lease only: armada lease hold {0}, or in Python: with \
                     robot.lease()",
                    self.robot
                ),
            ),
            Refusal::LeaseStale => Denial::new(
                DenialCode::LeaseStale,
                format!("the lease of {} is not in force any more: acquire it anew", self.robot),
            ),
            Refusal::LeaseLost => {
                Denial::new(DenialCode::LeaseStale, format!("{}: the lease ran out", self.robot))
            }
            Refusal::LeaseTaken => Denial::new(
                DenialCode::LeaseRequired,
                format!("{}: somebody acquired the lease", self.robot),
            ),
            Refusal::LocalControl => Denial::new(
                DenialCode::LeaseRequired,
                format!("the pendant of {} has control: it is given back there only", self.robot),
            )
            .with("holder", "pendant")
            .with("authority", "local"),
            Refusal::RoleTooLow { needed } => Denial::new(
                DenialCode::LeaseRequired,
                format!(
                    "to take the lease of {} needs the role {} or a higher one",
                    self.robot,
                    role_name(needed)
                ),
            )
            .with("field", "role")
            .with("needed", role_name(needed)),
            Refusal::ScopeTooNarrow { scope, needed } => Denial::new(
                DenialCode::LeaseRequired,
                format!(
                    "this sub-lease of {} is for {}, and {} is needed: ask the holder of the lease",
                    self.robot,
                    scope_name(scope),
                    scope_name(needed)
                ),
            )
            .with("scope", scope_name(scope))
            .with("needed", scope_name(needed)),
            Refusal::DelegatedAlready => Denial::new(
                DenialCode::LeaseRequired,
                format!(
                    "a sub-lease of {} cannot be delegated again: ask the holder of the lease",
                    self.robot
                ),
            ),
            Refusal::TooManyDelegates { limit } => Denial::new(
                DenialCode::Busy,
                format!("the lease of {} has {limit} sub-leases already", self.robot),
            )
            .with("limit", limit),
            Refusal::OperationalMode(mode) => Denial::new(
                DenialCode::WrongMode,
                format!(
                    "the key switch of {} stands at {}, which forbids this",
                    self.robot,
                    operational_name(mode)
                ),
            )
            .with("operational_mode", operational_name(mode)),
            Refusal::OperationalModeChanged => self.ended("the key switch was turned"),
            Refusal::QueueFull { limit } => Denial::new(
                DenialCode::Busy,
                format!("{limit} motions wait for {} already", self.robot),
            )
            .with("limit", limit),
            Refusal::QueueBroken => self.ended("the motion before it ended early"),
            Refusal::NotPausable => Denial::new(
                DenialCode::NotSupported,
                format!(
                    "this motion of {} cannot be paused: trajectories, single moves and jogs to a \
                     position can while they are in progress, unless other robots keep their pace",
                    self.robot
                ),
            ),
            Refusal::NoHome { joint } => Denial::new(
                DenialCode::NotSupported,
                format!("the robot file of {} gives {} no home", self.robot, self.joint(joint)),
            )
            .with("joint", self.joint(joint)),
            Refusal::NotHomed { joint } => Denial::new(
                DenialCode::NotReady,
                format!("{} of {} is not homed", self.joint(joint), self.robot),
            )
            .with("joint", self.joint(joint)),
            Refusal::NoSuchChain { chain } => Denial::new(
                DenialCode::InvalidArgument,
                format!("{} has no chain number {chain}", self.robot),
            ),
            Refusal::ControllerRefused { code } => Denial::new(
                DenialCode::DriverError,
                format!("the controller of {} gave up with error {code}", self.robot),
            )
            .with("code", code),
            Refusal::TooLate => Denial::new(
                DenialCode::Timeout,
                format!("the control loop of {} was too busy: nothing was begun", self.robot),
            ),
            Refusal::StepFailed => Denial::new(
                DenialCode::Internal,
                format!(
                    "the control loop of {} failed in the step that took the request: look \
                     whether it was done",
                    self.robot
                ),
            ),
            Refusal::ControllerTimeout => Denial::new(
                DenialCode::Timeout,
                format!("the controller of {} did not do it in time", self.robot),
            ),
            Refusal::EquipmentChanged { current, .. } => Denial::new(
                DenialCode::StaleModel,
                format!("tools or payloads of {} were changed meanwhile: look again", self.robot),
            )
            .with("config_seqno", current),
            Refusal::StartTooSoon { lead_s, least_s } => Denial::new(
                DenialCode::Timeout,
                format!(
                    "the start is in {:.1} ms, robots that start together need {:.1} ms to agree",
                    lead_s * 1e3,
                    least_s * 1e3
                ),
            )
            .with("lead_ms", lead_s * 1e3)
            .with("limit", least_s * 1e3),
            Refusal::Partner { group, partner, fault } => self.partner(group, partner, fault),
            Refusal::Superseded => Denial::new(
                DenialCode::Busy,
                format!("{}: another request of the same kind took its place", self.robot),
            ),
        }
    }

    /// The denial that a partner's conduct means.
    fn partner(&self, group: Uuid, partner: u8, fault: PartnerFault) -> Denial {
        let (name, said) = self.groups.of(group, partner);
        let (code, text) = match fault {
            PartnerFault::Aborted => match said {
                Some(said) => (said.code, format!("partner {name} stopped: {}", said.message)),
                None => (DenialCode::NotReady, format!("partner {name} stopped")),
            },
            PartnerFault::Silent(silence_s) => (
                DenialCode::CommunicationLost,
                format!("partner {name} was not heard for {:.0} ms", silence_s * 1e3),
            ),
            PartnerFault::NotReady => (
                DenialCode::NotReady,
                format!("partner {name} did not say that it is ready to start"),
            ),
            PartnerFault::Diverged(apart_s) => (
                DenialCode::Tolerance,
                format!("partner {name} is {:.1} ms away on the common path", apart_s * 1e3),
            ),
        };
        Denial::new(code, text).with("partner", name)
    }

    fn wrong_mode(&self, mode: CommandMode, needed: CommandMode) -> Denial {
        Denial::new(
            DenialCode::WrongMode,
            format!(
                "{} is in {}, {} is needed: set it first",
                self.robot,
                name(mode),
                name(needed)
            ),
        )
        .with("command_mode", name(mode))
        .with("needed", name(needed))
    }

    /// The denial of a command while `holder`, in its role, has the lease for so long \[s\].
    pub(super) fn driven_by(&self, (holder, role): (&str, Role), remaining_s: f64) -> Denial {
        let (robot, who) = (&self.robot, title(holder, role));
        let message = if remaining_s > 0.0 {
            format!("{robot} is driven by {who} for another {remaining_s:.1} s")
        } else {
            format!(
                "{robot} still moves for {who}, whose lease has run out: acquire the lease to \
                 command it"
            )
        };
        let remaining_ms = (remaining_s * 1e3).round();
        Denial::new(DenialCode::LeaseRequired, message)
            .with("holder", holder)
            .with("role", role_name(role))
            .with("remaining_ms", remaining_ms)
    }

    /// The denial of motion while a stop is latched.
    pub(super) fn stopped(&self, level: StopLevel) -> Denial {
        Denial::new(
            DenialCode::Stopped,
            format!("{} is stopped at level {level:?}: reset the stop first", self.robot),
        )
        .with("level", format!("{level:?}"))
    }

    fn faulted(&self, code: FaultCode) -> Denial {
        let fault = fault_name(code);
        let remedy = self.remedy(code);
        Denial::new(DenialCode::Faulted, format!("{} has the fault {fault}: {remedy}", self.robot))
            .with("fault", fault)
    }

    fn out_of_range(&self, joint: usize, value: f64, limit: f64) -> Denial {
        let side = if value > limit { "above" } else { "below" };
        Denial::new(
            DenialCode::OutOfRange,
            format!("{} of {}: {value} is {side} the limit {limit}", self.joint(joint), self.robot),
        )
        .with("joint", self.joint(joint))
        .with("value", value)
        .with("limit", limit)
    }

    fn ended(&self, why: &str) -> Denial {
        Denial::new(DenialCode::WrongMode, format!("{}: {why}", self.robot))
    }

    /// What a person is to do about a fault.
    pub(super) fn remedy(&self, code: FaultCode) -> String {
        let cause = match code {
            FaultCode::CommunicationLost => "see that the controller runs and can be reached",
            FaultCode::ControllerError => "put right what the controller complains of",
            FaultCode::FatalError => "put the controller right, or restart it",
            FaultCode::EmergencyStop => "see that it is safe and release the emergency stop",
            FaultCode::GuardStop => "see that it is safe and close the safeguard",
            FaultCode::NotReady => "see why the drives went off",
            FaultCode::TrackingError | FaultCode::VelocityError => {
                "see what the robot ran into, or what loads it"
            }
            FaultCode::HomingFailed => "see why the controller found no reference",
            FaultCode::StopIgnored => "stop the motion at the controller, and see why it went on",
            FaultCode::LoopError => "report the defect; restart the agent if it stays",
        };
        let command = match clear_by(code) {
            ClearBy::Halt => "halt",
            ClearBy::ResetErrors | ClearBy::Controller => "reset-errors",
        };
        format!("{cause}, then: armada {command} {}", self.robot)
    }

    /// A fault of the loop, in words.
    pub(super) fn fault(&self, fault: &LoopFault) -> Fault {
        let joint = fault.joint.unwrap_or_default();
        let message = match fault.code {
            FaultCode::CommunicationLost => format!(
                "no feedback from the controller for {:.0} ms, limit {:.0} ms",
                fault.value * 1e3,
                fault.limit * 1e3
            ),
            FaultCode::ControllerError => format!("the controller reports error {}", fault.value),
            FaultCode::EmergencyStop => {
                "the controller's emergency stop is pressed: release it".to_owned()
            }
            FaultCode::NotReady => {
                "drives went off or the controller stopped taking commands".to_owned()
            }
            FaultCode::TrackingError => format!(
                "{} is {:.4} {unit} from its set-point, limit {} {unit}",
                self.joint(joint),
                fault.value,
                fault.limit,
                unit = self.unit(joint),
            ),
            FaultCode::LoopError => "the control loop failed in a step".to_owned(),
            FaultCode::FatalError => "the controller reports a fatal error".to_owned(),
            FaultCode::GuardStop => "a safeguard of the controller is open".to_owned(),
            FaultCode::VelocityError => format!(
                "{} is {:.4} {unit}/s from its set-point, limit {} {unit}/s",
                self.joint(joint),
                fault.value,
                fault.limit,
                unit = self.unit(joint),
            ),
            FaultCode::HomingFailed => "the controller failed to home".to_owned(),
            FaultCode::StopIgnored => format!(
                "the controller goes on with its own motion {:.1} s after it was asked to end it, \
                 limit {:.1} s: its drives are switched off",
                fault.value, fault.limit
            ),
        };
        Fault {
            code: fault.code,
            message,
            joint: fault.joint.map(|joint| self.joint(joint).to_owned()),
            value: fault.value,
            limit: fault.limit,
            clear: clear_by(fault.code),
            remedy: self.remedy(fault.code),
            recording: None,
            since_ns: fault.stamp,
        }
    }
}

/// The denial that a trajectory which is not valid means.
pub(super) fn trajectory_denial(error: &TrajectoryError) -> Denial {
    let code = match error {
        TrajectoryError::BeyondLimit { .. } => DenialCode::OutOfRange,
        TrajectoryError::TooManyWaypoints { .. } | TrajectoryError::TooLong { .. } => {
            DenialCode::TooLarge
        }
        _ => DenialCode::InvalidArgument,
    };
    let denial = Denial::new(code, error.to_string()).with("field", "trajectory");
    match error {
        TrajectoryError::BeyondLimit { joint, value, limit, .. } => {
            denial.with("joint", joint.as_str()).with("value", *value).with("limit", *limit)
        }
        _ => denial,
    }
}

/// A waypoint would let the robot be further away than the robot's own supervision does.
pub(super) fn wide_tolerance_denial(
    waypoint: usize,
    joint: &str,
    value: f64,
    limit: f64,
) -> Denial {
    let text = format!(
        "waypoint {waypoint}: position_tolerance {value} of {joint} is above the robot's tracking \
         tolerance {limit}, which cannot be widened"
    );
    Denial::new(DenialCode::OutOfRange, text)
        .with("field", "position_tolerance")
        .with("joint", joint)
        .with("value", value)
        .with("limit", limit)
}

/// A mode as it is written on the wire.
pub(super) fn name(mode: CommandMode) -> String {
    wire_name(serde_json::to_value(mode))
}

/// An operational mode as it is written on the wire.
pub(super) fn operational_name(mode: OperationalMode) -> String {
    wire_name(serde_json::to_value(mode))
}

/// A fault's kind as it is written on the wire.
pub(super) fn fault_name(code: FaultCode) -> String {
    wire_name(serde_json::to_value(code))
}

/// A role as it is written on the wire.
pub(super) fn role_name(role: Role) -> String {
    wire_name(serde_json::to_value(role))
}

/// A scope as it is written on the wire.
pub(super) fn scope_name(scope: LeaseScope) -> String {
    wire_name(serde_json::to_value(scope))
}

fn wire_name(value: serde_json::Result<Value>) -> String {
    value.ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

#[cfg(test)]
mod tests;
