//! Trajectories one after the other, paused and at other speeds, over real Zenoh.

use std::f64::consts::FRAC_PI_2;

use crate::common::{Bench, denial};
use armada_model::{JointTrajectory, Waypoint};
use armada_protocol::messages::*;
use armada_protocol::method::robot::{
    Cancel, ExecuteTrajectory, Pause, Resume, SetMode, SetSpeedRatio,
};
use uuid::Uuid;

/// Turns the first joint from `from` to `to` in `duration_s`.
pub(crate) fn turn(from: f64, to: f64, duration_s: f64) -> JointTrajectory {
    let names = [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ];
    let waypoint = |time_from_start_s, first| Waypoint {
        time_from_start_s,
        joint_position: vec![first, -FRAC_PI_2, FRAC_PI_2, -FRAC_PI_2, -FRAC_PI_2, 0.0],
        ..Waypoint::default()
    };
    JointTrajectory {
        joint_names: names.map(str::to_owned).to_vec(),
        waypoints: vec![waypoint(0.0, from), waypoint(duration_s, to)],
        ..JointTrajectory::default()
    }
}

async fn ready() -> Bench {
    let bench = Bench::start().await;
    let params = SetModeParams { mode: CommandMode::Trajectory };
    bench.client.call::<SetMode>(&bench.robot, params).await.expect("mode is granted");
    bench
}

async fn execute(bench: &Bench, trajectory: JointTrajectory, queue: Queue) -> Uuid {
    let params =
        ExecuteTrajectoryParams { queue, ..ExecuteTrajectoryParams::at_once(None, trajectory) };
    let accepted = bench.client.call::<ExecuteTrajectory>(&bench.robot, params).await;
    accepted.expect("accepted").motion_id
}

#[tokio::test(flavor = "multi_thread")]
async fn three_trajectories_run_through_and_the_status_tells_what_waits() {
    let bench = ready().await;
    let first = execute(&bench, turn(0.0, 0.2, 4.0), Queue::Append).await;
    let second = execute(&bench, turn(0.2, 0.4, 0.8), Queue::AppendBlended).await;
    let third = execute(&bench, turn(0.4, 0.1, 0.8), Queue::Append).await;
    let status = bench.status_when(|status| status.queued.len() == 2).await;
    assert_eq!(status.motion.map(|motion| motion.id), Some(first));
    assert_eq!(status.queued, [second, third]);
    for motion in [first, second, third] {
        let end = bench.motion_end(motion).await;
        assert_eq!(end.status, ActionStatus::Complete, "{end:?}");
    }
    let states = bench.client.subscribe::<RobotState>("robots/left_arm/state", 1).await;
    let (_, state) = states.expect("subscribes").next().await.expect("a state");
    assert_eq!(state.joint_position_command_rad[0], 0.1);
    let gone = turn(0.4, 0.1, 0.8);
    let params = ExecuteTrajectoryParams {
        queue: Queue::Append,
        ..ExecuteTrajectoryParams::at_once(None, gone)
    };
    let refused = bench.client.call::<ExecuteTrajectory>(&bench.robot, params).await;
    assert_eq!(denial(refused).code, DenialCode::Tolerance);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trajectory_is_paused_resumed_and_slowed_down_on_the_way() {
    let bench = ready().await;
    let (client, robot) = (&bench.client, &bench.robot);
    let motion_id = execute(&bench, turn(0.0, 0.4, 4.0), Queue::Refuse).await;
    let motion = MotionParams { motion_id };
    client.call::<Pause>(robot, motion).await.expect("paused");
    let paused = bench
        .status_when(|s| s.motion.as_ref().is_some_and(|m| m.status == ActionStatus::Paused))
        .await;
    assert_eq!(paused.motion.map(|motion| motion.id), Some(motion_id));
    let answer = client.call::<SetSpeedRatio>(robot, SpeedRatioParams { ratio: 0.5 }).await;
    assert_eq!(answer.expect("set").speed_ratio, 0.5);
    client.call::<Resume>(robot, motion).await.expect("resumed");
    let end = bench.motion_end(motion_id).await;
    assert_eq!((end.status, end.elapsed_s), (ActionStatus::Complete, 4.0), "{end:?}");
    for ratio in [0.0, 1.5] {
        let refused = client.call::<SetSpeedRatio>(robot, SpeedRatioParams { ratio }).await;
        let refused = denial(refused);
        assert_eq!(refused.code, DenialCode::OutOfRange, "{refused:?}");
        assert_eq!(refused.details["field"], "ratio");
    }
    let refused = denial(client.call::<Pause>(robot, motion).await);
    assert_eq!(refused.code, DenialCode::NotAttached, "{refused:?}");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_waits_is_answered_at_the_end_and_what_waits_behind_a_cancel_is_cancelled() {
    let bench = ready().await;
    let (client, robot) = (&bench.client, &bench.robot);
    let params = ExecuteTrajectoryParams {
        wait: true,
        ..ExecuteTrajectoryParams::at_once(None, turn(0.0, 0.1, 0.5))
    };
    let accepted = client.call::<ExecuteTrajectory>(robot, params).await.expect("waited for");
    assert_eq!(accepted.status, Some(ActionStatus::Complete));
    let first = execute(&bench, turn(0.1, 0.4, 3.0), Queue::Refuse).await;
    let second = execute(&bench, turn(0.4, 0.1, 1.0), Queue::Append).await;
    client.call::<Cancel>(robot, CancelParams { motion_id: first }).await.expect("cancelled");
    for motion in [first, second] {
        assert_eq!(bench.motion_end(motion).await.status, ActionStatus::Cancelled);
    }
    let forever = ExecuteTrajectoryParams {
        on_lease_loss: LeaseLoss::ContinueS(61.0),
        ..ExecuteTrajectoryParams::at_once(None, turn(0.1, 0.4, 3.0))
    };
    let refused = denial(client.call::<ExecuteTrajectory>(robot, forever).await);
    assert_eq!(refused.details["field"], "on_lease_loss", "{refused:?}");
    bench.shut_down().await;
}
