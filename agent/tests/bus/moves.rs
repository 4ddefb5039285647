//! Tools, kinematics and single moves of a running agent, over real Zenoh and datagrams.

use crate::common::{Bench, denial};
use armada_model::{JointVector, Pose};
use armada_protocol::messages::*;
use armada_protocol::method::robot::{
    AttachPayload, AttachTool, DetachPayload, DetachTool, ForwardKinematics, InverseKinematics,
    MoveJoint, MoveLinear, MovePose, SetMode,
};
use uuid::Uuid;

const START: [f64; 6] = [0.2, -1.2, 1.4, -1.7, -1.4, 0.1];

fn tool() -> ToolInfo {
    ToolInfo {
        name: "gripper".to_owned(),
        uuid: None,
        tool_type: ToolType::ElectricGripper,
        tcp: Pose::from_translation(0.0, 0.0, 0.15),
        inertia: Inertia { mass_kg: 0.9, com_m: [0.0, 0.0, 0.06], inertia_kg_m2: [0.0; 6] },
        description: String::new(),
    }
}

fn attach() -> AttachToolParams {
    AttachToolParams { chain: None, tool: Some(tool()), name: None }
}

fn move_joint(position: [f64; 6], options: MoveOptions) -> MoveJointParams {
    let joint_position_rad = JointVector::from_slice(&position).expect("six joints");
    MoveJointParams { motion_id: None, joint_position_rad, options }
}

fn move_to(pose: Pose, options: MoveOptions) -> MovePoseParams {
    MovePoseParams { motion_id: None, chain: None, pose, options }
}

async fn follow_moves(bench: &Bench) {
    let params = SetModeParams { mode: CommandMode::Trajectory };
    bench.client.call::<SetMode>(&bench.robot, params).await.expect("mode is granted");
}

async fn tcp(bench: &Bench) -> Pose {
    let params = ForwardKinematicsParams::default();
    bench.client.call::<ForwardKinematics>(&bench.robot, params).await.expect("a pose").tcp
}

async fn tcp_at(bench: &Bench, position: JointVector) -> Pose {
    let joint_position_rad = Some(position);
    let params = ForwardKinematicsParams { joint_position_rad, ..Default::default() };
    bench.client.call::<ForwardKinematics>(&bench.robot, params).await.expect("a pose").tcp
}

async fn ended(bench: &Bench, id: Uuid) -> ActionStatus {
    bench.motion_end(id).await.status
}

