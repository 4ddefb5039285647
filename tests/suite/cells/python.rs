//! Streams of the Python client to a real agent.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use anyhow::{Context, Result};
use armada_protocol::client::{Client, StopOptions};
use armada_protocol::messages::{CommandMode, RobotState, StopVerdict};
use armada_tests::{Cell, CellOptions, DEADLINE, python, wait_for};

use crate::support::stop_request;

/// Starts a program with the endpoints of `cell` in it.
fn start(cell: &Cell, python: &Path, program: &str) -> Result<Child> {
    let quoted: Vec<String> = cell.endpoints().iter().map(|end| format!("{end:?}")).collect();
    let told = format!("armada.connect({})", quoted.join(", "));
    assert!(program.contains("armada.connect()"), "{program}");
    let program = program.replace("armada.connect()", &told);
    let mut command = Command::new(python);
    command.arg("-c").arg(program).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().context("python starts")
}

/// What a program printed that has to succeed.
async fn printed(program: Child) -> Result<String> {
    let Output { status, stdout, stderr } =
        tokio::task::spawn_blocking(move || program.wait_with_output()).await??;
    let printed = String::from_utf8_lossy(&stdout).into_owned();
    assert!(status.success(), "{printed}\n{}", String::from_utf8_lossy(&stderr));
    Ok(printed)
}

/// The first state of the left arm that is as expected.
async fn state_when(
    client: &Client,
    what: &str,
    condition: impl Fn(&RobotState) -> bool,
) -> Result<RobotState> {
    let states = client.subscribe::<RobotState>("robots/left_arm/state", 512).await?;
    let look = async || states.next().await.ok().map(|(_, state)| state).filter(&condition);
    wait_for(what, DEADLINE, look).await
}

#[tokio::test(flavor = "multi_thread")]
async fn the_example_that_streams_positions_works_as_printed() -> Result<()> {
    let Some(python) = python() else { return Ok(()) };
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let before = state_when(&client, "a state", |_| true).await?.joint_position_rad;
    let example = include_str!("../../../protocol/python/examples/stream.py");
    let program = start(&cell, &python, example)?;
    // It swings by a little less than 0.1 rad.
    let swung = |state: &RobotState| {
        let away = (state.joint_position_rad[0] - before[0]).abs();
        state.command_mode == CommandMode::PositionCommand && (0.06..0.11).contains(&away)
    };
    state_when(&client, "the arm swings", swung).await?;
    let printed = printed(program).await?;
    assert_eq!(printed.trim(), "swung: halt");
    let after = state_when(&client, "a state", |_| true).await?.joint_position_rad;
    let off = after.max_abs_difference(&before);
    assert!(off < 5e-3, "it came back to {off} rad");
    let status = client.robot_status(&"left_arm".parse()?).await?;
    assert!(status.faults.is_empty() && status.lease.is_none(), "{status:#?}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_ends_a_stream_of_speeds_and_its_sender_is_told() -> Result<()> {
    const PROGRAM: &str = "
import armada
with armada.connect() as cell:
    left = cell.robot('left_arm')
    try:
        with left.lease(), left.stream_velocity() as stream:
            for _ in stream.ticks(rate_hz=100, duration_s=20.0):
                stream.send([0.1, 0, 0, 0, 0, 0.2])
    except (armada.StreamEnded, armada.LeaseLost) as ended:
        print('told:', ended)
";
    let Some(python) = python() else { return Ok(()) };
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let program = start(&cell, &python, PROGRAM)?;
    let moving = |state: &RobotState| {
        let speed = state.joint_velocity_command_rad_s;
        state.command_mode == CommandMode::VelocityCommand && speed.get(5) == Some(&0.2)
    };
    let state = state_when(&client, "the arm moves", moving).await?;
    assert!((state.joint_velocity_command_rad_s[0] - 0.1).abs() < 1e-9, "{state:#?}");
    let options = StopOptions { expected: cell.robots()?, timeout: Duration::from_secs(5) };
    let report = client.stop(stop_request(), options).await?;
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:#?}");
    let printed = printed(program).await?;
    assert!(printed.contains("told:") && printed.contains("left_arm"), "{printed}");
    Ok(())
}
