//! `armada stop-button` with a real input through a pipe, and a real agent.

use std::process::Stdio;

use armada_protocol::RobotName;
use armada_protocol::client::Client;
use armada_protocol::messages::{RobotStatus, StopLatch, StopStage};
use armada_protocol::method::robot::Reset;

use crate::common::{Process, armada, connect, endpoint, robot_file, status_when};

/// What makes a robot ask for a button.
const ASKS_FOR_BUTTON: (&str, &str) =
    ("estop_stops_cell: false", "sources: [{name: door_1, level: L2}]");

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
        let file = robot_file(folder.path(), "left_arm", &[ASKS_FOR_BUTTON]);
        let (file, state) = (file.to_str().expect("text"), folder.path().join("state"));
        let endpoint = endpoint();
        let emulator = Process::start(&["emulator", "sim", file]);
        let state = state.to_str().expect("text");
        let agent = ["agent", file, "--listen", &endpoint, "--state-dir", state];
        let processes = [emulator, Process::start(&agent)];
        let client = connect(&endpoint).await;
        let robot = "left_arm".parse().expect("a name");
        Self { client, robot, endpoint, _processes: processes, _folder: folder }
    }

    fn button(&self) -> Process {
        let name = ["stop-button", "--name", "door_1", "--stdin-level", "--repeat", "never"];
        Process::start(&[&name[..], &["--connect", &self.endpoint]].concat())
    }

    async fn status_when(
        &self,
        what: &str,
        condition: impl Fn(&RobotStatus) -> bool,
    ) -> RobotStatus {
        status_when(&self.client, &self.robot, what, condition).await
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
            let stands = |stop: &StopLatch| stop.stage >= StopStage::Standstill;
            status.stop.as_ref().is_some_and(stands)
                && status.stop_sources.iter().all(|source| !source.pressed)
        };
        let status = self.status_when("it stands, the button released", released).await;
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

    drop(button.take_input());
    bench.latched("is pressed").await;
    drop(button);

    let mut button = bench.button();
    button.say("released");
    bench.reset().await;
    drop(button);
    bench.latched("silent").await;
}

#[tokio::test]
async fn a_button_with_a_name_or_key_that_cannot_be_is_refused() {
    for (more, reason) in
        [(["--name", "Door 1"], "is not the name"), (["--key-file", "nowhere"], "nowhere")]
    {
        let output = armada(&["stop-button", "--stdin-level", "--connect", "tcp/127.0.0.1:1"])
            .args(if more[0] == "--name" { &[][..] } else { &["--name", "door_1"] })
            .args(more)
            .stdin(Stdio::null())
            .output()
            .expect("it runs");
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && error.contains(reason), "{more:?}: {error}");
    }
}
