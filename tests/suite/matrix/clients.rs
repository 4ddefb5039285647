//! Rows 1, 2, 3, 16 and 17: clients that die, quarrel, flood, replay and forge.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, Result};
use armada_model::JointVector;
use armada_protocol::client::Client;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::*;
use armada_protocol::method::robot::{Halt, JogFreespace, SetMode};
use armada_tests::{HostProcess, NetCellOptions, Quality, in_network, monotonic, wait_for};
use serde_json::Value;
use tokio::task::JoinSet;
use uuid::Uuid;
use zenoh::qos::CongestionControl;

use crate::support::{
    Bed, PERIOD, RESERVE, Watch, assert_within, count, denial, is_commanded, speed,
};

/// Between two samples of a stream.
const SPACING: Duration = Duration::from_millis(5);
/// Silence of a stream after which the robot decelerates.
const STREAM_TIMEOUT: Duration = Duration::from_millis(40);
/// The longest that a jog of the command line goes on without another request.
const DEAD_MAN: Duration = Duration::from_millis(250);

#[test]
fn clients_that_die_quarrel_flood_replay_or_forge_do_no_harm() -> Result<()> {
    in_network("failure matrix, clients", async |network| {
        let bed = Bed::start(network, NetCellOptions::default()).await?;
        row_01_jog_or_stream_client_dies(&bed).await.context("row 1")?;
        row_02_operation_client_dies(&bed).await.context("row 2")?;
        row_03_second_client_commands(&bed).await.context("row 3")?;
        row_16_slow_subscriber_or_flood(&bed).await.context("row 16")?;
        row_17_replayed_or_forged_command(&bed).await.context("row 17")
    })
}

/// Agent, sample age: 40 to 100 ms, a ramp, no latch; new samples in the same epoch go on.
async fn row_01_jog_or_stream_client_dies(bed: &Bed) -> Result<()> {
    let robot = &bed.left;
    // The driver's link alone is lost; the observer sees the robot through the gateway.
    let driver = bed.cell.client_of("driver", &["left_arm"]).await?;
    let observer = bed.cell.client_of("observer", &["gateway"]).await?;
    let keeper = driver.acquire_lease(robot, Duration::from_secs(20)).await?;
    let mode = SetModeParams { mode: CommandMode::VelocityCommand };
    let epoch = driver.under(keeper.lease()).call::<SetMode>(robot, mode).await?.epoch;
    let mut watch = Watch::of(&observer, robot).await?;
    let feeder = Feeder::start(&driver, bed, keeper.lease(), epoch).await?;
    watch.state_when("it follows", |_| true, |state| speed(state) > 0.19).await?;
    bed.cell.network.set_link("client", "left_arm", Quality::CUT)?;
    let starved = watch.event_when("it starves", |event| is_stream(event, "starved")).await?;
    // All of it by the agent's own clock: when the last sample came, and when it was missed.
    let stream = async || {
        let status = observer.robot_status(robot).await.ok()?;
        Some((status.stamp_ns, status.stream.filter(|stream| stream.starved)?.age_ms))
    };
    let (stamp, age_ms) = wait_for("its age is told", Duration::from_secs(5), stream).await?;
    let newest = stamp.saturating_since(starved.stamp_ns);
    let age = Duration::from_secs_f64(age_ms / 1e3).saturating_sub(newest);
    assert!(age + PERIOD >= STREAM_TIMEOUT, "starved after {age:?}");
    assert!(age <= STREAM_TIMEOUT + PERIOD + RESERVE, "starved after {age:?}");
    let rest = watch.rest(starved.stamp_ns).await?;
    assert_within("row 1: starved to rest", starved.stamp_ns, rest, Duration::from_millis(100));
    watch.assert_ramped();
    let status = observer.robot_status(robot).await?;
    assert!(status.stop.is_none() && status.faults.is_empty(), "no latch: {status:#?}");
    assert_eq!(status.command_mode, CommandMode::VelocityCommand, "the mode stays");
    // What was under way on the link comes late and is too old; new samples go on as they are.
    bed.cell.network.set_link("client", "left_arm", Quality::default())?;
    watch.event_when("it goes on", |event| is_stream(event, "resumed")).await?;
    let after = watch.heard.last().context("just heard")?.stamp_ns;
    watch.state_when("it moves", |s| s.stamp_ns > after, |state| speed(state) > 0.19).await?;
    assert_eq!(observer.robot_status(robot).await?.epoch, epoch, "the epoch stays");
    watch.assert_ramped();
    drop(feeder);
    keeper.release().await?;
    a_jog_whose_client_is_killed_ends(bed).await?;
    observer.close();
    driver.close();
    Ok(())
}

