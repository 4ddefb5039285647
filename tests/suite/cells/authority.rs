//! Who may command, and why a robot does not move, as a person types and reads it.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result};
use armada_tests::{Cell, CellOptions, DEADLINE, armada, signal, wait_for};
use rustix::process::Signal;
use serde_json::Value;

use crate::support::done;

/// A command that holds something until it is ended.
struct Holding {
    child: Child,
    /// Its first lines.
    printed: Vec<String>,
}

impl Holding {
    /// Starts it and waits for its first lines.
    async fn start(cell: &Cell, arguments: &[&str], lines: usize) -> Result<Self> {
        let mut child = Command::new(armada()?)
            .args(arguments)
            .arg("--cell")
            .arg(cell.cell_file())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()?;
        let output = child.stdout.take().context("its output")?;
        let mut holding = Self { child, printed: Vec::new() };
        let reading = tokio::task::spawn_blocking(move || {
            BufReader::new(output).lines().take(lines).collect::<Result<_, _>>()
        });
        holding.printed = tokio::time::timeout(DEADLINE, reading).await???;
        assert_eq!(holding.printed.len(), lines, "{arguments:?}: {:?}", holding.printed);
        Ok(holding)
    }

    /// The lease of a robot, as it was printed.
    fn lease(&self, robot: &str) -> Result<String> {
        let begin = format!("{robot}: lease ");
        let line = self.printed.iter().find_map(|line| line.strip_prefix(&begin));
        let lease = line.and_then(|line| line.split(',').next());
        Ok(lease.with_context(|| format!("{robot}: {:?}", self.printed))?.to_owned())
    }

    /// Its exit code, once it ends.
    async fn code(&mut self) -> Result<i32> {
        let child = &mut self.child;
        let mut look = || child.try_wait().ok().flatten();
        let status = wait_for("the command ends", DEADLINE, || std::future::ready(look())).await?;
        Ok(status.code().unwrap_or(-1))
    }

    /// Ends it as Ctrl-C does.
    async fn end(mut self) -> Result<i32> {
        signal(self.child.id(), Signal::INT)?;
        self.code().await
    }
}

impl Drop for Holding {
    fn drop(&mut self) {
        // It has ended already if the test did not fail.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs a command that has to end with `code`; returns what it printed.
fn ends_with(cell: &Cell, code: i32, arguments: &[&str]) -> Result<String> {
    let (printed, ended) = cell.run(arguments)?;
    assert_eq!(ended, code, "{arguments:?}: {printed}");
    Ok(printed)
}

#[tokio::test(flavor = "multi_thread")]
async fn several_robots_are_held_all_or_none_and_commanded_under_their_leases() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let both = ["lease", "hold", "torso", "right_arm", "--role", "operator"];
    let holding = Holding::start(&cell, &both, 2).await?;
    let goal = ["move", "right_arm", "--joints", "elbow_joint=1.2"];
    let printed = ends_with(&cell, 1, &goal)?;
    assert!(printed.contains("lease_required"), "{printed}");
    done(&cell, &[&goal[..], &["--lease", &holding.lease("right_arm")?]].concat())?;
    // Somebody who wants the torso as well gives the left arm back, which was granted first.
    let printed = ends_with(&cell, 1, &["lease", "hold", "torso", "left_arm"])?;
    assert!(printed.contains("torso") && printed.contains("driven by"), "{printed}");
    let shown = done(&cell, &["lease", "show"])?;
    let left = shown.lines().find(|line| line.starts_with("left_arm")).context("its line")?;
    assert!(left.contains("nobody"), "{shown}");
    assert_eq!(holding.end().await?, 0);
    done(&cell, &goal)?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_is_told_why_a_robot_does_not_move_and_what_to_do() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let printed = done(&cell, &["why"])?;
    for robot in ["left_arm", "right_arm", "torso"] {
        assert!(printed.contains(&format!("{robot} is ready")), "{printed}");
    }
    done(&cell, &["stop", "--reason", "lunch"])?;
    let printed = ends_with(&cell, 1, &["why", "left_arm"])?;
    assert!(printed.starts_with("left_arm does not move: stop L2"), "{printed}");
    assert!(printed.contains("armada reset left_arm"), "{printed}");
    let json: Value = serde_json::from_str(&ends_with(&cell, 1, &["why", "torso", "--json"])?)?;
    assert_eq!(json["torso"]["why"][0]["code"], "stopped");
    done(&cell, &["reset", "--yes"])?;
    done(&cell, &["why", "left_arm"])?;
    // A robot that is not there does not move either.
    let printed = ends_with(&cell, 1, &["why", "lift"])?;
    assert!(printed.contains("lift does not move: nobody answers"), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_takes_a_robot_from_a_program_and_everybody_is_told_why() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let keeper = client.acquire_lease(&"left_arm".parse()?, Duration::from_secs(1)).await?;
    let printed = ends_with(&cell, 1, &["why", "left_arm"])?;
    assert!(printed.contains("driven by test for another"), "{printed}");
    let take = ["lease", "take", "left_arm", "--role", "operator", "--reason", "planner hangs"];
    let holding = Holding::start(&cell, &take, 1).await?;
    tokio::time::timeout(DEADLINE, keeper.lost()).await?;
    let shown = done(&cell, &["lease", "show", "left_arm"])?;
    assert!(shown.contains("operator") && shown.contains("took it: planner hangs"), "{shown}");
    let (status, _) = cell.run(&["status"])?;
    assert!(status.contains("(operator)"), "{status}");
    // What is taken is held as any other lease.
    let goal = ["move", "left_arm", "--joints", "elbow_joint=1.2"];
    let printed = ends_with(&cell, 1, &goal)?;
    assert!(printed.contains("operator"), "{printed}");
    done(&cell, &[&goal[..], &["--lease", &holding.lease("left_arm")?]].concat())?;
    assert_eq!(holding.end().await?, 0);
    done(&cell, &["why", "left_arm"])?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lower_role_takes_nothing_from_a_higher_one() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let hold = ["lease", "hold", "left_arm", "--role", "supervisor"];
    let holding = Holding::start(&cell, &hold, 1).await?;
    let take = ["lease", "take", "left_arm", "--role", "operator", "--reason", "mine"];
    let printed = ends_with(&cell, 1, &take)?;
    assert!(printed.contains("supervisor"), "{printed}");
    assert_eq!(holding.end().await?, 0);
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_holder_lets_somebody_set_signals_but_not_move() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let mut holding = Holding::start(&cell, &["lease", "hold", "left_arm"], 1).await?;
    let lease = holding.lease("left_arm")?;
    let to = ["lease", "delegate", "left_arm", "--to", "lamp-ui", "--scope", "io"];
    let mut delegated = Holding::start(&cell, &[&to[..], &["--lease", &lease]].concat(), 1).await?;
    let sub = delegated.lease("left_arm")?;
    done(&cell, &["signal", "set", "left_arm", "DO1", "true", "--lease", &sub])?;
    let goal = ["move", "left_arm", "--joints", "elbow_joint=1.2"];
    ends_with(&cell, 1, &[&goal[..], &["--lease", &sub]].concat())?;
    let shown = done(&cell, &["lease", "show", "left_arm"])?;
    assert!(shown.contains("lamp-ui (io)"), "{shown}");
    // With the holder's lease goes what was delegated under it.
    signal(holding.child.id(), Signal::INT)?;
    assert_eq!(holding.code().await?, 0);
    assert_eq!(delegated.code().await?, 1);
    Ok(())
}
