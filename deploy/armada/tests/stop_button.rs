//! `armada stop-button` as a real process, with a real input through a pipe, and a real agent.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests may panic as the tests do"
)]

use std::future::Future;
use std::io::Write as _;
use std::net::{TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientOptions};
use armada_protocol::messages::{RobotStatus, StopLatch};
use armada_protocol::method::robot::Reset;

const DEADLINE: Duration = Duration::from_secs(30);

/// A process that is killed when a test ends.
struct Process(Child);

impl Process {
    fn start(arguments: &[&str]) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_armada"))
            .args(arguments)
            .env_remove("RUST_LOG")
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it runs");
        Self(child)
    }

    /// Writes a line to its standard input.
    fn say(&mut self, line: &str) {
        let input = self.0.stdin.as_mut().expect("piped");
        writeln!(input, "{line}").and_then(|()| input.flush()).expect("it reads");
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

async fn within<T>(what: &str, future: impl Future<Output = T>) -> T {
    let done = tokio::time::timeout(DEADLINE, future).await;
    done.unwrap_or_else(|_| panic!("{what}: not after {DEADLINE:?}"))
}

fn robot_file(folder: &Path) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/robots");
    let text = std::fs::read_to_string(source.join("left_arm.yaml")).expect("robot file");
    let urdf = source.join("six_axis_arm.urdf").canonicalize().expect("robot description");
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let text = text
        .replace("127.0.0.1:47101", &socket.local_addr().expect("bound").to_string())
        .replace("urdf: six_axis_arm.urdf", &format!("urdf: {}", urdf.display()))
        .replace("priority: 80", "priority: null")
        .replace("lock_memory: true", "lock_memory: false")
        .replace("estop_stops_cell: false", "sources: [{name: door_1, level: L2}]");
    let file = folder.join("left_arm.yaml");
    std::fs::write(&file, text).expect("written");
    file
}

/// An agent with its emulated controller, which asks for the button `door_1`.
struct Bench {
    client: Client,
    robot: RobotName,
    endpoint: String,
    _processes: [Process; 2],
    _folder: tempfile::TempDir,
}

impl Bench {
    async fn start() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let file = robot_file(folder.path());
        let (file, state) = (file.to_str().expect("text"), folder.path().join("state"));
        let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("bound");
        let endpoint = format!("tcp/{port}");
        let emulator = Process::start(&["emulator", "sim", file]);
        let state = state.to_str().expect("text");
        let agent = ["agent", file, "--listen", &endpoint, "--state-dir", state];
        let processes = [emulator, Process::start(&agent)];
        let options = || ClientOptions {
            name: "test".to_owned(),
            connect: vec![endpoint.clone()],
            namespace: None,
        };
        let connected = async {
            loop {
                if let Ok(client) = Client::connect(options()).await {
                    return client;
                }
            }
        };
        let client = within("the agent listens", connected).await;
        let robot = "left_arm".parse().expect("a name");
        Self { client, robot, endpoint, _processes: processes, _folder: folder }
    }

    fn button(&self) -> Process {
        let name = ["stop-button", "--name", "door_1", "--stdin-level"];
        Process::start(&[&name[..], &["--connect", &self.endpoint]].concat())
    }

    async fn status_when(
        &self,
        what: &str,
        condition: impl Fn(&RobotStatus) -> bool,
    ) -> RobotStatus {
        let fits = async {
            loop {
                let status = self.client.robot_status(&self.robot).await;
                if let Some(status) = status.ok().filter(&condition) {
                    return status;
                }
                tokio::task::yield_now().await;
            }
        };
        within(what, fits).await
    }

    async fn latched(&self, why: &str) -> StopLatch {
        let latched = |status: &RobotStatus| {
            let stops = status.stop.iter().flat_map(|stop| &stop.stops);
            stops.into_iter().any(|stop| stop.source == "door_1" && stop.reason.contains(why))
        };
        self.status_when(why, latched).await.stop.expect("waited for")
    }

    async fn reset(&self) {
        let released = |status: &RobotStatus| {
            status.stop.is_some() && status.stop_sources.iter().all(|source| !source.pressed)
        };
        let status = self.status_when("the button is heard to be released", released).await;
        let params = status.stop.expect("waited for").reset_params();
        self.client.call::<Reset>(&self.robot, params).await.expect("reset");
        self.status_when("nothing is latched", |status| status.stop.is_none()).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_button_stops_when_it_is_pressed_when_its_input_ends_and_when_it_dies() {
    let bench = Bench::start().await;
    bench.latched("never heard").await;
    let mut button = bench.button();
    let heard = |s: &RobotStatus| s.stop_sources.iter().all(|source| source.age_ms.is_some());
    let status = bench.status_when("the button is heard", heard).await;
    assert!(status.stop_sources.iter().all(|source| source.pressed), "it begins pressed");
    button.say("released");
    bench.reset().await;

    button.say("pressed");
    bench.latched("is pressed").await;
    button.say("released");
    bench.reset().await;

    button.say("open");
    bench.latched("is pressed").await;
    button.say("released");
    bench.reset().await;

    drop(button.0.stdin.take());
    bench.latched("is pressed").await;
    drop(button);

    let mut button = bench.button();
    button.say("released");
    bench.reset().await;
    button.0.kill().expect("killed");
    bench.latched("silent").await;
}

#[tokio::test]
async fn a_button_with_a_name_or_key_that_cannot_be_is_refused() {
    for (more, reason) in
        [(["--name", "Door 1"], "is not the name"), (["--key-file", "nowhere"], "nowhere")]
    {
        let output = Command::new(env!("CARGO_BIN_EXE_armada"))
            .args(["stop-button", "--stdin-level", "--connect", "tcp/127.0.0.1:1"])
            .args(if more[0] == "--name" { &[][..] } else { &["--name", "door_1"] })
            .args(more)
            .stdin(Stdio::null())
            .output()
            .expect("it runs");
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && error.contains(reason), "{more:?}: {error}");
    }
}
