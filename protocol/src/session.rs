//! A Zenoh session, set up for its role in a cell.
//!
//! No discovery: everybody dials the endpoints it was told. The gateway is the cell's router;
//! agents are peers that dial it and, one side only, each other, so that a stop reaches every
//! agent when the gateway is dead.

use serde_json::json;
use zenoh::{Config, Session};

/// Where the gateway listens unless told otherwise.
pub const DEFAULT_GATEWAY_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Silence after which a link is given up \[ms\]; presence is for display, no stop waits for it.
const LINK_LEASE_MS: u64 = 1000;
/// Longest message a session takes from the network \[bytes\].
const MAX_WIRE_MESSAGE: usize = 8 * 1024 * 1024;

/// What a session is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The router of the cell.
    Gateway,
    /// The agent of one or more robots.
    Agent,
    /// A program that uses the cell.
    Client,
}

/// How a session joins the cell.
#[derive(Clone, Debug)]
pub struct SessionOptions {
    /// What it is for.
    pub role: Role,
    /// Zenoh endpoints to listen on, such as `tcp/127.0.0.1:7447`.
    pub listen: Vec<String>,
    /// Zenoh endpoints to dial; all of them, again and again until they answer. A client that dials
    /// one of them reaches what that one reaches; one that dials several reaches these only.
    pub connect: Vec<String>,
    /// Prefix of every key, which keeps cells apart that share a network.
    pub namespace: Option<String>,
    /// Whether listening outside loopback without authentication is allowed.
    pub insecure_lan: bool,
}

/// Why a session could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// Listening where strangers could reach it was not explicitly allowed.
    #[error(
        "endpoint {0} listens outside this machine, where anybody could command the robots: \
         use a loopback address, or allow it with --insecure-lan on a network you trust"
    )]
    NotLoopback(String),
    /// Zenoh refuses a setting.
    #[error("zenoh refuses the setting {setting}: {cause}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Zenoh's reason.
        cause: String,
    },
    /// Zenoh cannot open the session.
    #[error("cannot open a zenoh session (listen {listen:?}, connect {connect:?}): {cause}")]
    Open {
        /// Endpoints listened on.
        listen: Vec<String>,
        /// Endpoints dialled.
        connect: Vec<String>,
        /// Zenoh's reason.
        cause: String,
    },
}

/// Opens a session.
///
/// A client fails if nobody answers at any of its endpoints; agent and gateway go on dialling.
///
/// # Errors
/// [`SessionError::NotLoopback`] for a listener strangers could reach, [`SessionError::Setting`]
/// for a setting that Zenoh refuses, [`SessionError::Open`] if it cannot listen or connect.
pub async fn open(options: &SessionOptions) -> Result<Session, SessionError> {
    zenoh::open(config(options)?).await.map_err(|cause| SessionError::Open {
        listen: options.listen.clone(),
        connect: options.connect.clone(),
        cause: cause.to_string(),
    })
}

/// The Zenoh configuration of a session.
///
/// # Errors
/// [`SessionError::NotLoopback`] and [`SessionError::Setting`].
pub fn config(options: &SessionOptions) -> Result<Config, SessionError> {
    if let Some(open) = options.listen.iter().find(|e| !options.insecure_lan && !is_local(e)) {
        return Err(SessionError::NotLoopback(open.clone()));
    }
    let mode = mode(options);
    let mut settings = vec![
        ("mode", json!(mode)),
        ("listen/endpoints", json!(options.listen)),
        ("connect", connect(options)),
        ("scouting/multicast/enabled", json!(false)),
        ("scouting/gossip/enabled", json!(false)),
        ("scouting/delay", json!(0)),
        ("timestamping", json!({ "enabled": true })),
        ("queries_default_timeout", json!(2000)),
        ("transport/unicast/max_sessions", json!(256)),
        ("transport/link/tx/lease", json!(LINK_LEASE_MS)),
        ("transport/link/tx/keep_alive", json!(4)),
        ("transport/link/tx/queue/size", queue_sizes()),
        ("transport/link/tx/queue/congestion_control/drop/wait_before_drop", json!(0)),
        ("transport/link/tx/queue/congestion_control/block/wait_before_close", json!(1_000_000)),
        ("transport/link/rx/max_message_size", json!(MAX_WIRE_MESSAGE)),
    ];
    if let Some(namespace) = &options.namespace {
        settings.push(("namespace", json!(namespace)));
    }
    let mut config = Config::default();
    for (setting, value) in settings {
        config
            .insert_json5(setting, &value.to_string())
            .map_err(|cause| SessionError::Setting { setting, cause: cause.to_string() })?;
    }
    Ok(config)
}

/// The gateway relays between its clients and the agents, but nothing between peers. So a client
/// that is told one endpoint is served by it, and one that is told several is linked to each.
const fn mode(options: &SessionOptions) -> &'static str {
    match options.role {
        Role::Gateway => "router",
        Role::Client if options.connect.len() == 1 => "client",
        Role::Agent | Role::Client => "peer",
    }
}

fn connect(options: &SessionOptions) -> serde_json::Value {
    let is_client = options.role == Role::Client;
    json!({
        "endpoints": options.connect,
        // A client waits this long for its endpoints; the others never give up.
        "timeout_ms": if is_client { 1000 } else { -1 },
        "exit_on_failure": false,
        "retry": { "period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2 },
    })
}

/// Room for bursts of express messages, which take one batch each.
fn queue_sizes() -> serde_json::Value {
    json!({
        "control": 4, "real_time": 16, "interactive_high": 16, "interactive_low": 16,
        "data_high": 16, "data": 4, "data_low": 16, "background": 4,
    })
}

fn is_local(endpoint: &str) -> bool {
    let Some((protocol, address)) = endpoint.split_once('/') else { return false };
    if protocol.starts_with("unixsock") {
        return true;
    }
    let address = address.split(['?', '#']).next().unwrap_or_default();
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost" || host.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(listen: &str) -> SessionOptions {
        SessionOptions {
            role: Role::Gateway,
            listen: vec![listen.to_owned()],
            connect: Vec::new(),
            namespace: None,
            insecure_lan: false,
        }
    }

    #[test]
    fn every_setting_is_known_to_zenoh() {
        for role in [Role::Gateway, Role::Agent, Role::Client] {
            let mut options = options("tcp/[::1]:7447");
            options.role = role;
            options.namespace = Some("cell7".to_owned());
            config(&options).expect("zenoh takes it");
        }
    }

    #[test]
    fn a_listener_outside_loopback_must_be_allowed() {
        for open in ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/192.0.2.1:7447", "tcp/robot:7447"] {
            let mut options = options(open);
            assert!(matches!(config(&options), Err(SessionError::NotLoopback(_))), "{open}");
            options.insecure_lan = true;
            config(&options).expect("allowed explicitly");
        }
    }

    #[test]
    fn loopback_and_unix_sockets_need_no_permission() {
        for local in ["tcp/127.0.0.1:0", "tcp/localhost:7447", "unixsock-stream//run/armada.sock"] {
            config(&options(local)).expect(local);
        }
    }
}
