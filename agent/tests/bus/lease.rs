//! The lease over real Zenoh: who may command, and what the others are told.

use std::time::Duration;

use crate::common::Bench;
use armada_model::{JointTrajectory, JointVector, Waypoint};
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::*;
use armada_protocol::method::Method;
use armada_protocol::method::robot::{
    AcquireLease, Commit, ExecuteTrajectory, Halt, Prepare, ReleaseLease, RenewLease, SetMode,
};
use uuid::Uuid;

/// Asks as `name` under a lease.
async fn ask<M: Method>(
    bench: &Bench,
    (name, lease): (&str, Option<Uuid>),
    params: M::Params,
) -> Result<M::Answer, Denial> {
    let key = keys::ROBOT_RPC.with(&[bench.robot.as_str(), M::NAME]);
    let request = Request::new(name, params).under(lease);
    let payload = WireEncoding::Json.encode(&request).expect("a request");
    let replies = bench
        .client
        .session()
        .get(key)
        .payload(payload)
        .encoding(WireEncoding::Json.to_zenoh())
        .timeout(Duration::from_secs(5))
        .await
        .expect("asked");
    let reply = replies.recv_async().await.expect("a reply");
    match reply.result() {
        Ok(sample) => {
            let bytes = sample.payload().to_bytes();
            Ok(serde_json::from_slice(&bytes).expect("an answer"))
        }
        Err(error) => Err(serde_json::from_slice(&error.payload().to_bytes()).expect("a denial")),
    }
}

const fn renewal(grant: &LeaseGrant) -> RenewLeaseParams {
    RenewLeaseParams { lease: grant.lease, ttl_ms: None }
}

async fn acquire(bench: &Bench, name: &str, ttl_ms: u64) -> Result<LeaseGrant, Denial> {
    ask::<AcquireLease>(bench, (name, None), AcquireLeaseParams { ttl_ms, ..Default::default() })
        .await
}

