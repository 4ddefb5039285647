//! The answering end: requests under `rpc/` and values that can be asked for.
//!
//! ```text
//! query --callback--> bounded queue --> one task a request --> handler --> reply | denial
//! ```
//! The callback runs on Zenoh's receiving threads, so it only queues. Urgent methods, such as
//! stops, have a queue and places of their own. A request with an id that was seen before gets the
//! answer of the first one and is not done again.

use std::collections::{HashMap, VecDeque};
use std::future::Future;
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;
use serde_json::Value;
use tokio::sync::{Semaphore, mpsc, watch};
use tracing::{debug, warn};
use uuid::Uuid;
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait};

use crate::codec::{MAX_REQUEST_BYTES, WireEncoding};
use crate::messages::{Denial, DenialCode, Request};
use crate::method::Method;

/// Requests waiting for a task; more are answered `busy`.
const QUEUE: usize = 64;
/// Requests in progress at once.
const CONCURRENT: usize = 32;
/// Answers kept for repeated requests.
const KEPT_ANSWERS: usize = 512;

/// What answers the methods under one `rpc/` prefix.
pub trait Handler: Send + Sync + 'static {
    /// Answers one request: `call.run::<SomeMethod, _, _>(…)`, or [`Call::unknown_method`].
    fn handle(&self, call: Call) -> impl Future<Output = Result<Value, Denial>> + Send;

    /// Whether requests for `method` never wait behind those for other methods. Called on Zenoh's
    /// receiving threads: it must be quick.
    fn is_urgent(&self, method: &str) -> bool {
        let _ = method;
        false
    }
}

/// One request on its way to a handler.
#[derive(Debug)]
pub struct Call {
    method: String,
    encoding: WireEncoding,
    payload: Vec<u8>,
    answers: Arc<Answers>,
}

impl Call {
    /// Name of the method asked for.
    #[must_use]
    pub fn method(&self) -> &str {
        &self.method
    }

    /// Decodes the request, runs `work` unless the same request was seen before, and returns the
    /// answer.
    ///
    /// # Errors
    /// A denial if the request does not decode, reuses an id for something else, or `work` refuses.
    pub async fn run<M, F, W>(self, work: F) -> Result<Value, Denial>
    where
        M: Method,
        F: FnOnce(Request<M::Params>) -> W + Send,
        W: Future<Output = Result<M::Answer, Denial>> + Send,
    {
        let request: Request<M::Params> = self.decode()?;
        let Some(id) = request.request_id else {
            return to_value(&work(request).await?);
        };
        match self.answers.enter(id, M::NAME)? {
            Entered::Again(answer) => wait_for(answer).await,
            Entered::First(answer) => {
                let result = work(request).await.and_then(|answer| to_value(&answer));
                // Nobody may be waiting; the value is kept for those who ask later.
                answer.send_replace(Some(result.clone()));
                result
            }
        }
    }

    /// The refusal of a method that does not exist; `known` are those that do.
    #[must_use]
    pub fn unknown_method(&self, known: &[&str]) -> Denial {
        Denial::new(
            DenialCode::UnknownMethod,
            format!("there is no method {:?}; there are {}", self.method, known.join(", ")),
        )
        .with("method", self.method.as_str())
    }

    fn decode<P: serde::de::DeserializeOwned>(&self) -> Result<Request<P>, Denial> {
        // A query without payload asks without parameters.
        let empty: &[u8] = br#"{"params":{}}"#;
        if self.payload.is_empty() {
            return Ok(WireEncoding::Json.decode(empty, MAX_REQUEST_BYTES)?);
        }
        Ok(self.encoding.decode(&self.payload, MAX_REQUEST_BYTES)?)
    }
}

/// Answers requests until dropped.
#[derive(Debug)]
pub struct RpcServer {
    _queryable: Queryable<()>,
}

/// Answers every key `{prefix}/{method}` with `handler`.
///
/// # Errors
/// Zenoh's error if the queryable cannot be declared.
pub async fn rpc<H: Handler>(
    session: &Session,
    prefix: &str,
    handler: Arc<H>,
) -> zenoh::Result<RpcServer> {
    let (urgent, urgent_waiting) = mpsc::channel(QUEUE);
    let (ordinary, ordinary_waiting) = mpsc::channel(QUEUE);
    let of_callback = Arc::clone(&handler);
    let queryable = session
        .declare_queryable(format!("{prefix}/**"))
        .complete(true)
        .callback(move |query| {
            let is_urgent = of_callback.is_urgent(method_of(query.key_expr().as_str()));
            let queue = if is_urgent { &urgent } else { &ordinary };
            if let Err(mpsc::error::TrySendError::Full(query)) = queue.try_send(query) {
                let denial = Denial::new(DenialCode::Busy, "too many requests are waiting");
                reply_blocking(&query, &denial);
            }
        })
        .await?;
    start(serve_queue(urgent_waiting, format!("{prefix}/"), Arc::clone(&handler)));
    start(serve_queue(ordinary_waiting, format!("{prefix}/"), handler));
    Ok(RpcServer { _queryable: queryable })
}

