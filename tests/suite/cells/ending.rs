//! A cell ends as a whole and leaves nothing behind.

use anyhow::{Context, Result};
use armada_tests::{Cell, CellOptions, DEADLINE, is_running, kill, wait_for};
use rustix::process::Signal;

async fn assert_all_gone(pids: &[u32]) -> Result<()> {
    let gone = async || pids.iter().all(|pid| !is_running(*pid)).then_some(());
    wait_for("no process is left", DEADLINE, gone).await
}

#[tokio::test(flavor = "multi_thread")]
async fn ctrl_c_in_the_middle_of_the_demo_leaves_no_process_behind() -> Result<()> {
    let mut cell = Cell::start(CellOptions { demo: true, ..CellOptions::default() }).await?;
    let client = cell.client().await?;
    let moving = |status: &armada_protocol::messages::CellStatus| !status.motions.is_empty();
    let waited = cell.status_when(&client, "the demo moves", DEADLINE, moving).await;
    waited.with_context(|| cell.printed())?;
    let processes = cell.processes()?;
    let code = cell.end(Signal::INT).await?;
    assert_eq!(code, 0, "{}", cell.printed());
    assert_all_gone(&processes).await
}

#[tokio::test(flavor = "multi_thread")]
async fn processes_end_with_a_supervisor_that_is_killed() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let processes = cell.processes()?;
    kill(cell.up_pid())?;
    assert_all_gone(&processes).await
}