/// Asks until the robot was measured to stand.
async fn attached(bench: &Bench) -> EquipmentAnswer {
    loop {
        match bench.client.call::<AttachTool>(&bench.robot, attach()).await {
            Ok(answer) => return answer,
            Err(error) => assert_eq!(denial(Err::<(), _>(error)).code, DenialCode::Busy),
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tool_moves_the_tcp_and_keeps_the_order_of_its_payload() {
    let bench = Bench::start().await;
    let (client, robot) = (&bench.client, &bench.robot);
    let flange = tcp(&bench).await;
    let answer = attached(&bench).await;
    assert_eq!((answer.config_seqno, answer.model_rev), (2, 2));
    let moved = tcp(&bench).await;
    assert!((moved.distance(&flange).0 - 0.15).abs() < 1e-3, "{moved:?}");
    let again = denial(client.call::<AttachTool>(robot, attach()).await);
    assert_eq!(again.code, DenialCode::AlreadyAttached);
    let inertia = Inertia { mass_kg: 2.0, ..Inertia::default() };
    let payload =
        PayloadInfo { name: "box".to_owned(), uuid: None, inertia, description: String::new() };
    let params = AttachPayloadParams { chain: None, payload, pose: Pose::default() };
    client.call::<AttachPayload>(robot, params).await.expect("held");
    let early = denial(client.call::<DetachTool>(robot, DetachParams::default()).await);
    assert_eq!(early.code, DenialCode::AlreadyAttached, "{early}");
    client.call::<DetachPayload>(robot, DetachParams::default()).await.expect("let go");
    let other = DetachParams { chain: None, name: Some("torch".to_owned()) };
    let other = denial(client.call::<DetachTool>(robot, other).await);
    assert_eq!(other.code, DenialCode::NotAttached, "{other}");
    client.call::<DetachTool>(robot, DetachParams::default()).await.expect("detached");
    let info = client.robot_info(robot).await.expect("info");
    assert_eq!(info.model_rev, 5);
    assert_eq!(info.equipment[0].tool, None);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_straight_move_leads_the_tool_along_its_line() {
    let bench = Bench::start().await;
    let (client, robot) = (&bench.client, &bench.robot);
    attached(&bench).await;
    follow_moves(&bench).await;
    let params = move_joint(START, MoveOptions { wait: true, ..MoveOptions::default() });
    let answer = client.call::<MoveJoint>(robot, params).await.expect("moved");
    assert_eq!(answer.status, Some(ActionStatus::Complete));
    let states =
        client.subscribe::<RobotState>("robots/left_arm/state", 512).await.expect("subscribes");
    // Where it is told to be, which it still approaches.
    let from = tcp_at(&bench, JointVector::from_slice(&START).expect("six joints")).await;
    let to = Pose::from_translation(-0.05, 0.15, 0.1) * from;
    let accepted =
        client.call::<MoveLinear>(robot, move_to(to, MoveOptions::default())).await.expect("taken");
    assert_eq!(ended(&bench, accepted.motion_id).await, ActionStatus::Complete);
    let direction = (to.position() - from.position()).normalize();
    let mut way = 0.0_f64;
    loop {
        // Where it is told to be: where it is depends on when a busy machine lets the loop run.
        let (_, state) = states.next().await.expect("a state");
        let tip = tcp_at(&bench, state.joint_position_command_rad).await;
        let off = tip.position() - from.position();
        let beside = (off - direction * off.dot(&direction)).norm();
        assert!(beside < 1e-3, "{beside} m beside the line");
        way = way.max(off.dot(&direction));
        if tip.distance(&to).0 < 1e-4 {
            break;
        }
    }
    assert!((way - to.distance(&from).0).abs() < 1e-3, "{way} m");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn connected_moves_are_one_motion_with_a_status_each() {
    let bench = Bench::start().await;
    let (client, robot) = (&bench.client, &bench.robot);
    follow_moves(&bench).await;
    let mut corner = START;
    corner[0] += 0.5;
    let mut end = corner;
    end[1] -= 0.3;
    let connect = MoveOptions { connect: true, ..MoveOptions::default() };
    let rounded = MoveOptions { blend_radius_m: 0.05, ..connect };
    let first = client.call::<MoveJoint>(robot, move_joint(START, connect)).await.expect("kept");
    assert_eq!(first.status, Some(ActionStatus::Queued));
    let second = client.call::<MoveJoint>(robot, move_joint(corner, rounded)).await.expect("kept");
    let last = MoveOptions { wait: true, ..MoveOptions::default() };
    let last = client.call::<MoveJoint>(robot, move_joint(end, last)).await.expect("moved");
    assert_eq!(last.status, Some(ActionStatus::Complete));
    for id in [first.motion_id, second.motion_id] {
        assert_eq!(ended(&bench, id).await, ActionStatus::Complete);
    }
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn collected_moves_end_with_their_epoch() {
    let bench = Bench::start().await;
    let (client, robot) = (&bench.client, &bench.robot);
    let connect = MoveOptions { connect: true, ..MoveOptions::default() };
    let early = denial(client.call::<MoveJoint>(robot, move_joint(START, connect)).await);
    assert_eq!(early.code, DenialCode::WrongMode);
    follow_moves(&bench).await;
    let kept = client.call::<MoveJoint>(robot, move_joint(START, connect)).await.expect("kept");
    let params = SetModeParams { mode: CommandMode::Halt };
    client.call::<SetMode>(robot, params).await.expect("halt");
    assert_eq!(ended(&bench, kept.motion_id).await, ActionStatus::Cancelled);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn poses_are_solved_or_refused_with_the_reason() {
    let bench = Bench::start().await;
    let (client, robot) = (&bench.client, &bench.robot);
    let joint_position_rad = JointVector::from_slice(&START).ok();
    let params = ForwardKinematicsParams { chain: None, joint_position_rad };
    let pose = client.call::<ForwardKinematics>(robot, params).await.expect("a pose").tcp;
    let inverse = |pose| InverseKinematicsParams { chain: None, pose, seed_rad: None };
    let found = client.call::<InverseKinematics>(robot, inverse(pose)).await.expect("solved");
    let joint_position_rad = Some(found.joint_position_rad);
    let params = ForwardKinematicsParams { chain: None, joint_position_rad };
    let back = client.call::<ForwardKinematics>(robot, params).await.expect("a pose").tcp;
    assert!(back.distance(&pose).0 < 1e-5);
    let far = Pose::from_translation(5.0, 0.0, 0.0);
    let refused = denial(client.call::<InverseKinematics>(robot, inverse(far)).await);
    assert_eq!(refused.code, DenialCode::Unreachable);
    assert_eq!(refused.details["cause"], "out_of_reach");
    follow_moves(&bench).await;
    let refused =
        denial(client.call::<MovePose>(robot, move_to(far, MoveOptions::default())).await);
    assert_eq!(refused.code, DenialCode::Unreachable);
    let fast = MoveOptions { speed: 1.5, ..MoveOptions::default() };
    let refused = denial(client.call::<MovePose>(robot, move_to(pose, fast)).await);
    assert_eq!(refused.details["field"], "options.speed");
    bench.shut_down().await;
}
