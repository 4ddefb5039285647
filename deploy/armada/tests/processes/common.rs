//! Processes, robots and how they are waited for.

use std::future::Future;
use std::io::Write as _;
use std::net::{TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientOptions};
use armada_protocol::messages::RobotStatus;
use rustix::process::{Pid, Signal, kill_process};

/// How long anything may take to be seen on a busy machine.
const DEADLINE: Duration = Duration::from_secs(30);

/// The program, to be run with these arguments.
pub(crate) fn armada(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_armada"));
    command.args(arguments).env_remove("RUST_LOG");
    command
}

/// A process that is killed when a test ends.
pub(crate) struct Process(Child);

impl Process {
    pub(crate) fn start(arguments: &[&str]) -> Self {
        let child = armada(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it runs");
        Self(child)
    }

    /// Writes a line to its standard input.
    pub(crate) fn say(&mut self, line: &str) {
        let input = self.0.stdin.as_mut().expect("piped");
        writeln!(input, "{line}").and_then(|()| input.flush()).expect("it reads");
    }

    /// Its standard input, which ends when that is dropped.
    pub(crate) fn take_input(&mut self) -> Option<ChildStdin> {
        self.0.stdin.take()
    }

    /// Asks it to end; returns its exit code and what it logged.
    pub(crate) async fn end(mut self) -> (Option<i32>, String) {
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

pub(crate) async fn within<T>(what: &str, future: impl Future<Output = T>) -> T {
    let done = tokio::time::timeout(DEADLINE, future).await;
    done.unwrap_or_else(|_| panic!("{what}: not after {DEADLINE:?}"))
}

/// The left arm of the default cell under another name, on a port of its own, with changes.
pub(crate) fn robot_file(folder: &Path, name: &str, changes: &[(&str, &str)]) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/robots");
    let text = std::fs::read_to_string(source.join("left_arm.yaml")).expect("robot file");
    let urdf = source.join("six_axis_arm.urdf").canonicalize().expect("robot description");
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let text = text
        .replace("robot: left_arm", &format!("robot: {name}"))
        .replace("127.0.0.1:47101", &socket.local_addr().expect("bound").to_string())
        .replace("urdf: six_axis_arm.urdf", &format!("urdf: {}", urdf.display()))
        .replace("priority: 80", "priority: null")
        .replace("lock_memory: true", "lock_memory: false")
        // A busy machine runs any of these processes late: that is not what the tests are about.
        .replace("communication_timeout_ms: 100", "communication_timeout_ms: 2000")
        .replace("watchdog_ms: 100", "watchdog_ms: 5000");
    let text = changes.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "the robot file has no {from:?}");
        text.replace(from, to)
    });
    let file = folder.join(format!("{name}.yaml"));
    std::fs::write(&file, text).expect("written");
    file
}

/// An endpoint on a port that was free.
pub(crate) fn endpoint() -> String {
    let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("bound");
    format!("tcp/{port}")
}

/// A client of the agent that is to listen there.
pub(crate) async fn connect(endpoint: &str) -> Client {
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

/// The robot's status as soon as it is so.
pub(crate) async fn status_when(
    client: &Client,
    robot: &RobotName,
    what: &str,
    condition: impl Fn(&RobotStatus) -> bool,
) -> RobotStatus {
    let fits = async {
        loop {
            // A robot answers as soon as it has started.
            if let Some(status) = client.robot_status(robot).await.ok().filter(&condition) {
                return status;
            }
            tokio::task::yield_now().await;
        }
    };
    within(what, fits).await
}