/// The last part of a key `…/rpc/{method}`; empty if it has none.
fn method_of(key: &str) -> &str {
    key.rsplit_once("/rpc/").map_or("", |(_, method)| method)
}

async fn serve_queue<H: Handler>(
    mut waiting: mpsc::Receiver<Query>,
    prefix: String,
    handler: Arc<H>,
) {
    let answers = Arc::new(Answers::default());
    let places = Arc::new(Semaphore::new(CONCURRENT));
    while let Some(query) = waiting.recv().await {
        let Ok(place) = Arc::clone(&places).acquire_owned().await else { return };
        let (handler, answers, prefix) = (Arc::clone(&handler), answers.clone(), prefix.clone());
        start(async move {
            answer(&query, &prefix, &*handler, answers).await;
            drop(place);
        });
    }
}

async fn answer<H: Handler>(query: &Query, prefix: &str, handler: &H, answers: Arc<Answers>) {
    let encoding = request_encoding(query);
    let result = match call_of(query, prefix, &encoding, answers) {
        Ok((key, call)) => handler.handle(call).await.map(|value| (key, value)),
        Err(denial) => Err(denial),
    };
    let encoding = encoding.unwrap_or_default();
    match result {
        Ok((key, value)) => reply(query, &key, encoding, &value).await,
        Err(denial) => reply_denial(query, encoding, &denial).await,
    }
}

fn request_encoding(query: &Query) -> Result<WireEncoding, Denial> {
    query.encoding().map_or(Ok(WireEncoding::Json), |label| Ok(WireEncoding::from_zenoh(label)?))
}

fn call_of(
    query: &Query,
    prefix: &str,
    encoding: &Result<WireEncoding, Denial>,
    answers: Arc<Answers>,
) -> Result<(String, Call), Denial> {
    let asked = query.key_expr().as_str();
    let method = method_of(asked);
    if method.is_empty() || method.contains('*') || method.contains('$') {
        return Err(Denial::new(
            DenialCode::InvalidArgument,
            format!("key {asked:?} must name one method"),
        ));
    }
    let encoding = encoding.clone()?;
    let payload = query.payload().map(|bytes| bytes.to_bytes().into_owned()).unwrap_or_default();
    let call = Call { method: method.to_owned(), encoding, payload, answers };
    Ok((format!("{prefix}{method}"), call))
}

/// Sends the one good answer to a query.
pub async fn reply<T: Serialize + Sync>(
    query: &Query,
    key: &str,
    encoding: WireEncoding,
    message: &T,
) {
    match encoding.encode(message) {
        Ok(bytes) => {
            if let Err(error) = query.reply(key, bytes).encoding(encoding.to_zenoh()).await {
                debug!(key, %error, "answer not sent");
            }
        }
        Err(error) => reply_denial(query, encoding, &error.into()).await,
    }
}

/// Refuses a query.
pub async fn reply_denial(query: &Query, encoding: WireEncoding, denial: &Denial) {
    match encoding.encode(denial) {
        Ok(bytes) => {
            if let Err(error) = query.reply_err(bytes).encoding(encoding.to_zenoh()).await {
                debug!(%error, "denial not sent");
            }
        }
        Err(error) => warn!(%error, "denial cannot be encoded"),
    }
}

fn reply_blocking(query: &Query, denial: &Denial) {
    if let Ok(bytes) = WireEncoding::Json.encode(denial) {
        let label = WireEncoding::Json.to_zenoh();
        if let Err(error) = query.reply_err(bytes).encoding(label).wait() {
            debug!(%error, "denial not sent");
        }
    }
}

/// A value that can be asked for at one key.
///
/// # Errors
/// Zenoh's error if the queryable cannot be declared.
pub async fn value<T, F>(session: &Session, key: String, current: F) -> zenoh::Result<RpcServer>
where
    T: Serialize + Send + Sync,
    F: Fn() -> Result<T, Denial> + Send + Sync + 'static,
{
    let own_key = key.clone();
    values(session, key, move |_| Ok(vec![(own_key.clone(), current()?)])).await
}