/// A person's program that jogs dies; the robot rests when the time of its last request is over.
async fn a_jog_whose_client_is_killed_ends(bed: &Bed) -> Result<()> {
    let robot = &bed.left;
    bed.granted::<Halt>(robot, Empty {}).await?;
    let mut watch = Watch::of(&bed.client, robot).await?;
    let jog = ["jog", "left_arm", "--joint", "shoulder_pan_joint=0.2", "--for", "30"];
    let mut jog = bed.cell.spawn("client", "jog", &jog)?;
    let moving = watch.state_when("it jogs", |_| true, |state| speed(state) > 0.19).await;
    moving.with_context(|| jog.printed())?;
    let killed = monotonic();
    jog.kill()?;
    let slower = watch.state_when("it brakes", |s| s.stamp_ns > killed, |s| speed(s) < 0.19);
    let slower = slower.await?;
    assert_within("row 1: jog killed to braking", killed, slower.stamp_ns, DEAD_MAN);
    let rest = watch.rest(killed).await?;
    watch.assert_ramped();
    watch.assert_still(rest).await?;
    let status = bed.client.robot_status(robot).await?;
    assert!(status.stop.is_none() && status.faults.is_empty(), "no latch: {status:#?}");
    Ok(())
}

/// Agent, window of 1 s: the policy of each operation; no latch, and nothing goes on by itself.
async fn row_02_operation_client_dies(bed: &Bed) -> Result<()> {
    let (mut left, lease) = hold_lease(bed, "left_arm").await?;
    let (mut right, other) = hold_lease(bed, "right_arm").await?;
    let holder = (bed.client.under(lease), bed.client.under(other));
    let stops = bed.move_one(&holder.0, &bed.left, 6.0, LeaseLoss::StopOnPath).await?;
    let goes_on = bed.move_one(&holder.1, &bed.right, 3.0, LeaseLoss::Finish).await?;
    let mut watch = Watch::of(&bed.client, &bed.left).await?;
    watch.state_when("it moves", |_| true, is_commanded).await?;
    let killed = monotonic();
    left.kill()?;
    right.kill()?;
    let status = bed.client.robot_status(&bed.left).await?;
    let held = status.lease.context("it is still held")?;
    let deadline = status.stamp_ns + Duration::from_millis(held.remaining_ms);
    assert_within("row 2: killed to the end of the lease", killed, deadline, TTL);
    let is_over =
        |event: &Event| event.kind == EventKind::Lease && event.message.contains("ran out");
    let over = watch.event_when("the lease runs out", is_over).await?;
    let tick = PERIOD + Duration::from_millis(1);
    assert!(over.stamp_ns + tick >= deadline, "not before its time");
    assert_within("row 2: end of the lease to its notice", deadline, over.stamp_ns, tick);
    let end = bed.end_of(&bed.left, stops).await?;
    assert_eq!(end.reason.as_ref().map(|r| r.code), Some(DenialCode::LeaseStale), "{end:#?}");
    assert!(end.elapsed_s < end.duration_s, "{end:#?}");
    watch.assert_ramped();
    let end = bed.end_of(&bed.right, goes_on).await?;
    assert_eq!(end.status, ActionStatus::Complete, "its policy is to finish: {end:#?}");
    // Whoever acquires it again finds a robot that stands, and may ask for a new motion.
    let keeper = bed.client.acquire_lease(&bed.left, Duration::from_secs(20)).await?;
    let granted = monotonic();
    watch.assert_still(granted).await?;
    let status = bed.client.robot_status(&bed.left).await?;
    assert!(status.stop.is_none() && status.faults.is_empty(), "no latch: {status:#?}");
    let under = bed.client.under(keeper.lease());
    let again = bed.move_one(&under, &bed.left, 0.5, LeaseLoss::StopOnPath).await?;
    assert_eq!(bed.end_of(&bed.left, again).await?.status, ActionStatus::Complete);
    keeper.release().await?;
    Ok(())
}

