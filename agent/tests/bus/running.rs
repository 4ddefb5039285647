//! A running agent over real Zenoh, with a simulated controller over real datagrams.

use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

use crate::common::{Bench, DEADLINE, denial, emulate, stop_options};
use armada_agent::runtime::{Agent, AgentError};
use armada_model::{JointTrajectory, JointUnit, JointVector, Pose, Waypoint};
use armada_protocol::messages::*;
use armada_protocol::method::robot::{
    Abort, AttachTool, Cancel, Commit, ExecuteTrajectory, Halt, JogFreespace, Prepare, Reset,
    ResetErrors, SetMode,
};
use uuid::Uuid;

const READY: [f64; 6] = [0.0, -FRAC_PI_2, FRAC_PI_2, -FRAC_PI_2, -FRAC_PI_2, 0.0];

pub(crate) fn goal(first: f64) -> JogFreespaceParams {
    let mut position = READY;
    position[0] = first;
    JogFreespaceParams {
        motion_id: None,
        joint_position_rad: JointVector::from_slice(&position).expect("six joints"),
        max_velocity_rad_s: None,
        wait: false,
    }
}

/// Turns the first joint from `from` to `to` in `duration_s`.
fn turn(from: f64, to: f64, duration_s: f64) -> JointTrajectory {
    let names = [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ];
    let waypoint = |time_from_start_s, first| {
        let mut joint_position = READY.to_vec();
        joint_position[0] = first;
        Waypoint { time_from_start_s, joint_position, ..Waypoint::default() }
    };
    JointTrajectory {
        joint_names: names.map(str::to_owned).to_vec(),
        waypoints: vec![waypoint(0.0, from), waypoint(duration_s, to)],
        ..JointTrajectory::default()
    }
}

fn follow(trajectory: JointTrajectory) -> ExecuteTrajectoryParams {
    ExecuteTrajectoryParams::at_once(None, trajectory)
}

fn prepare(trajectory: JointTrajectory) -> PrepareParams {
    PrepareParams::alone(None, trajectory)
}

async fn set_mode(bench: &Bench, mode: CommandMode) -> ModeAnswer {
    let params = SetModeParams { mode };
    bench.client.call::<SetMode>(&bench.robot, params).await.expect("mode is granted")
}

