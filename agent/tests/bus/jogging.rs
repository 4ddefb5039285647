//! Jogs and homing over real Zenoh, answered at once or at their end.

use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

use crate::common::{Bench, DEADLINE, denial, stop_options};
use armada_model::{JointVector, Twist};
use armada_protocol::messages::*;
use armada_protocol::method::robot::{
    Cancel, Halt, Home, JogCartesian, JogFreespace, JogJoint, SetMode,
};
use tokio::task::JoinSet;
use uuid::Uuid;

const READY: [f64; 6] = [0.0, -FRAC_PI_2, FRAC_PI_2, -FRAC_PI_2, -FRAC_PI_2, 0.0];

fn vector(first: f64, rest: [f64; 6]) -> JointVector {
    let mut values = rest;
    values[0] = first;
    JointVector::from_slice(&values).expect("six joints")
}

fn to(first: f64) -> JogFreespaceParams {
    JogFreespaceParams {
        motion_id: Some(Uuid::now_v7()),
        joint_position_rad: vector(first, READY),
        max_velocity_rad_s: None,
        wait: true,
    }
}

fn at_speed(id: Uuid, first: f64, timeout_s: f64) -> JogJointParams {
    JogJointParams {
        motion_id: Some(id),
        joint_velocity_rad_s: vector(first, [0.0; 6]),
        timeout_s,
        wait: false,
    }
}

async fn bench_in(mode: CommandMode) -> Bench {
    let bench = Bench::start().await;
    let params = SetModeParams { mode };
    bench.client.call::<SetMode>(&bench.robot, params).await.expect("mode is granted");
    bench
}

async fn commanded(bench: &Bench) -> f64 {
    let states = bench.client.subscribe::<RobotState>("robots/left_arm/state", 1).await;
    let (_, state) = states.expect("subscribes").next().await.expect("a state");
    state.joint_position_command_rad[0]
}

