//! The limits of the operational mode that the key switch is in.

use crate::common::{Bench, denial};
use crate::queueing::turn;
use crate::running::committed;
use armada_model::JointTrajectory;
use armada_protocol::messages::{
    CommandMode, DenialCode, OperationalMode, PrepareParams, SetModeParams,
};
use armada_protocol::method::robot::{Prepare, SetMode};

const SWITCH: &str = "operational_mode: cobot";
const REDUCED: &str = "operational_mode: manual_reduced_speed";

async fn follow(bench: &Bench) {
    let params = SetModeParams { mode: CommandMode::Trajectory };
    bench.client.call::<SetMode>(&bench.robot, params).await.expect("mode is granted");
}

const fn prepare(trajectory: JointTrajectory) -> PrepareParams {
    PrepareParams::alone(None, trajectory)
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_prepared_keeps_the_limits_of_reduced_speed_while_they_are_in_force() {
    // 0.6 rad in a second is less than the joint's 2.09 rad/s, and more than a quarter of it.
    let bench = Bench::start_with(SWITCH, REDUCED).await;
    let (client, robot) = (&bench.client, &bench.robot);
    let reduced = OperationalMode::ManualReducedSpeed;
    bench.status_when(|status| status.operational_mode == reduced).await;
    follow(&bench).await;
    let refused = denial(client.call::<Prepare>(robot, prepare(turn(0.0, 0.6, 1.0))).await);
    assert_eq!(refused.code, DenialCode::OutOfRange, "{refused}");
    assert!(refused.message.contains("shoulder_pan_joint"), "{refused}");
    let (_, end) = committed(&bench, &turn(0.0, 0.2, 1.0)).await;
    assert_eq!(end.status, armada_protocol::messages::ActionStatus::Complete, "{end:?}");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_prepared_may_use_the_full_limits_where_the_key_switch_allows_them() {
    let bench = Bench::start().await;
    follow(&bench).await;
    let fast = prepare(turn(0.0, 0.6, 1.0));
    bench.client.call::<Prepare>(&bench.robot, fast).await.expect("legal at full speed");
    bench.shut_down().await;
}
