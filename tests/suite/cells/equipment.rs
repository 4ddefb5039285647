//! Tools, payloads, settings and kinematics of one robot, as a person types them.

use anyhow::{Context, Result};
use armada_model::Pose;
use armada_tests::{Cell, CellOptions};

use crate::support::{done, json, refused};

const GRIPPER: &str = r#"{"name": "gripper", "tool_type": "electric_gripper",
    "tcp": {"position_m": {"x": 0, "y": 0, "z": 0.15}}, "inertia": {"mass_kg": 0.9}}"#;

/// Pose of the tool of the left arm.
fn tcp(cell: &Cell, more: &[&str]) -> Result<Pose> {
    let answer = json(cell, &[&["tcp", "left_arm"], more].concat())?;
    Ok(serde_json::from_value(answer["tcp"].clone())?)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tool_and_what_it_holds_are_attached_and_detached_in_order() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let flange = tcp(&cell, &[])?;
    let printed = done(&cell, &["tool", "attach", "left_arm", GRIPPER])?;
    assert!(printed.contains("arm carries gripper (0.9 kg)"), "{printed}");
    let (distance, angle) = tcp(&cell, &[])?.distance(&flange);
    assert!((distance - 0.15).abs() < 1e-3 && angle < 1e-3, "{distance} m, {angle} rad");
    let printed = refused(&cell, &["tool", "attach", "left_arm", GRIPPER])?;
    assert!(printed.contains("already_attached"), "{printed}");
    let printed = refused(&cell, &["tool", "attach", "left_arm", "torch"])?;
    assert!(printed.contains("torch"), "{printed}");
    let printed = done(&cell, &["payload", "attach", "left_arm", "box", "--mass", "2.5"])?;
    assert!(printed.contains("gripper (0.9 kg) with box (2.5 kg)"), "{printed}");
    let printed = refused(&cell, &["tool", "detach", "left_arm"])?;
    assert!(printed.contains("box"), "{printed}");
    let printed = refused(&cell, &["payload", "detach", "left_arm", "crate"])?;
    assert!(printed.contains("not_attached") && printed.contains("crate"), "{printed}");
    done(&cell, &["payload", "detach", "left_arm", "box"])?;
    let printed = done(&cell, &["tool", "detach", "left_arm", "gripper"])?;
    assert!(printed.contains("arm carries nothing"), "{printed}");
    assert!(tcp(&cell, &[])?.distance(&flange).0 < 1e-3);
    let printed = done(&cell, &["tool", "list", "left_arm"])?;
    assert!(printed.contains("carries nothing"), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn settings_are_read_and_written_within_what_they_may_be() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let printed = done(&cell, &["param", "list", "left_arm"])?;
    assert!(printed.contains("collision_response") && printed.contains("retract"), "{printed}");
    for (name, value, shown) in [
        ("collision_detection", "off", "off"),
        ("collision_sensitivity", "0.75", "0.75"),
        ("collision_response", "retract", "retract"),
        ("payload_slot", "3", "3"),
    ] {
        let before = done(&cell, &["param", "get", "left_arm", name])?;
        assert!(!before.contains(shown), "{name} is {before} already");
        done(&cell, &["param", "set", "left_arm", name, value])?;
        let after = done(&cell, &["param", "get", "left_arm", name])?;
        assert!(after.contains(shown), "{name}: {after}");
    }
    for (name, value) in
        [("collision_sensitivity", "1.5"), ("collision_response", "sing"), ("payload_slot", "2.5")]
    {
        let printed = refused(&cell, &["param", "set", "left_arm", name, value])?;
        assert!(printed.contains(name), "{printed}");
    }
    let after = done(&cell, &["param", "get", "left_arm", "collision_response"])?;
    assert!(after.contains("retract"), "a refused value changes nothing: {after}");
    let printed = refused(&cell, &["param", "get", "left_arm", "colour"])?;
    assert!(printed.contains("colour") && printed.contains("payload_slot"), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn joints_that_ik_prints_for_a_pose_bring_the_tool_there() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let wanted = tcp(&cell, &["--joints", "elbow_joint=1.3,wrist_1_joint=-1.2"])?;
    assert!(wanted.distance(&tcp(&cell, &[])?).0 > 0.05, "it is elsewhere");
    let pose = serde_json::to_string(&wanted)?;
    let goal = done(&cell, &["ik", "left_arm", "--pose", &pose])?;
    let goal = goal.lines().next().context("a goal")?;
    done(&cell, &["move", "left_arm", "--joints", goal])?;
    let (distance, angle) = tcp(&cell, &[])?.distance(&wanted);
    assert!(distance < 1e-3 && angle < 1e-3, "{distance} m, {angle} rad off");
    let printed = refused(&cell, &["ik", "left_arm", "--pose", "5,0,0,0,0,0"])?;
    assert!(printed.contains("unreachable"), "{printed}");
    Ok(())
}
