//! Streams of commands over real Zenoh, from a client that may die.

use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

use crate::common::{Bench, DEADLINE, connect};
use armada_model::JointVector;
use armada_protocol::client::{Client, LeaseKeeper, Stream};
use armada_protocol::messages::*;
use armada_protocol::method::robot::SetMode;
use uuid::Uuid;

const READY: [f64; 6] = [0.0, -FRAC_PI_2, FRAC_PI_2, -FRAC_PI_2, -FRAC_PI_2, 0.0];

/// Between two samples.
const SPACING: Duration = Duration::from_millis(5);

/// A lease long enough for a loaded machine.
const TTL: Duration = Duration::from_secs(5);

/// A client of its own that holds the lease of a robot in `mode`, and streams to it.
struct Sender {
    client: Client,
    keeper: LeaseKeeper,
    stream: Stream,
}

impl Sender {
    async fn start(bench: &Bench, mode: CommandMode) -> Self {
        let client = connect(bench.endpoint()).await;
        let keeper = client.acquire_lease(&bench.robot, TTL).await.expect("nobody has it");
        let params = SetModeParams { mode };
        let held = client.under(keeper.lease());
        let answer = held.call::<SetMode>(&bench.robot, params).await.expect("granted");
        let stream = client.stream(&bench.robot, keeper.lease(), answer.epoch).await;
        Self { client, keeper, stream: stream.expect("states come") }
    }

    /// Streams what `put` puts until the status is as expected; returns it.
    async fn until(
        &mut self,
        bench: &Bench,
        mut put: impl FnMut(&mut Stream),
        condition: impl Fn(&RobotStatus) -> bool,
    ) -> RobotStatus {
        let mut clock = tokio::time::interval(SPACING);
        let mut last = None;
        let found = tokio::time::timeout(DEADLINE, async {
            loop {
                clock.tick().await;
                put(&mut self.stream);
                let status = bench.client.robot_status(&bench.robot).await.expect("status");
                if condition(&status) {
                    return status;
                }
                last = Some(status);
            }
        })
        .await;
        found.unwrap_or_else(|_| panic!("the status never was as expected: {last:#?}"))
    }
}