/// Turns the first joint by 0.4 rad in 4 s, from where the arm stands.
async fn slow_turn(bench: &Bench) -> JointTrajectory {
    let states = bench.client.subscribe::<RobotState>("robots/left_arm/state", 1).await;
    let (_, state) = states.expect("subscribes").next().await.expect("a state");
    let info = bench.client.robot_info(&bench.robot).await.expect("info");
    let start: JointVector = state.joint_position_command_rad;
    let row = |time_from_start_s, by| {
        let mut joint_position = start.to_vec();
        joint_position[0] += by;
        Waypoint { time_from_start_s, joint_position, ..Waypoint::default() }
    };
    JointTrajectory {
        joint_names: info.joints.into_iter().map(|joint| joint.name).collect(),
        waypoints: vec![row(0.0, 0.0), row(4.0, 0.4)],
        ..JointTrajectory::default()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn only_the_holder_commands_and_the_others_learn_who_it_is() {
    let bench = Bench::start().await;
    let grant = acquire(&bench, "planner-1", 60_000).await.expect("free");
    let holder = ("planner-1", Some(grant.lease));
    let status = bench.status_when(|status| status.lease.is_some()).await;
    let lease = status.lease.expect("seen");
    assert_eq!((lease.holder.as_str(), lease.stale), ("planner-1", false));
    assert!((50_000..=60_000).contains(&lease.remaining_ms), "{lease:?}");
    let jog = SetModeParams { mode: CommandMode::Jog };
    let refusals = [
        acquire(&bench, "planner-2", 1000).await.map(drop),
        ask::<SetMode>(&bench, ("planner-2", None), jog).await.map(drop),
    ];
    for refused in refusals.map(|refused| refused.expect_err("held")) {
        assert_eq!(refused.code, DenialCode::LeaseRequired);
        assert!(refused.message.contains("is driven by planner-1 for another"), "{refused}");
        assert_eq!(refused.details["holder"], "planner-1");
        assert!(refused.details["remaining_ms"].as_f64().is_some_and(|left| left > 50_000.0));
    }
    let stranger = ("planner-2", Some(Uuid::nil()));
    let refused = ask::<SetMode>(&bench, stranger, jog).await.expect_err("not in force");
    assert_eq!(refused.code, DenialCode::LeaseStale);
    assert_eq!(refused.details["holder"], "planner-1");
    ask::<SetMode>(&bench, holder, jog).await.expect("the holder may");
    ask::<Halt>(&bench, ("anybody", None), Empty {}).await.expect("a halt needs no lease");
    let renewed = ask::<RenewLease>(&bench, holder, renewal(&grant)).await;
    assert_eq!(renewed.expect("held").ttl_ms, 60_000);
    let released = ask::<ReleaseLease>(&bench, holder, LeaseParams { lease: grant.lease }).await;
    assert!(released.expect("held").epoch > grant.epoch);
    bench.status_when(|status| status.lease.is_none()).await;
    ask::<SetMode>(&bench, ("planner-2", None), jog).await.expect("nobody holds one");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_motion_ends_when_its_holder_does_not_renew() {
    let bench = Bench::start().await;
    let grant = acquire(&bench, "planner", 400).await.expect("free");
    let holder = ("planner", Some(grant.lease));
    let mode = SetModeParams { mode: CommandMode::Trajectory };
    ask::<SetMode>(&bench, holder, mode).await.expect("the holder may");
    ask::<RenewLease>(&bench, holder, renewal(&grant)).await.expect("held");
    let params = ExecuteTrajectoryParams::at_once(None, slow_turn(&bench).await);
    let accepted = ask::<ExecuteTrajectory>(&bench, holder, params).await.expect("accepted");
    let end = bench.motion_end(accepted.motion_id).await;
    assert_eq!(end.status, ActionStatus::Failed);
    assert!(end.elapsed_s < 3.0, "{end:?}");
    assert_eq!(end.reason.map(|reason| reason.code), Some(DenialCode::LeaseStale));
    let status = bench.status_when(|status| status.lease.as_ref().is_some_and(|l| l.stale)).await;
    assert_eq!(status.lease.map(|lease| lease.remaining_ms), Some(0));
    acquire(&bench, "another", 1000).await.expect("anybody may acquire a stale lease");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn prepare_and_commit_go_on_while_nobody_holds_a_lease_and_need_it_otherwise() {
    let bench = Bench::start().await;
    let nobody = ("gateway", None);
    let mode = SetModeParams { mode: CommandMode::Trajectory };
    ask::<SetMode>(&bench, nobody, mode).await.expect("nobody holds one");
    let params = PrepareParams::alone(None, slow_turn(&bench).await);
    let prepared = ask::<Prepare>(&bench, nobody, params.clone()).await.expect("prepared");
    let grant = acquire(&bench, "planner", 60_000).await.expect("free");
    bench.status_when(|status| status.lease.is_some()).await;
    let refused = ask::<Prepare>(&bench, nobody, params).await.expect_err("held");
    assert_eq!(refused.code, DenialCode::LeaseRequired, "{refused}");
    let boot_id = bench.status_when(|_| true).await.boot_id;
    let commit = CommitParams {
        motion_id: prepared.motion_id,
        boot_id,
        start_ns: Default::default(),
        rate_slope_s: None,
    };
    let holder = ("planner", Some(grant.lease));
    let refused = ask::<Commit>(&bench, holder, commit).await.expect_err("of an epoch before");
    assert_eq!(refused.code, DenialCode::LeaseStale, "{refused}");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lease_lasts_200_ms_to_a_minute() {
    let bench = Bench::start().await;
    for (ttl_ms, limit) in [(199, 200), (60_001, 60_000)] {
        let refused = acquire(&bench, "planner", ttl_ms).await.expect_err("refused");
        assert_eq!(refused.code, DenialCode::OutOfRange);
        assert_eq!(refused.details["value"], ttl_ms);
        assert_eq!(refused.details["limit"], limit);
    }
    bench.shut_down().await;
}
