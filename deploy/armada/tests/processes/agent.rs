//! `armada agent`, of several robots and killed.

use std::process::Stdio;

use armada_protocol::RobotName;
use armada_protocol::messages::{RobotFlags, RobotStatus, StopStage};
use armada_protocol::method::robot::Reset;

use crate::common::{Process, armada, connect, endpoint, robot_file, status_when};

#[tokio::test(flavor = "multi_thread")]
async fn one_process_serves_two_robots_and_ramps_both_down_on_a_signal() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = ["left_arm", "right_arm"].map(|name| robot_file(folder.path(), name, &[]));
    let files = files.each_ref().map(|file| file.to_str().expect("text"));
    let _emulators = files.map(|file| Process::start(&["emulator", "sim", file]));
    let endpoint = endpoint();
    let state = folder.path().join("state");
    let state = state.to_str().expect("text");
    let agent = ["agent", files[0], files[1], "--listen", &endpoint, "--state-dir", state];
    let agent = Process::start(&agent);
    let client = connect(&endpoint).await;
    for name in ["left_arm", "right_arm"] {
        let robot: RobotName = name.parse().expect("a name");
        let enabled = |status: &RobotStatus| status.flags.contains(RobotFlags::ENABLED);
        status_when(&client, &robot, "the drives are on", enabled).await;
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
    let file = robot_file(folder.path(), "left_arm", &[]);
    let file = file.to_str().expect("text");
    let output = armada(&["agent", file, file]).stdin(Stdio::null()).output().expect("it runs");
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("is given twice"), "{errors}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_that_is_killed_is_followed_by_one_that_is_stopped_until_a_reset() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = robot_file(folder.path(), "left_arm", &[]);
    let (file, state) = (file.to_str().expect("text"), folder.path().join("state"));
    let _emulator = Process::start(&["emulator", "sim", file]);
    let robot: RobotName = "left_arm".parse().expect("a name");
    let start = async || {
        let endpoint = endpoint();
        let state = state.to_str().expect("text");
        let agent = ["agent", file, "--listen", &endpoint, "--state-dir", state];
        (Process::start(&agent), connect(&endpoint).await)
    };
    let enabled = |status: &RobotStatus| status.flags.contains(RobotFlags::ENABLED);
    let (agent, client) = start().await;
    status_when(&client, &robot, "drives on", enabled).await;
    drop(agent);
    let (agent, client) = start().await;
    let stands =
        |s: &RobotStatus| s.stop.as_ref().is_some_and(|l| l.stage >= StopStage::Standstill);
    let status = status_when(&client, &robot, "a stop from the start", stands).await;
    let latch = status.stop.expect("waited for");
    let sources: Vec<_> = latch.stops.iter().map(|stop| stop.source.as_str()).collect();
    assert_eq!(sources, ["agent_lost"]);
    client.call::<Reset>(&robot, latch.reset_params()).await.expect("reset");
    status_when(&client, &robot, "nothing latched", |s| s.stop.is_none()).await;
    let (code, log) = agent.end().await;
    assert_eq!(code, Some(0), "{log}");
    let (_agent, client) = start().await;
    let fresh = status_when(&client, &robot, "drives on", enabled).await;
    assert!(fresh.stop.is_none(), "an end in order leaves nothing behind: {fresh:?}");
}
