//! Every refusal and every fault in words, and where each code of the contract comes from.

use armada_model::{JointLimits, JointType, MonoTime};
use armada_protocol::messages::ReducedLimits;
use uuid::Uuid;

use super::*;

fn vocabulary() -> Vocabulary {
    let joint = |name: &str, joint_type| JointInfo {
        name: name.to_owned(),
        joint_type,
        limits: JointLimits::default(),
        reduced: ReducedLimits::default(),
        home: None,
    };
    let joints = vec![joint("elbow", JointType::Revolute), joint("rail", JointType::Prismatic)];
    let mut vocabulary = Vocabulary::new("left_arm".parse().expect("a name"), joints);
    vocabulary.groups.note(Uuid::from_u128(9), &["right_arm".parse().expect("a name")]);
    vocabulary
}

/// Makes the table of refusals, and a match over them that a new one does not pass.
macro_rules! refusals {
    ($($pattern:pat => $example:expr, $code:ident;)+) => {
        /// An example of every refusal, with its code.
        fn table() -> Vec<(Refusal, DenialCode)> {
            let table = vec![$(($example, DenialCode::$code)),+];
            for (example, _) in &table {
                match example {
                    $($pattern => {})+
                }
            }
            table
        }
    };
}

refusals! {
    Refusal::WrongMode { .. } =>
        Refusal::WrongMode { mode: CommandMode::Halt, needed: CommandMode::Jog }, WrongMode;
    Refusal::ThroughHalt { .. } =>
        Refusal::ThroughHalt { mode: CommandMode::Jog, wanted: CommandMode::Homing }, WrongMode;
    Refusal::ModeNotSupported(_) => Refusal::ModeNotSupported(CommandMode::Homing), NotSupported;
    Refusal::Stopped(_) => Refusal::Stopped(StopLevel::L1), Stopped;
    Refusal::Faulted(_) => Refusal::Faulted(FaultCode::GuardStop), Faulted;
    Refusal::CommunicationLost => Refusal::CommunicationLost, CommunicationLost;
    Refusal::NotEnabled => Refusal::NotEnabled, NotEnabled;
    Refusal::NotReady => Refusal::NotReady, NotReady;
    Refusal::CauseRemains(_) => Refusal::CauseRemains(FaultCode::EmergencyStop), Faulted;
    Refusal::Busy(_) => Refusal::Busy(Uuid::nil()), Busy;
    Refusal::StillMoving => Refusal::StillMoving, Busy;
    Refusal::NoSuchMotion => Refusal::NoSuchMotion, NotAttached;
    Refusal::OutOfRange { .. } =>
        Refusal::OutOfRange { joint: 0, value: 3.0, limit: 2.0 }, OutOfRange;
    Refusal::StartTolerance { .. } =>
        Refusal::StartTolerance { joint: 1, value: 0.3, limit: 0.1 }, Tolerance;
    Refusal::WrongLength { .. } => Refusal::WrongLength { given: 3, expected: 2 }, InvalidArgument;
    Refusal::EpochPassed { .. } => Refusal::EpochPassed { given: 3, current: 5 }, LeaseStale;
    Refusal::StartMissed { .. } => Refusal::StartMissed { late_s: 0.25 }, Timeout;
    Refusal::Cancelled => Refusal::Cancelled, WrongMode;
    Refusal::ModeLeft => Refusal::ModeLeft, WrongMode;
    Refusal::Disabled => Refusal::Disabled, NotEnabled;
    Refusal::StillEnabled => Refusal::StillEnabled, DriverError;
    Refusal::TooManyPending => Refusal::TooManyPending, Busy;
    Refusal::NotSupported(_) => Refusal::NotSupported("homing"), NotSupported;
    Refusal::LeaseRequired { .. } => Refusal::LeaseRequired { remaining_s: 3.2 }, LeaseRequired;
    Refusal::LeaseStale => Refusal::LeaseStale, LeaseStale;
    Refusal::LeaseLost => Refusal::LeaseLost, LeaseStale;
    Refusal::LeaseTaken => Refusal::LeaseTaken, LeaseRequired;
    Refusal::LocalControl => Refusal::LocalControl, LeaseRequired;
    Refusal::RoleTooLow { .. } => Refusal::RoleTooLow { needed: Role::Operator }, LeaseRequired;
    Refusal::ScopeTooNarrow { .. } =>
        Refusal::ScopeTooNarrow { scope: LeaseScope::Io, needed: LeaseScope::Arm }, LeaseRequired;
    Refusal::DelegatedAlready => Refusal::DelegatedAlready, LeaseRequired;
    Refusal::TooManyDelegates { .. } => Refusal::TooManyDelegates { limit: 8 }, Busy;
    Refusal::OperationalMode(_) => Refusal::OperationalMode(OperationalMode::Auto), WrongMode;
    Refusal::OperationalModeChanged => Refusal::OperationalModeChanged, WrongMode;
    Refusal::QueueFull { .. } => Refusal::QueueFull { limit: 16 }, Busy;
    Refusal::QueueBroken => Refusal::QueueBroken, WrongMode;
    Refusal::NotPausable => Refusal::NotPausable, NotSupported;
    Refusal::NoHome { .. } => Refusal::NoHome { joint: 1 }, NotSupported;
    Refusal::NotHomed { .. } => Refusal::NotHomed { joint: 0 }, NotReady;
    Refusal::NoSuchChain { .. } => Refusal::NoSuchChain { chain: 4 }, InvalidArgument;
    Refusal::ControllerRefused { .. } => Refusal::ControllerRefused { code: 12 }, DriverError;
    Refusal::ControllerTimeout => Refusal::ControllerTimeout, Timeout;
    Refusal::TooLate => Refusal::TooLate, Timeout;
    Refusal::NoLease => Refusal::NoLease, LeaseRequired;
    Refusal::StepFailed => Refusal::StepFailed, Internal;
    Refusal::EquipmentChanged { .. } =>
        Refusal::EquipmentChanged { given: 1, current: 2 }, StaleModel;
    Refusal::Superseded => Refusal::Superseded, Busy;
    Refusal::StartTooSoon { .. } =>
        Refusal::StartTooSoon { lead_s: 0.004, least_s: 0.02 }, Timeout;
    Refusal::Partner { fault: PartnerFault::Aborted, .. } =>
        partner(PartnerFault::Aborted), NotReady;
    Refusal::Partner { fault: PartnerFault::NotReady, .. } =>
        partner(PartnerFault::NotReady), NotReady;
    Refusal::Partner { fault: PartnerFault::Silent(_), .. } =>
        partner(PartnerFault::Silent(0.061)), CommunicationLost;
    Refusal::Partner { fault: PartnerFault::Diverged(_), .. } =>
        partner(PartnerFault::Diverged(0.055)), Tolerance;
}

