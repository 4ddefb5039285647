//! The asking end: robots and the cell as typed calls.

mod error;
mod lease;
mod stop;
mod stop_source;
mod stream;
mod subscription;

use std::time::{Duration, SystemTime};

use serde::de::DeserializeOwned;
use serde_json::Value;
use tokio::time::Instant;
use uuid::Uuid;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

pub use error::ClientError;
pub use lease::{GroupLeaseError, GroupLeaseKeeper, LeaseKeeper};
pub use stop::StopOptions;
pub use stop_source::AnsweredStopSource;
pub use stream::Stream;
pub use subscription::Subscription;

use crate::RobotName;
use crate::codec::{MAX_MESSAGE_BYTES, WireEncoding};
use crate::keys;
use crate::messages::{
    CellInfo, CellMotionStatus, CellStatus, ClockSample, Denial, DenialCode, MotionStatus, Request,
    RobotInfo, RobotStatus,
};
use crate::method::Method;
use crate::session::{self, DEFAULT_GATEWAY_ENDPOINT, Role, SessionError, SessionOptions};

/// Pause before a request that nobody answered is repeated.
const RETRY_PAUSE: Duration = Duration::from_millis(50);
/// How long to wait for a value such as a status.
const VALUE_TIMEOUT: Duration = Duration::from_secs(1);
/// How long to wait for the first endpoint to answer.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(1);
/// How long to wait for the other endpoints after the first; they are dialled further.
const CONNECT_GRACE: Duration = Duration::from_millis(150);
/// Pause between looks at the links.
const CONNECT_PAUSE: Duration = Duration::from_millis(4);

/// How a client reaches its cell.
#[derive(Clone, Debug)]
pub struct ClientOptions {
    /// Name given with every request, for people and the audit trail.
    pub name: String,
    /// Zenoh endpoints of the gateway and, to be able to stop without it, of the agents.
    pub connect: Vec<String>,
    /// Prefix of every key, as in the cell file.
    pub namespace: Option<String>,
}

impl Default for ClientOptions {
    fn default() -> Self {
        Self {
            name: "armada-client".to_owned(),
            connect: vec![DEFAULT_GATEWAY_ENDPOINT.to_owned()],
            namespace: None,
        }
    }
}

/// A connection to a cell.
#[derive(Clone, Debug)]
pub struct Client {
    session: Session,
    name: String,
    /// The lease under which requests are asked.
    lease: Option<Uuid>,
    /// How many endpoints were dialled.
    endpoints: usize,
}

impl Client {
    /// Connects to a cell.
    ///
    /// # Errors
    /// [`ClientError::Session`] if no session can be opened, [`ClientError::NobodyThere`] if
    /// neither a gateway nor an agent answers at the endpoints.
    pub async fn connect(options: ClientOptions) -> Result<Self, ClientError> {
        let client = Self::connect_at_once(options).await?;
        client.wait_for_late_links().await;
        Ok(client)
    }

    /// Connects to a cell as soon as one of the endpoints answers; the others come in as they do.
    ///
    /// This is for [`Self::stop`], which goes out at once and again to those that come late.
    ///
    /// # Errors
    /// As [`Self::connect`].
    pub async fn connect_at_once(options: ClientOptions) -> Result<Self, ClientError> {
        let session = session::open(&SessionOptions {
            role: Role::Client,
            listen: Vec::new(),
            connect: options.connect.clone(),
            namespace: options.namespace,
            insecure_lan: false,
        })
        .await
        .map_err(|error| nobody_there(error, &options.connect))?;
        let endpoints = options.connect.len();
        let client = Self { session, name: options.name, lease: None, endpoints };
        let deadline = now() + CONNECT_TIMEOUT;
        while client.links().await == 0 {
            if now() >= deadline {
                return Err(ClientError::NobodyThere { endpoints: options.connect });
            }
            tokio::time::sleep(CONNECT_PAUSE).await;
        }
        Ok(client)
    }

    /// The asking end of a session that is open already; `name` is given with every request.
    #[must_use]
    pub fn on_session(session: Session, name: impl Into<String>) -> Self {
        Self { session, name: name.into(), lease: None, endpoints: 0 }
    }

    /// The same connection, asking under a lease, or under none.
    #[must_use]
    pub fn under(&self, lease: impl Into<Option<Uuid>>) -> Self {
        Self { lease: lease.into(), ..self.clone() }
    }

    /// The Zenoh session beneath.
    #[must_use]
    pub const fn session(&self) -> &Session {
        &self.session
    }

    async fn links(&self) -> usize {
        self.session.info().transports().await.count()
    }

