//! One row for each reason, and that the gravest comes first.

use armada_protocol::messages::{
    ClearBy, ControllerState, Executor, LatchedStop, LoopStatistics, MotionKind, MotionStatus,
    OperationalMode, ResetNeeds, Role, StopLevel, StopSourceStatus,
};

use super::*;

const STAMP: MonoTime = MonoTime::from_nanos(7);

/// A robot in halt, drives on, of nobody.
fn calm() -> RobotStatus {
    RobotStatus {
        robot: "left_arm".parse().expect("a name"),
        boot_id: Uuid::nil(),
        seqno: 1,
        stamp_ns: STAMP,
        epoch: 1,
        command_mode: CommandMode::Halt,
        operational_mode: OperationalMode::Auto,
        controller_state: ControllerState::MotorOn,
        flags: RobotFlags::ENABLED.with(RobotFlags::READY, true),
        stop: None,
        faults: Vec::new(),
        authority: AuthorityState::Free,
        lease: None,
        motion: None,
        queued: Vec::new(),
        speed_ratio: 1.0,
        stream: None,
        control_loop: LoopStatistics::default(),
        dropped: Vec::new(),
        stop_sources: Vec::new(),
        why: Vec::new(),
        next: Vec::new(),
    }
}

fn stop() -> StopLatch {
    let (source, level) = ("door_1".to_owned(), StopLevel::L1);
    let reason = "door opened".to_owned();
    StopLatch {
        level,
        stops: vec![LatchedStop { stop_id: Uuid::nil(), source, level, reason }],
        stage: StopStage::Standstill,
        reset: ResetNeeds::default(),
    }
}

fn fault(code: FaultCode) -> Fault {
    Fault {
        code,
        message: "elbow is 0.2 rad from its set-point".to_owned(),
        joint: None,
        value: 0.2,
        limit: 0.1,
        clear: ClearBy::ResetErrors,
        remedy: "look what held it, then: armada reset-errors left_arm".to_owned(),
        recording: None,
        since_ns: STAMP,
    }
}

fn lease(stale: bool) -> Lease {
    Lease {
        holder: "anna".to_owned(),
        role: Role::Operator,
        reason: Some("planner hangs".to_owned()),
        remaining_ms: if stale { 0 } else { 800 },
        stale,
        delegates: Vec::new(),
    }
}

fn motion(status: ActionStatus) -> MotionStatus {
    MotionStatus {
        id: Uuid::nil(),
        robot: "left_arm".parse().expect("a name"),
        boot_id: Uuid::nil(),
        seqno: 1,
        stamp_ns: STAMP,
        kind: MotionKind::Trajectory,
        executor: Executor::Agent,
        status,
        reason: None,
        client: "planner".to_owned(),
        epoch: 1,
        started_ns: Some(STAMP),
        elapsed_s: 0.1,
        duration_s: 1.0,
        waypoint: 0,
        waypoint_count: 2,
        group: None,
    }
}

const fn stream(starved: bool, allowed: f64) -> StreamStatistics {
    let (taken, dropped, limited, age_ms) = (500, 2, 0, 61.4);
    StreamStatistics {
        taken,
        dropped,
        limited,
        age_ms,
        starved,
        jitter_ms: 4.25,
        loss: 0.05,
        state_age_ms: 12.0,
        allowed,
    }
}

/// What is changed of a calm robot.
type Change = fn(&mut RobotStatus);

/// Makes the table, and a match over its codes that a new one does not pass.
macro_rules! rows {
    ($($code:ident: $change:expr, $message:expr, $who:expr, $since:expr, $step:expr;)+) => {
        fn rows() -> Vec<(WhyCode, Change, &'static str, Option<&'static str>, bool, &'static str)> {
            let every = |code: WhyCode| match code { $(WhyCode::$code)|+ => {} };
            every(WhyCode::Ready);
            vec![$((WhyCode::$code, $change as Change, $message, $who, $since, $step)),+]
        }
    };
}