fn speeds(first: f64) -> JointVector {
    JointVector::from_slice(&[first, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("six joints")
}

fn positions(first: f64) -> JointVector {
    let mut position = READY;
    position[0] = first;
    JointVector::from_slice(&position).expect("six joints")
}

fn taken(status: &RobotStatus) -> u64 {
    status.stream.map_or(0, |stream| stream.taken)
}

fn dropped(status: &RobotStatus, what: &str) -> u64 {
    status.dropped.iter().find(|(name, _)| name == what).map_or(0, |(_, count)| *count)
}

/// The newest state as soon as it satisfies `condition`.
async fn state_when(bench: &Bench, condition: impl Fn(&RobotState) -> bool) -> RobotState {
    let key = format!("robots/{}/state", bench.robot);
    let states = bench.client.subscribe::<RobotState>(&key, 1).await.expect("subscribes");
    tokio::time::timeout(DEADLINE, async {
        loop {
            let (_, state) = states.next().await.expect("a state");
            if condition(&state) {
                return state;
            }
        }
    })
    .await
    .expect("the state never was as expected")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_whose_streaming_client_dies_comes_to_rest_and_says_that_it_starves() {
    let bench = Bench::start().await;
    let mut sender = Sender::start(&bench, CommandMode::VelocityCommand).await;
    let put = |stream: &mut Stream| {
        stream.velocity(&speeds(0.3)).expect("put");
    };
    let key = format!("robots/{}/state", bench.robot);
    let states = bench.client.subscribe::<RobotState>(&key, 4096).await.expect("subscribes");
    let follows = |status: &RobotStatus| {
        taken(status) > 50 && status.flags.contains(RobotFlags::VALID_VELOCITY_COMMAND)
    };
    let status = sender.until(&bench, put, follows).await;
    assert_eq!(status.command_mode, CommandMode::VelocityCommand);
    let dying = sender.client.clone();
    dying.close();
    // At rest within the time-out of 40 ms and the stop, from the last state in which a sample was
    // followed: in ticks, since a loop that a busy machine runs late makes fewer.
    let comes_to_rest = async {
        let mut followed = None;
        loop {
            let (_, state) = states.next().await.expect("a state");
            let stands = state.joint_velocity_command_rad_s.iter().all(|&speed| speed == 0.0);
            if state.flags.contains(RobotFlags::VALID_VELOCITY_COMMAND) {
                followed = Some(state.seqno);
            } else if let Some(followed) = followed.filter(|_| stands) {
                return state.seqno - followed;
            }
        }
    };
    let ticks = tokio::time::timeout(DEADLINE, comes_to_rest).await.expect("it comes to rest");
    // 0.3 rad/s with the arm's acceleration takes less than 150 ms; ticks are 2 ms, states come every
    // 10 ms.
    assert!(ticks < (40 + 150) / 2, "at rest after {ticks} ticks");
    let status = bench.status_when(|s| s.stream.is_some_and(|stream| stream.starved)).await;
    assert_eq!(status.command_mode, CommandMode::VelocityCommand, "the mode stays");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn samples_of_a_client_without_the_lease_are_dropped_and_counted() {
    let bench = Bench::start().await;
    let mut sender = Sender::start(&bench, CommandMode::PositionCommand).await;
    let epoch = bench.status_when(|_| true).await.epoch;
    let stranger = connect(bench.endpoint()).await;
    assert!(stranger.acquire_lease(&bench.robot, TTL).await.is_err(), "it is held");
    let wrong = Uuid::from_u128(1);
    let mut other = stranger.stream(&bench.robot, wrong, epoch).await.expect("states come");
    let put = |stream: &mut Stream| {
        stream.position(&positions(0.05), None).expect("put");
        other.position(&positions(-1.0), None).expect("put");
    };
    let status = sender
        .until(&bench, put, |status| dropped(status, "stream_lease") > 50 && taken(status) > 50)
        .await;
    assert_eq!(dropped(&status, "stream_epoch"), 0);
    let state = state_when(&bench, |_| true).await;
    let first = state.joint_position_command_rad[0];
    assert!((0.0..=0.05 + 1e-6).contains(&first), "only the holder moves the robot: {first}");
    sender.keeper.release().await.expect("held");
    let status = bench.status_when(|status| status.lease.is_none()).await;
    assert!(status.stream.is_none() && status.epoch > epoch, "{status:?}");
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn joints_are_commanded_by_name_and_what_cannot_be_read_is_counted() {
    let bench = Bench::start().await;
    let mut sender = Sender::start(&bench, CommandMode::PositionCommand).await;
    let put = |stream: &mut Stream| {
        let names = ["wrist_3_joint", "no_such_joint"];
        stream.joints(&names, &[0.2, 1.0], &[]).expect("put");
        stream.joints(&names, &[0.2], &[]).expect("put");
    };
    let garbage = bench.client.session().clone();
    garbage.put(format!("robots/{}/stream/position", bench.robot), "{}").await.expect("put");
    let status = sender.until(&bench, put, |status| taken(status) > 30).await;
    assert!(dropped(&status, "unknown_joint") > 10, "{status:?}");
    assert!(dropped(&status, "stream_malformed") > 10, "{status:?}");
    let mut held = READY;
    held[5] = 0.2;
    let put = |stream: &mut Stream| {
        stream.joints(&["wrist_3_joint"], &[0.2], &[]).expect("put");
    };
    let moved = async {
        let mut clock = tokio::time::interval(SPACING);
        loop {
            clock.tick().await;
            put(&mut sender.stream);
        }
    };
    let there = state_when(&bench, |state| {
        // The others stay where they were measured, which is not exact.
        let joints = state.joint_position_command_rad.iter().zip(&held);
        joints.into_iter().all(|(is, held)| (is - held).abs() < 1e-3)
    });
    tokio::select! {
        () = moved => {}
        _ = there => {}
    }
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lease_that_is_kept_outlasts_its_time_and_dropping_it_gives_it_back() {
    let bench = Bench::start().await;
    let ttl = Duration::from_secs(2);
    let keeper = bench.client.acquire_lease(&bench.robot, ttl).await.expect("free");
    let since = bench.status_when(|status| status.lease.is_some()).await.stamp_ns;
    bench.status_when(|status| status.stamp_ns.saturating_since(since) > 2 * ttl).await;
    assert!(!keeper.is_lost());
    let status = bench.client.robot_status(&bench.robot).await.expect("status");
    assert!(status.lease.is_some_and(|lease| !lease.stale && lease.holder == "test"));
    drop(keeper);
    bench.status_when(|status| status.lease.is_none()).await;
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_takes_the_lease_and_its_keeper_tells() {
    let bench = Bench::start().await;
    let ttl = Duration::from_millis(300);
    let keeper = bench.client.acquire_lease(&bench.robot, ttl).await.expect("free");
    let request = StopRequest {
        stop_id: Uuid::now_v7(),
        source: "test".to_owned(),
        level: StopLevel::L2,
        scope: StopScope::Cell,
        reason: "test".to_owned(),
        seq: 0,
    };
    bench.client.stop(request, crate::common::stop_options()).await.expect("stopped");
    tokio::time::timeout(DEADLINE, keeper.lost()).await.expect("told");
    assert!(keeper.is_lost());
    bench.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_state_of_a_lower_rate_comes_at_ticks_that_its_spacing_divides() {
    let bench = Bench::start().await;
    let info = bench.client.robot_info(&bench.robot).await.expect("info");
    assert_eq!(info.state_classes_hz, [1, 10, 30]);
    let ticks = (1000.0 / info.period_ms / 10.0).round() as u64;
    let key = format!("robots/{}/state/10", bench.robot);
    let states = bench.client.subscribe::<RobotState>(&key, 8).await.expect("subscribes");
    let mut numbers = Vec::new();
    while numbers.len() < 4 {
        let next = tokio::time::timeout(DEADLINE, states.next()).await.expect("they come");
        numbers.push(next.expect("a state").1.seqno / ticks);
    }
    assert!(numbers.windows(2).all(|pair| pair[1] > pair[0]), "one in each spacing: {numbers:?}");
    bench.shut_down().await;
}