fn partner(fault: PartnerFault) -> Refusal {
    Refusal::Partner { group: Uuid::from_u128(9), partner: 0, fault }
}

/// Codes that no refusal of the loop has, and where they are produced and tested.
const ELSEWHERE: [(DenialCode, &str); 6] = [
    (DenialCode::Collision, "own links, self_collision.rs; the gateway"),
    (DenialCode::AlreadyAttached, "tools and payloads, agent/tests/equipment.rs"),
    (DenialCode::Unreachable, "inverse kinematics, agent/tests/moves.rs; the gateway"),
    (DenialCode::TooLarge, "codec.rs: a payload above the limit; here: a long trajectory"),
    (DenialCode::BadEncoding, "codec.rs: a payload that cannot be read"),
    (DenialCode::UnknownMethod, "serve.rs: a method that does not exist"),
];

/// Codes whose methods are built by others, or later.
const LATER: [(DenialCode, &str); 1] =
    [(DenialCode::StaleSequence, "streams count such samples; no request has a number yet")];

#[test]
fn every_refusal_has_its_code_and_words_of_the_house() {
    let vocabulary = vocabulary();
    for (refusal, code) in table() {
        let denial = vocabulary.denial(&refusal);
        assert_eq!(denial.code, code, "{refusal:?}");
        let first = denial.message.chars().next().expect("words");
        assert!(!first.is_uppercase() && !denial.message.ends_with('.'), "{}", denial.message);
        assert!(!denial.message.contains('{') && denial.message.len() > 10, "{}", denial.message);
    }
}