/// Values that can be asked for at the keys of an expression: `find` is given the expression that
/// was asked, and returns every value it means with its key.
///
/// # Errors
/// Zenoh's error if the queryable cannot be declared.
pub async fn values<T, F>(session: &Session, keys: String, find: F) -> zenoh::Result<RpcServer>
where
    T: Serialize + Send + Sync,
    F: Fn(&str) -> Result<Vec<(String, T)>, Denial> + Send + Sync + 'static,
{
    let (queue, mut waiting) = mpsc::channel::<Query>(QUEUE);
    let queryable = session
        .declare_queryable(keys)
        .complete(true)
        // When the queue is full the query is dropped: zero replies, which askers repeat.
        .callback(move |query| drop(queue.try_send(query)))
        .await?;
    start(async move {
        while let Some(query) = waiting.recv().await {
            answer_values(&query, find(query.key_expr().as_str())).await;
        }
    });
    Ok(RpcServer { _queryable: queryable })
}

async fn answer_values<T: Serialize + Sync>(
    query: &Query,
    found: Result<Vec<(String, T)>, Denial>,
) {
    let encoding = request_encoding(query);
    match found.and_then(|found| Ok((found, encoding.clone()?))) {
        Ok((found, encoding)) => {
            for (key, message) in &found {
                reply(query, key, encoding, message).await;
            }
        }
        Err(denial) => reply_denial(query, encoding.unwrap_or_default(), &denial).await,
    }
}

#[expect(clippy::disallowed_methods, reason = "the serving end is runtime code")]
fn start(task: impl Future<Output = ()> + Send + 'static) {
    tokio::spawn(task);
}

fn to_value<T: Serialize>(message: &T) -> Result<Value, Denial> {
    serde_json::to_value(message)
        .map_err(|error| Denial::new(DenialCode::Internal, format!("answer: {error}")))
}

type Answer = Option<Result<Value, Denial>>;

/// Answers given lately, by request id.
#[derive(Debug, Default)]
struct Answers {
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    by_id: HashMap<Uuid, (&'static str, watch::Receiver<Answer>)>,
    order: VecDeque<Uuid>,
}

enum Entered {
    First(watch::Sender<Answer>),
    Again(watch::Receiver<Answer>),
}

impl Answers {
    fn enter(&self, id: Uuid, method: &'static str) -> Result<Entered, Denial> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((first, answer)) = kept.by_id.get(&id) {
            if *first == method {
                return Ok(Entered::Again(answer.clone()));
            }
            return Err(Denial::new(
                DenialCode::InvalidArgument,
                format!("request_id {id} was already used for {first}"),
            )
            .with("field", "request_id"));
        }
        let (sender, receiver) = watch::channel(None);
        kept.by_id.insert(id, (method, receiver));
        kept.order.push_back(id);
        if kept.order.len() > KEPT_ANSWERS
            && let Some(oldest) = kept.order.pop_front()
        {
            kept.by_id.remove(&oldest);
        }
        Ok(Entered::First(sender))
    }
}

async fn wait_for(mut answer: watch::Receiver<Answer>) -> Result<Value, Denial> {
    let internal = || Denial::new(DenialCode::Internal, "the first request was not answered");
    let value = answer.wait_for(Option::is_some).await.map_err(|_| internal())?;
    value.clone().unwrap_or_else(|| Err(internal()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_request_is_recognised_until_it_is_very_old() {
        let answers = Answers::default();
        let first = Uuid::from_u128(1);
        assert!(matches!(answers.enter(first, "halt"), Ok(Entered::First(_))));
        assert!(matches!(answers.enter(first, "halt"), Ok(Entered::Again(_))));
        for other in 2..=(KEPT_ANSWERS as u128 + 1) {
            assert!(answers.enter(Uuid::from_u128(other), "halt").is_ok());
        }
        assert!(matches!(answers.enter(first, "halt"), Ok(Entered::First(_))));
    }

    #[test]
    fn an_id_used_for_another_method_is_refused() {
        let answers = Answers::default();
        assert!(answers.enter(Uuid::nil(), "halt").is_ok());
        let denial = answers.enter(Uuid::nil(), "enable").err().expect("used for halt");
        assert_eq!(denial.code, DenialCode::InvalidArgument);
    }
}