rows! {
    NotConnected: |s| s.flags = RobotFlags::COMMUNICATION_FAILURE,
        "the controller has not been heard yet", None, false,
        "check that the controller runs and its address is right";
    Stopped: |s| s.stop = Some(stop()),
        "stop L1 by door_1: door opened", Some("door_1"), true,
        "see that it is safe, then: armada reset left_arm";
    StopSource: |s| s.stop_sources = vec![
        StopSourceStatus { source: "door_1".to_owned(), pressed: true, age_ms: Some(42.5) },
    ],
        "door_1 is pressed or silent, heard 42 ms ago", Some("door_1"), false,
        "release door_1, and see that it can be heard";
    Faulted: |s| s.faults = vec![fault(FaultCode::TrackingError)],
        "elbow is 0.2 rad from its set-point", None, true,
        "look what held it, then: armada reset-errors left_arm";
    Local: |s| s.authority = AuthorityState::Local,
        "the pendant has control", Some("pendant"), true,
        "give control back at the pendant";
    DrivesOff: |s| s.flags = RobotFlags::NONE,
        "the drives are off", None, false,
        "switch the drives on: armada enable left_arm";
    DrivenBy: |s| s.lease = Some(lease(false)),
        "driven by anna (operator) for another 0.8 s, who took it: \"planner hangs\"",
        Some("anna"), true,
        "anybody but anna: wait, or: armada lease take left_arm --role operator --reason WHY";
    LeaseStale: |s| s.lease = Some(lease(true)),
        "the lease of anna (operator) has run out: it may renew it, anybody may have one, who took \
         it: \"planner hangs\"",
        Some("anna"), true,
        "acquire the lease: armada lease hold left_arm";
    Moving: |s| s.motion = Some(motion(ActionStatus::Running)),
        "it moves for planner, motion 00000000-0000-0000-0000-000000000000",
        Some("planner"), true,
        "wait for its end, or: armada halt left_arm";
    Waiting: |s| s.motion = Some(motion(ActionStatus::Paused)),
        "motion 00000000-0000-0000-0000-000000000000 of planner is paused", Some("planner"), false,
        "resume or cancel the motion, or wait for its start";
    DegradedLink: |s| s.stream = Some(stream(true, 1.0)),
        "the stream starves: no sample for 61 ms", None, false,
        "see to the link of somebody";
    Halted: |s| s.command_mode = CommandMode::Halt,
        "it is in halt: nothing is asked of it", None, false,
        "set a mode and move, or: armada move";
    Ready: |s| s.command_mode = CommandMode::Trajectory,
        "nothing keeps it from moving", None, false,
        "execute_trajectory, or set mode halt";
}

fn known() -> Known {
    let stops = vec![(Uuid::nil(), STAMP)];
    Known { stops, lease: Some(STAMP), local: Some(STAMP), ..Known::default() }
}

#[test]
fn every_reason_is_told_with_who_and_since_when_and_what_to_do() {
    for (code, change, message, who, has_since, step) in rows() {
        let mut status = calm();
        change(&mut status);
        let reasons = why(&status, &known());
        let first = reasons.first().expect("never empty");
        assert_eq!((first.code, first.message.as_str()), (code, message));
        assert_eq!(first.who.as_deref(), who, "{code:?}");
        assert_eq!(first.since_ns, has_since.then_some(STAMP), "{code:?}");
        assert_eq!(next(&status, &known()).first().map(String::as_str), Some(step), "{code:?}");
    }
}

#[test]
fn a_reason_without_a_time_is_dated_from_when_it_was_first_told() {
    let at = MonoTime::from_nanos;
    let mut told = FirstTold::default();
    let mut dated = |status: &RobotStatus, now: u64| {
        let mut reasons = why(status, &known());
        told.date(&mut reasons, at(now));
        reasons.iter().map(|why| (why.code, why.since_ns)).collect::<Vec<_>>()
    };
    let mut off = calm();
    off.flags = RobotFlags::NONE;
    assert_eq!(dated(&off, 100), [(WhyCode::DrivesOff, Some(at(100)))]);
    let off_and_stopped = RobotStatus { stop: Some(stop()), ..off.clone() };
    let expected = [(WhyCode::Stopped, Some(STAMP)), (WhyCode::DrivesOff, Some(at(100)))];
    assert_eq!(dated(&off_and_stopped, 200), expected);
    assert_eq!(dated(&calm(), 300), [(WhyCode::Halted, Some(at(300)))]);
    assert_eq!(dated(&off, 400), [(WhyCode::DrivesOff, Some(at(400)))]);
}

