//! The reference: Zenoh with the settings that Armada gives it, and nothing else.

use std::time::Duration;

use anyhow::Context as _;
use armada_agent::runtime::monotonic;
use armada_protocol::codec::WireEncoding;
use armada_protocol::qos::Channel;
use armada_protocol::session::{self, Role, SessionOptions};
use zenoh::query::{ConsolidationMode, QueryTarget, Queryable};
use zenoh::sample::Locality;
use zenoh::{Session, Wait as _};

use super::wakes::BareLoop;

/// Key of everything raw; no key of a cell.
pub(super) const KEY: &str = "bench/raw";
/// Two stamps.
const LEAST_BYTES: usize = 16;
/// How long an answer may take.
const PATIENCE: Duration = Duration::from_secs(2);

/// Opens a session as an agent does.
async fn open(endpoint: &str) -> anyhow::Result<Session> {
    let options = SessionOptions {
        role: Role::Agent,
        listen: vec![endpoint.to_owned()],
        connect: Vec::new(),
        namespace: None,
        insecure_lan: false,
    };
    Ok(session::open(&options).await?)
}

/// Puts a payload each period; it begins with its time stamps.
pub(super) async fn publish(
    endpoint: &str,
    period: Duration,
    priority: Option<u8>,
    bytes: usize,
) -> anyhow::Result<BareLoop> {
    let session = open(endpoint).await?;
    let channel = Channel::State;
    let publisher = session
        .declare_publisher(KEY)
        .priority(channel.priority())
        .congestion_control(channel.congestion_control())
        .express(channel.express())
        .encoding(WireEncoding::Json.to_zenoh())
        .allowed_destination(Locality::Remote)
        .await
        .map_err(zenoh_error)?;
    let tick = move |deadline: armada_model::MonoTime, _| {
        let mut payload = vec![b'0'; bytes.max(LEAST_BYTES)];
        let stamps = [deadline, monotonic()].map(|time| time.as_nanos().to_le_bytes());
        for (slot, byte) in payload.iter_mut().zip(stamps.concat()) {
            *slot = byte;
        }
        // One that is not put is missing at the subscriber, where it is counted.
        drop(publisher.put(payload).wait());
        let _open = &session;
    };
    Ok(BareLoop::start(period, priority, tick)?)
}

/// When a payload of [`publish`] was due and when it was put \[ns\].
pub(super) fn stamps(payload: &[u8]) -> Option<[u64; 2]> {
    let (due, rest) = payload.split_first_chunk()?;
    let put = rest.first_chunk()?;
    Some([u64::from_le_bytes(*due), u64::from_le_bytes(*put)])
}

/// What answers queries at once.
pub(super) struct Answerer {
    _queryable: Queryable<()>,
    _session: Session,
}

/// Answers every query with `bytes` bytes.
pub(super) async fn reply(endpoint: &str, bytes: usize) -> anyhow::Result<Answerer> {
    let session = open(endpoint).await?;
    let answer = vec![b'0'; bytes];
    let queryable = session
        .declare_queryable(KEY)
        .callback(move |query| {
            // One that is not sent is a time-out of the asker, where it is told.
            drop(query.reply(KEY, answer.clone()).wait());
        })
        .await
        .map_err(zenoh_error)?;
    Ok(Answerer { _queryable: queryable, _session: session })
}

/// Time from a query to its answer.
pub(super) async fn round_trip(
    session: &Session,
    channel: Channel,
    payload: Vec<u8>,
) -> anyhow::Result<Duration> {
    let begin = monotonic();
    let replies = session
        .get(KEY)
        .target(QueryTarget::BestMatching)
        .consolidation(ConsolidationMode::None)
        .congestion_control(channel.congestion_control())
        .priority(channel.priority())
        .express(channel.express())
        .payload(payload)
        .timeout(PATIENCE)
        .await
        .map_err(zenoh_error)?;
    let reply = replies.recv_async().await.map_err(|_| anyhow::anyhow!("no answer"))?;
    let took = monotonic().saturating_since(begin);
    reply.result().map_err(|_| anyhow::anyhow!("the query timed out")).context("reference")?;
    Ok(took)
}

/// Zenoh's error, which is no `Error` of the kind that carries a cause.
pub(super) fn zenoh_error(error: zenoh::Error) -> anyhow::Error {
    anyhow::anyhow!("zenoh: {error}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_read_from_the_beginning_of_a_payload() {
        let mut payload = 7u64.to_le_bytes().to_vec();
        payload.extend(9u64.to_le_bytes());
        payload.extend([0; 100]);
        assert_eq!(stamps(&payload), Some([7, 9]));
        assert_eq!(stamps(&payload[..15]), None);
    }
}