/// Agent, epoch, one cycle: dropped, and told who holds it; take it with a reason, or wait.
async fn row_03_second_client_commands(bed: &Bed) -> Result<()> {
    let robot = &bed.left;
    let holder = bed.cell.client_of("planner", &["left_arm"]).await?;
    let second = bed.cell.client_of("intruder", &["gateway"]).await?;
    let keeper = holder.acquire_lease(robot, Duration::from_secs(20)).await?;
    let under = holder.under(keeper.lease());
    let id = bed.move_one(&under, robot, 2.0, LeaseLoss::StopOnPath).await?;
    let refused = denial(second.call::<JogFreespace>(robot, to_zero()).await);
    assert_eq!(refused.code, DenialCode::LeaseRequired);
    assert!(refused.message.contains("planner"), "{refused}");
    assert_eq!(second.robot_status(robot).await?.lease.map(|l| l.holder), Some("planner".into()));
    let mode = SetModeParams { mode: CommandMode::Jog };
    assert_eq!(denial(second.call::<SetMode>(robot, mode).await).code, DenialCode::LeaseRequired);
    let stale = second.under(Uuid::from_u128(7));
    let refused = denial(stale.call::<JogFreespace>(robot, to_zero()).await);
    assert!(matches!(refused.code, DenialCode::LeaseRequired | DenialCode::LeaseStale));
    let end = bed.end_of(robot, id).await?;
    assert_eq!(end.status, ActionStatus::Complete, "the holder's motion is untouched: {end:#?}");
    // Whoever is a person may take it with a reason: at once, and the holder is told by whom.
    let mut watch = Watch::of(&bed.client, robot).await?;
    let id = bed.move_one(&under, robot, 6.0, LeaseLoss::Finish).await?;
    watch.state_when("it moves", |_| true, |state| speed(state) > 0.1).await?;
    let asked = monotonic();
    let ttl = Duration::from_secs(20);
    let taken = second.take_lease(robot, ttl, Role::Operator, "part is stuck").await?;
    let of_take =
        |event: &Event| event.kind == EventKind::Lease && event.message.contains("part is stuck");
    let revoked = watch.event_when("it is taken", of_take).await?;
    let bound = PERIOD + Duration::from_millis(20);
    assert_within("row 3: take to revocation", asked, revoked.stamp_ns, bound);
    tokio::time::timeout(Duration::from_secs(20), keeper.lost()).await.context("it is told")?;
    let end = bed.end_of(robot, id).await?;
    assert_eq!(end.reason.map(|r| r.code), Some(DenialCode::LeaseRequired));
    watch.assert_ramped();
    let refused = denial(under.call::<SetMode>(robot, mode).await);
    assert!(matches!(refused.code, DenialCode::LeaseRequired | DenialCode::LeaseStale));
    // Or waits until it is given back.
    taken.release().await?;
    let keeper = holder.acquire_lease(robot, Duration::from_secs(2)).await?;
    keeper.release().await?;
    holder.close();
    second.close();
    Ok(())
}

/// The loop is isolated: a flood and a reader that hangs cost telemetry, never a set-point.
async fn row_16_slow_subscriber_or_flood(bed: &Bed) -> Result<()> {
    let robot = &bed.left;
    let reader = bed.cell.spawn("client", "events", &["events"])?;
    let before = bed.status_when(robot, "quiet", |_| true).await?;
    let id = bed.move_one(&bed.client, robot, 3.0, LeaseLoss::StopOnPath).await?;
    reader.freeze()?;
    bed.cell.gateway.freeze()?;
    let flooder = bed.cell.client_of("flood", &["left_arm"]).await?;
    let flood = Flood::start(&flooder, keys::ROBOT_STREAM_VELOCITY.of(robot))?;
    let end = bed.end_of(robot, id).await?;
    let sent = flood.end();
    bed.cell.gateway.thaw()?;
    reader.thaw()?;
    assert_eq!(end.status, ActionStatus::Complete, "{end:#?}");
    assert!(sent > 3_000, "only {sent} messages were sent");
    let malformed = |status: &RobotStatus| count(status, "stream_malformed") > 1_000;
    let after = bed.status_when(robot, "the flood is counted", malformed).await?;
    let time = after.stamp_ns.saturating_since(before.stamp_ns).as_secs_f64();
    let ticks = after.control_loop.ticks - before.control_loop.ticks;
    let share = ticks as f64 * PERIOD.as_secs_f64() / time;
    assert!(share > 0.95, "{ticks} ticks in {time} s");
    // One period a tick: with none missed it ended when it was to.
    let missed = after.control_loop.missed_periods - before.control_loop.missed_periods;
    let started = end.started_ns.context("it moved")?;
    let took = end.stamp_ns.saturating_since(started).as_secs_f64();
    let late = took - end.duration_s - missed as f64 * PERIOD.as_secs_f64();
    assert!(late < 0.3, "{took} s for {} s with {missed} periods missed", end.duration_s);
    flooder.close();
    wait_for("the gateway is back", Duration::from_secs(20), async || {
        let status = bed.client.cell_status().await.ok()?;
        (status.verdict == CellVerdict::Ready).then_some(())
    })
    .await
}