#[test]
fn every_code_of_the_contract_comes_from_somewhere() {
    let refusals: Vec<DenialCode> = table().into_iter().map(|(_, code)| code).collect();
    for code in DenialCode::ALL {
        let places = [
            refusals.contains(&code),
            ELSEWHERE.iter().any(|(elsewhere, _)| *elsewhere == code),
            LATER.iter().any(|(later, _)| *later == code),
        ];
        let count = places.into_iter().filter(|place| *place).count();
        assert_eq!(count, 1, "{code} is in {count} of the lists");
    }
}

#[test]
fn a_trajectory_of_too_many_waypoints_is_too_large() {
    let error = TrajectoryError::TooManyWaypoints { count: 20_000, limit: 10_000 };
    assert_eq!(trajectory_denial(&error).code, DenialCode::TooLarge);
}

#[test]
fn every_fault_says_what_when_where_and_what_to_do() {
    let vocabulary = vocabulary();
    for code in [
        FaultCode::CommunicationLost,
        FaultCode::ControllerError,
        FaultCode::FatalError,
        FaultCode::EmergencyStop,
        FaultCode::GuardStop,
        FaultCode::NotReady,
        FaultCode::TrackingError,
        FaultCode::VelocityError,
        FaultCode::HomingFailed,
        FaultCode::StopIgnored,
        FaultCode::LoopError,
    ] {
        let stamp = MonoTime::from_nanos(7);
        let joint = matches!(code, FaultCode::TrackingError | FaultCode::VelocityError);
        let joint = joint.then_some(1);
        let fault = vocabulary.fault(&LoopFault { code, stamp, joint, value: 0.3, limit: 0.1 });
        assert_eq!((fault.since_ns, fault.value, fault.limit), (stamp, 0.3, 0.1));
        assert_eq!(fault.joint.as_deref(), joint.map(|_| "rail"));
        let command = if fault.clear == ClearBy::Halt { "halt" } else { "reset-errors" };
        let ending = format!("then: armada {command} left_arm");
        assert!(fault.remedy.ends_with(&ending), "{code:?}: {}", fault.remedy);
        assert!(joint.is_none() || fault.message.contains("rail is 0.3000 m"), "{}", fault.message);
    }
}

#[test]
fn whoever_is_refused_for_a_lease_learns_who_holds_it_and_for_how_long() {
    let denial = vocabulary().driven_by(("planner-2", Role::Program), 3.2);
    assert_eq!(denial.message, "left_arm is driven by planner-2 for another 3.2 s");
    assert_eq!(denial.details["holder"], "planner-2");
    let person = vocabulary().driven_by(("anna", Role::Supervisor), 0.4);
    assert_eq!(person.message, "left_arm is driven by anna (supervisor) for another 0.4 s");
    assert_eq!(person.details["role"], "supervisor");
    assert_eq!(denial.details["remaining_ms"], 3200.0);
}

#[test]
fn a_partner_is_told_by_its_name_and_its_own_reason() {
    let mut vocabulary = vocabulary();
    let silent = vocabulary.denial(&partner(PartnerFault::Silent(0.0612)));
    assert_eq!(silent.message, "partner right_arm was not heard for 61 ms");
    let reason = Denial::new(DenialCode::Faulted, "right_arm has the fault tracking_error");
    vocabulary.groups.note_reason(Uuid::from_u128(9), 0, reason);
    let aborted = vocabulary.denial(&partner(PartnerFault::Aborted));
    assert_eq!(aborted.code, DenialCode::Faulted);
    assert_eq!(
        aborted.message,
        "partner right_arm stopped: right_arm has the fault tracking_error"
    );
}
