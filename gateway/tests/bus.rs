//! The gateway on real Zenoh over loopback, with agents that have no robots.

mod common;

use std::collections::BTreeMap;
use std::time::Duration;

use armada_gateway::{GatewayError, GatewayOptions, run};
use armada_model::{JointTrajectory, Waypoint};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys::{self, Key, Kind, Owner};
use armada_protocol::messages::{
    ActionStatus, CellAcquireLeaseParams, CellExecuteTrajectory, CellFrames, CellLeaseParams,
    CellResetParams, CellStatus, CellVerdict, CheckClearanceParams, Denial, DenialCode, Event,
    MotionParams, Presence, StopLevel, StopRequest, StopScope, StopVerdict,
};
use armada_protocol::method::cell;
use common::{JOINTS, PATIENCE, TestAgent, TestCell, eventually, hand_at_zero, locked};
use tokio::sync::oneshot;
use uuid::Uuid;
use zenoh::sample::SampleKind;

fn trajectory(robots: &[&str]) -> JointTrajectory {
    let names = robots.iter().flat_map(|robot| JOINTS.map(|joint| format!("{robot}/{joint}")));
    let joint_names: Vec<_> = names.collect();
    let row = |time_from_start_s| Waypoint {
        time_from_start_s,
        joint_position: vec![0.0; joint_names.len()],
        ..Waypoint::default()
    };
    let waypoints = vec![row(0.0), row(1.0)];
    JointTrajectory { waypoints, joint_names, ..JointTrajectory::default() }
}

fn stop_request() -> StopRequest {
    StopRequest {
        stop_id: Uuid::now_v7(),
        source: "tester".to_owned(),
        level: StopLevel::L2,
        scope: StopScope::Cell,
        reason: String::new(),
        seq: 0,
    }
}

async fn status_with(
    client: &Client,
    what: &str,
    fits: impl Fn(&CellStatus) -> bool,
) -> CellStatus {
    eventually(what, async || client.cell_status().await.ok().filter(&fits)).await
}

/// Until every robot is online and its clock is measured.
async fn ready(client: &Client) -> CellStatus {
    status_with(client, "every robot is known", |status| {
        let known = |robot: &armada_protocol::messages::CellRobotStatus| {
            robot.presence == Presence::Online
                && robot.command_mode.is_some()
                && robot.clock_offset_ns.is_some()
        };
        status.robots.values().all(known)
    })
    .await
}

async fn execute(client: &Client, robots: &[&str]) -> Result<Uuid, ClientError> {
    let trajectory = trajectory(robots);
    let params = CellExecuteTrajectory::new(None, trajectory);
    let accepted = client.call_cell::<cell::ExecuteTrajectory>(params).await?;
    Ok(accepted.motion_id)
}