/// Agent, lease and number: dropped and counted; a request is done once however often it comes.
async fn row_17_replayed_or_forged_command(bed: &Bed) -> Result<()> {
    let robot = &bed.right;
    let keeper = bed.client.acquire_lease(robot, Duration::from_secs(20)).await?;
    bed.client.call::<Halt>(robot, Empty {}).await?;
    let under = bed.client.under(keeper.lease());
    let mode = SetModeParams { mode: CommandMode::VelocityCommand };
    let epoch = under.call::<SetMode>(robot, mode).await?.epoch;
    let mut watch = Watch::of(&bed.client, robot).await?;
    let state = watch.state_when("a state", |_| true, |_| true).await?;
    let zeros = state.joint_position_rad.map_indexed(|_, _| 0.0);
    let fast = zeros.map_indexed(|_, _| 0.5);
    let sample = |lease, epoch, seq, state_seqno, values| StreamCommand {
        lease,
        epoch,
        seq,
        state_seqno,
        values,
        velocity: None,
    };
    let lease = keeper.lease();
    put(&bed.client, bed, &sample(lease, epoch, 100, state.seqno, zeros)).await?;
    let taken = |s: &RobotStatus| s.stream.is_some_and(|stream| stream.taken > 0);
    bed.status_when(robot, "the stream runs", taken).await?;
    for (forged, counter) in [
        (sample(lease, epoch, 99, state.seqno + 1, fast), "stream_sequence"),
        (sample(lease, epoch, 100, state.seqno + 1, fast), "stream_sequence"),
        (sample(Uuid::from_u128(3), epoch, 101, state.seqno, fast), "stream_lease"),
        (sample(lease, epoch - 1, 102, state.seqno, fast), "stream_epoch"),
        (sample(lease, epoch, 103, 0, fast), "stream_age"),
    ] {
        let before = count(&bed.client.robot_status(robot).await?, counter);
        put(&bed.client, bed, &forged).await?;
        let counted = |status: &RobotStatus| count(status, counter) > before;
        bed.status_when(robot, counter, counted).await?;
    }
    let audited =
        |event: &Event| event.kind == EventKind::Denied && event.message.contains("dropped");
    watch.event_when("it is in the audit trail", audited).await?;
    assert!(watch.seen.iter().all(|state| !is_commanded(state)), "none of them moves it");
    keeper.release().await?;
    bed.granted::<Halt>(robot, Empty {}).await?;
    a_replayed_request_is_answered_and_not_done(bed).await
}

/// The very bytes of a request come a second time, from somebody else.
async fn a_replayed_request_is_answered_and_not_done(bed: &Bed) -> Result<()> {
    let robot = &bed.right;
    let mode = SetModeParams { mode: CommandMode::Trajectory };
    bed.client.call::<SetMode>(robot, mode).await?;
    let trajectory = bed.one(robot, 0.05, 0.5).await?;
    let params = ExecuteTrajectoryParams::at_once(None, trajectory);
    let request = WireEncoding::Json.encode(&Request::new("planner", params))?;
    let key = keys::ROBOT_RPC.with(&[robot.as_str(), "execute_trajectory"]);
    let first = ask(&bed.client, &key, request.clone()).await?;
    let id: Uuid = serde_json::from_value(first["motion_id"].clone())?;
    bed.end_of(robot, id).await?;
    let mut watch = Watch::of(&bed.client, robot).await?;
    let thief = bed.cell.client_of("thief", &["right_arm"]).await?;
    let replayed = monotonic();
    assert_eq!(ask(&thief, &key, request).await?["motion_id"], first["motion_id"]);
    watch.assert_still(replayed).await?;
    thief.close();
    Ok(())
}

/// How long the leases of row 2 last.
const TTL: Duration = Duration::from_secs(1);

