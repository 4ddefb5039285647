//! A simulated arm with its emulator and agent in this process, and a client to it.

use std::net::{TcpListener, UdpSocket};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::time::Duration;

use armada_agent::config::{RealtimeConfig, RobotConfig};
use armada_agent::runtime::{Agent, AgentOptions, Emulation};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError, ClientOptions, StopOptions};
use armada_protocol::messages::{Denial, MotionStatus, RobotStatus};
use tempfile::TempDir;
use uuid::Uuid;

pub(crate) const DEADLINE: Duration = Duration::from_secs(10);

/// Ordinary scheduling: tests share the machine.
const ORDINARY: RealtimeConfig = RealtimeConfig { priority: None, cpu: None, lock_memory: false };

pub(crate) struct Bench {
    pub(crate) emulation: Option<Emulation>,
    pub(crate) agent: Agent,
    pub(crate) client: Client,
    pub(crate) robot: RobotName,
    folder: TempDir,
    endpoint: String,
}

impl Bench {
    pub(crate) async fn start() -> Self {
        Self::start_with("", "").await
    }

    /// The same, with `what` in the robot file replaced.
    pub(crate) async fn start_with(what: &str, with: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let file = robot_file(folder.path(), "left_arm");
        if !what.is_empty() {
            let text = std::fs::read_to_string(&file).expect("robot file");
            assert!(text.contains(what), "{what:?} is not in the robot file");
            std::fs::write(&file, text.replace(what, with)).expect("robot file");
        }
        let endpoint = format!("tcp/127.0.0.1:{}", free_tcp_port());
        let emulation = Some(emulate(&file));
        let agent = Agent::start(options(&file, &endpoint)).await.expect("agent starts");
        let client = connect(&endpoint).await;
        let robot: RobotName = "left_arm".parse().expect("a name");
        let bench = Self { emulation, agent, client, robot, folder, endpoint };
        bench.status_when(|status| status.next.iter().any(|next| next.contains("move"))).await;
        bench
    }

    pub(crate) fn file(&self) -> PathBuf {
        self.folder.path().join("left_arm.yaml")
    }

    pub(crate) fn options(&self) -> AgentOptions {
        options(&self.file(), &format!("tcp/127.0.0.1:{}", free_tcp_port()))
    }

    pub(crate) fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// The status as soon as it satisfies `condition`.
    pub(crate) async fn status_when(
        &self,
        condition: impl Fn(&RobotStatus) -> bool,
    ) -> RobotStatus {
        let mut last = None;
        let found = tokio::time::timeout(DEADLINE, async {
            loop {
                let status = self.client.robot_status(&self.robot).await.expect("status");
                if condition(&status) {
                    return status;
                }
                last = Some(status);
                tokio::task::yield_now().await;
            }
        })
        .await;
        found.unwrap_or_else(|_| panic!("the status never was as expected: {last:#?}"))
    }

    /// The motion's status once it is terminal.
    pub(crate) async fn motion_end(&self, id: Uuid) -> MotionStatus {
        tokio::time::timeout(DEADLINE, async {
            loop {
                let motion = self.client.motion(&self.robot, id).await.expect("motion");
                if motion.status.is_terminal() {
                    return motion;
                }
            }
        })
        .await
        .expect("the motion ends")
    }

    pub(crate) async fn shut_down(self) {
        self.agent.shut_down().await;
    }
}

pub(crate) fn denial<T: std::fmt::Debug>(result: Result<T, ClientError>) -> Denial {
    match result {
        Err(ClientError::Denied(denial)) => denial,
        other => panic!("expected a denial, got {other:?}"),
    }
}

pub(crate) fn stop_options() -> StopOptions {
    StopOptions { expected: Vec::new(), timeout: Duration::from_secs(5) }
}

pub(crate) async fn connect(endpoint: &str) -> Client {
    let options = ClientOptions {
        name: "test".to_owned(),
        connect: vec![endpoint.to_owned()],
        namespace: None,
    };
    Client::connect(options).await.expect("client connects")
}

pub(crate) fn emulate(file: &Path) -> Emulation {
    let config = RobotConfig::load(file).expect("robot file");
    let (_, model) = config.read_urdf().expect("robot description");
    let setup = config.driver_setup(&model, NonZeroU64::MIN).expect("set-up");
    let emulator = config.driver.emulator(&setup).expect("emulator");
    Emulation::start(emulator, ORDINARY).expect("emulation")
}

fn options(file: &Path, endpoint: &str) -> AgentOptions {
    AgentOptions {
        robot_files: vec![file.to_owned()],
        listen: Some(vec![endpoint.to_owned()]),
        connect: Some(Vec::new()),
        namespace: None,
        insecure_lan: false,
    }
}

/// The left arm of the default cell under another name, with a port of its own.
pub(crate) fn robot_file(folder: &Path, name: &str) -> PathBuf {
    let source = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config/robots");
    let text = std::fs::read_to_string(source.join("left_arm.yaml")).expect("robot file");
    let urdf = source.join("six_axis_arm.urdf").canonicalize().expect("robot description");
    let text = text
        .replace("robot: left_arm", &format!("robot: {name}"))
        .replace("127.0.0.1:47101", &format!("127.0.0.1:{}", free_udp_port()))
        .replace("urdf: six_axis_arm.urdf", &format!("urdf: {}", urdf.display()))
        .replace("priority: 80", "priority: null")
        .replace("lock_memory: true", "lock_memory: false");
    let file = folder.join(format!("{name}.yaml"));
    std::fs::write(&file, text).expect("robot file");
    file
}

fn free_udp_port() -> u16 {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.local_addr().expect("an address").port()
}

pub(crate) fn free_tcp_port() -> u16 {
    let socket = TcpListener::bind("127.0.0.1:0").expect("a port");
    socket.local_addr().expect("an address").port()
}
