//! A flood: samples of streams that no robot may follow, as many a second as are asked for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use anyhow::Context as _;
use armada_agent::runtime::{monotonic, sleep_until};
use armada_model::JointVector;
use armada_protocol::RobotName;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::StreamCommand;
use armada_protocol::qos::Channel;
use uuid::Uuid;
use zenoh::Wait as _;
use zenoh::pubsub::Publisher;

use super::arm::connect;
use super::raw::zenoh_error;
use super::robot_file::JOINTS;

/// Between two bursts.
const PAUSE: Duration = Duration::from_millis(1);

/// A thread that sends until this is dropped.
pub(super) struct Flood {
    ended: Arc<AtomicBool>,
    sent: Arc<AtomicU64>,
    thread: Option<JoinHandle<()>>,
}

impl Flood {
    /// Sends to the robots by turns, `rate_hz` messages a second in all. Each is decoded by an agent,
    /// looked at by a control loop, and dropped for its lease.
    pub(super) async fn start(
        endpoints: Vec<String>,
        robots: &[RobotName],
        rate_hz: u32,
    ) -> anyhow::Result<Self> {
        let client = connect(endpoints).await?;
        let mut publishers = Vec::new();
        for robot in robots {
            let publisher = client
                .session()
                .declare_publisher(keys::ROBOT_STREAM_VELOCITY.of(robot))
                .priority(Channel::Stream.priority())
                .congestion_control(Channel::Stream.congestion_control())
                .express(Channel::Stream.express())
                .encoding(WireEncoding::Json.to_zenoh())
                .await
                .map_err(zenoh_error)?;
            publishers.push(publisher);
        }
        let sample = sample()?;
        let (ended, sent) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let (end, count) = (Arc::clone(&ended), Arc::clone(&sent));
        let thread = Builder::new().name("flood".to_owned()).spawn(move || {
            send(&publishers, &sample, rate_hz, &count, &end);
            client.close();
        })?;
        Ok(Self { ended, sent, thread: Some(thread) })
    }

    /// How many messages it has sent, as it sends them.
    pub(super) fn sent(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.sent)
    }
}

impl Drop for Flood {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic has been printed by the thread itself.
            drop(thread.join());
        }
    }
}

fn sample() -> anyhow::Result<Vec<u8>> {
    let values = JointVector::zeros(JOINTS.len()).context("a robot has so many joints")?;
    let (lease, epoch, seq, state_seqno, velocity) = (Uuid::nil(), 0, 0, 0, None);
    let sample = StreamCommand { lease, epoch, seq, state_seqno, values, velocity };
    Ok(WireEncoding::Json.encode(&sample)?)
}

fn send(
    publishers: &[Publisher<'_>],
    sample: &[u8],
    rate_hz: u32,
    count: &AtomicU64,
    end: &AtomicBool,
) {
    let begin = monotonic();
    let mut by_turns = publishers.iter().cycle();
    while !end.load(Ordering::Relaxed) {
        let time = monotonic().saturating_since(begin).as_nanos();
        let due = time * u128::from(rate_hz) / 1_000_000_000;
        while u128::from(count.load(Ordering::Relaxed)) < due && !end.load(Ordering::Relaxed) {
            let Some(publisher) = by_turns.next() else { return };
            // What cannot be sent is not counted as missing: a flood drops.
            drop(publisher.put(sample).wait());
            count.fetch_add(1, Ordering::Relaxed);
        }
        sleep_until(monotonic() + PAUSE);
    }
}