#[tokio::test(flavor = "multi_thread")]
async fn agents_appear_and_vanish_in_the_status() {
    let cell = TestCell::start(&["left", "right"]).await;
    let client = cell.client().await;
    assert_eq!(client.cell_info().await.expect("answers").robots.len(), 2);
    let left = TestAgent::start(&cell, "left").await;
    let _right = TestAgent::start(&cell, "right").await;
    let status = ready(&client).await;
    assert_eq!(status.verdict, CellVerdict::Ready);
    let same_clock = |offset: Option<i64>, bound: Option<u64>| {
        offset.expect("measured").unsigned_abs() <= bound.expect("measured")
    };
    for robot in status.robots.values() {
        assert!(same_clock(robot.clock_offset_ns, robot.clock_bound_ns), "{robot:?}");
    }
    left.session.close().await.expect("closes");
    let lost =
        |status: &CellStatus| status.robots.values().any(|robot| robot.presence == Presence::Lost);
    let status = status_with(&client, "left is lost", lost).await;
    assert_eq!(status.verdict, CellVerdict::Degraded);
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_motion_of_two_robots_starts_together_and_can_be_asked_for_afterwards() {
    let cell = TestCell::start(&["left", "right"]).await;
    let client = cell.client().await;
    let agents = [TestAgent::start(&cell, "left").await, TestAgent::start(&cell, "right").await];
    ready(&client).await;
    let id = eventually("both describe themselves", async || {
        match execute(&client, &["left", "right"]).await {
            Ok(id) => Some(id),
            Err(ClientError::Denied(denial)) if denial.code == DenialCode::NotReady => None,
            Err(other) => panic!("{other}"),
        }
    })
    .await;
    let ended = async || {
        let status = client.cell_motion(id).await.ok()?;
        status.status.is_terminal().then_some(status)
    };
    let status = eventually("the motion ends", ended).await;
    assert_eq!(status.status, ActionStatus::Complete);
    assert_eq!(status.client, "tester");
    let starts = agents.map(|agent| locked(&agent.shared.starts)[0].as_nanos());
    let bounds = ready(&client).await.robots.into_values().filter_map(|r| r.clock_bound_ns);
    let bound: u64 = bounds.sum::<u64>() + 2_000_000;
    assert!(starts[0].abs_diff(starts[1]) <= bound, "{starts:?}, bound {bound}");
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn leases_of_several_robots_are_all_granted_or_none() {
    let cell = TestCell::start(&["left", "right"]).await;
    let client = cell.client().await;
    let left = TestAgent::start(&cell, "left").await;
    let right = TestAgent::start(&cell, "right").await;
    ready(&client).await;
    let acquire =
        || CellAcquireLeaseParams { robots: Vec::new(), ttl_ms: 5_000, role: Default::default() };
    let granted = client.call_cell::<cell::AcquireLease>(acquire()).await.expect("granted");
    let leases: BTreeMap<_, _> =
        granted.leases.iter().map(|(robot, grant)| (robot.clone(), grant.lease)).collect();
    assert_eq!(leases.len(), 2);
    assert!(granted.leases.values().all(|grant| grant.ttl_ms == 5_000));
    let params = CellLeaseParams { leases };
    let released = client.call_cell::<cell::ReleaseLease>(params).await.expect("released");
    assert_eq!((released.released.len(), released.refused.len()), (2, 0));
    *locked(&right.shared.lease) = Err(Denial::new(DenialCode::LeaseRequired, "driven by b"));
    let refused = client.call_cell::<cell::AcquireLease>(acquire()).await;
    let Err(ClientError::Denied(denial)) = refused else { panic!("{refused:?}") };
    assert_eq!((denial.code, &*denial.message), (DenialCode::LeaseRequired, "right: driven by b"));
    assert_eq!(*locked(&left.shared.lease), Ok(None), "left was given back");
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_concerns_several_robots_takes_no_single_lease() {
    let cell = TestCell::start(&["left"]).await;
    let client = cell.client().await;
    let leased = client.under(Uuid::from_u128(3));
    let denied = execute(&leased, &["left"]).await.expect_err("refused");
    let ClientError::Denied(denial) = denied else { panic!("{denied}") };
    assert_eq!(denial.code, DenialCode::InvalidArgument);
    assert!(denial.message.contains("in leases"), "{denial}");
    let pause = MotionParams { motion_id: Uuid::from_u128(4) };
    let denied = leased.call_cell::<cell::Pause>(pause).await;
    let Err(ClientError::Denied(denial)) = denied else { panic!("{denied:?}") };
    assert_eq!(denial.code, DenialCode::NotAttached);
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_without_shapes_are_not_called_clear() {
    let cell = TestCell::start(&["left", "right"]).await;
    let client = cell.client().await;
    let _agents = [TestAgent::start(&cell, "left").await, TestAgent::start(&cell, "right").await];
    ready(&client).await;
    let params =
        CheckClearanceParams { trajectory: trajectory(&["left", "right"]), offset_ms: 100.0 };
    let answer = eventually("both describe themselves", async || {
        match client.call_cell::<cell::CheckClearance>(params.clone()).await {
            Ok(answer) => Some(answer),
            Err(ClientError::Denied(denial)) if denial.code == DenialCode::NotReady => None,
            Err(other) => panic!("{other}"),
        }
    })
    .await;
    assert!(!answer.clear);
    assert_eq!(answer.distance_m, None);
    assert!(answer.without_shape.contains(&"left/hand".to_owned()), "{answer:?}");
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn events_of_robots_come_in_the_stream_of_the_cell() {
    let cell = TestCell::start(&["left"]).await;
    let client = cell.client().await;
    let left = TestAgent::start(&cell, "left").await;
    ready(&client).await;
    let events = client.subscribe::<Event>(&keys::CELL_EVENTS.any(), 64).await.expect("subscribes");
    let mut seqno = 0;
    let event = eventually("an event is passed on", async || {
        left.publish_event(seqno).await;
        seqno += 1;
        let (_, event) = events.try_next().expect("an event")?;
        event.robot.is_some().then_some(event)
    })
    .await;
    assert!(event.details["robot_seqno"].is_u64(), "{event:?}");
    assert_eq!(event.boot_id, client.cell_info().await.expect("answers").boot_id);
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_is_reported_complete_and_a_reset_clears_it() {
    let cell = TestCell::start(&["left", "right"]).await;
    let client = cell.client().await;
    let _left = TestAgent::start(&cell, "left").await;
    let _right = TestAgent::start(&cell, "right").await;
    ready(&client).await;
    let report = client.call_cell::<cell::Stop>(stop_request()).await.expect("answers");
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:?}");
    let denied = execute(&client, &["left", "right"]).await.expect_err("stopped");
    assert!(matches!(&denied, ClientError::Denied(d) if d.code == DenialCode::Stopped), "{denied}");
    let mut resets = BTreeMap::new();
    for robot in ["left", "right"].map(|name| name.parse::<RobotName>().expect("a name")) {
        let status = client.robot_status(&robot).await.expect("answers");
        resets.insert(robot, status.stop.expect("latched").reset_params());
    }
    let reset = client.call_cell::<cell::Reset>(CellResetParams { resets }).await.expect("answers");
    assert_eq!((reset.reset.len(), reset.refused.len()), (2, 0));
    assert!(reset.reset.iter().all(|(_, ids)| ids == &[report.stop_id]));
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_without_agents_is_incomplete_with_their_names() {
    let cell = TestCell::start(&["left"]).await;
    let client = cell.client().await;
    let report = client.call_cell::<cell::Stop>(stop_request()).await.expect("answers");
    assert_eq!(report.verdict, StopVerdict::Incomplete);
    assert_eq!(report.missing, ["left".parse().expect("a name")]);
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_tell_where_the_hand_is() {
    let cell = TestCell::start(&["left"]).await;
    let client = cell.client().await;
    let agent = TestAgent::start(&cell, "left").await;
    ready(&client).await;
    let frames =
        client.subscribe::<CellFrames>(&keys::CELL_FRAMES.any(), 16).await.expect("subscribes");
    let hand = eventually("the hand is told", async || {
        agent.publish_state(&[0.0, 0.0]).await;
        let (_, frames) = frames.try_next().expect("frames")?;
        frames.frames.get("left/hand").copied()
    })
    .await;
    let (distance, angle) = hand.distance(&hand_at_zero());
    assert!(distance < 1e-9 && angle < 1e-6, "{hand:?}");
    cell.shut_down().await;
}

/// Keys on which the gateway takes something from others.
fn keys_taken() -> impl Iterator<Item = &'static Key> {
    let published =
        |key: &&Key| key.kinds.iter().any(|k| matches!(k, Kind::Published | Kind::Cached));
    keys::ALL.iter().filter(published).filter(|key| key.owner != Owner::Gateway)
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_that_is_sent_ends_the_gateway() {
    let cell = TestCell::start(&["left"]).await;
    let client = cell.client().await;
    let _left = TestAgent::start(&cell, "left").await;
    ready(&client).await;
    let payloads: [&[u8]; 5] = [b"", b"{", b"null", b"\xff\xfe\x00", b"{\"robot\":\"left\"}"];
    for key in keys_taken() {
        for robot in ["left", "stranger"] {
            let key = key.with(&[robot, "00000000-0000-0000-0000-000000000001"]);
            for payload in payloads {
                client.session().put(&key, payload.to_vec()).await.expect("sent");
                let odd = client.session().put(&key, payload.to_vec());
                odd.encoding("application/x-odd").await.expect("sent");
            }
        }
    }
    for method in ["stop", "reset", "execute_trajectory", "cancel", "nothing"] {
        for payload in payloads.into_iter().filter(|payload| !payload.is_empty()) {
            let key = keys::CELL_RPC.with(&[method]);
            let replies = client
                .session()
                .get(&key)
                .payload(payload.to_vec())
                .encoding(WireEncoding::Json.to_zenoh())
                .timeout(Duration::from_secs(5))
                .await
                .expect("asked");
            let reply = replies.recv_async().await.expect("answered");
            assert!(reply.result().is_err(), "{method} took {payload:?}");
        }
    }
    let status = ready(&client).await;
    assert_eq!(status.verdict, CellVerdict::Ready);
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unknown_method_is_refused_with_those_there_are() {
    let cell = TestCell::start(&["left"]).await;
    let client = cell.client().await;
    let answer = client.call_by_name(None, "dance", serde_json::json!({}), PATIENCE).await;
    let Err(ClientError::Denied(denial)) = answer else { panic!("{answer:?}") };
    assert_eq!(denial.code, DenialCode::UnknownMethod);
    assert!(denial.message.contains("stop, reset, execute_trajectory, cancel"), "{denial}");
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_gateway_at_the_same_endpoint_is_refused() {
    let cell = TestCell::start(&["left"]).await;
    let options = GatewayOptions { config: cell.config.clone(), listen: None, insecure_lan: false };
    let (ready, _) = oneshot::channel();
    let second = run(options, ready, std::future::pending());
    let ended = tokio::time::timeout(PATIENCE, second).await.expect("in time");
    assert!(matches!(ended, Err(GatewayError::Session(_))), "{ended:?}");
    cell.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gateway_that_ends_says_goodbye() {
    let cell = TestCell::start(&["left"]).await;
    let client = cell.client().await;
    let tokens = client
        .session()
        .liveliness()
        .declare_subscriber(keys::CELL_GATEWAY_ALIVE.any())
        .history(true)
        .await
        .expect("subscribes");
    let next = async || {
        let sample = tokio::time::timeout(PATIENCE, tokens.recv_async()).await;
        sample.expect("in time").expect("a token").kind()
    };
    assert_eq!(next().await, SampleKind::Put);
    cell.shut_down().await;
    assert_eq!(next().await, SampleKind::Delete);
}