/// Waits until the motion is in progress.
async fn begun(bench: &Bench, id: Uuid) {
    bench.status_when(|status| status.motion.as_ref().is_some_and(|motion| motion.id == id)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_jog_that_is_waited_for_is_answered_at_its_goal() {
    let bench = bench_in(CommandMode::Jog).await;
    let call = bench.client.call_within::<JogFreespace>(&bench.robot, to(0.3), DEADLINE);
    let answer = call.await.expect("granted");
    assert_eq!(answer.status, Some(ActionStatus::Complete));
    assert_eq!(commanded(&bench).await, 0.3);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_that_is_cancelled_is_answered_so_and_one_that_fails_is_denied() {
    let bench = bench_in(CommandMode::Jog).await;
    let (client, robot) = (&bench.client, &bench.robot);
    let params = to(2.0);
    let id = params.motion_id.expect("given");
    let cancel = async {
        begun(&bench, id).await;
        client.call::<Cancel>(robot, CancelParams { motion_id: id }).await.expect("cancelled");
    };
    let (answer, ()) =
        tokio::join!(client.call_within::<JogFreespace>(robot, params, DEADLINE), cancel);
    assert_eq!(answer.expect("an answer").status, Some(ActionStatus::Cancelled));
    let params = to(-2.0);
    let id = params.motion_id.expect("given");
    let stop = async {
        begun(&bench, id).await;
        let request = StopRequest {
            stop_id: Uuid::now_v7(),
            source: "test".to_owned(),
            level: StopLevel::L2,
            scope: StopScope::Cell,
            reason: "test".to_owned(),
            seq: 0,
        };
        client.stop(request, stop_options()).await.expect("stopped");
    };
    let (answer, ()) =
        tokio::join!(client.call_within::<JogFreespace>(robot, params, DEADLINE), stop);
    assert_eq!(denial(answer).code, DenialCode::Stopped);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_jog_at_a_speed_goes_on_as_long_as_it_is_repeated_and_no_longer() {
    let bench = bench_in(CommandMode::Jog).await;
    let (client, robot, id) = (&bench.client, &bench.robot, Uuid::now_v7());
    let first = client.call::<JogJoint>(robot, at_speed(id, 0.5, 1.0)).await.expect("granted");
    assert_eq!((first.motion_id, first.status), (id, None));
    for _ in 0..5 {
        client.call::<JogJoint>(robot, at_speed(id, 0.5, 1.0)).await.expect("goes on");
    }
    let last = JogJointParams { wait: true, ..at_speed(id, 0.2, 0.1) };
    let end = client.call_within::<JogJoint>(robot, last, DEADLINE).await.expect("an answer");
    assert_eq!(end.status, Some(ActionStatus::Complete));
    let motion = bench.motion_end(id).await;
    assert_eq!((motion.kind, motion.status), (MotionKind::JogJoint, ActionStatus::Complete));
    assert!(commanded(&bench).await > 0.0);
    let late = denial(client.call::<JogJoint>(robot, at_speed(id, 0.5, 0.1)).await);
    assert_eq!(late.details["field"], "motion_id", "{late}");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn refusals_of_jogs_name_field_value_and_limit() {
    let bench = bench_in(CommandMode::Jog).await;
    let (client, robot) = (&bench.client, &bench.robot);
    for timeout_s in [0.0, 0.019, 10.1, -1.0] {
        let params = at_speed(Uuid::now_v7(), 0.1, timeout_s);
        let refused = denial(client.call::<JogJoint>(robot, params).await);
        assert_eq!(refused.code, DenialCode::OutOfRange, "{refused}");
        assert!(refused.message.ends_with("expected 0.02 to 10"), "{refused}");
        assert_eq!(refused.details["field"], "timeout_s");
    }
    let fast = denial(client.call::<JogJoint>(robot, at_speed(Uuid::now_v7(), -50.0, 0.1)).await);
    assert_eq!((fast.code, &fast.details["value"]), (DenialCode::OutOfRange, &(-50.0).into()));
    let chain = |name: &str| ChainTwist {
        chain: name.to_owned(),
        twist: Twist::ZERO,
        frame: JogFrame::Tool,
    };
    for (chains, expected) in [
        (vec![], "chains is empty"),
        (vec![chain("leg")], "there is no chain \"leg\", there are: arm"),
        (vec![chain("arm"), chain("arm")], "chain \"arm\" is given twice"),
    ] {
        let params = JogCartesianParams { motion_id: None, chains, timeout_s: 0.1, wait: false };
        let refused = denial(client.call::<JogCartesian>(robot, params).await);
        assert!(refused.message.starts_with(expected), "{refused}");
        assert_eq!(refused.code, DenialCode::InvalidArgument);
    }
    let order = |order: &[&[&str]]| HomeParams {
        order: order.iter().map(|group| group.iter().map(|j| (*j).to_owned()).collect()).collect(),
        ..HomeParams::default()
    };
    for (params, expected) in [
        (order(&[&["elbow_joint"], &[]]), "order.1 is empty"),
        (order(&[&["knee"]]), "there is no joint \"knee\""),
        (order(&[&["elbow_joint"], &["elbow_joint"]]), "joint \"elbow_joint\" is named twice"),
    ] {
        let refused = denial(client.call::<Home>(robot, params).await);
        assert!(refused.message.starts_with(expected), "{refused}");
    }
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_that_wait_leave_room_for_those_that_do_not() {
    let bench = bench_in(CommandMode::Jog).await;
    let (client, robot, id) = (&bench.client, &bench.robot, Uuid::now_v7());
    client.call::<JogJoint>(robot, at_speed(id, 0.1, 10.0)).await.expect("granted");
    let mut waiting = JoinSet::new();
    let mut busy = 0;
    for _ in 0..20 {
        let (client, robot) = (client.clone(), robot.clone());
        let params = JogJointParams { wait: true, ..at_speed(id, 0.1, 10.0) };
        waiting
            .spawn(async move { client.call_within::<JogJoint>(&robot, params, DEADLINE).await });
    }
    while busy < 4 {
        let answer = waiting.join_next().await.expect("some are left").expect("no panic");
        assert_eq!(denial(answer).code, DenialCode::Busy);
        busy += 1;
    }
    let again = client.call::<JogJoint>(robot, at_speed(id, 0.1, 10.0)).await;
    again.expect("one that does not wait is answered");
    client.call::<Halt>(robot, Empty {}).await.expect("halted");
    while let Some(answer) = waiting.join_next().await {
        let answer = answer.expect("no panic").expect("an answer");
        assert_eq!(answer.status, Some(ActionStatus::Cancelled));
    }
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn joints_move_home_in_their_order() {
    let bench = bench_in(CommandMode::Jog).await;
    let (client, robot) = (&bench.client, &bench.robot);
    client.call_within::<JogFreespace>(robot, to(0.4), DEADLINE).await.expect("away from home");
    for mode in [CommandMode::Halt, CommandMode::Homing] {
        client.call::<SetMode>(robot, SetModeParams { mode }).await.expect("granted");
    }
    let params = HomeParams {
        order: vec![vec!["wrist_3_joint".to_owned()], vec!["shoulder_pan_joint".to_owned()]],
        method: HomeMethod::MoveToHome,
        wait: true,
        ..HomeParams::default()
    };
    let answer = client.call_within::<Home>(robot, params, Duration::from_secs(8)).await;
    assert_eq!(answer.expect("granted").status, Some(ActionStatus::Complete));
    assert_eq!(commanded(&bench).await, 0.0);
    bench.shut_down().await;
}
