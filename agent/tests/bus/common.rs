//! A simulated arm with its emulator and agent in this process, and a client to it.

use std::net::{TcpListener, UdpSocket};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::time::Duration;

use armada_agent::config::{RealtimeConfig, RobotConfig};
use armada_agent::drivers::MAX_PACKET;
use armada_agent::drivers::sim::{Fault, decode_inject_answer, encode_inject};
use armada_agent::runtime::{Agent, AgentOptions, Emulation};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError, ClientOptions, StopOptions};
use armada_protocol::messages::{
    Denial, MotionStatus, NameParams, RobotFlags, RobotStatus, SignalValue,
};
use armada_protocol::method::robot::GetSignal;
use tempfile::TempDir;
use uuid::Uuid;

pub(crate) const DEADLINE: Duration = Duration::from_secs(10);

/// Ordinary scheduling: tests share the machine.
const ORDINARY: RealtimeConfig = RealtimeConfig { priority: None, cpu: None, lock_memory: false };

pub(crate) struct Bench {
    pub(crate) emulation: Option<Emulation>,
    agent: Option<Agent>,
    pub(crate) client: Client,
    pub(crate) robot: RobotName,
    folder: TempDir,
    endpoint: String,
}

impl Bench {
    /// An arm that can be moved; its agent keeps nothing.
    pub(crate) async fn start() -> Self {
        Self::start_with("", "").await
    }

    /// The same, with `what` in the robot file replaced.
    pub(crate) async fn start_with(what: &str, with: &str) -> Self {
        let bench = Self::begin("", false, |folder| replace(folder, what, with)).await;
        bench.ready().await;
        bench
    }

    /// An arm with more lines in its robot file, whose agent keeps latched stops.
    pub(crate) async fn keeping(more: &str) -> Self {
        Self::prepared(more, |_| {}).await
    }

    /// As [`Self::keeping`], with more in the folder of its robot file.
    pub(crate) async fn prepared(more: &str, prepare: impl FnOnce(&Path)) -> Self {
        let bench = Self::begin(more, true, prepare).await;
        bench.connected().await;
        bench
    }