    /// Waits until every endpoint is linked, but not for long: one may be dead.
    async fn wait_for_late_links(&self) {
        let patience = now() + CONNECT_GRACE;
        while self.links().await < self.endpoints && now() < patience {
            tokio::time::sleep(CONNECT_PAUSE).await;
        }
    }

    /// Asks a robot's agent.
    ///
    /// # Errors
    /// [`ClientError::Denied`] if it refuses, [`ClientError::NoReply`] if nobody answers,
    /// [`ClientError::Timeout`] if the answer is late, [`ClientError::Codec`] if it is not valid.
    pub async fn call<M: Method>(
        &self,
        robot: &RobotName,
        params: M::Params,
    ) -> Result<M::Answer, ClientError> {
        self.call_within::<M>(robot, params, M::TIMEOUT).await
    }

    /// Asks a robot's agent and waits for the answer as long as `timeout`: for requests that are
    /// answered at the end of a motion.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn call_within<M: Method>(
        &self,
        robot: &RobotName,
        params: M::Params,
        timeout: Duration,
    ) -> Result<M::Answer, ClientError> {
        let key = keys::ROBOT_RPC.with(&[robot.as_str(), M::NAME]);
        self.call_key::<M>(&key, params, timeout).await
    }

    /// Asks the gateway.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn call_cell<M: Method>(&self, params: M::Params) -> Result<M::Answer, ClientError> {
        self.call_key::<M>(&keys::CELL_RPC.with(&[M::NAME]), params, M::TIMEOUT).await
    }

    /// Asks for a method by its name, with parameters and answer as they are on the wire: for
    /// programs that pass requests on. Asks the gateway if `robot` is `None`.
    ///
    /// # Errors
    /// As [`Self::call`]; [`ClientError::Denied`] also if `method` is no name of a method.
    pub async fn call_by_name(
        &self,
        robot: Option<&RobotName>,
        method: &str,
        params: Value,
        timeout: Duration,
    ) -> Result<Value, ClientError> {
        // Names of vendors' methods hold slashes; wild cards would ask several at once.
        let is_name = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '/');
        if method.is_empty() || !method.chars().all(is_name) {
            let message = format!("{method:?} is not the name of a method");
            return Err(Denial::new(DenialCode::InvalidArgument, message).into());
        }
        let key = match robot {
            Some(robot) => keys::ROBOT_RPC.with(&[robot.as_str(), method]),
            None => keys::CELL_RPC.with(&[method]),
        };
        let payload = WireEncoding::Json.encode(&self.request(params))?;
        self.ask(&key, Some(payload), timeout).await
    }

    fn request<P>(&self, params: P) -> Request<P> {
        Request::new(self.name.clone(), params).under(self.lease)
    }

    async fn call_key<M: Method>(
        &self,
        key: &str,
        params: M::Params,
        timeout: Duration,
    ) -> Result<M::Answer, ClientError> {
        let payload = WireEncoding::Json.encode(&self.request(params))?;
        self.ask(key, Some(payload), timeout).await
    }

    /// Asks until somebody answers: after a reconnection a query may find nobody for a moment.
    /// Requests carry an id, so a repetition is not done twice.
    async fn ask<T: DeserializeOwned>(
        &self,
        key: &str,
        payload: Option<Vec<u8>>,
        timeout: Duration,
    ) -> Result<T, ClientError> {
        let deadline = now() + timeout;
        let patience = now() + timeout.min(Duration::from_millis(300));
        loop {
            match self.ask_once(key, payload.clone(), timeout).await {
                Err(ClientError::NoReply { .. }) if now() < patience => {
                    tokio::time::sleep(RETRY_PAUSE.min(deadline - now())).await;
                }
                other => return other,
            }
        }
    }

    async fn ask_once<T: DeserializeOwned>(
        &self,
        key: &str,
        payload: Option<Vec<u8>>,
        timeout: Duration,
    ) -> Result<T, ClientError> {
        let mut get = self
            .session
            .get(key)
            .target(QueryTarget::BestMatching)
            .consolidation(ConsolidationMode::None)
            .congestion_control(crate::qos::Channel::Rpc.congestion_control())
            .priority(crate::qos::Channel::Rpc.priority())
            .express(crate::qos::Channel::Rpc.express())
            .timeout(timeout);
        if let Some(payload) = payload {
            get = get.payload(payload).encoding(WireEncoding::Json.to_zenoh());
        }
        let replies = get.await.map_err(ClientError::zenoh)?;
        match replies.recv_async().await {
            Ok(reply) => decode_reply(&reply, key, timeout),
            Err(_) => Err(ClientError::NoReply { key: key.to_owned() }),
        }
    }

    async fn value<T: DeserializeOwned>(&self, key: &str) -> Result<T, ClientError> {
        self.ask(key, None, VALUE_TIMEOUT).await
    }

    /// What a robot is.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn robot_info(&self, robot: &RobotName) -> Result<RobotInfo, ClientError> {
        self.value(&keys::ROBOT_INFO.of(robot)).await
    }

    /// How a robot is.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn robot_status(&self, robot: &RobotName) -> Result<RobotStatus, ClientError> {
        self.value(&keys::ROBOT_STATUS.of(robot)).await
    }

    /// A sample of the clock of a robot's agent.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn robot_clock(&self, robot: &RobotName) -> Result<ClockSample, ClientError> {
        self.value(&keys::ROBOT_CLOCK.of(robot)).await
    }

    /// Status of a motion of one robot, also after its end.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn motion(&self, robot: &RobotName, id: Uuid) -> Result<MotionStatus, ClientError> {
        self.value(&keys::ROBOT_MOTION.with(&[robot.as_str(), &id.to_string()])).await
    }

    /// Status of a motion of several robots, also after its end.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn cell_motion(&self, id: Uuid) -> Result<CellMotionStatus, ClientError> {
        self.value(&keys::CELL_MOTION.with(&[&id.to_string()])).await
    }

    /// The robots of the cell and where they stand.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn cell_info(&self) -> Result<CellInfo, ClientError> {
        self.value(&keys::CELL_INFO.any()).await
    }

    /// Condition of the cell.
    ///
    /// # Errors
    /// As [`Self::call`].
    pub async fn cell_status(&self) -> Result<CellStatus, ClientError> {
        self.value(&keys::CELL_STATUS.any()).await
    }

    /// Robots whose agents are on the bus now, by name.
    ///
    /// # Errors
    /// [`ClientError::Zenoh`] if the bus cannot be asked.
    pub async fn robots_alive(&self) -> Result<Vec<RobotName>, ClientError> {
        let tokens = self
            .session
            .liveliness()
            .get(keys::ROBOT_ALIVE.any())
            .timeout(VALUE_TIMEOUT)
            .await
            .map_err(ClientError::zenoh)?;
        let mut robots = Vec::new();
        while let Ok(reply) = tokens.recv_async().await {
            if let Ok(sample) = reply.result()
                && sample.kind() == SampleKind::Put
            {
                robots.extend(keys::robot_of(sample.key_expr().as_str()));
            }
        }
        robots.sort();
        robots.dedup();
        Ok(robots)
    }

    /// Samples of a key expression as messages; when the reader is slow, the oldest of more than
    /// `capacity` samples are dropped.
    ///
    /// # Errors
    /// [`ClientError::Zenoh`] if the subscriber cannot be declared.
    pub async fn subscribe<T: DeserializeOwned>(
        &self,
        key: &str,
        capacity: usize,
    ) -> Result<Subscription<T>, ClientError> {
        Subscription::declare(&self.session, key, capacity).await
    }

    /// Closes the connection.
    pub fn close(self) {
        // A failure to say goodbye changes nothing for anybody.
        drop(self.session.close().wait());
    }
}

