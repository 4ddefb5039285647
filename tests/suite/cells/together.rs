//! Motions of several robots, as a person types and reads them.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use armada_protocol::client::Client;
use armada_protocol::messages::ActionStatus;
use armada_tests::{Cell, CellOptions, python};
use tempfile::TempDir;
use uuid::Uuid;

use crate::support::{both_arms, done, motion_when};

const HANDOVER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/motions/handover.json");

/// A file with a motion of both arms that takes so long.
fn file(folder: &TempDir, angle_rad: f64, duration_s: f64) -> Result<PathBuf> {
    let path = folder.path().join("both.json");
    std::fs::write(&path, serde_json::to_vec(&both_arms(angle_rad, duration_s))?)?;
    Ok(path)
}

/// Starts it without waiting for its end; returns its identity.
fn start(cell: &Cell, file: &std::path::Path, coupling: &str) -> Result<Uuid> {
    let file = file.to_str().context("a name")?;
    let printed = done(cell, &["run", file, "--coupling", coupling, "--no-wait", "--json"])?;
    let accepted = printed.get(printed.find('{').context("an answer")?..).context("it")?;
    let end = accepted.find('}').context("its end")?;
    let accepted: serde_json::Value = serde_json::from_str(accepted.get(..=end).context("it")?)?;
    Ok(accepted["motion_id"].as_str().context("its id")?.parse()?)
}

async fn is(client: &Client, id: Uuid, status: ActionStatus) -> Result<()> {
    motion_when(client, id, |motion| motion.status == status).await.map(|_| ())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_motion_of_several_robots_is_paused_slowed_resumed_and_cancelled() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let folder = tempfile::tempdir()?;
    let id = start(&cell, &file(&folder, 0.6, 60.0)?, "rigid")?;
    is(&client, id, ActionStatus::Running).await?;
    // The only one in progress needs no name.
    let printed = done(&cell, &["pause"])?;
    assert!(printed.contains(&id.to_string()), "{printed}");
    is(&client, id, ActionStatus::Paused).await?;
    let (status, _) = cell.run(&["status"])?;
    assert!(status.contains("rigid") && status.contains("paused"), "{status}");
    let name = id.to_string();
    let printed = done(&cell, &["speed", &name, "0.5"])?;
    assert!(printed.contains("0.5"), "{printed}");
    done(&cell, &["resume", &name])?;
    is(&client, id, ActionStatus::Running).await?;
    done(&cell, &["cancel", &name])?;
    is(&client, id, ActionStatus::Cancelled).await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn how_well_robots_kept_together_is_told_at_the_end() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let folder = tempfile::tempdir()?;
    let file = file(&folder, 0.2, 2.0)?;
    let printed = done(&cell, &["run", file.to_str().context("a name")?])?;
    assert!(printed.contains("complete") && printed.contains("time_synced"), "{printed}");
    assert!(printed.contains("divergence"), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn clearance_of_a_motion_is_told_before_anything_moves() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let printed = done(&cell, &["check-clearance", HANDOVER])?;
    assert!(printed.contains("clear: at least"), "{printed}");
    assert!(printed.contains("nearest: "), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_python_program_holds_moves_stops_and_resets_real_robots() -> Result<()> {
    let Some(python) = python() else { return Ok(()) };
    let cell = Cell::start(CellOptions::default()).await?;
    let package = concat!(env!("CARGO_MANIFEST_DIR"), "/../protocol/python");
    let mut program = Command::new(python);
    program.env("PYTHONPATH", package).arg("-c").arg(PROGRAM).args(cell.endpoints());
    let output = tokio::task::spawn_blocking(move || program.output()).await??;
    let printed = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{printed}\n{errors}");
    assert!(printed.contains("why: stop L2 by armada-python: lunch"), "{printed}");
    assert!(printed.trim_end().ends_with("done"), "{printed}");
    Ok(())
}

/// What a person would write, with checks.
const PROGRAM: &str = r#"
import sys
import armada

with armada.connect(*sys.argv[1:]) as cell:
    left = cell.robot("left_arm")
    with cell.leases(["left_arm", "right_arm"], role=armada.Role.OPERATOR) as leases:
        with armada.connect(*sys.argv[1:], name="other") as other:
            try:
                other.robot("right_arm").lease()
                raise SystemExit("the lease was given twice")
            except armada.DeniedError as denied:
                assert "operator" in denied.message, denied
            grant = leases.lease("left_arm").delegate("other", scope=armada.LeaseScope.IO)
            with other.robot("left_arm").use_lease(grant.lease):
                other.robot("left_arm").set_signal("DO1", True)
        goals = {name: cell.robot(name).state().joint_position_rad + 0.1 for name in leases.robots}
        motion = cell.move(goals, duration_s=4.0, wait=False, coupling=armada.Coupling.RIGID)
        for status in motion.progress(20.0):
            if status.status == "running":
                break
        motion.pause()
        assert motion.set_speed(0.5) == 0.5
        motion.resume()
        end = motion.arrive()
        assert end.coupling == "rigid", end
        leases.check()
    assert cell.stop("lunch").verdict == "complete"
    print("why:", left.why()[0])
    left.reset()
    assert not cell.reset().refused
    assert left.why()[0].code in ("halted", "ready"), left.why()
print("done")
"#;