    async fn begin(more: &str, keeps: bool, prepare: impl FnOnce(&Path)) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let file = robot_file(folder.path(), "left_arm");
        let text = std::fs::read_to_string(&file).expect("robot file");
        std::fs::write(&file, format!("{text}\n{more}")).expect("robot file");
        prepare(folder.path());
        let endpoint = format!("tcp/127.0.0.1:{}", free_tcp_port());
        let emulation = Some(emulate(&file));
        let state_dir = keeps.then(|| folder.path().join("state"));
        let options = AgentOptions { state_dir, ..options(&file, &endpoint) };
        let agent = Some(Agent::start(options).await.expect("agent starts"));
        let client = connect(&endpoint).await;
        let robot: RobotName = "left_arm".parse().expect("a name");
        Self { emulation, agent, client, robot, folder, endpoint }
    }

    /// Waits until it can be moved.
    pub(crate) async fn ready(&self) {
        self.status_when(|status| status.next.iter().any(|next| next.contains("move"))).await;
    }

    /// Waits until its controller is heard.
    async fn connected(&self) {
        let silent = RobotFlags::COMMUNICATION_FAILURE;
        self.status_when(|status| !status.flags.contains(silent)).await;
    }

    /// Where its agent keeps latched stops.
    pub(crate) fn state_dir(&self) -> PathBuf {
        self.folder.path().join("state")
    }

    /// Ends the agent in order and starts it again.
    pub(crate) async fn restart(&mut self) {
        self.restart_after(|_| {}).await;
    }

    /// Starts the agent again with what one that is killed leaves behind.
    pub(crate) async fn restart_as_after_a_crash(&mut self) {
        let file = "left_arm.latch.json";
        let left = std::fs::read(self.state_dir().join(file)).expect("kept while it runs");
        self.restart_after(|folder| std::fs::write(folder.join(file), left).expect("written"))
            .await;
    }

    /// As [`Self::restart`], with something done to its state folder in between.
    pub(crate) async fn restart_after(&mut self, between: impl FnOnce(&Path)) {
        self.agent.take().expect("it runs").shut_down().await;
        between(&self.state_dir());
        let endpoint = format!("tcp/127.0.0.1:{}", free_tcp_port());
        let state_dir = Some(self.state_dir());
        let options = AgentOptions { state_dir, ..options(&self.file(), &endpoint) };
        self.agent = Some(Agent::start(options).await.expect("agent starts"));
        self.client = connect(&endpoint).await;
        self.endpoint = endpoint;
        self.connected().await;
    }

    /// A client besides the first.
    pub(crate) async fn another_client(&self) -> Client {
        connect(&self.endpoint).await
    }

    /// Does something to the emulated controller.
    pub(crate) fn inject(&self, fault: &str) {
        inject(self.emulation.as_ref().expect("it runs"), fault);
    }

    /// Waits until the agent sees a signal of the controller as it should be.
    pub(crate) async fn signal_is(&self, name: &str, on: bool) {
        let wanted = if on { SignalValue::Bool(true) } else { SignalValue::Bool(false) };
        let seen = async {
            loop {
                let params = NameParams { name: name.to_owned() };
                let value = self.client.call::<GetSignal>(&self.robot, params).await;
                if value.expect("a signal").value == wanted {
                    return;
                }
            }
        };
        tokio::time::timeout(DEADLINE, seen).await.expect("the signal is seen");
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
        self.agent.expect("it runs").shut_down().await;
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

pub(crate) fn options(file: &Path, endpoint: &str) -> AgentOptions {
    AgentOptions {
        robot_files: vec![file.to_owned()],
        listen: Some(vec![endpoint.to_owned()]),
        connect: Some(Vec::new()),
        namespace: None,
        insecure_lan: false,
        state_dir: None,
    }
}

/// Does something to an emulated controller.
pub(crate) fn inject(emulation: &Emulation, fault: &str) {
    let fault: Fault = fault.parse().expect("a fault");
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.connect(emulation.addresses()[0]).expect("an address");
    socket.set_read_timeout(Some(Duration::from_millis(200))).expect("set");
    let (mut packet, mut answer) = ([0; MAX_PACKET], [0; MAX_PACKET]);
    let len = encode_inject(&fault, &mut packet);
    for _ in 0..20 {
        socket.send(&packet[..len]).expect("sent");
        if let Ok(len) = socket.recv(&mut answer)
            && decode_inject_answer(&answer[..len]).is_ok_and(|(_, accepted)| accepted)
        {
            return;
        }
    }
    panic!("the emulator does not answer");
}

/// Replaces `what`, which must be there, in the robot file of a folder; nothing if it is empty.
fn replace(folder: &Path, what: &str, with: &str) {
    if what.is_empty() {
        return;
    }
    let file = folder.join("left_arm.yaml");
    let text = std::fs::read_to_string(&file).expect("robot file");
    assert!(text.contains(what), "{what:?} is not in the robot file");
    std::fs::write(&file, text.replace(what, with)).expect("robot file");
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
        .replace("lock_memory: true", "lock_memory: false")
        // A busy machine runs any of these threads late: that is not what the tests are about.
        .replace("communication_timeout_ms: 100", "communication_timeout_ms: 2000")
        .replace("watchdog_ms: 100", "watchdog_ms: 5000")
        .replace("tracking_tolerance_rad: 0.1", "tracking_tolerance_rad: 1.0")
        .replace("following_error_rad: 0.5", "following_error_rad: 10")
        .replace("start_tolerance_rad: 0.02", "start_tolerance_rad: 0.1")
        // Tests that need one give their own.
        .replace("stop:\n  # An emergency stop", "# An emergency stop")
        .replace("  estop_stops_cell: false\n", "");
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