/// A session with one endpoint is not even opened if nobody answers there.
fn nobody_there(error: SessionError, endpoints: &[String]) -> ClientError {
    match error {
        SessionError::Open { cause, .. } if cause.contains("Unable to connect") => {
            ClientError::NobodyThere { endpoints: endpoints.to_vec() }
        }
        other => ClientError::Session(other),
    }
}

fn decode_reply<T: DeserializeOwned>(
    reply: &Reply,
    key: &str,
    timeout: Duration,
) -> Result<T, ClientError> {
    match reply.result() {
        Ok(sample) => {
            let encoding = WireEncoding::from_zenoh(sample.encoding())?;
            Ok(encoding.decode(&sample.payload().to_bytes(), MAX_MESSAGE_BYTES)?)
        }
        Err(refused) => {
            let bytes = refused.payload().to_bytes();
            let denial = WireEncoding::from_zenoh(refused.encoding())
                .and_then(|encoding| encoding.decode::<Denial>(&bytes, MAX_MESSAGE_BYTES));
            // Zenoh's own errors, such as its timeout, are plain text.
            denial.map_or_else(
                |_| Err(ClientError::Timeout { key: key.to_owned(), timeout }),
                |denial| Err(ClientError::Denied(denial)),
            )
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "the asking end is runtime code")]
fn now() -> Instant {
    Instant::now()
}

/// The wall clock, for display only \[ns since 1970 UTC\].
#[must_use]
#[expect(clippy::disallowed_methods, reason = "the asking end is runtime code")]
pub fn utc_ns() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}
