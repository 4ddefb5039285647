//! The commands on one robot, as a person types them.

use std::process::Command;

use anyhow::{Context, Result};
use armada_tests::{Cell, CellOptions, armada};

use crate::support::{done, refused};

#[tokio::test(flavor = "multi_thread")]
async fn an_arm_is_jogged_sent_home_and_moved_to_a_pose_in_its_own_axes() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    done(&cell, &["jog", "left_arm", "--joint", "elbow_joint=0.2", "--for", "0.5"])?;
    done(&cell, &["jog", "left_arm", "--tool", "z=0.05", "--frame", "tool", "--for", "0.5"])?;
    let printed = refused(&cell, &["jog", "left_arm", "--joint", "elbow_joint=9", "--for", "1"])?;
    assert!(printed.contains("out_of_range") && printed.contains("elbow_joint"), "{printed}");
    let printed = refused(&cell, &["jog", "left_arm", "--joint", "elbw=0.1", "--for", "1"])?;
    assert!(printed.contains("elbw"), "{printed}");
    done(&cell, &["move", "left_arm", "--home"])?;
    let printed = done(&cell, &["tcp", "left_arm"])?;
    assert!(printed.contains("tool") && printed.contains("flange"), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn signals_and_the_speed_are_set_and_what_does_not_exist_is_named() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    done(&cell, &["signal", "set", "left_arm", "DO1", "true"])?;
    assert!(done(&cell, &["signal", "get", "left_arm", "DO1"])?.contains("on"));
    let printed = refused(&cell, &["signal", "set", "left_arm", "DI1", "true"])?;
    assert!(printed.contains("DI1"), "{printed}");
    let printed = refused(&cell, &["signal", "get", "left_arm", "DO99"])?;
    assert!(printed.contains("DO99") && printed.contains("DO1"), "{printed}");
    done(&cell, &["speed", "left_arm", "0.5"])?;
    refused(&cell, &["speed", "left_arm", "3"])?;
    let motion = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/motions/handover.json");
    // Robots that are at one phase go at the least speed of all; others would part.
    let printed = refused(&cell, &["run", motion, "--coupling", "independent"])?;
    assert!(printed.contains("speed ratio") && printed.contains("left_arm"), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_of_a_real_loop_replays_without_a_difference() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    done(&cell, &["move", "left_arm", "--joints", "elbow_joint=1.2"])?;
    let printed = done(&cell, &["record", "left_arm"])?;
    let file = printed.split_whitespace().find(|word| word.ends_with(".armada"));
    let file = file.context("the file is named")?.to_owned();
    let replay =
        |file: &str| Command::new(armada()?).args(["replay", file]).output().context("runs");
    let output = replay(&file)?;
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && printed.contains("no difference"), "{printed}");
    let output = replay(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"))?;
    let printed = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && printed.contains("not a recording"), "{printed}");
    std::fs::remove_file(&file)?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_holds_the_lease_is_named_to_others() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let robot = "left_arm".parse()?;
    let ttl = std::time::Duration::from_secs(20);
    let keeper = client.acquire_lease(&robot, ttl).await?;
    let goal = ["move", "left_arm", "--joints", "elbow_joint=1.2"];
    let printed = refused(&cell, &goal)?;
    assert!(printed.contains("lease_required") && printed.contains("driven by"), "{printed}");
    let lease = keeper.lease().to_string();
    done(&cell, &[&goal[..], &["--lease", &lease]].concat())?;
    keeper.release().await?;
    done(&cell, &goal)?;
    Ok(())
}
