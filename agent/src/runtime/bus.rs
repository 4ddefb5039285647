//! The agent on the bus: its session and the keys it answers.

use std::sync::Arc;
use std::time::Duration;

use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::{ClockSample, Denial, DenialCode, MotionStatus};
use armada_protocol::publish::{Cached, Latest};
use armada_protocol::serve::{self, RpcServer};
use armada_protocol::session::{self, Role, SessionOptions};
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;

use super::agent::{AgentError, AgentOptions};
use super::board::SharedBoard;
use super::clock::{monotonic, utc_ns};
use super::requests::Requests;
use super::robot::Robot;
use super::stop_intake::StopIntake;
use crate::config::ZenohConfig;

/// How long a starting agent looks for the endpoints it dials, before it asks whether its name is
/// taken.
const COMPANY_PATIENCE: Duration = Duration::from_millis(500);

/// What keeps the agent's keys alive.
pub(super) struct Keys {
    _stop: StopIntake,
    _servers: Vec<RpcServer>,
    _alive: LivelinessToken,
}

pub(super) async fn open_session(
    options: &AgentOptions,
    robots: &[Robot],
) -> Result<Session, AgentError> {
    let listen = endpoints(options.listen.as_ref(), robots, |config| &config.listen);
    let mut connect = endpoints(options.connect.as_ref(), robots, |config| &config.connect);
    connect.retain(|endpoint| !listen.contains(endpoint));
    let session = SessionOptions {
        role: Role::Agent,
        listen,
        connect,
        namespace: options.namespace.clone(),
        insecure_lan: options.insecure_lan,
    };
    let dials = !session.connect.is_empty();
    let session = session::open(&session).await?;
    if dials {
        wait_for_company(&session).await;
    }
    Ok(session)
}

/// Those given, else those of all robots, each once.
fn endpoints(
    given: Option<&Vec<String>>,
    robots: &[Robot],
    of: fn(&ZenohConfig) -> &Vec<String>,
) -> Vec<String> {
    let mut all = Vec::new();
    let own = robots.iter().flat_map(|robot| of(&robot.config.zenoh));
    for endpoint in given.map_or_else(|| own.collect::<Vec<_>>(), |given| given.iter().collect()) {
        if !all.contains(endpoint) {
            all.push(endpoint.clone());
        }
    }
    all
}

/// Two agents of one name would both drive the robot's controller.
pub(super) async fn refuse_taken_names(
    session: &Session,
    robots: &[Robot],
) -> Result<(), AgentError> {
    let tokens = session
        .liveliness()
        .get(keys::ROBOT_ALIVE.any())
        .timeout(Duration::from_millis(500))
        .await
        .map_err(zenoh_error)?;
    while let Ok(reply) = tokens.recv_async().await {
        let Ok(alive) = reply.result() else { continue };
        let taken = keys::robot_of(alive.key_expr().as_str());
        if let Some(taken) = taken.filter(|taken| robots.iter().any(|r| r.config.robot == *taken)) {
            return Err(AgentError::NameTaken(taken.to_string()));
        }
    }
    Ok(())
}

/// Waits a moment for somebody to be connected to; an agent also starts alone.
async fn wait_for_company(session: &Session) {
    let company = async {
        while session.info().transports().await.next().is_none() {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    // Being alone after that time is no error.
    drop(tokio::time::timeout(COMPANY_PATIENCE, company).await);
}

pub(super) async fn open_keys(
    session: &Session,
    robot: &Robot,
    board: &Arc<SharedBoard>,
    requests: &Arc<Requests>,
    stop: StopIntake,
) -> Result<Keys, AgentError> {
    let name = &robot.config.robot;
    let boot_id = requests.boot_id;
    let equipment = Arc::clone(&requests.equipment);
    let rpc = keys::ROBOT_RPC.of(name);
    let prefix = rpc.trim_end_matches("/*");
    let asked_board = Arc::clone(board);
    let status = move || Ok(asked_board.lock().status(monotonic()));
    let clock = move || Ok(ClockSample { boot_id, stamp_ns: monotonic(), utc_ns: utc_ns() });
    let told = Arc::clone(&equipment);
    let servers = vec![
        serve::rpc(session, prefix, Arc::clone(requests)).await.map_err(zenoh_error)?,
        serve::value(session, keys::ROBOT_INFO.of(name), move || Ok(told.info()))
            .await
            .map_err(zenoh_error)?,
        serve::value(session, keys::ROBOT_STATUS.of(name), status).await.map_err(zenoh_error)?,
        serve::value(session, keys::ROBOT_CLOCK.of(name), clock).await.map_err(zenoh_error)?,
        serve_motions(session, robot, board).await?,
    ];
    equipment.announce().await;
    let alive = session
        .liveliness()
        .declare_token(keys::ROBOT_ALIVE.of(name))
        .await
        .map_err(zenoh_error)?;
    Ok(Keys { _stop: stop, _servers: servers, _alive: alive })
}

async fn serve_motions(
    session: &Session,
    robot: &Robot,
    board: &Arc<SharedBoard>,
) -> Result<RpcServer, AgentError> {
    let name = robot.config.robot.clone();
    let board = Arc::clone(board);
    let find = move |asked: &str| -> Result<Vec<(String, MotionStatus)>, Denial> {
        let key = |motion: &MotionStatus| {
            keys::ROBOT_MOTION.with(&[name.as_str(), &motion.id.to_string()])
        };
        let board = board.lock();
        let id = asked.rsplit('/').next().unwrap_or_default();
        if id == "*" || id == "**" {
            return Ok(board.motions.all().map(|motion| (key(motion), motion.clone())).collect());
        }
        let found = id.parse().ok().and_then(|id| board.motions.find(id));
        let unknown = || {
            Denial::new(DenialCode::NotAttached, format!("{name} has no motion {id:?} on record"))
        };
        found.map(|motion| vec![(key(motion), motion.clone())]).ok_or_else(unknown)
    };
    serve::values(session, keys::ROBOT_MOTION.of(&robot.config.robot), find)
        .await
        .map_err(zenoh_error)
}

pub(super) async fn declare_latest(
    session: &Session,
    robot: &Robot,
    key: &keys::Key,
    encoding: WireEncoding,
) -> Result<Latest, AgentError> {
    let name = key.of(&robot.config.robot);
    Latest::declare(session, name, key.channel, encoding).await.map_err(zenoh_error)
}

/// The sender of the state at a lower rate \[Hz\].
pub(super) async fn declare_class(
    session: &Session,
    robot: &Robot,
    rate_hz: u32,
) -> Result<Latest, AgentError> {
    let key = &keys::ROBOT_STATE_AT;
    let name = key.with(&[robot.config.robot.as_str(), &rate_hz.to_string()]);
    let encoding = robot.config.publish.encoding;
    Latest::declare(session, name, key.channel, encoding).await.map_err(zenoh_error)
}

pub(super) async fn declare_cached(
    session: &Session,
    robot: &Robot,
    key: &keys::Key,
    samples: usize,
) -> Result<Cached, AgentError> {
    let name = key.of(&robot.config.robot);
    Cached::declare(session, name, key.channel, samples).await.map_err(zenoh_error)
}

pub(super) fn zenoh_error(error: zenoh::Error) -> AgentError {
    AgentError::Zenoh(error.to_string())
}
