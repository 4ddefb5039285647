//! The lease over real Zenoh: who may command, and what the others are told.

use std::net::UdpSocket;
use std::time::Duration;

use crate::common::{Bench, DEADLINE};
use armada_agent::drivers::sim::{Fault, encode_inject};
use armada_model::{JointTrajectory, JointVector, Waypoint};
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::*;
use armada_protocol::method::Method;
use armada_protocol::method::robot::{
    AcquireLease, Commit, DelegateLease, ExecuteTrajectory, Halt, Prepare, ReleaseLease,
    RenewLease, SetMode, SetSignal, TakeLease,
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
async fn a_robot_whose_file_requires_a_lease_is_moved_under_one_only() {
    let bench = Bench::start_with("lease_required: false", "lease_required: true").await;
    assert!(bench.client.robot_info(&bench.robot).await.expect("info").lease_required);
    let jog = SetModeParams { mode: CommandMode::Jog };
    let refused = ask::<SetMode>(&bench, ("planner", None), jog).await.expect_err("no lease");
    assert_eq!(refused.code, DenialCode::LeaseRequired);
    assert!(refused.message.contains("armada lease hold left_arm"), "{refused}");
    let grant = acquire(&bench, "planner", 60_000).await.expect("free");
    ask::<SetMode>(&bench, ("planner", Some(grant.lease)), jog).await.expect("the holder may");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_motion_ends_when_its_holder_does_not_renew() {
    let bench = Bench::start().await;
    let trajectory = slow_turn(&bench).await;
    let grant = acquire(&bench, "planner", 2000).await.expect("free");
    let holder = ("planner", Some(grant.lease));
    let mode = SetModeParams { mode: CommandMode::Trajectory };
    ask::<SetMode>(&bench, holder, mode).await.expect("the holder may");
    ask::<RenewLease>(&bench, holder, renewal(&grant)).await.expect("held");
    let params = ExecuteTrajectoryParams::at_once(None, trajectory);
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

fn taking(role: Role, reason: &str) -> TakeLeaseParams {
    TakeLeaseParams { ttl_ms: 5000, role, reason: reason.to_owned() }
}

/// The next event about leases that says so.
async fn lease_event(events: &armada_protocol::client::Subscription<Event>, change: &str) -> Event {
    tokio::time::timeout(DEADLINE, async {
        loop {
            let (_, event) = events.next().await.expect("an event");
            let said = event.details.get("change").and_then(|said| said.as_str());
            if event.kind == EventKind::Lease && said == Some(change) {
                return event;
            }
        }
    })
    .await
    .unwrap_or_else(|_| panic!("no event {change}"))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_takes_the_lease_and_everybody_learns_from_whom_and_why() {
    let bench = Bench::start().await;
    let key = keys::ROBOT_EVENTS.of(&bench.robot);
    let events = bench.client.subscribe::<Event>(&key, 64).await.expect("subscribes");
    // So long that only the news can tell the keeper in time.
    let ttl = Duration::from_secs(60);
    let keeper = bench.client.acquire_lease(&bench.robot, ttl).await.expect("free");
    let holder = ("test", Some(keeper.lease()));
    let mode = SetModeParams { mode: CommandMode::Trajectory };
    ask::<SetMode>(&bench, holder, mode).await.expect("the holder may");
    let params = ExecuteTrajectoryParams::at_once(None, slow_turn(&bench).await);
    let accepted = ask::<ExecuteTrajectory>(&bench, holder, params).await.expect("accepted");
    let anna = ("anna", None);
    let grant = ask::<TakeLease>(&bench, anna, taking(Role::Operator, "planner hangs")).await;
    let grant = grant.expect("an operator takes from a program");
    let event = lease_event(&events, "taken").await;
    assert_eq!(event.message, "lease of test taken by anna (operator): \"planner hangs\"");
    tokio::time::timeout(DEADLINE, keeper.lost()).await.expect("the keeper is told at once");
    let end = bench.motion_end(accepted.motion_id).await;
    assert_eq!(end.status, ActionStatus::Cancelled);
    let reason = end.reason.expect("told");
    assert_eq!(reason.code, DenialCode::LeaseRequired);
    assert_eq!(reason.details["holder"], "anna");
    let status = bench.status_when(|status| status.lease.is_some()).await;
    let lease = status.lease.expect("held");
    assert_eq!((lease.holder.as_str(), lease.role), ("anna", Role::Operator));
    assert_eq!(lease.reason.as_deref(), Some("planner hangs"));
    assert_eq!(status.authority, AuthorityState::Held);
    let why = status.why.iter().find(|why| why.code == WhyCode::DrivenBy).expect("told");
    assert_eq!((why.who.as_deref(), why.since_ns.is_some()), (Some("anna"), true));
    assert!(status.epoch >= grant.epoch);
    let refused = ask::<TakeLease>(&bench, ("otto", None), taking(Role::Operator, "me too")).await;
    assert!(refused.is_ok(), "of the same role: {refused:?}");
    let boss = ask::<TakeLease>(&bench, ("boss", None), taking(Role::Supervisor, "enough")).await;
    boss.expect("a supervisor takes from an operator");
    let refused = ask::<TakeLease>(&bench, anna, taking(Role::Operator, "please")).await;
    let refused = refused.expect_err("from a supervisor");
    assert_eq!(refused.code, DenialCode::LeaseRequired);
    for (detail, value) in [("needed", "supervisor"), ("holder", "boss"), ("role", "supervisor")] {
        assert_eq!(refused.details[detail], value, "{detail}");
    }
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lease_is_taken_by_a_person_who_says_why() {
    let bench = Bench::start().await;
    let long = "x".repeat(201);
    for (role, reason, code, field) in [
        (Role::Program, "because", DenialCode::OutOfRange, "role"),
        (Role::Operator, " ", DenialCode::OutOfRange, "reason"),
        (Role::Operator, long.as_str(), DenialCode::OutOfRange, "reason"),
        (Role::Operator, "a\nline", DenialCode::InvalidArgument, "reason"),
    ] {
        let refused = ask::<TakeLease>(&bench, ("anna", None), taking(role, reason)).await;
        let refused = refused.expect_err("refused");
        assert_eq!((refused.code, &refused.details["field"]), (code, &field.into()), "{refused}");
    }
    assert_eq!(bench.status_when(|_| true).await.authority, AuthorityState::Free);
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_holder_lets_others_command_in_a_scope_for_as_long_as_it_holds_the_lease() {
    let bench = Bench::start().await;
    let grant = acquire(&bench, "planner", 60_000).await.expect("free");
    let planner = ("planner", Some(grant.lease));
    let params =
        |lease, scope| DelegateLeaseParams { lease, to: "panel".to_owned(), scope, ttl_ms: 50_000 };
    let io = ask::<DelegateLease>(&bench, planner, params(grant.lease, LeaseScope::Io)).await;
    let io = io.expect("it is the holder's");
    assert_eq!((io.epoch, io.ttl_ms), (grant.epoch, 50_000), "it takes nothing away");
    let panel = ("panel", Some(io.lease));
    let signal = || SetValueParams { name: "DO1".to_owned(), value: SignalValue::Bool(true) };
    ask::<SetSignal>(&bench, panel, signal()).await.expect("it is for that");
    let refused = ask::<SetSignal>(&bench, ("panel", None), signal()).await.expect_err("held");
    assert_eq!(refused.code, DenialCode::LeaseRequired);
    let jog = SetModeParams { mode: CommandMode::Jog };
    let refused = ask::<SetMode>(&bench, panel, jog).await.expect_err("not for the arm");
    assert_eq!(refused.code, DenialCode::LeaseRequired);
    for (detail, value) in [("scope", "io"), ("needed", "arm"), ("holder", "planner")] {
        assert_eq!(refused.details[detail], value, "{detail}");
    }
    let again = ask::<DelegateLease>(&bench, panel, params(io.lease, LeaseScope::Io)).await;
    assert_eq!(again.expect_err("not again").code, DenialCode::LeaseRequired);
    let status = bench.status_when(|s| s.lease.as_ref().is_some_and(|l| !l.delegates.is_empty()));
    let delegates = status.await.lease.expect("held").delegates;
    let delegate = delegates.first().expect("one");
    assert_eq!((delegate.holder.as_str(), delegate.scope), ("panel", LeaseScope::Io));
    assert!((40_000..=50_000).contains(&delegate.remaining_ms), "{delegate:?}");
    let kept = bench.client.keep_lease(&bench.robot, io.lease).await.expect("in force");
    ask::<ReleaseLease>(&bench, planner, LeaseParams { lease: grant.lease }).await.expect("held");
    tokio::time::timeout(DEADLINE, kept.lost()).await.expect("with the lease above it");
    let refused = ask::<SetSignal>(&bench, panel, signal()).await.expect_err("not in force");
    assert_eq!(refused.code, DenialCode::LeaseStale);
    bench.shut_down().await;
}

/// Injects a fault into the emulated controller until the status is as expected.
async fn inject_until(
    bench: &Bench,
    fault: &str,
    condition: impl Fn(&RobotStatus) -> bool,
) -> RobotStatus {
    let text = std::fs::read_to_string(bench.file()).expect("robot file");
    let address = text.lines().find_map(|line| line.trim().strip_prefix("address: "));
    let address = address.expect("of the controller").trim_matches('"').to_owned();
    let fault: Fault = fault.parse().expect("a fault");
    let mut packet = [0; 128];
    let len = encode_inject(&fault, &mut packet);
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.send_to(&packet[..len], &address).expect("sent");
    bench.status_when(condition).await
}

#[tokio::test(flavor = "multi_thread")]
async fn the_pendant_takes_the_robot_from_everybody_and_nothing_resumes() {
    let bench = Bench::start().await;
    let grant = acquire(&bench, "planner", 60_000).await.expect("free");
    let planner = ("planner", Some(grant.lease));
    let mode = SetModeParams { mode: CommandMode::Trajectory };
    ask::<SetMode>(&bench, planner, mode).await.expect("the holder may");
    let params = ExecuteTrajectoryParams::at_once(None, slow_turn(&bench).await);
    let accepted = ask::<ExecuteTrajectory>(&bench, planner, params).await.expect("accepted");
    let local = |status: &RobotStatus| status.authority == AuthorityState::Local;
    let status = inject_until(&bench, "local_on", local).await;
    let first = status.why.first().expect("a reason");
    assert_eq!((first.code, first.who.as_deref()), (WhyCode::Local, Some("pendant")));
    assert_eq!(status.next, ["give control back at the pendant"]);
    assert_eq!((status.lease, status.faults), (None, Vec::new()));
    let end = bench.motion_end(accepted.motion_id).await;
    assert_eq!(end.status, ActionStatus::Failed);
    let jog = SetModeParams { mode: CommandMode::Jog };
    for refused in [
        ask::<SetMode>(&bench, ("anybody", None), jog).await.map(drop),
        acquire(&bench, "planner", 1000).await.map(drop),
        ask::<TakeLease>(&bench, ("boss", None), taking(Role::Supervisor, "mine")).await.map(drop),
    ] {
        let refused = refused.expect_err("the pendant has control");
        assert_eq!(refused.code, DenialCode::LeaseRequired, "{refused}");
        assert_eq!(refused.details["holder"], "pendant");
    }
    ask::<Halt>(&bench, ("anybody", None), Empty {}).await.expect("a halt goes always");
    let free = |status: &RobotStatus| status.authority == AuthorityState::Free;
    let status = inject_until(&bench, "local_off", free).await;
    assert_eq!((status.command_mode, status.motion), (CommandMode::Halt, None));
    acquire(&bench, "planner", 1000).await.expect("free again");
    bench.shut_down().await;
}