#[test]
fn the_reasons_come_in_the_order_of_their_weight() {
    let rows = rows();
    for (at, (grave, change, ..)) in rows.iter().enumerate() {
        for (light, other, ..) in rows.iter().skip(at + 1) {
            let mut status = calm();
            // The graver last, where both change the same.
            other(&mut status);
            change(&mut status);
            let codes: Vec<WhyCode> =
                why(&status, &known()).into_iter().map(|reason| reason.code).collect();
            assert_eq!(codes.first(), Some(grave), "beside {light:?}: {codes:?}");
            let order = |code| rows.iter().position(|row| row.0 == code);
            assert!(codes.is_sorted_by_key(|code| order(*code)), "{codes:?}");
        }
    }
}

#[test]
fn nothing_lighter_is_advised_while_something_grave_is_there() {
    let mut status = calm();
    status.flags = RobotFlags::NONE;
    status.lease = Some(lease(false));
    assert_eq!(next(&status, &known()), ["switch the drives on: armada enable left_arm"]);
    status.stop = Some(stop());
    status.faults = vec![fault(FaultCode::EmergencyStop), fault(FaultCode::EmergencyStop)];
    let steps = next(&status, &known());
    assert_eq!(
        steps,
        [
            "see that it is safe, then: armada reset left_arm",
            "look what held it, then: armada reset-errors left_arm",
        ]
    );
}

#[test]
fn a_stop_that_is_acknowledged_at_the_arm_says_so() {
    let mut status = calm();
    let reset = ResetNeeds { zone: ResetZone::Manual, acknowledged: false, ..Default::default() };
    status.stop = Some(StopLatch { reset, ..stop() });
    let step = next(&status, &known()).remove(0);
    assert!(step.starts_with("acknowledge it at the arm, see that it is safe"), "{step}");
}

#[test]
fn whoever_wants_to_move_a_robot_that_requires_a_lease_is_told_to_acquire_it() {
    let known = Known { lease_required: true, ..known() };
    let mut status = calm();
    let step = next(&status, &known).remove(0);
    assert!(step.ends_with("armada lease hold left_arm"), "{step}");
    status.lease = Some(lease(false));
    let steps = next(&status, &known);
    assert!(!steps.iter().any(|step| step.contains("without which")), "{steps:?}");
}

#[test]
fn a_reset_that_would_be_refused_yet_is_not_advised_before_its_time() {
    let mut status = calm();
    status.stop = Some(StopLatch { stage: StopStage::Commanded, ..stop() });
    let step = next(&status, &known()).remove(0);
    assert!(step.starts_with("wait until it is measured to stand still, see that"), "{step}");
}

#[test]
fn a_controller_that_serves_somebody_else_is_told_by_its_own_words() {
    let mut status = calm();
    status.flags = RobotFlags::COMMUNICATION_FAILURE;
    let link = Some("the controller is held by another client".to_owned());
    let known = Known { link, ..Known::default() };
    let first = why(&status, &known).remove(0);
    assert_eq!(first.message, "the controller is held by another client");
    status.faults = vec![fault(FaultCode::CommunicationLost)];
    let reasons = why(&status, &known);
    assert_eq!(reasons.len(), 1, "the silence is told once: {reasons:?}");
    assert_eq!(reasons[0].since_ns, Some(STAMP));
}

#[test]
fn a_stream_is_told_as_it_goes_and_as_its_link_lets_it() {
    for (stream, code, words) in [
        (stream(false, 1.0), WhyCode::Moving, "it follows a stream, 500 samples so far"),
        (stream(false, 0.5), WhyCode::DegradedLink, "the stream is slowed to 50 %"),
        (stream(false, 0.0), WhyCode::DegradedLink, "the stream is refused: jitter 4.2 ms"),
    ] {
        let mut status = calm();
        status.command_mode = CommandMode::VelocityCommand;
        status.stream = Some(stream);
        let reasons = why(&status, &known());
        let told = reasons.iter().find(|reason| reason.code == code);
        let told = told.unwrap_or_else(|| panic!("no {code:?} in {reasons:?}"));
        assert!(told.message.starts_with(words), "{}", told.message);
    }
}
