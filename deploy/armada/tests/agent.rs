//! `armada agent` with several robots, as a real process beside real emulators.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests may panic as the tests do"
)]

use std::future::Future;
use std::net::{TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientOptions};
use armada_protocol::messages::{RobotFlags, RobotStatus, StopStage};
use armada_protocol::method::robot::Reset;
use rustix::process::{Pid, Signal, kill_process};

const DEADLINE: Duration = Duration::from_secs(30);

/// A process that is killed when a test fails.
struct Process(Child);

impl Process {
    fn start(arguments: &[&str]) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_armada"))
            .args(arguments)
            .env_remove("RUST_LOG")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it runs");
        Self(child)
    }

    /// Asks it to end; returns its exit code and what it logged.
    async fn end(mut self) -> (Option<i32>, String) {
        let pid = i32::try_from(self.0.id()).ok().and_then(Pid::from_raw).expect("a process");
        kill_process(pid, Signal::TERM).expect("sent");
        let mut log = self.0.stderr.take().expect("piped");
        let read = tokio::task::spawn_blocking(move || std::io::read_to_string(&mut log));
        let log = within("the process ends", read).await.expect("no panic").expect("text");
        (self.0.wait().expect("it has ended").code(), log)
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

/// The left arm of the default cell under another name, on a port of its own.
fn robot_file(folder: &Path, name: &str) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/robots");
    let text = std::fs::read_to_string(source.join("left_arm.yaml")).expect("robot file");
    let urdf = source.join("six_axis_arm.urdf").canonicalize().expect("robot description");
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let text = text
        .replace("robot: left_arm", &format!("robot: {name}"))
        .replace("127.0.0.1:47101", &socket.local_addr().expect("bound").to_string())
        .replace("urdf: six_axis_arm.urdf", &format!("urdf: {}", urdf.display()))
        .replace("priority: 80", "priority: null")
        .replace("lock_memory: true", "lock_memory: false");
    let file = folder.join(format!("{name}.yaml"));
    std::fs::write(&file, text).expect("written");
    file
}

async fn connect(endpoint: &str) -> Client {
    let options = || ClientOptions {
        name: "test".to_owned(),
        connect: vec![endpoint.to_owned()],
        namespace: None,
    };
    let connected = async {
        loop {
            if let Ok(client) = Client::connect(options()).await {
                return client;
            }
        }
    };
    within("the agent listens", connected).await
}

#[tokio::test(flavor = "multi_thread")]
async fn one_process_serves_two_robots_and_ramps_both_down_on_a_signal() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = ["left_arm", "right_arm"].map(|name| robot_file(folder.path(), name));
    let files = files.each_ref().map(|file| file.to_str().expect("text"));
    let _emulators = files.map(|file| Process::start(&["emulator", "sim", file]));
    let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("bound");
    let endpoint = format!("tcp/{port}");
    let state = folder.path().join("state");
    let state = state.to_str().expect("text");
    let agent = ["agent", files[0], files[1], "--listen", &endpoint, "--state-dir", state];
    let agent = Process::start(&agent);
    let client = connect(&endpoint).await;
    for name in ["left_arm", "right_arm"] {
        let name: RobotName = name.parse().expect("a name");
        let enabled = async {
            // A robot answers as soon as it has started, which the second does after the first.
            while !client
                .robot_status(&name)
                .await
                .is_ok_and(|status| status.flags.contains(RobotFlags::ENABLED))
            {
                tokio::task::yield_now().await;
            }
        };
        within("the drives are on", enabled).await;
    }
    client.close();
    let (code, log) = agent.end().await;
    assert_eq!(code, Some(0), "{log}");
    for name in ["left_arm", "right_arm"] {
        let says = |line: &str| line.contains(name) && line.contains("control loop runs");
        assert!(log.lines().any(says), "{name}: {log}");
    }
}

#[tokio::test]
async fn a_robot_file_given_twice_is_refused_before_anything_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = robot_file(folder.path(), "left_arm");
    let file = file.to_str().expect("text");
    let output = Command::new(env!("CARGO_BIN_EXE_armada"))
        .args(["agent", file, file])
        .env_remove("RUST_LOG")
        .output()
        .expect("it runs");
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("is given twice"), "{errors}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_that_is_killed_is_followed_by_one_that_is_stopped_until_a_reset() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = robot_file(folder.path(), "left_arm");
    let (file, state) = (file.to_str().expect("text"), folder.path().join("state"));
    let _emulator = Process::start(&["emulator", "sim", file]);
    let robot: RobotName = "left_arm".parse().expect("a name");
    let start = async || {
        let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("bound");
        let endpoint = format!("tcp/{port}");
        let state = state.to_str().expect("text");
        let agent = ["agent", file, "--listen", &endpoint, "--state-dir", state];
        (Process::start(&agent), connect(&endpoint).await)
    };
    let status_when = async |client: &Client, what: &str, fits: fn(&RobotStatus) -> bool| {
        let seen = async {
            loop {
                let status = client.robot_status(&robot).await;
                if let Some(status) = status.ok().filter(fits) {
                    return status;
                }
                tokio::task::yield_now().await;
            }
        };
        within(what, seen).await
    };
    let (agent, client) = start().await;
    status_when(&client, "drives on", |s| s.flags.contains(RobotFlags::ENABLED)).await;
    drop(agent);
    let (agent, client) = start().await;
    let stands =
        |s: &RobotStatus| s.stop.as_ref().is_some_and(|l| l.stage >= StopStage::Standstill);
    let status = status_when(&client, "a stop from the start", stands).await;
    let latch = status.stop.expect("waited for");
    let sources: Vec<_> = latch.stops.iter().map(|stop| stop.source.as_str()).collect();
    assert_eq!(sources, ["agent_lost"]);
    client.call::<Reset>(&robot, latch.reset_params()).await.expect("reset");
    status_when(&client, "nothing latched", |s| s.stop.is_none()).await;
    let (code, log) = agent.end().await;
    assert_eq!(code, Some(0), "{log}");
    let (_agent, client) = start().await;
    let fresh = status_when(&client, "drives on", |s| s.flags.contains(RobotFlags::ENABLED)).await;
    assert!(fresh.stop.is_none(), "an end in order leaves nothing behind: {fresh:?}");
}