pub(crate) fn stop(level: StopLevel) -> StopRequest {
    StopRequest {
        stop_id: Uuid::now_v7(),
        source: "test".to_owned(),
        level,
        scope: StopScope::Cell,
        reason: "test".to_owned(),
        seq: 0,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_jog_ends_at_its_goal_and_says_so_once() {
    let bench = Bench::start().await;
    set_mode(&bench, CommandMode::Jog).await;
    let accepted = bench.client.call::<JogFreespace>(&bench.robot, goal(0.2)).await.expect("jog");
    assert!(accepted.duration_s > 0.1, "{accepted:?}");
    let end = bench.motion_end(accepted.motion_id).await;
    assert_eq!(end.status, ActionStatus::Complete, "{end:?}");
    assert_eq!(end.client, "test");
    let states = bench.client.subscribe::<RobotState>("robots/left_arm/state", 1).await;
    let states = states.expect("subscribes");
    let arrived = async {
        loop {
            let (_, state) = states.next().await.expect("a state");
            assert_eq!(state.joint_position_command_rad[0], 0.2);
            assert_eq!(state.tcp.len(), 1);
            if (state.joint_position_rad[0] - 0.2).abs() < 5e-3 {
                return;
            }
        }
    };
    tokio::time::timeout(DEADLINE, arrived).await.expect("the robot follows");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trajectory_is_followed_to_its_last_waypoint_exactly() {
    let bench = Bench::start().await;
    set_mode(&bench, CommandMode::Trajectory).await;
    let params = follow(turn(0.0, 0.25, 0.8));
    let accepted =
        bench.client.call::<ExecuteTrajectory>(&bench.robot, params).await.expect("accepted");
    assert_eq!(accepted.duration_s, 0.8);
    let end = bench.motion_end(accepted.motion_id).await;
    assert_eq!((end.status, end.waypoint, end.waypoint_count), (ActionStatus::Complete, 1, 2));
    assert!(end.started_ns.is_some());
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trajectory_in_degrees_is_followed_and_its_tolerances_are_kept_or_refused() {
    let bench = Bench::start().await;
    set_mode(&bench, CommandMode::Trajectory).await;
    let within = |position: f64, velocity: &[f64]| {
        let mut trajectory = turn(0.0, 0.3, 1.0);
        for waypoint in &mut trajectory.waypoints {
            waypoint.position_tolerance = vec![position; 6];
            waypoint.velocity_tolerance = velocity.to_vec();
        }
        follow(trajectory)
    };
    let (client, robot) = (&bench.client, &bench.robot);
    let wide = denial(client.call::<ExecuteTrajectory>(robot, within(2.0, &[])).await);
    assert_eq!(wide.code, DenialCode::OutOfRange, "{wide:?}");
    assert!(wide.message.contains("position_tolerance 2 of shoulder_pan_joint"), "{wide:?}");
    let speed = client.call::<ExecuteTrajectory>(robot, within(0.05, &[0.5; 6])).await;
    let end = bench.motion_end(speed.expect("taken").motion_id).await;
    assert_eq!(end.status, ActionStatus::Complete, "{end:?}");
    let mut degrees = turn(0.3, 0.0, 1.0);
    degrees.joint_units = vec![JointUnit::Degree; 6];
    for value in degrees.waypoints.iter_mut().flat_map(|waypoint| &mut waypoint.joint_position) {
        *value = value.to_degrees();
    }
    let accepted = client.call::<ExecuteTrajectory>(robot, follow(degrees)).await.expect("taken");
    assert_eq!(accepted.duration_s, 1.0);
    let end = bench.motion_end(accepted.motion_id).await;
    assert_eq!(end.status, ActionStatus::Complete);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn refusals_say_what_is_wrong() {
    let bench = Bench::start().await;
    let (client, robot) = (&bench.client, &bench.robot);
    let refused = denial(client.call::<JogFreespace>(robot, goal(0.1)).await);
    assert_eq!(refused.code, DenialCode::WrongMode, "{refused}");
    let unsupported = SetModeParams { mode: CommandMode::InvalidState };
    let refused = denial(client.call::<SetMode>(robot, unsupported).await);
    assert_eq!(refused.code, DenialCode::NotSupported, "{refused}");
    set_mode(&bench, CommandMode::Jog).await;
    let refused = denial(client.call::<JogFreespace>(robot, goal(9.0)).await);
    assert_eq!(refused.code, DenialCode::OutOfRange, "{refused}");
    assert_eq!(refused.details["joint"], "shoulder_pan_joint");
    set_mode(&bench, CommandMode::Halt).await;
    set_mode(&bench, CommandMode::Trajectory).await;
    let far = follow(turn(0.5, 0.6, 1.0));
    let refused = denial(client.call::<ExecuteTrajectory>(robot, far).await);
    assert_eq!(refused.code, DenialCode::Tolerance, "{refused}");
    let fast = follow(turn(0.0, 1.0, 0.1));
    let refused = denial(client.call::<ExecuteTrajectory>(robot, fast).await);
    assert_eq!(refused.code, DenialCode::OutOfRange, "{refused}");
    let unknown = CancelParams { motion_id: Uuid::now_v7() };
    let refused = denial(client.call::<Cancel>(robot, unknown).await);
    assert_eq!(refused.code, DenialCode::NotAttached, "{refused}");
    let status = bench.status_when(|_| true).await;
    assert!(status.dropped.iter().any(|(what, count)| what == "denied_wrong_mode" && *count == 1));
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_latches_with_its_ladder_until_every_stop_is_listed_in_the_reset() {
    let bench = Bench::start().await;
    let (client, robot) = (&bench.client, &bench.robot);
    set_mode(&bench, CommandMode::Jog).await;
    let moving = client.call::<JogFreespace>(robot, goal(2.0)).await.expect("jog");
    bench.status_when(|s| s.motion.as_ref().is_some_and(|m| m.started_ns.is_some())).await;
    let request = stop(StopLevel::L2);
    let report = client.stop(request.clone(), stop_options()).await.expect("stop is sent");
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:?}");
    let end = bench.motion_end(moving.motion_id).await;
    assert_eq!(end.status, ActionStatus::Failed);
    assert_eq!(end.reason.expect("a reason").code, DenialCode::Stopped);
    let refused =
        denial(client.call::<SetMode>(robot, SetModeParams { mode: CommandMode::Jog }).await);
    assert_eq!(refused.code, DenialCode::Stopped);
    let incomplete = ResetParams::default();
    let refused = denial(client.call::<Reset>(robot, incomplete).await);
    assert_eq!(refused.code, DenialCode::InvalidArgument);
    let before = bench.status_when(|s| s.stop.is_some()).await;
    let listed = before.stop.expect("seen").reset_params();
    assert_eq!(listed.stop_ids, [request.stop_id]);
    let answer = client.call::<Reset>(robot, listed).await.expect("reset");
    assert_eq!(answer.cleared, [request.stop_id]);
    let after = bench.status_when(|s| s.stop.is_none()).await;
    assert!(after.epoch > before.epoch);
    assert_eq!(after.command_mode, CommandMode::Halt);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_level_one_stop_ends_with_the_drives_off() {
    let bench = Bench::start().await;
    let report = bench.client.stop(stop(StopLevel::L1), stop_options()).await.expect("stop");
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:?}");
    let status = bench
        .status_when(|s| s.stop.as_ref().is_some_and(|stop| stop.stage == StopStage::DrivesOff))
        .await;
    assert!(!status.flags.contains(RobotFlags::ENABLED));
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn something_unreadable_on_a_stop_key_stops_and_is_counted() {
    let bench = Bench::start().await;
    bench.client.session().put("cell/stop", "no stop request").await.expect("is sent");
    let status = bench.status_when(|status| status.stop.is_some()).await;
    assert_eq!(status.stop.expect("latched").level, StopLevel::L2);
    assert!(
        status.dropped.iter().any(|(what, _)| what == "unreadable_stop"),
        "{:?}",
        status.dropped
    );
    bench.shut_down().await;
}

/// Prepares a motion, commits it to start in a second, and waits for its end; again while the loop
/// was too late for the start, which on a busy machine it may be.
pub(crate) async fn committed(
    bench: &Bench,
    trajectory: &JointTrajectory,
) -> (CommitParams, MotionStatus) {
    let (client, robot) = (&bench.client, &bench.robot);
    for _ in 0..5 {
        let prepared = client.call::<Prepare>(robot, prepare(trajectory.clone())).await;
        let clock = client.robot_clock(robot).await.expect("clock");
        let commit = CommitParams {
            motion_id: prepared.expect("prepared").motion_id,
            boot_id: clock.boot_id,
            start_ns: clock.stamp_ns + Duration::from_secs(1),
            rate_slope_s: None,
        };
        client.call::<Commit>(robot, commit).await.expect("committed");
        let end = bench.motion_end(commit.motion_id).await;
        let was_late = end.reason.as_ref().is_some_and(|why| why.code == DenialCode::Timeout);
        if !was_late {
            return (commit, end);
        }
    }
    panic!("the loop is never in time");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_prepared_motion_starts_at_its_instant_and_dies_with_its_epoch() {
    let bench = Bench::start().await;
    let (client, robot) = (&bench.client, &bench.robot);
    set_mode(&bench, CommandMode::Trajectory).await;
    let (commit, end) = committed(&bench, &turn(0.0, 0.1, 0.5)).await;
    assert_eq!(end.status, ActionStatus::Complete, "{:?}", end.reason);
    let (start, started) = (commit.start_ns, end.started_ns.expect("it started"));
    // At the tick that is next to it: one that comes later is refused.
    let (early, late) = (start.saturating_since(started), started.saturating_since(start));
    assert!(early <= Duration::from_millis(1), "{early:?} early");
    assert!(late <= Duration::from_millis(4), "{late:?} late");

    let prepared =
        client.call::<Prepare>(robot, prepare(turn(0.1, 0.0, 0.5))).await.expect("prepared");
    client.call::<Halt>(robot, Empty {}).await.expect("halt");
    let commit = CommitParams { motion_id: prepared.motion_id, ..commit };
    let refused = denial(client.call::<Commit>(robot, commit).await);
    assert!(matches!(refused.code, DenialCode::WrongMode | DenialCode::LeaseStale), "{refused}");
    let gone = CancelParams { motion_id: prepared.motion_id };
    let refused = denial(client.call::<Abort>(robot, gone).await);
    assert_eq!(refused.code, DenialCode::NotAttached);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_motion_that_was_prepared_with_another_tool_is_not_committed() {
    let bench = Bench::start().await;
    let (client, robot) = (&bench.client, &bench.robot);
    set_mode(&bench, CommandMode::Trajectory).await;
    let turned = prepare(turn(0.0, 0.1, 0.5));
    let prepared = client.call::<Prepare>(robot, turned).await.expect("prepared");
    let tool = ToolInfo {
        name: "gripper".to_owned(),
        uuid: None,
        tool_type: ToolType::ElectricGripper,
        tcp: Pose::default(),
        inertia: Inertia { mass_kg: 0.9, ..Inertia::default() },
        description: String::new(),
    };
    let attach = AttachToolParams { chain: None, tool: Some(tool), name: None };
    let held = client.call::<AttachTool>(robot, attach).await.expect("it stands");
    let clock = client.robot_clock(robot).await.expect("clock");
    let commit = CommitParams {
        motion_id: prepared.motion_id,
        boot_id: clock.boot_id,
        start_ns: clock.stamp_ns + Duration::from_millis(200),
        rate_slope_s: None,
    };
    let refused = denial(client.call::<Commit>(robot, commit).await);
    assert_eq!(refused.code, DenialCode::StaleModel, "{refused}");
    assert_eq!(refused.details["limit"], held.model_rev, "{refused}");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_repeated_request_is_answered_again_and_not_done_again() {
    let bench = Bench::start().await;
    let request = Request::new("test", SetModeParams { mode: CommandMode::Jog });
    let payload = serde_json::to_vec(&request).expect("encodes");
    let mut epochs = Vec::new();
    for _ in 0..3 {
        let replies = bench
            .client
            .session()
            .get("robots/left_arm/rpc/set_mode")
            .payload(payload.clone())
            .await
            .expect("is asked");
        let reply = replies.recv_async().await.expect("a reply");
        let sample = reply.result().expect("granted").payload().to_bytes().into_owned();
        let answer: ModeAnswer = serde_json::from_slice(&sample).expect("an answer");
        epochs.push(answer.epoch);
    }
    assert!(epochs.windows(2).all(|pair| pair[0] == pair[1]), "{epochs:?}");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_controller_is_a_latched_fault_until_it_is_back_and_reset() {
    let mut bench = Bench::start().await;
    bench.emulation = None;
    let lost = bench.status_when(|s| !s.faults.is_empty()).await;
    assert_eq!(lost.faults[0].code, FaultCode::CommunicationLost);
    assert_eq!(lost.command_mode, CommandMode::InvalidState);
    let robot = &bench.robot;
    let refused = denial(bench.client.call::<ResetErrors>(robot, Empty {}).await);
    assert!(
        matches!(refused.code, DenialCode::CommunicationLost | DenialCode::Faulted),
        "{refused}"
    );
    bench.emulation = Some(emulate(&bench.file()));
    bench.status_when(|s| !s.flags.contains(RobotFlags::COMMUNICATION_FAILURE)).await;
    bench.client.call::<ResetErrors>(robot, Empty {}).await.expect("faults are cleared");
    let back = bench.status_when(|s| s.faults.is_empty()).await;
    assert_eq!(back.command_mode, CommandMode::Halt);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_agent_of_the_same_name_is_refused() {
    let bench = Bench::start().await;
    let mut options = bench.options();
    options.connect = Some(vec![bench.endpoint().to_owned()]);
    let second = tokio::time::timeout(DEADLINE, Agent::start(options)).await.expect("an answer");
    match second {
        Err(AgentError::NameTaken(name)) => assert_eq!(name, "left_arm"),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("two agents answer for one robot"),
    }
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn of_two_motions_with_one_id_exactly_one_begins() {
    let bench = Bench::start().await;
    set_mode(&bench, CommandMode::Trajectory).await;
    let params = || ExecuteTrajectoryParams::at_once(Some(Uuid::from_u128(7)), turn(0.0, 0.1, 0.5));
    let (client, robot) = (&bench.client, &bench.robot);
    let (one, other) = tokio::join!(
        client.call::<ExecuteTrajectory>(robot, params()),
        client.call::<ExecuteTrajectory>(robot, params()),
    );
    assert!(one.is_ok() != other.is_ok(), "{one:?} {other:?}");
    let refused = denial(if one.is_ok() { other } else { one });
    assert_eq!(refused.code, DenialCode::InvalidArgument, "{refused}");
    let end = bench.motion_end(Uuid::from_u128(7)).await;
    assert_eq!(end.status, ActionStatus::Complete, "{end:?}");
    bench.shut_down().await;
}
