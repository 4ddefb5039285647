//! Arms move together, from Rust, Python and the command line.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use anyhow::{Context, Result};
use armada_protocol::messages::ActionStatus;
use armada_tests::{Cell, CellOptions, python};

use crate::support::{both_arms, execute, motion_when};

#[tokio::test(flavor = "multi_thread")]
async fn both_arms_start_together_and_reach_their_goals() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let accepted = execute(&client, both_arms(0.4, 1.0)).await?;
    let end = motion_when(&client, accepted.motion_id, |m| m.status.is_terminal()).await?;
    assert_eq!(end.status, ActionStatus::Complete, "{end:#?}");
    let skew = end.start_skew_ms.context("both have started")?;
    // Far below the 150 ms between commit and start; a busy machine may delay one of the loops.
    assert!(skew <= 100.0, "the arms started {skew} ms apart");
    for part in end.parts.values() {
        assert_eq!(part.status, ActionStatus::Complete);
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn one_part_that_is_not_valid_keeps_every_arm_from_starting() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let mut trajectory = both_arms(0.4, 1.0);
    trajectory.waypoints[1].joint_position[6] = 9.0;
    let refused = execute(&client, trajectory).await.expect_err("9 rad is out of range");
    assert!(refused.to_string().contains("out_of_range"), "{refused:#}");
    assert!(refused.to_string().contains("shoulder_pan_joint"), "{refused:#}");
    for robot in cell.robots()? {
        assert!(client.robot_status(&robot).await?.motion.is_none());
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_line_moves_one_arm() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let (printed, code) =
        cell.run(&["move", "left_arm", "--joints", "shoulder_pan_joint=0.3", "--speed", "0.5"])?;
    assert_eq!(code, 0, "{printed}");
    let (printed, code) = cell.run(&["move", "left_arm", "--joints", "elbow_joint=99"])?;
    assert_ne!(code, 0);
    assert!(printed.contains("elbow_joint") && printed.contains("99"), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_example_of_the_readme_works_as_printed() -> Result<()> {
    let Some(python) = python() else { return Ok(()) };
    let cell = Cell::start(CellOptions::default()).await?;
    let readme = include_str!("../../../README.md");
    let example = readme.split("```python\n").nth(1).context("a Python example")?;
    let example = example.split("```").next().context("its end")?;
    let endpoints = cell.endpoints();
    let quoted: Vec<String> = endpoints.iter().map(|endpoint| format!("{endpoint:?}")).collect();
    let example =
        example.replace("armada.connect()", &format!("armada.connect({})", quoted.join(", ")));
    let output =
        tokio::task::spawn_blocking(move || Command::new(python).arg("-c").arg(example).output())
            .await??;
    let printed = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{printed}\n{errors}");
    assert!(printed.contains("left_arm"), "{printed}");
    assert!(printed.to_lowercase().contains("complete"), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_subscriber_of_bare_zenoh_and_json_works_as_printed() -> Result<()> {
    let Some(python) = python() else { return Ok(()) };
    let cell = Cell::start(CellOptions::default()).await?;
    let readme = include_str!("../../../README.md");
    let example = readme.split("```py\n").nth(1).context("the bare example")?;
    let example = example.split("```").next().context("its end")?;
    let gateway = cell.endpoints().into_iter().next().context("the gateway")?;
    let example = example.replace("tcp/127.0.0.1:7447", &gateway);
    let mut reader =
        Command::new(python).args(["-u", "-c", &example]).stdout(Stdio::piped()).spawn()?;
    let output = reader.stdout.take().context("its output")?;
    let first = tokio::task::spawn_blocking(move || {
        let mut line = String::new();
        BufReader::new(output).read_line(&mut line).map(|_| line)
    });
    let first = tokio::time::timeout(armada_tests::DEADLINE, first).await;
    reader.kill()?;
    reader.wait()?;
    let line = first???;
    assert!(line.contains("robots/") && line.contains("halt"), "{line:?}");
    Ok(())
}