/// A program of its own that holds the lease of a robot.
async fn hold_lease(bed: &Bed, robot: &str) -> Result<(HostProcess, Uuid)> {
    let arguments = ["lease", "hold", robot, "--ttl", "1", "--json"];
    let process = bed.cell.spawn("client", &format!("lease-{robot}"), &arguments)?;
    let granted = async || {
        let printed = process.printed();
        let line = printed.lines().find(|line| line.starts_with('{'))?;
        serde_json::from_str::<LeaseGrant>(line).ok()
    };
    let grant = wait_for("the lease is granted", Duration::from_secs(20), granted).await;
    let grant = grant.with_context(|| process.printed())?;
    Ok((process, grant.lease))
}

pub(crate) fn is_stream(event: &Event, change: &str) -> bool {
    let details = event.details.get("change").and_then(Value::as_str);
    event.kind == EventKind::Stream && details == Some(change)
}

fn to_zero() -> JogFreespaceParams {
    JogFreespaceParams {
        motion_id: None,
        joint_position_rad: JointVector::zeros(6).expect("six joints"),
        max_velocity_rad_s: None,
        wait: false,
    }
}

async fn put(client: &Client, bed: &Bed, sample: &StreamCommand) -> Result<()> {
    let key = keys::ROBOT_STREAM_VELOCITY.of(&bed.right);
    let bytes = WireEncoding::Json.encode(sample)?;
    let put = client.session().put(key, bytes).encoding(WireEncoding::Json.to_zenoh());
    put.await.map_err(|error| anyhow::anyhow!("{error}"))
}

async fn ask(client: &Client, key: &str, request: Vec<u8>) -> Result<Value> {
    let get = client.session().get(key).payload(request);
    let get = get.encoding(WireEncoding::Json.to_zenoh());
    let replies = get.await.map_err(|error| anyhow::anyhow!("{error}"))?;
    let reply = replies.recv_async().await.map_err(|error| anyhow::anyhow!("{error}"))?;
    let sample = reply.result().map_err(|refused| {
        anyhow::anyhow!("{}", String::from_utf8_lossy(&refused.payload().to_bytes()))
    })?;
    Ok(serde_json::from_slice(&sample.payload().to_bytes())?)
}

/// Streams a slow turn of the first joint until it is dropped.
pub(crate) struct Feeder(#[expect(dead_code, reason = "dropping it ends the task")] JoinSet<()>);

impl Feeder {
    async fn start(client: &Client, bed: &Bed, lease: Uuid, epoch: u64) -> Result<Self> {
        Self::start_with(client, bed, (lease, epoch), SPACING).await
    }

    /// Under a lease and in an epoch, with another time between samples.
    pub(crate) async fn start_with(
        client: &Client,
        bed: &Bed,
        (lease, epoch): (Uuid, u64),
        spacing: Duration,
    ) -> Result<Self> {
        let mut stream = client.stream(&bed.left, lease, epoch).await?;
        let mut speeds = JointVector::zeros(6)?;
        speeds[0] = 0.2;
        let mut tasks = JoinSet::new();
        tasks.spawn(async move {
            let mut clock = tokio::time::interval(spacing);
            loop {
                clock.tick().await;
                // What is lost on the way is what this is about.
                let _ = stream.velocity(&speeds);
            }
        });
        Ok(Self(tasks))
    }
}

/// Puts nonsense on a key, 10 000 times a second, until it is ended.
struct Flood {
    ended: Arc<AtomicBool>,
    task: std::thread::JoinHandle<u64>,
}

impl Flood {
    fn start(client: &Client, key: String) -> Result<Self> {
        let ended = Arc::new(AtomicBool::new(false));
        let (end, session) = (Arc::clone(&ended), client.session().clone());
        let flood = move || {
            let mut sent = 0_u64;
            let begin = monotonic();
            while !end.load(Ordering::Relaxed) {
                // As many as are due by now, in bursts of a millisecond.
                let due = monotonic().saturating_since(begin).as_micros() / 100;
                while u128::from(sent) < due && !end.load(Ordering::Relaxed) {
                    let put = session.put(&key, vec![b'x'; 200]);
                    let put = put.congestion_control(CongestionControl::Drop);
                    let _ = zenoh::Wait::wait(put);
                    sent += 1;
                }
                std::thread::park_timeout(Duration::from_millis(1));
            }
            sent
        };
        let task = std::thread::Builder::new().name("flood".to_owned()).spawn(flood)?;
        Ok(Self { ended, task })
    }

    fn end(self) -> u64 {
        self.ended.store(true, Ordering::Relaxed);
        self.task.join().unwrap_or_default()
    }
}
